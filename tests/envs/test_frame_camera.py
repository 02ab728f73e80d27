"""Frame cameras: exact light, noise by EMVA 1288, rolling shutters, and the same bits for every cut of a stream."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest

from spikecam_env.envs.observations import (
    HIGH_SPEED,
    Blocks,
    CameraView,
    FrameCamera,
    FrameSensor,
    observation,
)
from spikecam_env.envs.registration import register
from spikecam_env.errors import InputError
from spikecam_env.sensor import Keyframes

register()
DISK = "spikecam_env/RotatingDisk-v0"
AT_REST: dict[str, Any] = {"shape": (16, 16), "frames_per_step": 8, "rpm": 0.0, "drift_px_s": 0.0}
EXACT: dict[str, Any] = {"noise": False, "sensor": FrameSensor(bits=16)}
"""Of a camera whose picture has no error but its eight bits."""
RATE = 40_000
SIGMAS = 5
"""Standard errors that a figure may be off: one test in two million then fails by chance."""


def shown(
    law: FrameCamera, light: Any, frames: int, cut: int, shape: tuple[int, int] = (5, 7), seed: int = 0
) -> list[tuple[np.ndarray, float, float]]:
    """(picture, age, bits) after every `cut` frames of one stream."""
    state, seen = law.start(CameraView(shape, cut), 1), []
    for _ in range(frames // cut):
        blocks = Blocks(np.zeros((1, cut, *shape), np.uint8), [light], RATE, (seed,))
        picture, state = law.step(blocks, state)
        seen.append((picture[0, 0], float(law.age(state)[0]), law.info(blocks, state)[0]["camera_bits"]))
    return seen


def rising(frames: int, shape: tuple[int, int] = (5, 7)) -> Keyframes:
    """Light from 0 to 1."""
    return Keyframes(np.array([0.0, frames]), np.broadcast_to(np.array([[[0.0]], [[1.0]]], np.float32), (2, *shape)))


def test_a_picture_is_the_mean_light_of_the_last_whole_exposure() -> None:
    """2000 Hz is a period of 20 frames; light rises by 1/80 a frame: means at frames 10, 30, 50."""
    seen = shown(FrameCamera(2000.0, **EXACT), rising(80), 64, 8)
    means = [0, 0, *[255 * 10 / 80] * 2, *[255 * 30 / 80] * 3, 255 * 50 / 80]
    assert all(picture.min() == picture.max() for picture, *_ in seen)
    np.testing.assert_allclose([picture[0, 0] for picture, *_ in seen], means, atol=0.51)
    assert [age for _, age, _ in seen] == [-1, -1, 4, 12, 0, 8, 16, 4]


def test_a_short_exposure_is_sharp_and_early() -> None:
    """0.1 ms are 4 frames: the exposures' middles are at frames 2 and 22."""
    seen = shown(FrameCamera(2000.0, exposure_s=1e-4, **EXACT), rising(80), 24, 8)
    np.testing.assert_allclose([p[0, 0] for p, *_ in seen], [255 * 2 / 80, 255 * 2 / 80, 255 * 22 / 80], atol=0.51)


@pytest.mark.parametrize("row_time_s", [0.0, 2e-3])
def test_exposures_are_complete_at_rates_that_divide_no_block(row_time_s: float) -> None:
    """30 Hz over ten seconds of the same light: 300 whole frames, but for one that a rolling shutter has not read."""
    law = FrameCamera(30.0, row_time_s=row_time_s, **EXACT)
    seen = shown(law, np.full((5, 7), 0.4), 400_000, 40)
    frames = sum(bits for *_, bits in seen) / (16 * 5 * 7)
    print(f"{frames:g} frames")
    assert frames == (299 if row_time_s else 300)
    assert {int(grey) for picture, age, _ in seen if age >= 0 for grey in picture.flat} == {102}


def test_the_camera_sees_the_light_of_the_environment() -> None:
    """A scene at rest: the mean over the exposure is the true light."""
    env = gymnasium.make(DISK, **AT_REST, obs=FrameCamera(5000.0, **EXACT), ground_truth=True, obs_state=True)
    seen, info = env.reset(seed=0)
    assert seen["age"] == 0 and info["age"] == 0
    np.testing.assert_allclose(seen["picture"][0], 255 * info["radiance"], atol=0.51)


def test_without_noise_and_with_eight_bits_a_picture_is_the_light_over_white() -> None:
    light = np.random.default_rng(0).random((40, 50))
    for white in (1.0, 0.2):
        law = FrameCamera(1000.0, white=white, noise=False, sensor=FrameSensor(bits=8))
        ((picture, *_),) = shown(law, light, 40, 40, light.shape)
        np.testing.assert_allclose(picture, 255 * np.minimum(light / white, 1), atol=0.501)


@pytest.mark.parametrize("sensor", [FrameSensor(), HIGH_SPEED, FrameSensor(read_noise=30.0, dark_current=4e5)], ids=str)
@pytest.mark.parametrize("white", [1e-3, 0.02])
@pytest.mark.parametrize("share", [0.15, 0.5, 0.8])
def test_variance_over_mean_is_that_of_photon_transfer(sensor: FrameSensor, white: float, share: float) -> None:
    """EMVA 1288: variance = K mean + K^2 (dark + read noise^2) + 1/12, at 1 ms.  White is 2000 electrons in the one
    light and, by a filter, the full well in the other.  The converter's steps are so fine that the eight bits' count
    alone: four of ten bits are a grey level, but one in 85 has five, so the slope of a picture is no number."""
    of_white, shape = min(sensor.spike_electrons * white * 40, sensor.full_well), (300, 300)
    gain, dark = 255 / of_white, sensor.dark_current * 1e-3
    law = FrameCamera(1000.0, white=white, sensor=replace(sensor, bits=16))
    ((picture, *_),) = shown(law, np.full(shape, share * white), 40, 40, shape)
    mean, variance = 255 * share, gain * 255 * share + gain**2 * (dark + sensor.read_noise**2) + 1 / 12
    print(f"mean {picture.mean():.3f} of {mean:.3f}, variance {picture.var():.3f} of {variance:.3f}")
    assert abs(picture.mean() - mean) < SIGMAS * np.sqrt(variance / picture.size)
    assert abs(picture.var() / variance - 1) < SIGMAS * np.sqrt(2 / picture.size)


def test_noise_of_two_frames_is_independent() -> None:
    shape = (200, 200)
    first, second = (seen[0].astype(float) for seen in shown(FrameCamera(1000.0), np.full(shape, 0.5), 80, 40, shape))
    correlation = float(np.corrcoef(first.ravel(), second.ravel())[0, 1])
    print(f"correlation {correlation:.4f}")
    assert abs(correlation) < SIGMAS / np.sqrt(first.size)


def test_in_the_dark_a_camera_has_a_gain_of_its_own() -> None:
    """At a spike every 2000 frames a picture of white 1 is black; by gain it is as bright as one in bright light."""
    means = {}
    for white in (1.0, 1e-3):
        ((picture, *_),) = shown(FrameCamera(1000.0, white=white), np.full((64, 64), 5e-4), 40, 40, (64, 64))
        means[white] = float(picture.mean())
    print(means)
    assert means[1.0] < 1 and means[1e-3] == pytest.approx(127.5, abs=1)


def test_the_dark_current_of_the_spike_camera_would_fill_the_well_in_a_frame_of_30_hz() -> None:
    """0.4442 pA are 2.8 million electrons a second."""
    leaky = FrameSensor(dark_current=0.4442e-12 / 1.602e-19)
    ((black, *_),) = shown(FrameCamera(30.0, sensor=leaky), np.full((5, 7), 0.5), 1334, 1334)
    ((grey, *_),) = shown(FrameCamera(30.0), np.full((5, 7), 0.5), 1334, 1334)
    assert black.max() == 0 and grey.min() > 100


def test_a_rolling_shutter_skews_a_moving_edge_by_row_time_times_speed() -> None:
    """An edge that moves right by 0.3 columns a frame; each row begins two frames after the one above."""
    speed, row, rows, columns = 0.3, 2.0, 6, 40
    keys = np.arange(61.0)
    edge = np.clip(5 + speed * keys[:, None] - np.arange(columns), 0, 1).astype(np.float32)
    light = Keyframes(keys, np.repeat(edge[:, None], rows, axis=1))
    for row_time_s, skew in ((row / RATE, speed * row), (0.0, 0.0)):
        law = FrameCamera(2000.0, exposure_s=4 / RATE, row_time_s=row_time_s, **EXACT)
        pictures = [picture for picture, *_ in shown(law, light, 60, 20, (rows, columns))]
        for number, picture in enumerate(pictures):
            at = picture.sum(axis=1) / 255
            print(number, at.round(3))
            expected = 5 + speed * (20 * number + 2) + skew * np.arange(rows)
            np.testing.assert_allclose(at, expected, atol=4 * 0.5 / 255, err_msg="three or four columns are grey")


def test_a_rolling_frame_is_out_when_its_last_row_is() -> None:
    """Five rows, three frames apart, of four frames each: frame j ends 16 frames after it begins."""
    seen = shown(FrameCamera(2000.0, exposure_s=4 / RATE, row_time_s=3 / RATE), np.full((5, 7), 0.5), 40, 8)
    assert [age for _, age, _ in seen] == [-1, 0, 8, 16, 4]
    assert [bits for *_, bits in seen] == [0, 350, 0, 0, 350]


@pytest.mark.parametrize(
    "options", [{}, {"row_time_s": 4 / RATE}, {"row_time_s": 5 / RATE, "exposure_s": 11.3 / RATE}], ids=str
)
def test_what_is_seen_does_not_depend_on_the_cut(options: dict[str, Any]) -> None:
    """With noise, and frames that overlap: all rows of a frame are exposed for the whole period."""
    rng = np.random.default_rng(1)
    light = Keyframes(np.linspace(0.0, 240.0, 37), rng.random((37, 5, 7)).astype(np.float32))
    law = FrameCamera(1730.0, **options)
    whole = dict(zip(range(1, 241), shown(law, light, 240, 1), strict=True))
    assert len({picture.tobytes() for picture, *_ in whole.values()}) >= 10
    for cut in (3, 40, 240):
        for number, (picture, age, _) in enumerate(shown(law, light, 240, cut), start=1):
            np.testing.assert_array_equal(picture, whole[cut * number][0])
            assert age == whole[cut * number][1]


def test_a_seed_repeats_the_noise_of_an_episode() -> None:
    env = gymnasium.make(DISK, **AT_REST, obs=FrameCamera(5000.0))

    def episode(seed: int) -> np.ndarray:
        return np.stack([env.reset(seed=seed)[0], *(env.step(np.zeros(2, np.float32))[0] for _ in range(3))])

    first, again = episode(1), episode(1)
    np.testing.assert_array_equal(first, again)
    assert (first[0] != first[1]).any(), "a scene at rest: frames differ by noise alone"
    light = np.full((8, 8), 0.5)
    (one, *_), (other, *_) = (shown(FrameCamera(1000.0), light, 40, 40, (8, 8), seed=seed)[0] for seed in (1, 2))
    assert (one != other).any()


@pytest.mark.parametrize("name", ["frame30", "frame120", "frame1000"])
def test_a_root_picture_is_the_root_of_the_same_numbers(name: str) -> None:
    light = np.random.default_rng(0).random((20, 30)) ** 4
    ((plain, *_),) = shown(observation(name), light, 1400, 1400, light.shape)  # type: ignore[arg-type]
    ((root, *_),) = shown(observation(f"root_{name}"), light, 1400, 1400, light.shape)  # type: ignore[arg-type]
    np.testing.assert_allclose(255 * (root / 255.0) ** 2, plain, atol=1.5)
    assert len(np.unique(root[plain < 25])) > len(np.unique(plain[plain < 25]))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: FrameCamera(0.0), "rate_hz = 0"),
        (lambda: FrameCamera(30.0, exposure_s=0.1), r"exposure_s = 0\.1"),
        (lambda: FrameCamera(30.0, white=0.0), "white = 0"),
        (lambda: FrameCamera(30.0, gamma=1.5), r"gamma = 1\.5"),
        (lambda: FrameCamera(30.0, row_time_s=-1e-6), "row_time_s = -1e-06"),
        (lambda: FrameCamera(30.0, noise="no"), "noise = 'no'"),  # type: ignore[arg-type]
        (lambda: FrameCamera(30.0, sensor="sony"), "sensor is 'sony'; give a FrameSensor"),  # type: ignore[arg-type]
        (lambda: FrameSensor(read_noise=-1.0), r"frame_sensor\.read_noise = -1"),
        (lambda: FrameSensor(bits=17), r"frame_sensor\.bits = 17"),
        (lambda: FrameSensor(bits=9.5), r"frame_sensor\.bits = 9\.5.*whole number"),  # type: ignore[arg-type]
        (
            lambda: gymnasium.make(DISK, shape=(64, 64), obs=FrameCamera(1000.0, row_time_s=2e-5)),
            r"row_time_s = 2e-05; the last of 64 rows begins 0\.00126 s after the first.*period is 0\.001 s: lower",
        ),
        (
            lambda: FrameCamera(30.0).step(
                Blocks(np.zeros((1, 8, 5, 7), np.uint8)), FrameCamera(30.0).start(CameraView((5, 7), 8), 1)
            ),
            "needs the light",
        ),
    ],
)
def test_wrong_use_is_named_in_a_line(call: Any, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)
