"""Whether 90 % intervals hold at every effort: how many contain the hidden parameter, and how wide they are.

    python -m benchmarks.interval_coverage --seeds 4 --out intervals.json

Each of `HIDDEN` is hidden in SEEDS small cameras, and each campaign is diagnosed at every one of EFFORTS.  An interval
counts where its effect is named.  Its width is compared with that of the same parameter of the same campaign at the
largest effort.

Campaigns in the file are not repeated; it is written after every campaign.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from tqdm import tqdm

from benchmarks.bound_coverage import wilson
from spikecam_env.cli.table import table
from spikecam_env.gap import Bars, Dark, Flat, Step, write_campaign
from spikecam_env.gap.candidates.strength import with_effect
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.diagnose import diagnose
from spikecam_env.gap.result import Diagnosis
from spikecam_env.sensor import SensorModel
from spikecam_env.whole import write_text_whole

SHAPE, FRAMES = (24, 32), 1000
DESIGN = (
    Dark(),
    *(Flat(radiance=x) for x in (0.08, 0.2, 0.4, 0.6)),
    Step(),
    Bars(high=1.4),
    Flat(radiance=0.3, use="holdout"),
)
MODEL = SensorModel.preset("scsim")
EFFORTS = (25.0, 60.0, 200.0)
FIRST_CAMERA = 300
"""Seed of the first camera."""

Parameters = dict[str, float]

HIDDEN: tuple[dict[str, Parameters], ...] = (
    {"row_temporal_noise": {"sigma_mV": 8.0}},
    {"row_temporal_noise": {"sigma_mV": 20.0}},
    {"common_threshold_noise": {"sigma_mV": 4.0}},
    {"threshold_flicker_noise": {"sigma_mV": 3.0}},
    {"dead_time": {"tau_us": 0.5}},
    {"spurious_spikes": {"probability": 1e-3}},
    {"photodiode_lag": {"fraction": 0.05, "tau_us": 600.0}},
    {"incomplete_reset": {"fraction": 0.02, "tau_us": 300.0}},
    {"afterpulsing": {"probability": 0.01, "delay_frames": 2.0}},
    {"row_fixed_pattern": {"sigma_mV": 80.0}},
    {"dead_time": {"tau_us": 0.5}, "row_temporal_noise": {"sigma_mV": 12.0}},
    {"photodiode_lag": {"fraction": 0.05, "tau_us": 600.0}, "row_temporal_noise": {"sigma_mV": 12.0}},
)
"""Effects of a camera, by name: counted, in proportion, by their square, of one parameter and two, and in pairs."""

CANDIDATES = tuple(dict.fromkeys(name for effects in HIDDEN for name in effects))


@dataclass(frozen=True)
class Stated:
    """One parameter of one diagnosis."""

    case: int
    """Index in `HIDDEN`."""
    seed: int
    """Of the camera, counted from `FIRST_CAMERA`."""
    effort: float
    """Budget of the diagnosis [campaigns]."""
    effect: str
    parameter: str
    truth: float
    """Its hidden value."""
    value: float | None
    """As it was diagnosed; None where its effect was not named."""
    low: float | None
    """Start of its 90 % interval; None where none is stated."""
    high: float | None
    """End of its 90 % interval."""
    sd: float | None
    """Its standard deviation."""
    skipped: str
    """Steps that were left out to stay within the effort; empty where none was."""

    @property
    def contains(self) -> bool:
        """Whether the interval contains the truth."""
        return self.low is not None and self.high is not None and self.low <= self.truth <= self.high

    @property
    def misses_by(self) -> float:
        """Standard deviations from the truth."""
        return abs(self.value - self.truth) / self.sd if self.value is not None and self.sd else float("nan")


def diagnosed(case: int, seed: int, efforts: Sequence[float]) -> list[Stated]:
    """One campaign at several efforts, the least first; where nothing was skipped, a larger one changes nothing."""
    model = MODEL
    for name, parameters in HIDDEN[case].items():
        model = with_effect(model, name, parameters)
    with tempfile.TemporaryDirectory() as folder:
        campaign = write_campaign(
            Path(folder, "camera"), model, shape=SHAPE, frames=FRAMES, recordings=DESIGN, seed=FIRST_CAMERA + seed
        )
        done: list[Stated] = []
        diagnosis = None
        for effort in sorted(efforts):
            if diagnosis is None or unfinished_note(diagnosis):
                diagnosis = diagnose(campaign, MODEL, candidates=CANDIDATES, effort=effort, seed=seed, progress=False)
            done += stated_by(diagnosis, case, seed, effort)
        return done


def unfinished_note(diagnosis: Diagnosis) -> str:
    """The note on steps that were skipped to stay within the effort; empty where none was."""
    return next((note for note in diagnosis.data if "--effort" in note), "")


def stated_by(diagnosis: Diagnosis, case: int, seed: int, effort: float) -> Iterator[Stated]:
    """Every fitted parameter of the hidden effects, as a diagnosis states it."""
    named = {effect.name: effect.parameters for effect in diagnosis.effects} if diagnosis.verdict == "named" else {}
    for name, parameters in HIDDEN[case].items():
        for key in candidate(name).fitted:
            estimate = named.get(name, {}).get(key)
            low, high = (estimate.interval if estimate else None) or (None, None)
            value, sd = (float(estimate.value), float(estimate.sd)) if estimate else (None, None)
            skipped = unfinished_note(diagnosis)
            yield Stated(case, seed, effort, name, key, parameters[key], value, low, high, sd, skipped)


def rows(done: Sequence[Stated]) -> Iterator[dict[str, Any]]:
    """A row an effort, of all parameters; then a row an effort of each parameter."""
    kinds: list[tuple[str, str] | None] = [None, *dict.fromkeys((s.effect, s.parameter) for s in done)]
    for kind in kinds:
        of_kind = [s for s in done if kind in (None, (s.effect, s.parameter))]
        for effort in sorted({s.effort for s in of_kind}):
            yield row(kind, effort, of_kind)


def row(kind: tuple[str, str] | None, effort: float, done: Sequence[Stated]) -> dict[str, Any]:
    """Of one parameter, or of all, at one effort."""
    own = [s for s in done if s.effort == effort]
    stated = [s for s in own if s.low is not None]
    inside = sum(s.contains for s in stated)
    low, high = wilson(inside, len(stated))
    most = {(s.case, s.seed, s.effect, s.parameter): width(s) for s in done if s.effort == max(EFFORTS)}
    ratios = [width(s) / most.get((s.case, s.seed, s.effect, s.parameter), np.nan) for s in stated]
    ratios = [r for r in ratios if np.isfinite(r)]
    return {
        "parameter": "all" if kind is None else ": ".join(kind),
        "effort": f"{effort:g}",
        "stated": f"{len(stated)} of {len(own)}",
        "inside": inside,
        "share": f"{100 * inside / max(len(stated), 1):.0f} %",
        "95 % interval": f"{100 * low:.0f} to {100 * high:.0f} %",
        "median width": f"{np.median(ratios):.2f}" if ratios else "-",
        "largest miss [sd]": f"{max((s.misses_by for s in stated), default=np.nan):.1f}",
    }


def width(stated: Stated) -> float:
    """Length of the interval; NaN without one."""
    return stated.high - stated.low if stated.low is not None and stated.high is not None else float("nan")


def main(out: Path, seeds: int = 4, first_seed: int = 0, only: tuple[str, ...] = ()) -> None:
    """Write and print the table.

    Args:
        out: file (.json) of the campaigns.
        seeds: cameras of each case.
        first_seed: number of the first.
        only: effects, one of which a case must hide; default all.
    """
    kept = json.loads(out.read_text(encoding="utf-8")) if out.exists() else []
    done = [Stated(**s) for s in kept]
    have = {(s.case, s.seed) for s in done}
    todo = [
        (case, seed)
        for seed in range(first_seed, first_seed + seeds)
        for case, effects in enumerate(HIDDEN)
        if (case, seed) not in have and (not only or set(only) & set(effects))
    ]
    for case, seed in tqdm(todo, "campaigns"):
        done += diagnosed(case, seed, EFFORTS)
        write_text_whole(out, json.dumps([asdict(s) for s in done], indent=1))
    print(table(list(rows(done))))


if __name__ == "__main__":
    tyro.cli(main)
