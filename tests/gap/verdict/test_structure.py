"""The description of an unexplained discrepancy, in numbers."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.report.table_rows import STRUCTURE
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.verdict import structure as module
from spikecam_env.gap.verdict.structure import level_exponent, structure

LEVELS = {"flat-0.1": 0.1, "flat-0.2": 0.2, "flat-0.4": 0.4}


def test_of_statistics_seen_on_as_many_flats_the_first_gives_the_exponent() -> None:
    """Statistic n goes with level^n; any but the first would give another exponent.  Eight, so that an order of chance
    (of a set of names, another in every process) would pass once in eight."""
    names = [f"statistic {n}" for n in range(8)]
    keys = tuple(StatisticKey("rates", flat, name) for name in names for flat in LEVELS)
    ones = np.ones(len(keys))
    null = Null(keys, 0 * ones, ones, 0 * ones, np.inf, 100.0)
    for first in range(8):
        power = {name: (n + first) % 8 for n, name in enumerate(names)}
        off = np.array([1e9 * LEVELS[k.recording] ** power[k.name] for k in keys])
        exponent = level_exponent(null, off, dict.fromkeys(LEVELS, "flat"), LEVELS)
        print(first, exponent)
        assert exponent == first


def made_up(off: dict[tuple[str, str], float]) -> tuple[Null, np.ndarray]:
    """Statistics off by so many noises, by (group, recording)."""
    keys = tuple(StatisticKey(group, recording, "mean") for group, recording in off)
    ones = np.ones(len(keys))
    return Null(keys, 0 * ones, ones, 0 * ones, np.inf, 100.0), np.array(list(off.values()))


@pytest.mark.parametrize("rows, extent", [(8.0, "pixel by pixel"), (40.0, "common to many pixels")])
def test_what_many_pixels_have_in_common_has_its_share_of_the_deviance(rows, extent, monkeypatch) -> None:
    """Of log(1 + 8) against two of log(1 + 10^2 / 8), 29 %; of log(1 + 40^2 / 8), 50 %."""
    monkeypatch.setattr(module, "where", lambda case: "")
    monkeypatch.setattr(module, "when", lambda case: "")
    case = SimpleNamespace(conditions=[SimpleNamespace(name=n, kind="flat", level=v) for n, v in LEVELS.items()])
    null, off = made_up({("rows", "flat-0.1"): rows, ("rates", "flat-0.1"): 10.0, ("rates", "flat-0.2"): 10.0})
    share = np.log1p(off**2 / 8)
    print(f"{share[0] / share.sum():.2f}")
    found = structure(case, null, off)
    assert found["extent"] == extent
    assert {"light", "level_exponent", "extent", "history", "neighbours", "clock", "where", "when"} <= set(found)
    assert set(found) - {"worst_group", "groups"} <= set(STRUCTURE), "without words on the page"
