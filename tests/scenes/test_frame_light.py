"""Light from a simulator's pictures: blended in time, or carried along their motion."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from scenes import FrameLight, RotatingDisk
from scenes.film.transfer import linear_from_srgb
from spikecam_env.errors import InputError, NotReadyError
from spikecam_env.sensor import Keyframes, SpikeSensor

SHAPE = (32, 48)
STEP_S = 0.001
"""40 frames of the camera."""
MOVED = 8.0
"""Of the near square in a step [pixels]: whole pixels at every fifth frame, where carried light is exact."""


def texture(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).random(SHAPE, np.float32)


def two_squares(share: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Light, motion to the next picture and depth: a near square goes right, a far one left, a wall is still."""
    light, motion, depth = texture(0), np.zeros((*SHAPE, 2), np.float32), np.full(SHAPE, 9.0, np.float32)
    for seed, row, column, speed, away in ((1, 8, 26, -MOVED, 5.0), (2, 12, 10, MOVED, 2.0)):
        left = column + round(speed * share)
        place = np.s_[row : row + 10, left : left + 12]
        light[place] = texture(seed)[row : row + 10, column : column + 12]
        motion[place], depth[place] = (speed, 0.0), away
    return light, motion, depth


def carried(motion_is: Any = "to_next", with_motion: bool = True, with_depth: bool = True) -> Keyframes:
    """Light between the second and the third picture of the squares."""
    light = FrameLight(SHAPE, transfer="linear", scale=1.0, motion_is=motion_is, motion_per_key=1.0)
    for share in (-1.0, 0.0, 1.0):
        picture, motion, depth = two_squares(share)
        motion *= 1 / STEP_S if motion_is == "per_second" else 1.0
        keys = light.add(share * STEP_S, picture, motion if with_motion else None, depth if with_depth else None)
    return Keyframes(keys.frame - 40, keys.radiance)


def beside_an_outline(depth: np.ndarray) -> np.ndarray:
    """Pixels next to a nearer surface, which count as its outline."""
    rows, columns = depth.shape
    edged = np.pad(depth, 1, mode="edge")
    around = [edged[v : v + rows, u : u + columns] for v in range(3) for u in range(3)]
    return np.asarray(np.min(around, axis=0) < depth)


def rms(difference: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(difference, dtype=np.float64))))


def test_spikes_of_a_still_picture_come_at_the_scale() -> None:
    """White at 0.2 spikes a frame: 1000 frames hold 200 spikes, and one more or less by the starting phase."""
    light, sensor = FrameLight((4, 6), scale=0.2), SpikeSensor("ideal", (4, 6), seed=0)
    spikes = np.zeros((4, 6), int)
    for step in range(26):
        keys = light.add(step * STEP_S, np.full((4, 6, 3), 255, np.uint8))
        if light.frame > sensor.frame:
            spikes += sensor.step(keys, light.frame - sensor.frame).sum(axis=0, dtype=int)
    assert sensor.frame == 1000
    assert np.abs(spikes - 200).max() <= 1


def test_light_is_linear_in_time_where_motion_is_unknown() -> None:
    first, second = texture(0), texture(1)
    light = FrameLight(SHAPE, transfer="linear", scale=0.5)
    keys = light.add(0.0, first)
    assert keys.frame.tolist() == [0] and light.frame == 0
    keys = light.add(STEP_S, second)
    assert keys.frame.tolist() == [0, 40] and light.frame == 40
    np.testing.assert_allclose(keys.at(10), 0.5 * (0.75 * first + 0.25 * second), rtol=1e-5)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32, np.float64])
def test_values_of_every_type_are_the_same_srgb_light(kind: type) -> None:
    full = 1.0 if np.issubdtype(kind, np.floating) else np.iinfo(kind).max
    values = np.tile(np.linspace(0, 1, 6), (4, 1))
    given = values * full if full == 1 else np.round(values * full)
    seen = FrameLight((4, 6), scale=1.0).add(0.0, given.astype(kind)).radiance[0]
    np.testing.assert_allclose(seen, linear_from_srgb(values), rtol=1e-4)


def test_a_number_is_the_power_of_the_transfer() -> None:
    seen = FrameLight((2, 2), scale=1.0, transfer=2.2).add(0.0, np.full((2, 2), 0.5)).radiance
    np.testing.assert_allclose(seen, 0.5**2.2, rtol=1e-5)


def test_pixels_of_a_finer_picture_are_averaged_as_light() -> None:
    """Two of four white: half the light, not the light of middle grey."""
    fine = np.tile(np.array([[0, 255], [255, 0]], np.uint8), (4, 6))
    np.testing.assert_allclose(FrameLight((4, 6), scale=0.6).add(0.0, fine).radiance, 0.3, rtol=1e-5)


@pytest.mark.parametrize("motion_is", ["to_next", "since_last", "per_second"])
def test_light_carried_by_whole_pixels_is_exact_in_the_order_of_depth(motion_is: str) -> None:
    """The near square covers the far one, and the wall behind both comes from the picture that shows it."""
    light, unordered, blended = (
        carried(motion_is),
        carried(motion_is, with_depth=False),
        carried(motion_is, False, False),
    )
    for frame in (5, 10, 20, 25, 35):
        truth, _, depth = two_squares(frame / 40)
        here = ~beside_an_outline(depth)
        np.testing.assert_allclose(light.at(frame)[here], truth[here], atol=1e-6)
        assert rms(unordered.at(frame)[here] - truth[here]) > 1e-3
        assert rms(blended.at(frame)[here] - truth[here]) > 0.05


def test_nothing_moves_further_than_asked_from_key_to_key() -> None:
    """8 pixels in 40 frames are 0.2 a frame, and 0.6 in three."""
    for motion_per_key, step in ((0.6, 3), (1.2, 6), (0.1, 1)):
        light = FrameLight(SHAPE, transfer="linear", motion_per_key=motion_per_key)
        for share in (0.0, 1.0):
            keys = light.add(share * STEP_S, *two_squares(share))
        assert keys.frame.tolist() == [*range(0, 40, step), 40]


def disk_pictures(disk: RotatingDisk, motion_is: str, frame: int, gap: int) -> tuple[np.ndarray, np.ndarray]:
    """Light and motion of a disk at a frame: its velocity, or its points' way by the turn itself."""
    truth = disk.truth(frame)
    if motion_is == "per_second":
        return truth.radiance, truth.flow * disk.frame_rate_hz
    sign = 1 if motion_is == "to_next" else -1
    y, x = np.indices(disk.shape) - np.array(disk.centre_at(frame))[::-1, None, None]
    turn = sign * gap * (disk.angle_at(1) - disk.angle_at(0))
    way = np.stack([x * (np.cos(turn) - 1) + y * np.sin(turn), y * (np.cos(turn) - 1) - x * np.sin(turn)], -1)
    return truth.radiance, np.where(truth.object_id[..., None] > 0, sign * way, 0.0)


def test_the_three_kinds_of_motion_carry_a_turning_disk_alike() -> None:
    """12 degrees from picture to picture; blended pictures are five times as far off, at least."""
    patches = cv2.resize(np.random.default_rng(0).random((12, 12)), (256, 256), interpolation=cv2.INTER_CUBIC)
    disk, gap = RotatingDisk((64, 64), 2000.0, light=(0.0, 1.0), texture=patches.clip(0, 1), background=0.5), 40
    frames = range(gap, 2 * gap)
    truth = [disk.truth(frame).radiance for frame in frames]
    errors: dict[str, float] = {}
    for kind in ("blended", "to_next", "since_last", "per_second"):
        motion_is: Any = "to_next" if kind == "blended" else kind
        light = FrameLight(disk.shape, transfer="linear", scale=1.0, motion_is=motion_is)
        for frame in (0, gap, 2 * gap):
            picture, motion = disk_pictures(disk, motion_is, frame, gap)
            keys = light.add(frame / disk.frame_rate_hz, picture, None if kind == "blended" else motion)
        errors[kind] = rms(np.array([keys.at(frame) for frame in frames]) - truth)
    print({kind: f"{100 * error:.2f} %" for kind, error in errors.items()})
    assert max(errors[kind] for kind in ("to_next", "since_last", "per_second")) < errors["blended"] / 5


def test_motion_since_the_last_picture_means_nothing_at_the_first() -> None:
    keys = []
    for first in (1.0, 50.0):
        light = FrameLight(SHAPE, motion_is="since_last")
        for share, times in ((0.0, first), (1.0, 1.0)):
            picture, motion, depth = two_squares(share)
            last = light.add(share * STEP_S, picture, times * motion, depth)
        keys.append(last)
    np.testing.assert_array_equal(keys[0].radiance, keys[1].radiance)


def test_pictures_between_whole_frames_have_keys_on_both_sides() -> None:
    """900 pictures a second: one in 44.4 frames."""
    light = FrameLight((2, 2), transfer="linear", scale=1.0)
    levels, frames = [0.0, 0.5, 0.1], []
    for number, level in enumerate(levels):
        keys = light.add(number / 900, np.full((2, 2), level))
        expected = np.interp(keys.frame, np.arange(3) * 40_000 / 900, levels)
        np.testing.assert_allclose(keys.radiance[:, 0, 0], expected, atol=1e-6)
        frames.append(keys.frame.tolist())
    assert frames == [[0], [0, 44], [44, 45, 88]]


def test_pictures_within_one_frame_add_no_key() -> None:
    light = FrameLight((2, 2), transfer="linear")
    light.add(0.0, np.zeros((2, 2)))
    keys = light.add(1e-5, np.ones((2, 2)))
    assert keys.frame.tolist() == [0] and light.frame == 0
    keys = light.add(1e-4, np.ones((2, 2)))
    assert keys.frame.tolist() == [0, 1, 4] and keys.radiance[1:].min() == np.float32(0.6)


def test_spikes_do_not_depend_on_when_the_sensor_is_stepped() -> None:
    light, often, once = FrameLight(SHAPE, scale=0.3), *(SpikeSensor("scsim", SHAPE, seed=1) for _ in range(2))
    given, steps = [], []
    for number in range(4):
        keys = light.add(number * STEP_S, *two_squares(number % 2))
        given.append(keys)
        if number:
            steps.append(often.step(keys, light.frame - often.frame))
    frame = np.concatenate([given[0].frame, *(keys.frame[1:] for keys in given[1:])])
    radiance = np.concatenate([given[0].radiance, *(keys.radiance[1:] for keys in given[1:])])
    np.testing.assert_array_equal(np.concatenate(steps), once.step(Keyframes(frame, radiance), 120))


def test_light_goes_on_from_a_saved_state_bit_for_bit() -> None:
    light, other = (FrameLight(SHAPE, motion_is="since_last") for _ in range(2))
    light.add(5.0, *two_squares(0.0))
    light.add(5.0 + STEP_S, *two_squares(1.0))
    other.restore(light.state())
    first, second = (each.add(5.0 + 2 * STEP_S, *two_squares(0.0)) for each in (light, other))
    np.testing.assert_array_equal(first.frame, second.frame)
    np.testing.assert_array_equal(first.radiance, second.radiance)


def test_the_first_picture_after_a_reset_is_at_the_frame_that_is_given() -> None:
    light = FrameLight((2, 2))
    light.add(3.0, np.zeros((2, 2)))
    light.reset(frame=120)
    assert light.frame == 120
    assert light.add(0.0, np.zeros((2, 2))).frame.tolist() == [120]
    assert light.add(STEP_S, np.zeros((2, 2))).frame.tolist() == [120, 160]


GOOD = np.zeros((4, 6), np.uint8)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((0.0, GOOD), "time_s = 0.0; it must be after the last picture's"),
        ((np.nan, GOOD), "finite number of seconds"),
        ((1.0, GOOD.T), r"frame has shape \(6, 4\)"),
        ((1.0, np.zeros((4, 6, 4), np.uint8)), "give the first three"),
        ((1.0, np.zeros((8, 12), np.uint8)), "one size"),
        ((1.0, GOOD.astype(int)), "frame is int64; it must be uint8"),
        ((1.0, np.full((4, 6), -0.1)), "values run from -0.1"),
        ((1.0, np.full((4, 6), np.nan)), "values run from nan"),
        ((1.0, np.full((4, 6), 1.5)), 'transfer="linear"'),
        ((1.0, GOOD, np.zeros((4, 6))), r"motion has shape \(4, 6\); it must be \(4, 6, 2\)"),
        ((1.0, GOOD, np.full((4, 6, 2), np.inf)), "motion holds NaN, or more than"),
        ((1.0, GOOD, np.zeros((4, 6, 2)), np.ones((4, 7))), r"depth has shape \(4, 7\)"),
        ((1.0, GOOD, np.zeros((4, 6, 2)), np.zeros((4, 6))), "infinity where nothing is"),
        ((1.0, GOOD, None, np.ones((4, 6))), "depth is given without motion"),
    ],
)
def test_wrong_pictures_are_refused_and_change_nothing(given: Any, said: str) -> None:
    light = FrameLight((4, 6))
    light.add(0.0, GOOD)
    before = light.state()
    with pytest.raises(InputError, match=said):
        light.add(*given)
    assert light.state() is before


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"transfer": "gama"}, "unknown transfer"),
        ({"transfer": 0}, "unknown transfer"),
        ({"scale": 0.0}, "scale"),
        ({"motion_is": "next"}, "to_next"),
        ({"channel": "alpha"}, "channel"),
        ({"motion_per_key": -1.0}, "motion_per_key"),
        ({"frame_rate_hz": 0.0}, "frame_rate_hz"),
    ],
)
def test_wrong_options_are_refused_by_name(options: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        FrameLight((4, 6), **options)


def test_states_of_another_size_or_before_the_first_picture_are_refused() -> None:
    light, other = FrameLight((4, 6)), FrameLight((6, 4))
    with pytest.raises(NotReadyError, match="call add first"):
        light.state()
    light.add(0.0, GOOD)
    with pytest.raises(InputError, match="this state is of light of"):
        other.restore(light.state())
