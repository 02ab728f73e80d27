"""Light of MuJoCo: how fast, how fine beside shot noise, and how near to eight times as many keys.

python -m benchmarks.mujoco_light

Needs pip install 'spikecam-env[mujoco]'.  A ball of 3 cm flies over a chequered table, or a white one over
grey; times are the processor's.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import tyro

from scenes.mujoco import MujocoLight, MujocoPictures, import_mujoco
from spikecam_env.cli.bench import print_figures
from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor
from spikecam_env.types import Pictures

SHAPES = ((64, 64), (128, 128), (250, 400))
SPEEDS_M_S = (5.0, 25.0)
"""Of the ball: a slow and a fast serve of table tennis."""
INTERVAL, FRAMES = 10.0, 40
"""Mean interval, and frames over which light is collected [frames]."""
SUPERSAMPLES = (1, 2, 3, 4)

TABLE = """<mujoco><option timestep="0.001" gravity="0 0 0"/><visual><quality shadowsize="0"/></visual>
<asset><texture name="squares" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".6 .7 .8" width="256" height="256"/>
<material name="squares" texture="squares" texrepeat="8 8"/></asset>
<worldbody><light pos="0 0 3" castshadow="false"/><geom type="plane" size="3 3 .1" material="squares"/>
<camera name="side" pos="0 -1.5 .8" xyaxes="1 0 0 0 .4 1"/>
<body name="ball" pos="-.3 0 .4"><freejoint/><geom type="sphere" size=".03" rgba="1 .6 .1 1" mass=".003"/></body>
<body pos=".4 0 .4"><joint type="slide" axis="0 0 1"/><geom type="box" size=".02 .1 .1" rgba=".8 .1 .1 1"/></body>
</worldbody></mujoco>"""

GREY = """<mujoco><option timestep="0.001" gravity="0 0 0"/>
<visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/><quality shadowsize="0"/></visual>
<worldbody><geom type="plane" size="9 9 .1" pos="0 0 -2" rgba=".25 .25 .25 1"/><camera pos="0 0 3" fovy="45"/>
<body pos="-.6 -.3 .1"><freejoint/><geom type="sphere" size=".1"  rgba="1 1 1 1"/></body></worldbody></mujoco>"""
WORLDS = {"orange, over squares": TABLE, "white, over grey": GREY}


def bench_mujoco(repeats: int = 40) -> dict[str, list[dict[str, Any]]]:
    """Tables of figures by title."""
    return {
        "A picture [ms of processor time]": [_pictures(shape, repeats) for shape in SHAPES],
        "Steps of 1 ms, 40 frames at 64 x 64: physics, replay, keys, sensor": [
            _steps(speed, samples, repeats) for speed in SPEEDS_M_S for samples in (2, 4)
        ],
        "Steps of colour beside shot noise, share of the mean light [%]": [_fineness()],
        "Keys every half pixel beside eight times as many: rms of frames' light, share of its mean [%]": [
            _keys(world, samples) for world in WORLDS for samples in SUPERSAMPLES
        ],
    }


def _world(speed_m_s: float = 0.0, text: str = TABLE) -> tuple[Any, Any]:
    mujoco = import_mujoco()
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qvel[0] = speed_m_s
    mujoco.mj_forward(model, data)
    return model, data


def _pictures(shape: tuple[int, int], repeats: int) -> dict[str, Any]:
    model, data = _world()
    row: dict[str, Any] = {"shape": f"{shape[0]} x {shape[1]}"}
    for samples in SUPERSAMPLES:
        with MujocoPictures(model, shape, supersample=samples) as pictures:
            row[f"light, {samples} x {samples}"] = _ms(lambda: pictures.light(data), repeats)
    with MujocoPictures(model, shape) as pictures:
        row["depth"] = _ms(lambda: pictures.depth(data), repeats)
        row["segmentation"] = _ms(lambda: pictures.segmentation(data), repeats)
    return row


def _steps(speed_m_s: float, samples: int, repeats: int) -> dict[str, Any]:
    mujoco = import_mujoco()
    model, data = _world(speed_m_s)
    light, sensor, keys = (
        MujocoLight(model, data, (64, 64), scale=0.3, supersample=samples),
        SpikeSensor("scsim", (64, 64)),
        0,
    )
    start = _state(model, data)

    def step() -> None:
        nonlocal keys
        mujoco.mj_step(model, data)
        made = light.step()
        keys += len(made.frame) - 1
        sensor.step(made, FRAMES)
        if data.qpos[0] > 0.3:  # out of the picture: thrown again
            mujoco.mj_setState(model, data, start, mujoco.mjtState.mjSTATE_INTEGRATION)
            light.begin(sensor.frame)

    light.begin()
    step()
    keys = 0
    ms = _ms(step, repeats)
    light.close()
    return {
        "ball, m/s": speed_m_s,
        "samples": f"{samples} x {samples}",
        "keys a step": keys / (repeats + 1),
        "ms": ms,
        "steps/s": 1e3 / ms,
    }


def _state(model: Any, data: Any) -> Any:
    mujoco = import_mujoco()
    which = mujoco.mjtState.mjSTATE_INTEGRATION
    values = np.empty(mujoco.mj_stateSize(model, which))
    mujoco.mj_getState(model, data, values, which)
    return values


def _fineness() -> dict[str, Any]:
    """Light at one sample a pixel, in bytes and in floats; shot noise is 1 / sqrt(electrons) of the mean light."""
    model, data = _world()
    with MujocoPictures(model, (64, 64), supersample=1) as pictures:
        light, colour = pictures.light(data), pictures.colour(data)
    luminance = (0.2126, 0.7152, 0.0722)
    bytes_light = colour.astype(np.float64) / 255 @ luminance
    electrons = SensorModel.preset("physical").circuit.threshold_electrons * FRAMES / INTERVAL
    finest = float(np.spacing(light).max() / np.sqrt(12) / light.mean())
    return {
        "shot noise": 100 / np.sqrt(electrons),
        "bytes": 100 * float(np.sqrt(np.mean((bytes_light - light) ** 2)) / light.mean()),
        "bytes, one colour": 100 / 255 / np.sqrt(12) / float(light.mean()),
        "floats": 100 * finest,
    }


def _keys(world: str, samples: int) -> dict[str, Any]:
    few, fine = (_frames_of(world, motion, samples) for motion in (0.5, 0.5 / 8))
    error = np.sqrt(np.mean((few[1] - fine[1]) ** 2)) / fine[1].mean()
    return {"ball at 25 m/s": world, "samples": f"{samples} x {samples}", "keys": few[0], "rms": 100 * float(error)}


def _frames_of(world: str, motion_per_key: float, samples: int, parts: int = 32) -> tuple[int, Pictures]:
    """Number of keys, and the mean light (160, 64, 64) of every frame of 4 ms."""
    mujoco = import_mujoco()
    model, data = _world(25.0, WORLDS[world])
    light = MujocoLight(model, data, (64, 64), motion_per_key=motion_per_key, supersample=samples)
    light.begin()
    mujoco.mj_step(model, data, 4)
    keys = light.step()
    light.close()
    return len(keys.frame), _exposed(keys, 160, parts)


def _exposed(keys: Keyframes, frames: int, parts: int) -> Pictures:
    """(frames, H, W): the mean light of every frame, by so many parts of each."""
    exposed = np.zeros((frames, *keys.radiance.shape[1:]), np.float32)
    for part in range(parts):
        exposed += np.stack([keys.at(frame + (part + 0.5) / parts) for frame in range(frames)])
    exposed /= np.float32(parts)
    return exposed


def _ms(run: Callable[[], object], repeats: int) -> float:
    """Processor time of a run, of all threads [ms]; the first is not counted."""
    run()
    start = time.process_time()
    for _ in range(repeats):
        run()
    return 1e3 * (time.process_time() - start) / repeats


if __name__ == "__main__":
    tyro.cli(partial(print_figures, bench_mujoco), description=__doc__)
