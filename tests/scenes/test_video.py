from __future__ import annotations

import numpy as np
import pytest

from scenes import Gaze, Scene, VideoScene


def steps(pictures: int = 4, shape: tuple[int, int] = (6, 8)) -> np.ndarray:
    """Pictures of one grey each: 0, 51, 102, 153."""
    return np.broadcast_to(51 * np.arange(pictures, dtype=np.uint8)[:, None, None], (pictures, *shape)).copy()


def test_light_is_linear_radiance_between_dark_and_bright() -> None:
    scene = VideoScene(steps(), 1000.0, light=(0.1, 0.9))
    keys = scene.radiance(0, 120)
    np.testing.assert_array_equal(keys.frame, [0, 40, 80, 120])
    expected = 0.1 + 0.8 * (np.arange(4) / 5) ** 2.2
    np.testing.assert_allclose(keys.radiance.mean(axis=(1, 2)), expected, rtol=1e-3)
    assert isinstance(scene, Scene)


def test_it_plays_forth_and_back_without_end() -> None:
    scene = VideoScene(steps(), 1000.0)
    for frame in (0, 40, 90, 119.5):
        here = scene.truth(frame).radiance
        np.testing.assert_allclose(scene.truth(240 - frame).radiance, here, rtol=1e-3)
        np.testing.assert_allclose(scene.truth(240_000 + frame).radiance, here, rtol=1e-3)


@pytest.mark.parametrize(("rate", "interval"), [(40_000.0, 1), (1000.0, 40), (30.0, 64), (90_000.0, 1)])
def test_keys_are_whole_frames_apart_whatever_the_rate(rate: float, interval: int) -> None:
    frame = VideoScene(steps(), rate).radiance(0, 300).frame
    assert (np.diff(frame) == interval).all() and frame[0] == 0 and frame[-1] >= 300


def test_a_picture_between_two_frames_has_keys_on_both_sides() -> None:
    """At 900 a second a picture comes every 44.4 frames."""
    frame = VideoScene(steps(), 900.0).radiance(0, 130).frame
    np.testing.assert_array_equal(frame, [0, 44, 45, 88, 89, 133])


def test_the_middle_of_the_film_fills_the_picture_by_area() -> None:
    film = np.zeros((2, 40, 100), np.uint8)
    film[:, :, 30:50] = 255
    seen = VideoScene(film, 1000.0, shape=(4, 4), light=(0.0, 1.0)).truth(0).radiance
    np.testing.assert_allclose(seen, np.tile([1.0, 1.0, 0.0, 0.0], (4, 1)), atol=1e-3)


def test_gaze_shifts_the_picture_and_mirrors_it_beyond_the_edge() -> None:
    film = np.tile(np.arange(8, dtype=np.uint8) * 30, (2, 6, 1))
    scene = VideoScene(film, 1000.0)
    still, turned = scene.truth(0).radiance, scene.truth(0, Gaze.fixed(2.0, 0.0)).radiance
    np.testing.assert_allclose(turned[:, :-2], still[:, 2:], rtol=1e-5)
    np.testing.assert_allclose(turned[:, -2:], still[:, :-3:-1], rtol=1e-5)


def test_truth_says_that_flow_is_unknown() -> None:
    truth = VideoScene(steps(), 1000.0).truth(5)
    assert np.isnan(truth.flow).all() and truth.flow.shape == (6, 8, 2)
    assert not truth.object_id.any() and truth.depth is None
