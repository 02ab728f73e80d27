"""The numbers of the search for motion: windows and noise.

Counts are made up, 16 blocks of 48 x 48 pixels without noise, of levels that differ from pixel to pixel; a square of
them is off in the first blocks.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from spikecam_env.gap.baseline import motion, static_part
from spikecam_env.gap.baseline.motion import common_mode, excess, expected_variance, find_motion, of_one_level
from spikecam_env.gap.baseline.static_part import Observed, without_motion
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.settings import DiagnosisSettings

SHAPE = (48, 48)
BLOCKS = 16
SCENE = Condition("scene", "unknown", np.nan, None, 100 * BLOCKS, "fit")


def counts(levels: list[float], side: int, share: float, blocks: int = 1) -> NDArray[np.float64]:
    """(BLOCKS, H, W) of levels [spikes a block]; a square in the middle has a share more in the first blocks."""
    level = np.random.default_rng(0).choice(levels, SHAPE)
    made = np.repeat(level[None], BLOCKS, axis=0)
    made[:blocks, 16 : 16 + side, 16 : 16 + side] *= 1.0 + share
    return made


def moves(made: NDArray[np.float64]) -> bool:
    flat = made.reshape(BLOCKS, -1)
    times = SimpleNamespace(count=flat.sum(axis=0))
    seen = SimpleNamespace(blocks=flat, frames=SCENE.frames, shape=SHAPE, times=times)
    return find_motion(SCENE, seen) is not None


MANY = [15.5, 18.5, 20.5, 22.5, 25.5]
SOME = [4.5, 5.5, 6.5]
FEW = [0.625, 0.875, 1.125]

SQUARES = {4: (MANY, 0.1), 8: (SOME, 0.12), 16: (SOME, 0.07)}
"""Levels and contrast of a square that windows of its side alone find: others hold too little of it, or dilute it."""


@pytest.mark.parametrize("side", motion.SIDES)
def test_a_square_is_found_by_the_windows_of_its_side(side: int, monkeypatch: pytest.MonkeyPatch) -> None:
    levels, share = SQUARES[side]
    assert moves(counts(levels, side, share))
    monkeypatch.setattr(motion, "SIDES", tuple(s for s in motion.SIDES if s != side))
    assert not moves(counts(levels, side, share))


LASTING = {1: (MANY, 0.08), 4: (FEW, 0.17), 8: (FEW, 0.13)}
"""Levels and contrast of a square of 8 that windows as long as it lasts alone find."""


@pytest.mark.parametrize("span", motion.SPANS)
def test_a_change_is_found_by_the_windows_as_long_as_it(span: int, monkeypatch: pytest.MonkeyPatch) -> None:
    levels, share = LASTING[span]
    assert moves(counts(levels, 8, share, span))
    monkeypatch.setattr(motion, "SPANS", tuple(s for s in motion.SPANS if s != span))
    assert not moves(counts(levels, 8, share, span))


WHOLE = [2.0, 3.0, 4.0]
"""Levels of which f (1 - f) is 0: all that a count varies by is its own noise."""


def test_own_noise_separates_chance_from_motion() -> None:
    """Windows of 64 pixels that are off by 4.6 and by 6.5 deviates of a count with a variance of a tenth."""
    found = []
    for z in (4.6, 6.5):
        off = z * np.sqrt(0.1) / 8 * BLOCKS / (BLOCKS - 1)  # its own mean has a sixteenth of it
        made = counts(WHOLE, 8, 0.0)
        made[0, 16:24, 16:24] += off
        found.append(moves(made))
    assert found == [False, True]


def test_own_noise_is_that_of_ends_jittered_by_a_tenth_of_an_interval() -> None:
    """Whole numbers of spikes: sqrt(2) E|n| = 1.13 of the jitter's standard deviation."""
    rng = np.random.default_rng(0)
    phase, (first, last) = rng.random(100_000), 0.1 * rng.standard_normal((2, 100_000))
    count = np.floor(phase + 5.0 + last) - np.floor(phase + first)
    print(measured := float(np.var(count)))
    assert 0.7 * measured < float(expected_variance(np.array(5.0))) < 1.4 * measured


@pytest.mark.parametrize("levels", [MANY, [100.0 * level for level in MANY]], ids=["short", "long"])
def test_a_contrast_is_found_however_long_the_recording(levels: list[float]) -> None:
    """Of a hundred times as many spikes the deviates that a pixel counts at most are a fifth of a percent."""
    assert moves(counts(levels, 8, 0.3))


@pytest.mark.parametrize(("share", "kept"), [(0.25, False), (0.35, True)])
def test_three_tenths_of_the_pixels_have_to_be_static(
    share: float, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    moving = np.arange(SHAPE[0] * SHAPE[1]).reshape(SHAPE) >= share * SHAPE[0] * SHAPE[1]
    monkeypatch.setattr(static_part, "find_motion", lambda *_: SimpleNamespace(recording="scene", moving=moving))
    monkeypatch.setattr(static_part, "observe", lambda *_, static: static)
    recording = SimpleNamespace(packed=lambda: None)
    seen_before = Observed((recording,), (SCENE,), (SimpleNamespace(shape=SHAPE),))
    seen, _ = without_motion(seen_before, static_only=True, settings=DiagnosisSettings())
    assert [mask.mean() == pytest.approx(share, abs=1e-3) for mask in seen.observations] == [True] * kept


def scatter(level: NDArray[np.float64], noisy: NDArray[np.bool_], seed: int = 0) -> NDArray[np.float64]:
    """(P,) excess of normal deviates of two parts of the time, of standard deviation 2 where noisy, else 1."""
    deviates = np.random.default_rng(seed).standard_normal((2, *SHAPE)) * np.where(noisy, 2.0, 1.0)
    kept = np.ones(SHAPE, bool)
    return excess(deviates, kept, of_one_level(level.reshape(-1), kept))


def test_the_noise_of_a_level_is_its_own() -> None:
    """The 256 dimmest pixels scatter by 2, in a corner of 16 x 16: 4 times, but for its border."""
    noisy = np.zeros(SHAPE, bool)
    noisy[:16, :16] = True
    level = np.where(noisy, 1.0, 5.0) + 1e-3 * np.arange(noisy.size).reshape(SHAPE) / noisy.size
    found = scatter(level, noisy).reshape(SHAPE)[:16, :16]
    print(found.min(), found.max())
    assert found.min() > 3.3


def test_the_noise_of_a_level_is_known_to_eight_percent() -> None:
    level, quiet = np.arange(float(SHAPE[0] * SHAPE[1])).reshape(SHAPE), np.ones(SHAPE, bool)
    found = np.concatenate([np.unique(scatter(level, quiet, seed)) for seed in range(30)]) / 4.0
    print(spread := float(found.std()))
    assert spread < 0.08


def test_few_spikes_are_no_outliers() -> None:
    """Of 0.05 spikes in pairs: all but one pixel in forty have none, and the mean is theirs.  Of one spike, a tenth of
    the pixels have three more: they are off."""
    use = np.ones(2000, bool)
    pairs = np.where(np.arange(2000) % 40 == 0, 2.0, 0.0)
    expected = common_mode(pairs, np.full(2000, 0.05), use)
    assert expected.mean() == pytest.approx(0.05, abs=0.01)
    more = np.where(np.arange(2000) % 10 == 0, 4.0, 1.0)
    expected = common_mode(more, np.full(2000, 1.0), use)
    assert expected.mean() == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("width", motion.SIDES)
def test_rows_share_as_much_as_all_of_their_pixels_at_most(width: int) -> None:
    """Rows off as a whole, by one standard deviation or by the three that a pixel counts; columns share none."""
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (BLOCKS, SHAPE[0], 1)) * np.ones((1, 1, SHAPE[1]))
    one = np.ones_like(signs)
    once, thrice = (motion.shared_variance((one, size * signs, one, one), width) for size in (1.0, 3.0))
    assert once == pytest.approx(width - 1, rel=0.2) and thrice == width - 1
    assert motion.shared_variance((one, signs.swapaxes(1, 2), one, one), width) == 0.0
