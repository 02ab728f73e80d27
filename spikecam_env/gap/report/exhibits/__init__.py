"""Exhibits: one way to look at the recordings a file, named as the group of statistics that it shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from spikecam_env.gap.report.exhibits import (
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
)
from spikecam_env.gap.report.panels import PixelMaps, PlotPanel
from spikecam_env.gap.result import Evidence, Statistic

LEAST_Z = 4.0
"""|z| from which an exhibit is shown among the evidence."""


@dataclass(frozen=True)
class Exhibit:
    """One way to look."""

    name: str
    """Of the group of statistics that it shows."""
    title: str
    caption: str
    panels: tuple[PlotPanel, ...]
    maps: tuple[PixelMaps, ...] = ()

    def z(self, statistics: Sequence[Statistic]) -> float:
        """Largest |z| of its statistics; of its own panels where the bank has none of this group."""
        own = [abs(s.z) for s in statistics if s.group == self.name]
        return max(own) if own else max((p.z for p in self.panels), default=0.0)


def exhibits(evidence: Evidence, frame_rate_hz: float) -> list[Exhibit]:
    """The exhibits of these recordings that have a panel or a map."""
    made = []
    for module in (rates, noise, intervals, drift, spectrum, rows, neighbours, clock, step, moving, pattern):
        panels = tuple(module.panels(evidence, frame_rate_hz))
        maps = tuple(pattern.maps(evidence)) if module is pattern else ()
        made.append(Exhibit(module.__name__.rsplit(".", 1)[1], module.TITLE, module.CAPTION, panels, maps))
    return [e for e in made if e.panels or e.maps]


def by_z(made: Sequence[Exhibit], statistics: Sequence[Statistic]) -> tuple[list[Exhibit], list[Exhibit]]:
    """Exhibits where measured and before differ, largest first, and the others."""
    order = sorted(made, key=lambda e: -e.z(statistics))
    return [e for e in order if e.z(statistics) >= LEAST_Z], [e for e in order if e.z(statistics) < LEAST_Z]
