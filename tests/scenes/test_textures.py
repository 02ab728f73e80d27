from __future__ import annotations

import numpy as np
import pytest

from scenes.textures import TEXTURES, random_texture
from spikecam_env.errors import InputError


@pytest.mark.parametrize("kind", TEXTURES)
@pytest.mark.parametrize("size", [32, 200, 512])
def test_texture_is_in_range_with_contrast_and_repeats_with_its_seed(kind: str, size: int) -> None:
    first, again, other = (random_texture(np.random.default_rng(s), size, [kind]) for s in (5, 5, 6))
    assert first.shape == (size, size) and first.dtype == np.float32
    assert first.min() >= 0 and first.max() <= 1 and first.std() > 0.02
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("kind", [kind for kind in TEXTURES if kind != "glyphs"])
def test_texture_tiles_without_a_seam(kind: str) -> None:
    """The step across the border is no larger than steps inside (median of 20 seeds)."""
    ratios = []
    for seed in range(20):
        texture = random_texture(np.random.default_rng(seed), 128, [kind])
        inside = np.abs(np.diff(texture, axis=1)).mean() + 1e-4
        ratios.append(np.abs(texture[:, 0] - texture[:, -1]).mean() / inside)
    print(kind, f"median border/inside step {np.median(ratios):.2f}")
    assert np.median(ratios) < 1.6


def test_bad_kinds_and_sizes_are_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="choose one of"):
        random_texture(rng, 64, ["plaid"])
    with pytest.raises(InputError, match="at least 8"):
        random_texture(rng, 4)
