from __future__ import annotations

import cv2
import numpy as np
import pytest

from benchmarks.exact_disk import supersampled
from scenes import Gaze, RotatingDisk
from scenes.flat.disk import disk_texture
from spikecam_env.errors import InputError

BACKGROUND = 0.2


@pytest.fixture(scope="module")
def texture() -> np.ndarray:
    return disk_texture(np.random.default_rng(3))


@pytest.fixture(scope="module")
def disk(texture: np.ndarray) -> RotatingDisk:
    return RotatingDisk(light=(0.0, 1.0), texture=texture, background=BACKGROUND, centre=(199.3, 124.8))


def rms(difference: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(difference, dtype=np.float64))))


def truly(disk: RotatingDisk, texture: np.ndarray, frame: float) -> np.ndarray:
    """The radiance by 16 x 16 samples a pixel, straight from the source texture."""
    return supersampled(disk, texture, BACKGROUND, frame)


def test_picture_is_the_area_average_to_1_2_percent(disk: RotatingDisk, texture: np.ndarray) -> None:
    errors = []
    for frame in (0, 7, 123, 1000, 5001.5):
        truth = disk.truth(frame)
        errors.append(rms((truth.radiance - truly(disk, texture, frame))[truth.object_id > 0]))
    print(f"rms error inside the disk, of full scale: {np.round(100 * np.array(errors), 2)} %")
    assert max(errors) < 0.012


@pytest.mark.parametrize(("motion", "bound"), [(1.2, 0.055), (0.6, 0.02)])
def test_light_between_keys_blends_both(texture: np.ndarray, motion: float, bound: float) -> None:
    disk = RotatingDisk(
        light=(0.0, 1.0), texture=texture, background=BACKGROUND, centre=(199.3, 124.8), motion_per_key=motion
    )
    keys = disk.radiance(40, 41)
    middle = keys.frame[:2].mean()
    error = rms((keys.at(middle) - truly(disk, texture, middle))[disk.truth(middle).object_id > 0])
    print(f"{motion} pixels a key: {100 * error:.2f} % rms of full scale half-way")
    assert error < bound


def test_light_of_a_frame_is_right_to_1_2_percent(disk: RotatingDisk, texture: np.ndarray) -> None:
    """Light that the sensor collects over a frame, from keys, against the mean of eight instants of it."""
    keys, instants = disk.radiance(40, 43), 41 + (np.arange(8) + 0.5) / 8
    given = np.mean([keys.at(t) for t in instants], axis=0)
    true = np.mean([truly(disk, texture, t) for t in instants], axis=0)
    error = rms((given - true)[disk.truth(41).object_id > 0])
    print(f"{100 * error:.2f} % rms of full scale")
    assert error < 0.012


def test_rim_moves_0_58_pixels_a_frame_at_2000_rpm() -> None:
    disk = RotatingDisk()
    assert disk.radius == pytest.approx(110)
    assert disk.rim_speed == pytest.approx(0.576, abs=5e-4)
    flow = disk.truth(0.5).flow
    speed = np.hypot(flow[..., 0], flow[..., 1])
    assert speed.max() == pytest.approx(0.576, abs=0.003)


@pytest.mark.parametrize("rpm", [0.0, 100.0, 2000.0, -3500.0, 30000.0])
def test_rim_moves_at_most_0_6_pixels_a_key_where_keys_are_whole_frames(rpm: float) -> None:
    disk = RotatingDisk(rpm=rpm, shape=(60, 60))
    step = np.diff(disk.radiance(0, 200).frame)
    assert (step == step[0]).all() and 1 <= step[0] <= 64
    assert step[0] == 1 or step[0] * disk.rim_speed <= 0.6


def test_keys_cover_the_block_and_do_not_depend_on_the_cut() -> None:
    disk = RotatingDisk(shape=(50, 80), rpm=900, drift_px_s=(300.0, -100.0))
    whole = disk.radiance(0, 60)
    light = dict(zip(whole.frame, whole.radiance, strict=True))
    for start, stop in ((0, 1), (1, 14), (14, 47), (47, 60)):
        part = disk.radiance(start, stop)
        assert part.frame[0] <= start and part.frame[-1] >= stop
        for frame, radiance in zip(part.frame, part.radiance, strict=True):
            np.testing.assert_array_equal(radiance, light[frame])


def test_radiance_is_linear_float32_within_the_light(disk: RotatingDisk, texture: np.ndarray) -> None:
    dim = RotatingDisk(light=(0.0, 0.25), texture=texture, background=BACKGROUND / 4, centre=disk.centre)
    bright, quarter = disk.radiance(8, 9).radiance, dim.radiance(8, 9).radiance
    assert bright.dtype == np.float32 and bright.min() >= 0 and bright.max() <= 1 + 1e-6
    np.testing.assert_allclose(quarter, bright / 4, atol=1e-6)


@pytest.mark.parametrize("gaze", [None, Gaze((3.0, -2.0), (-9.0, 7.5), (100.0, 140.0))])
def test_flow_carries_frame_t_onto_frame_t_plus_40(texture: np.ndarray, gaze: Gaze | None) -> None:
    """Follow every pixel of frame 140 back along the flow (midpoint rule, 4-frame steps) into frame 100."""
    disk = RotatingDisk(light=(0.0, 1.0), texture=cv2.GaussianBlur(texture, (0, 0), 12), drift_px_s=(2000.0, -3000.0))
    x, y = (a.astype(np.float32) for a in np.meshgrid(np.arange(disk.shape[1]), np.arange(disk.shape[0])))
    for frame in range(140, 100, -4):
        here = sample(disk.truth(frame, gaze).flow, x, y)
        half = sample(disk.truth(frame - 2, gaze).flow, x - 2 * here[..., 0], y - 2 * here[..., 1])
        x, y = x - 4 * half[..., 0], y - 4 * half[..., 1]
    first, last = disk.truth(100, gaze), disk.truth(140, gaze)
    inside = cv2.erode(last.object_id.astype(np.uint8), np.ones((9, 9))) > 0
    moved = rms((last.radiance - sample(first.radiance, x, y))[inside])
    still = rms((last.radiance - first.radiance)[inside])
    print(f"rms inside the disk: warped {100 * moved:.2f} %, unwarped {100 * still:.1f} %")
    assert moved < 0.02 < still


def test_gaze_moves_the_picture_the_other_way() -> None:
    disk = RotatingDisk(shape=(60, 90), radius=15)
    before, after = disk.truth(5), disk.truth(5, Gaze.fixed(7.0, -4.0))
    np.testing.assert_allclose(after.radiance[4:, :-7], before.radiance[:-4, 7:], atol=2e-3)
    assert after.poses["disk"][:2] == pytest.approx((44.5 - 7, 29.5 + 4))
    assert after.poses["camera"] == (7.0, -4.0)
    assert disk.places(5, Gaze.fixed(7.0, -4.0)) == {"disk": after.poses["disk"][:2]}


@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.3, -0.6), (-7.0, 3.0), (123.7, -57.25)])
@pytest.mark.parametrize("tile_shape", [(1, 1), (3, 5), (64, 40)])
def test_background_repeats_and_is_linear_between_texels(
    tile_shape: tuple[int, int], offset: tuple[float, float]
) -> None:
    tile = np.random.default_rng(0).random(tile_shape).astype(np.float32)
    seen = RotatingDisk(shape=(20, 30), radius=1, centre=(-900.0, 0.0), background=tile).truth(0, Gaze.fixed(*offset))
    rows, columns = np.arange(20) + offset[1], np.arange(30) + offset[0]
    expected = np.zeros((20, 30))
    for dr in (0, 1):
        for dc in (0, 1):
            r, c = np.floor(rows) + dr, np.floor(columns) + dc
            weight = np.outer(1 - np.abs(rows - r), 1 - np.abs(columns - c))
            picked = tile[np.ix_(r.astype(int) % tile_shape[0], c.astype(int) % tile_shape[1])]
            expected += weight * picked
    np.testing.assert_allclose(seen.radiance, expected, atol=2e-6)


def test_gaze_keys_start_and_end_with_the_block() -> None:
    disk = RotatingDisk(shape=(60, 90))
    keys = disk.radiance(41, 83, Gaze((0.0, 0.0), (8.0, 3.0), (41, 83)))
    assert keys.frame[0] == 41 and keys.frame[-1] == 83
    assert np.diff(keys.frame).max() * (disk.rim_speed + np.hypot(8, 3) / 42) <= 0.6


def test_disk_out_of_view_leaves_the_background() -> None:
    gone = RotatingDisk(shape=(20, 30), centre=(500.0, -300.0), background=0.1).truth(3)
    np.testing.assert_array_equal(gone.radiance, np.float32(0.1))
    assert not gone.object_id.any() and not gone.flow.any()


@pytest.mark.parametrize("centre", [(15.0, 10.0), (15.5, 10.0), (-3.0, 24.0), (31.0, -4.0)])
@pytest.mark.parametrize("radius", [1.0, 4.0, 40.0])
def test_only_pixels_within_the_rim_are_painted(centre: tuple[float, float], radius: float) -> None:
    disk = RotatingDisk(
        (20, 30), radius=radius, centre=centre, background=0.0, light=(0.0, 1.0), texture=np.ones((2, 2))
    )
    row, column = np.indices(disk.shape)
    cover = np.clip(radius + 0.5 - np.hypot(column - centre[0], row - centre[1]), 0, 1)
    np.testing.assert_allclose(disk.truth(0).radiance, cover, atol=1e-5)


def test_same_seed_same_scene() -> None:
    first, again, other = (RotatingDisk(shape=(40, 50), seed=s).truth(0).radiance for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_brighter_disk_is_the_same_in_more_light() -> None:
    disk = RotatingDisk(shape=(40, 50))
    for frame, gaze in ((0, None), (7, Gaze.fixed(3.5, -2.0))):
        once, twice = (scene.truth(frame, gaze).radiance for scene in (disk, disk.lit(2.0)))
        np.testing.assert_allclose(twice, 2 * once, rtol=1e-6)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"rpm": np.nan}, "rpm = nan"),
        ({"radius": 0.2}, "radius = 0.2"),
        ({"light": (0.5, 0.4)}, r"light\[1\] = 0.4"),
        ({"light": (-0.1, 0.4)}, r"light\[0\] = -0.1"),
        ({"shape": (0, 5)}, "shape ="),
        ({"texture": np.zeros((4, 5))}, "square"),
        ({"texture": np.full((4, 4), 2.0)}, r"lie in \[0, 1\]"),
        ({"background": -1.0}, "background must be"),
        ({"frame_rate_hz": 0.0}, "frame_rate_hz = 0.0"),
    ],
)
def test_bad_options_are_named(option: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        RotatingDisk(**{"shape": (16, 16), **option})


def sample(image: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return cv2.remap(image, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR)


@pytest.mark.parametrize("centre", [(-20.0, 50.0), (60.5, 16.0), (20.0, -31.0), (23.0, 20.0)])
def test_a_disk_beyond_the_border_is_seen_as_in_a_larger_picture(centre: tuple[float, float]) -> None:
    """On rows that are no multiple of those painted at a time; places of texels are float32, so not to the bit."""
    beyond, texture = 64, np.random.default_rng(0).random((64, 64), np.float32)
    wide = (centre[0] + beyond, centre[1] + beyond)
    given = {"radius": 40.0, "texture": texture, "background": 0.3}
    seen = RotatingDisk((33, 47), centre=centre, **given).radiance(3, 7).radiance
    larger = RotatingDisk((33 + 2 * beyond, 47 + 2 * beyond), centre=wide, **given).radiance(3, 7).radiance
    np.testing.assert_allclose(seen, larger[:, beyond : beyond + 33, beyond : beyond + 47], atol=1e-4)
