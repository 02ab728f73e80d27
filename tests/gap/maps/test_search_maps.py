"""The search among maps on made-up fits: effects that are added, their number, and their significance."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from spikecam_env.gap.maps import search as module
from spikecam_env.gap.maps.conclude import has_clear_strength
from spikecam_env.gap.maps.search import MapFit, PatternModel, search_maps
from spikecam_env.gap.settings import DiagnosisSettings

CASE = SimpleNamespace(jobs=1, settings=DiagnosisSettings())


def a_fit(name: str, misfit: float, added: tuple[str, ...] = (), sd: float = 0.1) -> MapFit:
    return MapFit(name, PatternModel(None, {}, added), {f"{name}.falloff": sd}, np.zeros(1), np.zeros(1), misfit)


def searched(removed: dict[str, float], monkeypatch) -> tuple[list[list[MapFit]], list[MapFit]]:
    """Each candidate removes its share of the misfit, whatever else is there."""

    def fit(case, state, null, values, name):
        added = (*state.added, name) if name else ()
        return a_fit(name, 1000.0 - sum(removed[n] for n in added), added)

    monkeypatch.setattr(module, "fit_candidate", fit)
    monkeypatch.setattr(module, "is_significant", lambda null, rho: True)
    return search_maps(CASE, PatternModel(None, {}), None, None, list(removed))


@pytest.mark.parametrize("removed, added", [(20.0, False), (30.0, True)])
def test_an_effect_has_to_remove_twenty_four_to_be_added(removed: float, added: bool, monkeypatch) -> None:
    rounds, rejected = searched({"vignetting": removed}, monkeypatch)
    assert [r[0].name for r in rounds] == (["", "vignetting"] if added else [""])
    assert [f.name for f in rejected] == ([] if added else ["vignetting"])


def test_five_effects_are_named_together_at_most(monkeypatch) -> None:
    rounds, _ = searched({f"effect {n}": 100.0 for n in range(8)}, monkeypatch)
    assert len(rounds) == 1 + 5


@pytest.mark.parametrize("sd, significant", [(0.4, True), (0.7, False)])
def test_a_strength_of_two_standard_deviations_is_significant(sd: float, significant: bool) -> None:
    """Its standard deviation is relative."""
    assert has_clear_strength(a_fit("vignetting", 0.0, ("vignetting",), sd), "vignetting", 0.5) == significant
