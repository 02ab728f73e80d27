"""A film's light along the motion found between its pictures: nearer to the truth than a fade, and never invented."""

from __future__ import annotations

import pickle

import cv2
import numpy as np
import pytest

from scenes import VideoScene

RATE_HZ, CAMERA_HZ = 100.0, 4000.0
GAP = 40
"""Frames from picture to picture."""
OPTIONS = {"light": (0.0, 1.0), "transfer": "linear", "frame_rate_hz": CAMERA_HZ}


def texture(shape: tuple[int, int], seed: int = 0, fine: float = 2.0) -> np.ndarray:
    """Smooth noise in [0, 1]."""
    rough = np.random.default_rng(seed).random(shape).astype(np.float32)
    return cv2.normalize(cv2.GaussianBlur(rough, (0, 0), fine), None, 0.05, 0.95, cv2.NORM_MINMAX)


def seen(pictures: list[np.ndarray], frame: float, interpolation: str) -> np.ndarray:
    scene = VideoScene(np.stack(pictures), RATE_HZ, interpolation=interpolation, **OPTIONS)  # type: ignore[arg-type]
    return scene.truth(frame).radiance


def errors_db(pictures: list[np.ndarray], between: np.ndarray, where: np.ndarray | None = None) -> dict[str, float]:
    """PSNR half-way between two pictures, by way of interpolation."""
    found = {}
    for way in ("linear", "motion"):
        off = np.square(seen(pictures, GAP / 2, way) - between)
        found[way] = -10 * np.log10(float((off if where is None else off[where]).mean()))
    print({way: round(db, 2) for way, db in found.items()})
    return found


@pytest.mark.parametrize("shift", [2.0, 6.0, 12.0])
def test_a_shifting_texture_is_eight_decibels_nearer_to_the_truth_than_by_fading(shift: float) -> None:
    """Shifted by sampling one texture, finer than the film, at steps of a quarter pixel; new texture enters."""
    fine = texture((4 * 64, 4 * 160), fine=8.0)
    first, middle, last = (
        np.ascontiguousarray(fine[::4, round(4 * by) :: 4][:, :120]) for by in (shift, shift / 2, 0.0)
    )
    found = errors_db([first, last], middle)
    assert found["motion"] > found["linear"] + 8


def with_body(left: int) -> tuple[np.ndarray, np.ndarray]:
    """A textured body before a textured background, and where it is."""
    picture, covered = texture((96, 128)), np.zeros((96, 128), bool)
    picture[30:66, left : left + 36] = texture((36, 36), seed=1)
    covered[30:66, left : left + 36] = True
    return picture, covered


def test_background_that_a_body_uncovers_and_covers_is_seen_where_it_is() -> None:
    (first, before), (middle, _), (last, after) = (with_body(left) for left in (30, 36, 42))
    hidden_once = errors_db([first, last], middle, before ^ after)
    assert hidden_once["motion"] > hidden_once["linear"] + 6
    whole = errors_db([first, last], middle)
    assert whole["motion"] > whole["linear"] + 8


def test_a_cut_between_two_shots_is_faded_not_warped() -> None:
    shots = [texture((64, 96), seed=seed) for seed in (0, 7)]
    for frame in (1, GAP / 4, GAP / 2, GAP - 1):
        np.testing.assert_array_equal(seen(shots, frame, "motion"), seen(shots, frame, "linear"))


@pytest.mark.parametrize("interpolation", ["motion", "linear"])
@pytest.mark.parametrize("kind", ["even", "texture"])
def test_a_constant_film_is_constant_to_the_bit(kind: str, interpolation: str) -> None:
    still = np.full((48, 64), 0.37, np.float32) if kind == "even" else texture((48, 64))
    scene = VideoScene(np.stack([still] * 3), RATE_HZ, interpolation=interpolation, **OPTIONS)  # type: ignore[arg-type]
    keys = scene.radiance(0, 200)
    np.testing.assert_array_equal(keys.radiance, np.broadcast_to(still, keys.radiance.shape))


def moving() -> VideoScene:
    pictures = [texture((48, 96))[:, 3 * n : 3 * n + 64] for n in range(5)]
    return VideoScene(np.stack(pictures), RATE_HZ, **OPTIONS)  # type: ignore[arg-type]


def test_keys_do_not_depend_on_where_a_stream_is_cut() -> None:
    whole = moving().radiance(0, 400)
    assert np.diff(whole.frame).max() < GAP / 2  # little moves from key to key
    scene = moving()
    for start, stop in ((250, 400), (0, 7), (7, 90), (90, 250)):
        part = scene.radiance(start, stop)
        inside = (whole.frame >= part.frame[0]) & (whole.frame <= part.frame[-1])
        np.testing.assert_array_equal(part.frame, whole.frame[inside])
        np.testing.assert_array_equal(part.radiance, whole.radiance[inside])


def test_a_film_with_motion_plays_forth_and_back() -> None:
    scene = moving()
    for frame in (10, 33.5, 120):
        back = 2 * scene.frames - frame
        np.testing.assert_allclose(scene.truth(back).radiance, scene.truth(frame).radiance, atol=1e-5)


def test_a_film_that_was_sent_to_another_process_or_is_brighter_moves_the_same() -> None:
    scene = moving()
    light = scene.radiance(0, 60).radiance
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(scene)).radiance(0, 60).radiance, light)
    np.testing.assert_array_equal(scene.lit(2.0).radiance(0, 60).radiance, 2 * light)


def test_pictures_too_small_to_search_are_faded() -> None:
    tiny = [texture((12, 14), seed=seed) for seed in (0, 1)]
    np.testing.assert_array_equal(seen(tiny, 13, "motion"), seen(tiny, 13, "linear"))
