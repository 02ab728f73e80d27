"""Why candidates were kept or not, in the order in which a page lists them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from spikecam_env.gap.fit.hypothesis import Fit, Hypothesis
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.verdict.ranking import ranking, why_rejected
from spikecam_env.sensor import SensorModel

MODEL = SensorModel.preset("scsim")


def at(misfit: float, prediction: object = None) -> Hypothesis:
    rho = np.array([1.5, -4.0])
    return Hypothesis(model=MODEL, base=None, prediction=prediction, rho=rho, misfit=misfit)  # type: ignore[arg-type]


def fit(name: str, misfit: float, draws: int = 1) -> Fit:
    prediction = SimpleNamespace(draws=(None,) * draws)
    return Fit(**vars(at(misfit, prediction)), name=name, parameters={}, sd={})


def turn(*fits: Fit, misfit: float = 100.0) -> Round:
    return Round(at(misfit), fits)


def test_a_better_candidate_below_the_kept_one_says_why() -> None:
    kept = fit("light_flicker", 60.0, draws=4)
    first = turn(kept, fit("crosstalk", 70.0), fit("lamp_drift", 50.0), fit("dead_time", 55.0, draws=2))
    rows = ranking([first], [(kept, first)], 12.0)
    assert [r.name for r in rows] == ["light_flicker", "lamp_drift", "dead_time", "crosstalk"]
    assert [r.accepted for r in rows] == [True, False, False, False]
    assert [r.reason for r in rows] == [
        "leaves 4.0 noises at worst",
        "smaller misfit in a single simulation; further ones did not confirm it",
        "smaller misfit, but all recordings together, and the number of parameters, favour light flicker",
        "larger misfit than light flicker",
    ]


def test_where_nothing_was_kept_the_best_comes_first_and_the_chosen_says_why_not() -> None:
    rows = ranking([turn(fit("crosstalk", 85.0, draws=4), fit("dead_time", 95.0), fit("lamp_drift", 100.0))], [], 12.0)
    assert [r.name for r in rows] == ["crosstalk", "dead_time", "lamp_drift"] and not any(r.accepted for r in rows)
    assert rows[0].reason == "not kept: it explains nothing more beside the others, or on held-out recordings"


@pytest.mark.parametrize(
    "misfit, reason",
    [
        (100.0, "explains nothing"),
        (99.98, "explains nothing"),
        (89.0, "removes 11.0 of the misfit; an effect must remove 12"),
        (80.0, "larger misfit than dead time"),
    ],
)
def test_a_misfit_alone_says_why_a_candidate_was_not_added(misfit: float, reason: str) -> None:
    assert why_rejected(misfit, 100.0, "dead_time", 12.0) == reason
