"""The denoiser of many streams against one of each: the rates are those, to the rounding of sums."""

from __future__ import annotations

import numpy as np
import pytest

from denoiser.many import ManyDnSS
from denoiser.online import OnlineDnSS
from denoiser.passes.recipe import RECIPES
from spikecam_env.errors import InputError

SHAPE = (10, 12)
ROUNDING = 1e-5
"""Of rates in [0, 1]: float32 sums of some hundred terms, in another order."""


def like(mode: str, **options) -> OnlineDnSS:
    return OnlineDnSS.pretrained(mode, output="rate", precision="float32", **options)


def streams(count: int, frames: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    rates = rng.random((count, 1, *SHAPE))
    return (rng.random((count, frames, *SHAPE)) < rates).astype(np.uint8)


def pushed(many: ManyDnSS, spikes: np.ndarray, cut: int) -> list[np.ndarray]:
    """The output of every stream, piece by piece."""
    pieces = [many.push(spikes[:, first : first + cut]) for first in range(0, spikes.shape[1], cut)]
    return [np.concatenate(its) for its in zip(*pieces, strict=True)]


@pytest.mark.parametrize(("mode", "options"), [("best", {}), ("paper", {}), ("paper", {"stride": 4})])
def test_each_stream_is_denoised_as_alone(mode: str, options: dict) -> None:
    spikes, one = streams(3, 90), like(mode, **options)
    for rates, stream in zip(pushed(ManyDnSS(one, 3, SHAPE), spikes, 13), spikes, strict=True):
        alone = one.another().push(stream)
        assert rates.shape == alone.shape and len(alone) > 48
        worst = np.abs(rates - alone).max()
        print(f"{mode}: {worst:.2g} apart")
        assert worst < ROUNDING


@pytest.mark.parametrize("mode", RECIPES)
def test_a_stream_that_begins_anew_forgets_and_the_others_go_on(mode: str) -> None:
    spikes, one = streams(2, 120), like(mode)
    many = ManyDnSS(one, 2, SHAPE)
    before = pushed(many, spikes[:, :40], 20)
    many.restart(np.array([False, True]))
    after = pushed(many, spikes[:, 40:], 20)
    whole, anew = one.another().push(spikes[0]), one.another().push(spikes[1, 40:])
    assert np.abs(np.concatenate([before[0], after[0]]) - whole).max() < ROUNDING
    assert np.abs(after[1] - anew).max() < ROUNDING


def test_the_denoiser_that_it_is_like_goes_on() -> None:
    spikes, one = streams(2, 64), like("best")
    first = one.push(spikes[0, :40])
    ManyDnSS(one, 2, SHAPE).push(spikes)
    np.testing.assert_array_equal(np.concatenate([first, one.push(spikes[0, 40:])]), one.another().push(spikes[0]))


def test_unusable_streams_are_named() -> None:
    with pytest.raises(InputError, match="overlap is True"):
        ManyDnSS(like("best", overlap=True), 2, SHAPE)
    with pytest.raises(InputError, match="spikes are"):
        ManyDnSS(like("best"), 2, SHAPE).push(streams(3, 8))
