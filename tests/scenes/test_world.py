"""Worlds: light that depends on the world alone, truth that agrees with it, flow that carries the picture."""

from __future__ import annotations

import dataclasses
import pickle

import cv2
import numpy as np
import pytest

from scenes.camera import Camera
from scenes.derived.flow import check_flow
from scenes.exposure import METERED_FRAMES, expose
from scenes.meshes import assemble, box, disc, rectangle, sphere, torus
from scenes.protocol import Gaze
from scenes.renderers.embree import Embree
from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole
from scenes.textures import blobs, dead_leaves
from scenes.trajectories import AT_REST, Ballistic, Path, Shake, Spinning, Still, Trajectory, Vibrating
from scenes.world import Body, World
from scenes.world.body_key import render_key
from scenes.world.carried import carry, project
from scenes.world.plan import BLOCK, pace_of
from spikecam_env.errors import InputError

SHAPE = (60, 96)


def busy(renderer: Embree, shake: Trajectory = AT_REST, shape: tuple[int, int] = SHAPE) -> World:
    rng = np.random.default_rng(2)
    return World(
        shape,
        (
            Body("wall", assemble(rectangle(6, 4, blobs(rng, 128))), Still((0, 0, -1)), backdrop=True),
            Body(
                "ball",
                assemble(sphere(0.4, blobs(rng, 64), 32)),
                Ballistic((-0.5, 0, 0.3), (9, 2, 0)) @ Spinning((1, 2, 0), 900),
            ),
            Body(
                "box",
                assemble(*box((0.6, 0.5, 0.5), dead_leaves(rng, 64), 3)),
                Still((0.5, 0.1, 0)) @ Spinning((0, 1, 1), 600),
            ),
            Body("ring", assemble(torus(0.4, 0.15, 0.7, 32)), Still((0.1, -0.3, 0.2)) @ Vibrating((0.3, 0, 0.2), 20)),
        ),
        Camera((0, 0, 3), shake=shake),
        background=0.2,
        renderer=renderer,
    )


def rms(difference: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(difference, dtype=np.float64))))


def moving(world: World, frame: float) -> np.ndarray:
    speed = np.linalg.norm(world.truth(frame).flow, axis=-1)
    return cv2.dilate((speed > 1e-4).astype(np.uint8), np.ones((5, 5))) > 0


@pytest.mark.parametrize("shake", [AT_REST, Shake(0.2)], ids=["still camera", "shaken camera"])
def test_keys_do_not_depend_on_the_cut_or_on_earlier_calls(renderer: Embree, shake: Trajectory) -> None:
    whole = busy(renderer, shake).radiance(BLOCK - 40, BLOCK + 40)
    light = dict(zip(whole.frame, whole.radiance, strict=True))
    again = busy(renderer, shake)
    for start, stop in ((BLOCK + 3, BLOCK + 9), (BLOCK - 33, BLOCK), (BLOCK, BLOCK + 1), (BLOCK - 40, BLOCK + 40)):
        part = again.radiance(start, stop)
        assert part.frame[0] <= start and part.frame[-1] >= stop
        for frame, radiance in zip(part.frame, part.radiance, strict=True):
            np.testing.assert_array_equal(radiance, light[frame])


def test_a_backdrop_that_rests_in_two_places_is_painted_where_it_is(renderer: Embree) -> None:
    """It stands still in both blocks, so each is painted over one picture of it: of this block, not of the other."""
    moved = Path((0.01, 0.02), ((0, 0, 0), (0.5, 0, 0)))

    def wall() -> World:
        bodies = (Body("wall", assemble(rectangle(0.5, 0.5, 0.9)), moved, backdrop=True),)
        return World(SHAPE, bodies, Camera((0, 0, 3)), renderer=renderer)

    world, later = wall(), 10 * BLOCK
    before = world.radiance(0, 4).radiance
    after = world.radiance(later, later + 4).radiance
    assert np.abs(after - before).max() > 0.3
    np.testing.assert_array_equal(after, wall().radiance(later, later + 4).radiance)


def test_carried_light_is_the_rendered_light_to_1_5_percent(renderer: Embree) -> None:
    world = busy(renderer)
    keys = world.radiance(0, 48)
    errors = []
    for index in (3, len(keys.frame) // 2, len(keys.frame) - 2):
        frame = float(keys.frame[index])
        errors.append(rms((keys.radiance[index] - world.truth(frame).radiance)[moving(world, frame)]))
    print(f"rms where things move: {np.round(100 * np.array(errors), 2)} %")
    assert max(errors) < 0.015


def test_nothing_pops_between_blocks_and_keys(renderer: Embree) -> None:
    """The step from one light key to the next is never far above the usual, for steps of the same length."""
    keys = busy(renderer).radiance(BLOCK - 64, BLOCK + 64)
    length = np.diff(keys.frame)
    steps = np.array([rms(b - a) for a, b in zip(keys.radiance, keys.radiance[1:], strict=False)]) / length
    print(f"rms change a frame: median {np.median(steps):.5f}, largest {steps.max():.5f}")
    assert steps.max() < 2 * np.median(steps)


def test_motion_between_keys_of_light_is_bounded(renderer: Embree) -> None:
    world = busy(renderer)
    keys = world.radiance(0, 128)
    fastest = max(np.linalg.norm(world.truth(frame).flow, axis=-1).max() for frame in (0.5, 60.5, 127.5))
    print(f"{fastest:.3f} pixels/frame, keys every {np.diff(keys.frame).max():.0f}")
    assert np.diff(keys.frame).max() * fastest <= world.motion_per_key * 1.05


def test_a_ball_is_where_its_trajectory_says(renderer: Embree) -> None:
    ball = Body("ball", assemble(sphere(0.3, 0.8, 48)), Ballistic((-0.4, 0.2, 0.5), (20, -10, 0)))
    world = World((100, 150), (ball,), Camera((0, 0, 3)), background=0.0, renderer=renderer)
    truth = world.truth(1000.5)
    where = np.array([-0.4 + 20 * 1000.5 / 40_000, 0.2 - 10 * 1000.5 / 40_000, 0.5])
    focal = 50 / np.tan(np.radians(20))
    rows, columns = np.nonzero(truth.object_id == 1)
    seen = np.array([columns.mean(), rows.mean()])
    expected = [74.5 + focal * where[0] / 2.5, 49.5 - focal * where[1] / 2.5]
    # a ball off the axis is seen as an ellipse, its middle up to radius^2 / (2 distance^2) of the offset farther out
    np.testing.assert_allclose(seen, expected, atol=0.5)
    assert truth.depth is not None and truth.depth[truth.object_id == 1].min() == pytest.approx(2.2, abs=0.01)
    assert np.isinf(truth.depth[truth.object_id == 0]).all()
    assert truth.poses["ball"][:3] == pytest.approx(tuple(where))
    middle = truth.flow[round(expected[1]), round(expected[0])]
    np.testing.assert_allclose(middle, np.array([20, 10]) / 40_000 * focal / 2.2, rtol=0.02)


def test_flow_carries_frame_t_onto_frame_t_plus_40(renderer: Embree) -> None:
    check = check_flow(busy(renderer, shape=(100, 160)), 10.5)
    print(check)
    assert check.error < 0.02 < check.unmoved and check.compared > 0.7


def test_a_gaze_shifts_the_picture_the_other_way(renderer: Embree) -> None:
    world = busy(renderer)
    here, there = world.truth(7.0), world.truth(7.0, Gaze.fixed(5.0, -3.0))
    np.testing.assert_allclose(there.radiance[3:, :-5], here.radiance[:-3, 5:], atol=1e-4)
    keys = world.radiance(8, 40, Gaze.fixed(5.0, -3.0))
    difference = keys.radiance[0] - world.truth(8.0, Gaze.fixed(5.0, -3.0)).radiance
    print(f"keys under a gaze: {100 * rms(difference):.2f} % rms")
    assert rms(difference) < 0.015
    assert keys.frame[0] == 8 and keys.frame[-1] == 40


def test_a_background_picture_fills_the_view_and_moves_with_the_gaze(renderer: Embree) -> None:
    sky = np.random.default_rng(0).random((60, 96)).astype(np.float32)
    world = World((60, 96), (), background=sky, renderer=renderer)
    np.testing.assert_allclose(world.radiance(0, 4).radiance[0], sky, atol=1e-5)
    np.testing.assert_allclose(world.truth(0.0, Gaze.fixed(7.0, 2.0)).radiance[:-2, :-7], sky[2:, 7:], atol=1e-2)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_body_hides_the_farther_whatever_their_order(renderer: Embree, order: tuple[int, int]) -> None:
    bodies = [
        Body("near", assemble(disc(0.4, 0.9)), Still((0, 0, 0.5))),
        Body("far", assemble(disc(0.6, 0.1)), Still((0, 0, -0.5))),
    ]
    world = World(SHAPE, tuple(bodies[k] for k in order), Camera((0, 0, 3)), Lighting(1, 0), renderer=renderer)
    assert world.truth(0.0).radiance[30, 48] == pytest.approx(0.9, abs=1e-4)
    assert world.radiance(0, 4).radiance[0, 30, 48] == pytest.approx(0.9, abs=1e-3)


def test_bodies_that_pierce_each_other_are_cut_by_depth(renderer: Embree) -> None:
    """Two crossed plates: of each the half nearer to the camera is seen, in keys as in truth."""
    plates = tuple(
        Body(name, assemble(*box((1.6, 1.6, 0.01), grey)), Spinning((0, 0, 1), 300) @ Still(turn=(0, turn, 0)))
        for name, grey, turn in (("dark", 0.2, 40), ("bright", 0.9, -40))
    )
    world = World((80, 100), plates, Camera((0, 0, 4)), Lighting(1, 0), renderer=renderer)
    keys = world.radiance(0, 30)
    frame = float(keys.frame[1])
    truth = world.truth(frame)
    assert {1, 2} <= set(np.unique(truth.object_id))
    agree = np.mean(np.abs(keys.radiance[1] - truth.radiance) < 0.1)
    print(f"{100 * agree:.1f} % of the pixels agree")
    assert agree > 0.97


def test_light_is_scaled_to_the_wanted_mean_interval(renderer: Embree) -> None:
    scene = expose(busy(renderer), 12.5)
    mean = np.mean([scene.truth(frame).radiance.mean() for frame in METERED_FRAMES])
    assert 1 / mean == pytest.approx(12.5, rel=1e-4)
    unlit = np.mean([busy(renderer).truth(frame).radiance.mean() for frame in METERED_FRAMES])
    ratio = scene.radiance(0, 2).radiance[0].mean() / busy(renderer).radiance(0, 2).radiance[0].mean()
    assert ratio == pytest.approx(1 / (12.5 * unlit), rel=1e-4)


def test_depth_carries_points_of_a_key_to_their_place(renderer: Embree) -> None:
    """In pixels and in depth, of points on the surface, to the precision of 32-bit numbers."""
    surface = assemble(*box((0.8, 0.8, 0.8), [0.5] * 6))
    motion = Ballistic((0.1, 0.2, 0), (30, -20, 50)) @ Spinning((0.3, 1, 0.5), 1200)
    camera = Camera((0, 0, 3))
    focal, centre = camera.focal(SHAPE[0]), ((SHAPE[1] - 1) / 2, (SHAPE[0] - 1) / 2)
    then, now = (np.linalg.inv(camera.pose(np.array(t))) @ motion.pose(np.array(t)) for t in (0.0, 32 / 40_000))
    lens, window = Pinhole(focal, centre, camera.pose(np.array(0.0))), PictureWindow(0, 0, *SHAPE)
    key = render_key(renderer, surface, motion.pose(np.array(0.0)), lens, Lighting(), window, 1.0)
    rigid = carry(key, now[None], then, focal, np.array([centre])).rigid[0].astype(np.float64)
    pixels, depth = project(now, key.points, focal, centre)
    _, depth_then = project(then, key.points, focal, centre)
    homogeneous = np.stack([depth * pixels[:, 0], depth * pixels[:, 1], depth, np.ones_like(depth)])
    x, y, w = rigid[4:16].reshape(3, 4) @ homogeneous
    carried = depth_then * (key.texels @ rigid[:2] + rigid[2]) + rigid[3]
    moved = np.linalg.norm(pixels - project(then, key.points, focal, centre)[0], axis=-1).max()
    off = np.abs(np.stack([x / w, y / w], -1) - key.texels).max()
    print(f"moved up to {moved:.1f} pixels, {off:.1e} texels off; depth {np.abs(carried - depth).max():.1e} off")
    assert moved > 1 and off < 1e-3 and np.abs(carried - depth).max() < 1e-5


def test_depth_halves_what_a_polynomial_misplaces_on_a_box(renderer: Embree, monkeypatch) -> None:
    """Half-way between two keys, where the box shows three sides."""
    faces = [blobs(np.random.default_rng(n), 128) for n in range(6)]
    turning = Spinning((0.3, 1, 0.5), 600, 30)

    def off() -> float:
        box_alone = Body("box", assemble(*box((1, 1, 1), faces)), turning)
        world = World((100, 160), (box_alone,), Camera((0, 0, 3)), background=0.3, renderer=renderer)
        step = pace_of(world, 0, world.cache.probe(world, 0), 0).step
        at, truth = step // 2, world.truth(step / 2)
        return rms((world.radiance(at, at + 1).radiance[0] - truth.radiance)[truth.object_id > 0])

    by_depth = off()
    monkeypatch.setattr("scenes.world.plan.FLAT", np.inf)
    by_polynomial = off()
    print(f"{100 * by_depth:.2f} % rms; by a polynomial alone {100 * by_polynomial:.2f} %")
    assert by_depth < 0.5 * by_polynomial


def test_what_comes_into_sight_between_two_keys_is_drawn(renderer: Embree) -> None:
    ball = Body("ball", assemble(sphere(0.4, 0.9)), Ballistic((-5, 0, 0), (8000, 0, 0)))
    world = World(SHAPE, (ball,), Camera((0, 0, 3)), background=0.0, renderer=renderer)
    light = world.radiance(0, 48).radiance.max(axis=(1, 2))
    assert light[0] == 0 and light.max() > 0.3


def test_light_multiplies_all_that_shines(renderer: Embree) -> None:
    glowing = dataclasses.replace(assemble(sphere(0.4, 0.5)), emission=0.3)
    world = World(SHAPE, (Body("lamp", glowing, Spinning((0, 1, 0), 600)),), Camera((0, 0, 3)), renderer=renderer)
    thrice = world.lit(3.0)
    np.testing.assert_allclose(thrice.truth(5.5).radiance, 3 * world.truth(5.5).radiance, rtol=1e-5)
    np.testing.assert_allclose(thrice.radiance(0, 8).radiance, 3 * world.radiance(0, 8).radiance, rtol=1e-5)


def test_a_pickled_world_gives_the_same_light(renderer: Embree) -> None:
    world = busy(renderer)
    light = world.radiance(0, 8).radiance
    copy = pickle.loads(pickle.dumps(world))
    object.__setattr__(copy, "renderer", renderer)
    np.testing.assert_array_equal(copy.radiance(0, 8).radiance, light)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"shape": (0, 5)}, "shape is"),
        ({"bodies": (Body("a", None), Body("a", None))}, "different names"),  # type: ignore[arg-type]
        ({"light": -1.0}, "light is -1.0"),
        ({"frame_rate_hz": 0.0}, "frame_rate_hz is 0.0"),
        ({"background": np.zeros(3)}, "background is"),
    ],
)
def test_bad_options_are_named(option: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        World(**{"shape": (8, 8), "bodies": (), **option})


def test_an_impossible_call_is_refused(renderer: Embree) -> None:
    with pytest.raises(InputError, match="first must be before"):
        busy(renderer).radiance(5, 5)
    with pytest.raises(InputError, match=r"mean_interval = 0\.5"):
        expose(busy(renderer), 0.5)
    with pytest.raises(InputError, match="parallel"):
        Camera((0, 3, 0), (0, 0, 0))
