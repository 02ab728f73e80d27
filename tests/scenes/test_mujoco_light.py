"""Light of MuJoCo: its pictures, the replay of a step, keys between, and contexts that live beside each other."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from scenes.renderers import contexts
from spikecam_env.errors import InputError, NotReadyError
from spikecam_env.sensor import Keyframes, SpikeSensor

pytest.importorskip("mujoco", reason="the extra mujoco is not installed: pip install 'spikecam-env[mujoco]'")

from scenes.mujoco import MujocoLight, MujocoPictures, camera_of, import_mujoco
from scenes.mujoco.light import key_frames
from scenes.mujoco.motion import Boxes, path_lengths
from scenes.mujoco.replay import State, replay

mujoco = import_mujoco()

FLAT = 'orthographic="true"' if hasattr(mujoco.MjModel, "cam_orthographic") else 'projection="orthographic"'
ROOM = f"""<mujoco><option timestep="0.001"/>
<visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/>
<quality shadowsize="0"/></visual>
<worldbody><geom type="plane" size="9 9 .1" pos="0 0 -2" rgba=".25 .25 .25 1"/>
<camera name="above" pos="0 0 3" fovy="45"/><camera name="flat" pos="0 0 3" fovy="5" {FLAT}/>
<body name="box" pos=".5 .25 0"><geom name="box" type="box" size=".25 .25 .25" rgba="1 0 0 1"/></body>
<body name="ball" pos="-.6 -.3 .1"><freejoint/><geom name="ball" type="sphere" size=".1" rgba="1 1 1 1"/></body>
</worldbody></mujoco>"""

GYMNASIUMS = ("Ant-v5", "HalfCheetah-v5", "InvertedDoublePendulum-v5", "Pusher-v5")


def room(**speed: float) -> tuple[Any, Any]:
    """The room without gravity; speed: of the ball along x and y [m/s], spin about z [rad/s]."""
    model = mujoco.MjModel.from_xml_string(ROOM)
    model.opt.gravity[:] = 0
    data = mujoco.MjData(model)
    data.qvel[:] = speed.get("x", 0.0), speed.get("y", 0.0), 0, 0, 0, speed.get("spin", 0.0)
    mujoco.mj_forward(model, data)
    return model, data


def of_frames(keys: Keyframes, frames: int, parts: int = 64) -> np.ndarray:
    """(frames, H, W): the mean light of every frame."""
    at = np.stack([keys.at(t) for t in np.linspace(keys.frame[0], keys.frame[-1], frames * parts + 1)])
    return ((at[1:] + at[:-1]) / 2).reshape(frames, parts, *at.shape[1:]).mean(axis=1)


def test_a_red_box_is_where_the_camera_sees_it_and_nowhere_else() -> None:
    """Its top is 2.75 m below; of a picture 2 * 2.75 tan(22.5 deg) = 2.278 m high it covers 0.5 m a side.  Four
    samples a pixel and axis make it 480 x 640, as large as MuJoCo's own buffer, whose samples must not stay.
    Pixels of an edge are less red."""
    model, data = room()
    with MujocoPictures(model, (120, 160), "above") as pictures:
        colour, seen = pictures.colour(data), pictures.segmentation(data)
    red = (colour[..., 0] > 200) & (colour[..., 1] < 60)
    rows, columns = np.nonzero(red)
    pixel = 2 * 2.75 * np.tan(np.pi / 8) / 120
    print(rows.min(), rows.max(), columns.min(), columns.max())
    assert abs(rows.min() - (59.5 - 0.5 / pixel)) <= 1.5 and abs(columns.max() - (79.5 + 0.75 / pixel)) <= 1.5
    assert abs(rows.max() + 1 - (59.5 + 0.5)) <= 1
    identity, geom = model.geom("box").id, int(mujoco.mjtObj.mjOBJ_GEOM)
    assert (seen[38:55, 100:110] == (identity, geom)).all()
    assert (seen[100, 150] == (0, geom)).all()


@pytest.mark.parametrize("camera", ["above", "flat"])
def test_depth_is_metres_along_the_axis(camera: str) -> None:
    model, data = room()
    with MujocoPictures(model, (120, 160), camera) as pictures:
        depth, seen = pictures.depth(data), pictures.segmentation(data)[..., 0]
    np.testing.assert_allclose(depth[seen == 0], 5.0, rtol=1e-4)
    box = depth[seen == 1]  # the camera sees its top, and a side
    print(box.min(), np.median(box), box.max())
    assert np.median(box) == pytest.approx(2.75, rel=1e-4) and box.min() > 2.749 and box.max() < 3.251


def test_light_is_what_the_lamp_states_without_a_curve_and_finer_than_bytes() -> None:
    """Ambient light alone: a plane of colour 0.25 gives 0.25, the half of it 0.125; bytes would give 0.1255."""
    model, data = room()
    for share in (1.0, 0.5, 0.1):
        model.vis.headlight.ambient[:] = share
        with MujocoPictures(model, (24, 32), "above") as pictures:
            floor = pictures.light(data)[-1, -1]
        print(share, floor)
        assert floor == pytest.approx(0.25 * share, rel=1e-5)


def test_srgb_is_had_on_demand() -> None:
    model, data = room()
    with MujocoPictures(model, (24, 32), "above", transfer="srgb") as pictures:
        assert pictures.light(data)[-1, -1] == pytest.approx(((0.25 + 0.055) / 1.055) ** 2.4, rel=1e-5)


@pytest.mark.parametrize("name", GYMNASIUMS)
def test_a_replay_ends_where_the_environment_does_bit_for_bit(name: str) -> None:
    gymnasium = pytest.importorskip("gymnasium")
    bare = gymnasium.make(name).unwrapped
    bare.reset(seed=1)
    bare.action_space.seed(1)
    scratch = mujoco.MjData(bare.model)
    for _ in range(20):
        before = State.of(bare.model, bare.data)
        bare.step(bare.action_space.sample())
        course = replay(bare.model, scratch, before, bare.data)
        assert course.exact
        assert (scratch.qpos == bare.data.qpos).all() and (scratch.qvel == bare.data.qvel).all()
        assert len(course.time_s) == bare.frame_skip + 1


def test_a_state_set_by_hand_is_no_replay_and_says_so() -> None:
    model, data = room(x=1.0)
    light = MujocoLight(model, data, (24, 32), camera="above")
    light.begin()
    mujoco.mj_step(model, data)
    light.step()
    assert light.exact
    mujoco.mj_step(model, data)
    data.qpos[0] = 0.2
    keys = light.step()
    assert not light.exact and keys.frame[-1] == 80
    light.close()


@pytest.mark.parametrize("speed", [{"x": 25.0}, {"x": 10.0, "y": -8.0}])
def test_keys_of_a_fast_ball_are_within_one_percent_of_eight_times_as_many(speed: dict[str, float]) -> None:
    made = {}
    for motion in (0.5, 0.5 / 8):
        model, data = room(**speed)
        model.opt.timestep = 0.004
        light = MujocoLight(model, data, (64, 64), camera="above", motion_per_key=motion)
        light.begin()
        mujoco.mj_step(model, data)
        keys = light.step()
        made[motion] = len(keys.frame), of_frames(keys, 160, 16)
        light.close()
    (few, coarse), (many, fine) = made[0.5], made[0.5 / 8]
    error = np.sqrt(np.mean((coarse - fine) ** 2)) / fine.mean()
    print(f"{few} keys against {many}: {100 * error:.2f} % rms")
    assert many > 5 * few > 15
    assert error < 0.01


def test_nothing_moves_more_than_half_a_pixel_from_key_to_key() -> None:
    """The middle of the ball in the pictures themselves: it moves evenly, and by no more than the bound."""
    model, data = room(x=25.0, spin=300.0)
    model.opt.timestep = 0.004
    light = MujocoLight(model, data, (64, 64), camera="above")
    light.begin()
    mujoco.mj_step(model, data)
    keys = light.step()
    light.close()
    white = keys.radiance[:, 34:] - np.float32(0.25)  # less the floor's, below the box
    middle = (white * np.arange(64)).sum(axis=(1, 2)) / white.sum(axis=(1, 2))
    rate = np.diff(middle) / np.diff(keys.frame)
    print(np.diff(middle), rate)
    assert np.diff(middle).max() < 0.55
    assert rate == pytest.approx(rate.mean(), rel=0.2)


def test_a_camera_that_moves_moves_the_floor() -> None:
    """A camera that turns by w dt moves all that is seen at its axis by focal w dt pixels."""
    text = ROOM.replace(
        '<body name="box"',
        '<body pos="0 0 3"><joint name="pan" axis="0 1 0"/><geom size=".01" pos="0 0 1"/>'
        '<camera name="pan" fovy="45"/></body><body name="box"',
    )
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.gravity[:] = 0
    data = mujoco.MjData(model)
    data.joint("pan").qvel[:] = 10.0
    pictures = MujocoPictures(model, (64, 64), "pan")
    before = State.of(model, data)
    mujoco.mj_step(model, data)
    scratch = mujoco.MjData(model)
    course = replay(model, scratch, before, data)
    _, length = path_lengths(model, scratch, course, Boxes(model), pictures.projection, (64, 64))
    at_axis = 32 / np.tan(np.pi / 8) * 0.01
    print(length[-1], at_axis)
    assert at_axis <= length[-1] < 2 * at_axis


def test_key_frames_are_whole_where_they_can_be() -> None:
    frame, length = np.array([0.0, 20.0, 40.0]), np.array([0.0, 0.1, 2.1])
    keys = key_frames(frame, length, 0.5)
    assert (keys == np.floor(keys)).all() and keys[0] == 0 and keys[-1] == 40
    assert np.diff(np.interp(keys, frame, length)).max() <= 0.5 + 1e-9
    fast = key_frames(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 10.0]), 0.5)
    assert np.diff(np.interp(fast, [0, 1, 2], [0, 1, 10])).max() <= 0.5 + 1e-9 and {0.0, 1.0, 2.0} <= set(fast)


def test_light_goes_on_from_step_to_step_into_the_sensor() -> None:
    model, data = room(x=5.0)
    light = MujocoLight(model, data, (32, 48), camera="above", scale=0.4)
    sensor = SpikeSensor("ideal", (32, 48))
    light.begin()
    last = None
    for step in range(3):
        mujoco.mj_step(model, data)
        keys = light.step()
        assert keys.frame[0] == 40 * step and keys.frame[-1] == 40 * (step + 1)
        assert last is None or (keys.radiance[0] == last).all()
        last = keys.radiance[-1]
        spikes = sensor.step(keys, 40)
    light.close()
    assert spikes[:, -1, -1].sum() == pytest.approx(40 * 0.4 * 0.25, abs=1)


def test_two_contexts_take_turns_and_end_alone() -> None:
    model, data = room()
    one, other = MujocoPictures(model, (40, 60), "above"), MujocoPictures(model, (24, 32), "above", supersample=1)
    first, second = one.light(data), other.light(data)
    for _ in range(3):
        np.testing.assert_array_equal(one.light(data), first)
        np.testing.assert_array_equal(other.light(data), second)
    other.close()
    other.close()
    np.testing.assert_array_equal(one.light(data), first)
    with pytest.raises(NotReadyError, match="closed"):
        other.light(data)
    one.close()


def test_it_draws_beside_our_own_scenes(renderer_kind: str) -> None:
    """pyrender, over PyOpenGL, and MuJoCo in one thread: neither disturbs the other's context."""
    from scenes.renderers.trial import draw

    model, data = room()
    with MujocoPictures(model, (40, 60), "above", renderer=renderer_kind) as pictures:
        first = pictures.light(data)
        draw(renderer_kind)
        np.testing.assert_array_equal(pictures.light(data), first)


def test_threads_share_a_context() -> None:
    model, data = room()
    with MujocoPictures(model, (40, 60), "above") as pictures, ThreadPoolExecutor(3) as threads:
        first = pictures.light(data)
        for other in threads.map(lambda _: pictures.light(data), range(12)):
            np.testing.assert_array_equal(other, first)


def test_fifty_makes_leave_no_memory_behind() -> None:
    """A context kept would hold its picture and depth, 2.9 MB."""
    model, data = room()
    used = []
    for make in range(60):
        pictures = MujocoPictures(model, (128, 128), "above")
        pictures.light(data)
        if make % 2:
            pictures.close()
        del pictures
        gc.collect()
        with open("/proc/self/statm", encoding="ascii") as file:
            used.append(int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6)
    print(f"{used[9]:.0f} MB after 10, {used[-1]:.0f} MB after 60")
    assert used[-1] - used[9] < 25


IN_A_FORK = """
import os, sys
import numpy as np
from scenes.mujoco import MujocoPictures, import_mujoco
from spikecam_env.errors import NotReadyError
mujoco = import_mujoco()
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
pictures, unused = MujocoPictures(model, (8, 8)), MujocoPictures(model, (8, 8))
drawn = pictures.light(data)
child = os.fork()
if not child:
    for made in (pictures, unused, MujocoPictures(model, (8, 8))):
        try:
            made.light(data)
        except NotReadyError as error:
            print(error, flush=True)
    os._exit(0)
os.waitpid(child, 0)
assert (pictures.light(data) == drawn).all()
print("parent draws")
"""


def test_a_fork_says_what_to_do_and_its_parent_draws_on() -> None:
    run = subprocess.run([sys.executable, "-c", IN_A_FORK], capture_output=True, text=True, timeout=120)
    lines = run.stdout.splitlines()
    print(run.stdout, run.stderr[-2000:])
    assert run.returncode == 0 and lines[-1] == "parent draws"
    assert len(lines) == 4 and all("'spawn'" in line for line in lines[:3])


FORKED_ENVS = """
import gymnasium, numpy as np
from scenes.mujoco import MujocoLight, camera_of
from spikecam_env.errors import NotReadyError

class Lit(gymnasium.Wrapper):
    def reset(self, **options):
        seen = super().reset(**options)
        bare = self.unwrapped
        self.light = MujocoLight(bare.model, bare.data, (16, 16), camera=camera_of(bare))
        self.light.begin()
        return seen
    def step(self, action):
        self.env.step(action)
        return np.float64([self.light.step().radiance.mean()] * 4), 0.0, False, False, {}

if __name__ == "__main__":
    make = lambda: Lit(gymnasium.make("InvertedPendulum-v5"))
    envs = gymnasium.vector.AsyncVectorEnv([make] * 2)
    envs.reset(seed=0)
    seen = envs.step(np.zeros((2, 1), np.float32))[0]
    envs.close()
    assert (seen > 0.01).all(), seen
    print("forked environments draw")
"""


def test_forked_environments_draw_where_the_parent_has_not() -> None:
    pytest.importorskip("gymnasium")
    run = subprocess.run([sys.executable, "-c", FORKED_ENVS], capture_output=True, text=True, timeout=120)
    print(run.stdout, run.stderr[-2000:])
    assert run.stdout.strip() == "forked environments draw"


IMPORTS = """
import os, sys
if sys.argv[1] == "missing":
    sys.modules["mujoco"] = None
    del sys.modules["mujoco"]
    import importlib.abc
    class No(importlib.abc.MetaPathFinder):
        def find_spec(self, name, path, target=None):
            if name == "mujoco":
                raise ModuleNotFoundError("No module named 'mujoco'", name="mujoco")
    sys.meta_path.insert(0, No())
else:
    os.environ["MUJOCO_GL"] = sys.argv[1]
before = dict(os.environ)
from scenes.mujoco import MujocoPictures, import_mujoco
try:
    import_mujoco()
    assert "mujoco" in sys.modules
except Exception as error:
    print(type(error).__name__, error)
assert os.environ.get("MUJOCO_GL") == before.get("MUJOCO_GL")
"""


def test_mujoco_missing_is_one_line_that_says_how_to_get_it() -> None:
    run = subprocess.run([sys.executable, "-c", IMPORTS, "missing"], capture_output=True, text=True, timeout=120)
    print(run.stderr[-2000:])
    assert run.stdout.strip() == "InputError MuJoCo is not installed; pip install 'spikecam-env[mujoco]'"


def test_mujoco_is_imported_even_where_pyopengl_has_no_egl_for_it() -> None:
    run = subprocess.run([sys.executable, "-c", IMPORTS, "egl"], capture_output=True, text=True, timeout=120)
    assert run.returncode == 0 and run.stdout == "", run.stdout + run.stderr[-2000:]


LIT = "<mujoco><worldbody><light pos='0 0 9'/><geom size='1'/></worldbody></mujoco>"
WITH_OSMESA = f"""
import sys
from scenes.mujoco import MujocoPictures, import_mujoco
mujoco = import_mujoco()
model = mujoco.MjModel.from_xml_string({LIT!r})
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
for kind in sys.argv[1:]:
    try:
        print(kind, MujocoPictures(model, (8, 8), renderer=kind).light(data).mean())
    except Exception as error:
        print(type(error).__name__, error)
"""


def test_osmesa_draws_the_same_and_one_process_serves_one_library(renderer_kind: str) -> None:
    run = subprocess.run(
        [sys.executable, "-c", WITH_OSMESA, "osmesa", renderer_kind], capture_output=True, text=True, timeout=120
    )
    print(run.stdout, run.stderr[-2000:])
    first, second = run.stdout.splitlines()
    if "libosmesa6" in first and os.environ.get("CI") != "true":
        pytest.skip("libosmesa6 is not installed")
    model = mujoco.MjModel.from_xml_string(LIT)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with MujocoPictures(model, (8, 8)) as pictures:
        assert float(first.split()[1]) == pytest.approx(float(pictures.light(data).mean()), abs=2e-4)
    assert second.startswith("NotReadyError") and "new process" in second


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"model": 7}, "model is a int; give a mujoco.MjModel"),
        ({"data": None}, "data is a NoneType; give the mujoco.MjData"),
        ({"shape": (0, 4)}, "shape = (0, 4)"),
        ({"camera": "abvoe"}, "unknown camera 'abvoe'; choose one of above, flat (above?)"),
        ({"camera": 2}, "camera = 2; it must be a number below 2, -1 for the free camera, or an MjvCamera"),
        ({"camera": 0.5}, "camera = 0.5"),
        ({"frame_rate_hz": float("nan")}, "frame_rate_hz = nan"),
        ({"scale": 0}, "scale = 0; it must be a number above 0"),
        ({"motion_per_key": 0}, "motion_per_key = 0"),
        ({"supersample": 9}, "supersample = 9"),
        ({"renderer": "embree"}, "unknown renderer of MuJoCo 'embree'; choose one of"),
        ({"transfer": "sgrb"}, "(srgb?)"),
    ],
)
def test_wrong_use_is_one_line(wrong: dict[str, Any], says: str) -> None:
    model, data = room()
    with pytest.raises(InputError) as refused:
        MujocoLight(**({"model": model, "data": data, "shape": (8, 8)} | wrong))
    assert says in str(refused.value) and "\n" not in str(refused.value)


def test_calls_in_the_wrong_order_say_which_comes_first() -> None:
    model, data = room()
    light = MujocoLight(model, data, (8, 8), camera="above")
    with pytest.raises(NotReadyError, match=r"call begin\(\)"):
        light.step()
    light.begin(frame=40)
    with pytest.raises(NotReadyError, match="no step of physics"):
        light.step()
    mujoco.mj_step(model, data)
    with pytest.raises(InputError, match="frame = 40"):
        light.step(frame=40)
    assert light.step(frame=80).frame.tolist() == [40, 80]
    light.close()


def test_embree_alone_cannot_draw_mujoco(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPIKECAM_RENDERER", "embree")
    model, data = room()
    with pytest.raises(InputError, match=r"draws with OpenGL alone, not with 'embree'.*libegl1"):
        MujocoPictures(model, (8, 8)).light(data)


def test_an_environment_is_seen_as_it_draws_itself() -> None:
    gymnasium = pytest.importorskip("gymnasium")
    env = gymnasium.make("Ant-v5", camera_name=None, default_camera_config={"distance": 7.0})
    assert camera_of(env).distance == 7.0
    with pytest.raises(InputError, match="has no MuJoCo model"):
        camera_of(gymnasium.make("CartPole-v1"))


@pytest.fixture
def renderer_kind() -> str:
    """The OpenGL of this test process."""
    from scenes.renderers.choose import chosen

    kind = chosen()
    if kind == "embree":
        pytest.skip("no OpenGL here")
    assert contexts.can_start()
    return kind
