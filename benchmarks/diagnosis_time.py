"""Processor time of diagnoses, by stage and by kernel.

    python -m benchmarks.diagnosis_time --out campaigns
    python -m benchmarks.diagnosis_time --out campaigns --only nothing dead_time

Five campaigns of the hidden world (`tests/hidden_world`), 64 x 64 pixels, 13 recordings of 8000 frames: nothing hidden,
a dead time and a crosstalk at some five detection limits, a pair by far laws, and a mechanism outside the catalogue.
Processor time, unlike time by the clock, does not depend on other work of the machine, but for its caches.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal
from unittest.mock import patch

import tyro

from benchmarks.clocked import Clocked
from spikecam_env.cli.table import markdown
from tests.hidden_world.cases import Case, cases
from tests.hidden_world.world import write_campaign

Campaign = Literal["nothing", "dead_time", "crosstalk", "pair", "outside"]

CAMPAIGNS: dict[Campaign, str] = {
    "nothing": "9641d4ecd737",
    "dead_time": "ac6cf03a3f3d",
    "crosstalk": "082a2747d8ef",
    "pair": "3bd7aea9b5f3",
    "outside": "dcad2de23cb7",
}
"""Cases of the set `laws`, part `tune`."""

KERNELS: Mapping[str, tuple[str, ...]] = {
    "spikes": ("sensor.sensor:SpikeSensor.step",),
    "bits": ("gap.twins.simulate:pack_frames",),
    "observation": ("gap.twins.simulate:observe", "gap.diagnose:observe"),
    "statistics": ("gap.twins.case:statistics_bank", "gap.twins.case:pattern_bank"),
    "refits": ("gap.twins.case:free_refit",),
    "features of films": ("gap.twins.case:films",),
    "drawn units": ("gap.twins.case:drawn_banks",),
}
"""Functions of `spikecam_env` by kernel, "module:name", where they are called by that name."""

PAGE = "page"
"""The stage after a diagnosis: its files and the page with its pictures."""


def places() -> Iterator[tuple[str, Any, str]]:
    """Kernel, module or class, and name of each function of KERNELS."""
    for kernel, named in KERNELS.items():
        for place in named:
            module, _, name = place.partition(":")
            owner: Any = import_module(f"spikecam_env.{module}")
            *outer, name = name.split(".")
            for part in outer:
                owner = getattr(owner, part)
            yield kernel, owner, name


def diagnosed(case: Case, folder: Path) -> tuple[dict[str, float], dict[str, float], str]:
    """Seconds by stage and by kernel of one diagnosis with its page, and its verdict."""
    from spikecam_env.gap import diagnose, write_report

    clocked = Clocked()
    begin = time.process_time()
    by_processor = patch("spikecam_env.gap.stages.time", SimpleNamespace(perf_counter=time.process_time))
    with clocked.of(places()), by_processor:
        diagnosis = diagnose(folder, case.model, exclude=case.exclude, progress=False)
    middle = time.process_time()
    diagnosis.write(folder.with_name(f"{folder.name}_diagnosed"))
    write_report(diagnosis, folder.with_name(f"{folder.name}_diagnosed") / "report.html")
    end = time.process_time()
    stages = {**diagnosis.stages, PAGE: end - middle, "all": end - begin}
    verdict = f"{diagnosis.verdict} {', '.join(effect.name for effect in diagnosis.effects)}"
    kernels = {**clocked.seconds, PAGE: end - middle}
    kernels |= {"other": end - begin - sum(kernels.values()), "all": end - begin}
    return stages, kernels, f"{verdict}, {diagnosis.simulated} recordings"


def bench_diagnoses(out: Path, only: tuple[Campaign, ...] = tuple(CAMPAIGNS)) -> None:
    """Diagnose the campaigns, each by itself in this process, and print both tables.

    Args:
        out: folder for the campaigns (98 MB each), which are not made again, and for the diagnoses.
        only: campaigns; default all five.
    """
    known = {case.id: case for case in cases("laws", "tune")}
    stages: dict[str, dict[str, float]] = {}
    kernels: dict[str, dict[str, float]] = {}
    for name in only:
        case = known[CAMPAIGNS[name]]
        if not (out / name).exists():
            write_campaign(case.recipe, out / name)
        stages[name], kernels[name], verdict = diagnosed(case, out / name)
        print(f"{name}: {stages[name]['all']:.0f} s, {verdict}", flush=True)
    print("\n" + columns("stage, s", stages) + "\n\n" + columns("kernel, s", kernels))


def columns(head: str, found: Mapping[str, Mapping[str, float]]) -> str:
    """A table of seconds, a campaign a column."""
    rows = [row for row in dict.fromkeys(name for of_one in found.values() for name in of_one) if row != "all"]
    return markdown([{head: row} | {c: f"{of.get(row, 0.0):.1f}" for c, of in found.items()} for row in (*rows, "all")])


if __name__ == "__main__":
    tyro.cli(bench_diagnoses, description=__doc__)
