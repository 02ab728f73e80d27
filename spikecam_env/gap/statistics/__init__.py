"""The statistics bank: statistics in named groups, one file a group; each names the effects that it reveals."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from spikecam_env.gap.observe.conditions import LABEL_ERROR
from spikecam_env.gap.statistics import (
    clock,
    drift,
    intervals,
    moving,
    neighbours,
    noise,
    pattern,
    rates,
    rows,
    spectrum,
    step,
    timing,
)
from spikecam_env.gap.statistics.reading import CampaignReading
from spikecam_env.renamed import old_names

GROUPS: dict[str, Callable[[CampaignReading, int], dict[str, float]]] = {
    module.__name__.rsplit(".", 1)[1]: module.statistics
    for module in (rates, noise, intervals, drift, spectrum, timing, rows, neighbours, clock, step, moving)
}


FLOORS: dict[tuple[str, str], float] = {
    ("rates", ""): LABEL_ERROR,
    ("rates", "scatter"): 0.05,
    ("noise", "variance"): 1e-3,
    ("noise", "lag-1"): 2e-3,
    ("noise", "A_"): 0.01,
    ("noise", "tail"): 0.02,
    ("drift", ""): 2e-5,
    ("drift", "wander"): 0.2,
    ("drift", "late"): drift.CONSTANCY,
    ("drift", "pixel"): 0.02,
    ("spectrum", ""): 0.1,
    ("rows", ""): 0.02,
    ("neighbours", ""): 2e-3,
    ("step", ""): 2e-3,
    ("moving", ""): 2e-4,
    ("moving", "left"): 5e-3,
    ("pattern", ""): 0.02,
    ("pattern", "over"): 0.5,
    ("pattern", "silent"): 1.0,
    ("texture", ""): 0.02,
    ("texture", "field"): 2e-3,
    ("intervals", ""): 1.0,
    ("timing", ""): 0.01,
    ("clock", ""): 0.02,
    ("clock", "whole"): 1.0,
    ("clock", "late"): 1.0,
    ("clock", "early"): 1.0,
}
"""Floors of the statistics' noise, whatever the number of spikes, by group and start of the name.

Labels and first-order laws are exact to no more: light labels to 2e-5, laws of noise to 1 %; counts, on the scale of
their root, to 1.  Source: docs/gap.md, "Known limits"."""


def floor_of(key: StatisticKey) -> float:
    """The least noise of a statistic, in its own unit."""
    return FLOORS.get(floor_family(key), 0.0)


def floor_family(key: StatisticKey) -> tuple[str, str]:
    """(group, start of the name) of the statistics that share a floor with this one: the longest in FLOORS."""
    return key.group, max((n for g, n in FLOORS if g == key.group and key.name.startswith(n)), key=len, default="")


class StatisticKey(NamedTuple):
    """Which statistic: its group, the recording it is of, and its name in the group."""

    group: str
    recording: str
    name: str


def statistics_bank(reading: CampaignReading) -> dict[StatisticKey, float]:
    """Every statistic of a campaign, but for those of the pattern."""
    bank: dict[StatisticKey, float] = {}
    for i, condition in enumerate(reading.conditions):
        for group, statistics in GROUPS.items():
            bank |= keyed(group, condition.name, statistics(reading, i))
    return bank


def keyed(group: str, recording: str, values: Mapping[str, float]) -> dict[StatisticKey, float]:
    """Statistics of one recording in one group, by key."""
    return {StatisticKey(group, recording, name): value for name, value in values.items()}


def pattern_bank(reading: CampaignReading) -> dict[StatisticKey, float]:
    """The pattern statistics of a measurement's rate maps: of the dark recording and of every flat."""
    bank: dict[StatisticKey, float] = {}
    for condition, o in zip(reading.conditions, reading.observations, strict=True):
        if condition.kind in ("dark", "flat"):
            bank |= keyed("pattern", condition.name, pattern.statistics(o.rate.reshape(o.shape)))
    return bank


__getattr__ = old_names(__name__, {"Key": "StatisticKey"})
