"""Gauss-Newton on made-up statistics whose laws are known: it finds the parameters, and keeps the best of its steps."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
from small import MODEL, TWINS, made_up_null, unit

from spikecam_env.gap.candidates.strength import with_effect
from spikecam_env.gap.compare.prediction import Draw, Null, Prediction
from spikecam_env.gap.fit.gauss_newton import Probe, descend
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.fit.slopes import Slopes
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.sensor import SensorModel

COUNT = 60
NAME = "incomplete_reset"
TRUE = {"fraction": 0.02, "tau_us": 300.0}
FREE = [(NAME, key) for key in TRUE]


def problem_of(n: Null, measured: np.ndarray) -> Problem:
    return Problem(SimpleNamespace(jobs=1), MODEL, n, measured, measured)  # type: ignore[arg-type]


def law(fraction: float, tau_us: float) -> np.ndarray:
    """Thirty statistics in proportion to the fraction, as many to its product with a power of the time constant."""
    strength = 20.0 * fraction / TRUE["fraction"]
    return strength * np.where(np.arange(COUNT) < 30, 1.0, (tau_us / TRUE["tau_us"]) ** 0.5)


def probe_of(n: Null, change: Callable[..., np.ndarray], probed: list[SensorModel] | None = None) -> Probe:
    def probe(model: SensorModel, base: BaseFit, count: int) -> Prediction:
        if probed is not None:
            probed.append(model)
        [effect] = [e for e in model.effects if e.name == NAME]
        values = n.mean + change(**{k: effect.parameters()[k] for k in TRUE})
        return Prediction(values, n.sd / np.sqrt(TWINS), n.sd, (Draw(TWINS - 1, values, None),))

    return Probe(probe)


def start(**times: float) -> SensorModel:
    return with_effect(MODEL, NAME, {k: v * times[k] for k, v in TRUE.items()})


def parameters_of(model: SensorModel) -> dict[str, float]:
    [effect] = [e for e in model.effects if e.name == NAME]
    return {k: effect.parameters()[k] for k in TRUE}


def test_both_parameters_are_found_within_their_errors():
    n = made_up_null(COUNT)
    measured = n.mean + law(**TRUE) + n.sd * np.random.default_rng(1).standard_normal(COUNT)
    end = descend(problem_of(n, measured), probe_of(n, law), start(fraction=0.6, tau_us=2.0), unit(), FREE)
    found = parameters_of(end.model)
    errors = np.sqrt(np.diag(end.covariance))
    print({k: f"{v:.4g} of {TRUE[k]:g}" for k, v in found.items()}, errors)
    for (_, key), error in zip(FREE, errors, strict=True):
        assert 0.001 < error < 0.1
        assert abs(np.log(found[key] / TRUE[key])) < 4 * error


def test_where_steps_come_to_leave_more_the_best_is_kept():
    """A law that promises more of the fraction, and turns round where the step leads."""
    n = made_up_null(COUNT)
    here = 0.5 * TRUE["fraction"]

    def broken(fraction: float, tau_us: float) -> np.ndarray:
        return law(fraction, tau_us) * (-1.0 if abs(np.log(fraction / here)) > 0.63 else 1.0)

    measured = n.mean + law(**TRUE)
    first = start(fraction=0.5, tau_us=1.0)
    end = descend(problem_of(n, measured), probe_of(n, broken), first, unit(), FREE)
    kept = descend(problem_of(n, measured), probe_of(n, law), first, unit(), FREE)
    print(parameters_of(end.model), parameters_of(kept.model))
    assert parameters_of(end.model) == parameters_of(first)
    assert abs(np.log(parameters_of(kept.model)["fraction"] / TRUE["fraction"])) < 0.05


def test_known_derivatives_are_not_taken_again():
    """A second descent begins with those of the first: a twin of its start, and one after each step."""
    n = made_up_null(COUNT)
    measured = n.mean + law(**TRUE) + n.sd * np.random.default_rng(1).standard_normal(COUNT)
    first = descend(problem_of(n, measured), probe_of(n, law), start(fraction=0.8, tau_us=1.2), unit(), FREE)
    known = Slopes.of_descent(first.model, FREE, first.columns, first.noise)
    again, anew = [], []
    begin = start(fraction=1.1, tau_us=0.9)
    end = descend(problem_of(n, measured), probe_of(n, law, again), begin, unit(), FREE, known=known.near(begin, FREE))
    descend(problem_of(n, measured), probe_of(n, law, anew), begin, unit(), FREE)
    assert len(again) == len(anew) - len(FREE)
    for (_, key), error in zip(FREE, np.sqrt(np.diag(end.covariance)), strict=True):
        assert abs(np.log(parameters_of(end.model)[key] / parameters_of(first.model)[key])) < error


def test_derivatives_far_away_are_not_known_nor_those_of_a_part_of_an_effect():
    columns = np.ones((COUNT, 2))
    known = Slopes.of_descent(start(fraction=1.0, tau_us=1.0), FREE, columns, columns)
    assert known.near(start(fraction=1.2, tau_us=1.2), FREE).free == tuple(FREE)
    assert not known.near(start(fraction=1.2, tau_us=2.0), FREE).free
    assert not known.of(FREE[:1]).near(start(fraction=1.0, tau_us=1.0), FREE).free
