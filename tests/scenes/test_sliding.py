from __future__ import annotations

import numpy as np
import pytest

from scenes import Gaze, Scene, SlidingTexture
from scenes.derived.flow import check_flow
from scenes.textures import glyphs
from spikecam_env.errors import InputError

PAGE = glyphs(np.random.default_rng(1), 128)
UNEVEN = np.random.default_rng(0).random((37, 64)).astype(np.float32)


def supersampled(scene: SlidingTexture, texture: np.ndarray, texel_px: float, frame: float, n: int = 16) -> np.ndarray:
    """Means of n x n samples a pixel of the texture's squares."""
    (rows, columns), (x, y) = scene.shape, scene.corner_at(frame)
    down = np.floor(((np.arange(rows * n) + 0.5) / n - 0.5 - y) / texel_px).astype(int) % texture.shape[0]
    right = np.floor(((np.arange(columns * n) + 0.5) / n - 0.5 - x) / texel_px).astype(int) % texture.shape[1]
    return texture[down][:, right].reshape(rows, n, columns, n).mean(axis=(1, 3))


@pytest.mark.parametrize("frame", [0, 1, 7.3, 1001, 4_000_000])
@pytest.mark.parametrize(("texture", "texel_px"), [(PAGE, 0.5), (PAGE, 1.0), (UNEVEN, 2.25)])
def test_picture_is_the_area_average_to_1_5_percent(texture: np.ndarray, texel_px: float, frame: float) -> None:
    """1.4 % where letters of two pixels lie half-way between two samples."""
    scene = SlidingTexture((60, 90), (20_000.0, -7777.0), texture, texel_px, light=(0.0, 1.0))
    error = scene.truth(frame).radiance - supersampled(scene, texture, texel_px, frame)
    rms = float(np.sqrt(np.mean(np.square(error))))
    print(f"{100 * rms:.2f} % rms of full scale")
    assert rms < 0.015


@pytest.mark.parametrize("gaze", [None, Gaze((3.0, -2.0), (9.0, -7.5), (100.0, 140.0))])
def test_flow_carries_frame_t_onto_frame_t_plus_40(gaze: Gaze | None) -> None:
    check = check_flow(SlidingTexture((60, 90), (9000.0, -3100.0)), gaze=gaze)
    print(check)
    assert check.error < 0.02 < check.unmoved and check.compared > 0.6


def test_a_wrong_flow_is_found() -> None:
    class Wrong(SlidingTexture):
        def velocity(self, gaze: Gaze | None = None) -> tuple[float, float]:
            x, y = super().velocity(gaze)
            return 1.05 * x, y

    check = check_flow(Wrong((60, 90), (9000.0, -3100.0)))
    print(check)
    assert min(check.error, check.shade_aside) > 0.02


def test_texture_repeats_and_gaze_moves_the_picture_the_other_way() -> None:
    scene = SlidingTexture((20, 30), (40_000.0, 0.0), PAGE, texel_px=0.25)
    now = scene.truth(0).radiance
    np.testing.assert_allclose(scene.truth(32).radiance, now, atol=1e-6)
    np.testing.assert_allclose(scene.truth(0, Gaze.fixed(4.0, 0.0)).radiance[:, :-4], now[:, 4:], atol=1e-6)


def test_keys_lie_on_a_grid_of_0_6_pixels() -> None:
    scene = SlidingTexture((20, 30), (8000.0, 0.0))
    assert isinstance(scene, Scene)
    whole = scene.radiance(0, 60)
    assert (np.diff(whole.frame) == 3).all()
    part = scene.radiance(31, 44)
    assert part.frame[0] == 30 and part.frame[-1] == 45
    np.testing.assert_array_equal(part.radiance, whole.radiance[10:16])


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"shape": (0, 5)}, "shape ="),
        ({"velocity_px_s": (np.nan, 0.0)}, r"velocity_px_s\[0\] ="),
        ({"texture": np.full((4, 4), 2.0)}, r"values in \[0, 1\]"),
        ({"texel_px": 0.0}, "texel_px = 0"),
        ({"light": (0.5, 0.4)}, "light is"),
        ({"frame_rate_hz": -1.0}, "frame_rate_hz = -1"),
    ],
)
def test_bad_options_are_named(option: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        SlidingTexture(**{"shape": (16, 16), **option})
