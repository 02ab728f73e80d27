"""Collage: light and truth agree, whatever the order and cut of the calls."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import scipy

from scenes.flat.collage import MOTION_PER_KEY, Collage
from scenes.flat.painted_disk import Texels
from scenes.keys import LONGEST_INTERVAL
from scenes.protocol import Gaze
from spikecam_env.errors import InputError

SHAPE = (48, 64)


def test_same_seed_same_light_and_another_seed_another():
    first, again, other = (Collage(SHAPE, seed).radiance(0, 8).radiance for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_keys_do_not_depend_on_how_the_stream_is_cut():
    scene = Collage(SHAPE, 3, speed=0.4)
    whole = scene.radiance(0, 200)
    for start, stop in ((0, 3), (57, 101), (199, 200)):
        piece = scene.radiance(start, stop)
        assert piece.frame[0] <= start and piece.frame[-1] >= stop
        for frame, picture in zip(piece.frame, piece.radiance, strict=True):
            if frame <= 200:
                assert np.array_equal(picture, whole.radiance[list(whole.frame).index(frame)])


def exact(scene: Collage, frame: float, n: int = 1) -> np.ndarray:
    """The law of `painted_disk.py` for shapes with masks, in float64, on an average of n x n samples a pixel."""
    fine = (np.arange(n) + 0.5) / n - 0.5
    rows, columns = ((np.arange(size)[:, None] + fine).ravel() for size in scene.shape)
    light = np.zeros((len(rows), len(columns)))
    for layer in scene.plane_at(np.array([frame]), Gaze.fixed(0.0, 0.0)).discs:
        middle, zoom, _ = layer.grid
        dx, dy = columns - layer.x, rows[:, None] - layer.y
        u = middle + zoom * (np.cos(layer.angle) * dx - np.sin(layer.angle) * dy)
        v = middle + zoom * (np.sin(layer.angle) * dx + np.cos(layer.angle) * dy)
        cover = 1.0 if layer.mask is None else bilinear(layer.mask, u, v)
        light = bilinear(layer.texels, u, v) + (1 - cover) * light
    return light.reshape(scene.shape[0], n, scene.shape[1], n).mean(axis=(1, 3))


def bilinear(texels: Texels, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Texels between their squares; beside them is nothing, or the next period."""
    side = texels.period or texels.side
    picture = texels.low + float(texels.step) * (texels.pairs & 0xFFFF).reshape(texels.side, -1)[:side, :side]
    mode = "grid-wrap" if texels.period else "nearest"
    return scipy.ndimage.map_coordinates(picture, [v, u], order=1, mode=mode)


@pytest.mark.parametrize("seed", range(4))
def test_light_is_bilinear_between_texels(seed):
    """To 2e-6 of the brightest light: texels are 16 bits, weights float32."""
    scene = Collage(SHAPE, seed, speed=1.0, light=1.0)
    seen = scene.truth(12.25).radiance
    rms = float(np.sqrt(np.mean((seen - exact(scene, 12.25)) ** 2)))
    from_area = float(np.sqrt(np.mean((seen - exact(scene, 12.25, 16)) ** 2)))
    print(f"{rms:.1e} rms off the law, {from_area:.4f} off the average of 16 x 16 samples a pixel")
    assert rms < 2e-6


def test_keys_are_the_truth():
    scene = Collage(SHAPE, 4, speed=1.0)
    keys = scene.radiance(64, 72)
    assert np.array_equal(keys.radiance[2], scene.truth(keys.frame[2]).radiance)


@pytest.mark.parametrize("speed", [0.0, 0.1, 2.0])
def test_motion_between_keys_is_bounded(speed):
    scene = Collage(SHAPE, 5, speed=speed)
    assert scene.key_every <= LONGEST_INTERVAL
    fastest = np.linalg.norm(scene.truth(10.0).flow, axis=-1).max()
    print(f"fastest pixel {fastest:.3f}, keys every {scene.key_every}")
    assert scene.key_every == 1 or scene.key_every * fastest <= MOTION_PER_KEY


def test_a_scene_of_speed_zero_stands_still():
    light = Collage(SHAPE, 6, speed=0.0).radiance(0, 300).radiance
    assert np.array_equal(light[0], light[-1])


def test_light_stays_between_its_bounds():
    for seed in range(4):
        light = Collage(SHAPE, seed, light=0.5, contrast=10.0).radiance(0, 32).radiance
        assert light.min() >= 0.05 * 0.99 and light.max() <= 0.5 * 1.001


def test_flow_carries_the_picture():
    """Light moved back along the flow for four frames is the light of now, but at uncovered places."""
    scene = Collage((96, 96), 7, speed=0.8)
    now, later = scene.truth(40.0), scene.truth(44.0)
    y, x = np.indices((96, 96), dtype=np.float32)
    moved = cv2.remap(later.radiance, x + 4 * now.flow[..., 0], y + 4 * now.flow[..., 1], cv2.INTER_LINEAR)
    inner = (slice(8, -8), slice(8, -8))
    along = np.median(abs(moved - now.radiance)[inner])
    still = np.median(abs(later.radiance - now.radiance)[inner])
    print(f"median change along the flow {along:.5f}, in place {still:.5f}")
    assert along < 0.35 * still


def test_a_fixed_gaze_shifts_the_picture():
    scene = Collage((96, 96), 8, layers=0)
    here, there = scene.truth(5.0).radiance, scene.truth(5.0, Gaze.fixed(3.0, 2.0)).radiance
    assert np.allclose(there[:-2, :-3], here[2:, 3:], atol=0.02)


def test_gaze_motion_is_in_the_flow():
    scene = Collage(SHAPE, 9)
    gaze = Gaze((0.0, 0.0), (10.0, -5.0), (0.0, 10.0))
    difference = scene.truth(5.0, gaze).flow[0, 0] - scene.truth(5.0, Gaze.fixed(5.0, -2.5)).flow[0, 0]
    assert np.allclose(difference, (-1.0, 0.5), atol=1e-5)


@pytest.mark.parametrize("bad", [{"speed": -1.0}, {"light": 0.0}, {"contrast": 0.5}, {"textures": [np.eye(4, 5)]}])
def test_bad_options_are_named(bad):
    with pytest.raises(InputError, match=next(iter(bad))):
        Collage(SHAPE, 0, **bad)


def test_a_stop_before_the_start_is_refused():
    with pytest.raises(InputError, match="frames run from 5 to 4"):
        Collage(SHAPE, 0).radiance(5, 4)
