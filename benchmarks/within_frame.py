"""Do the engines do what a pixel does within a frame?  Every effect, beside the hidden world (`tests/hidden_world`).

At each setting both make independent groups of pixels.  A statistic's standard error is its spread over these groups,
on either side, and z the difference over both errors.  The relative error stands beside it, as enough spikes make any
difference significant.  Correlations, lines and slopes have absolute errors.

python -m benchmarks.within_frame --only dead_time
python -m benchmarks.within_frame --page docs/within_the_frame.md    # of all effects: 15 minutes of a core
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import tyro
from scipy import stats
from tqdm import tqdm

from benchmarks.settings.cases import Case, cases
from benchmarks.settings.statistics import LIMIT, Comparison, compared
from spikecam_env.cli.main import run_parsed
from spikecam_env.cli.table import markdown
from spikecam_env.errors import InputError
from spikecam_env.sensor.effect_sheet import Sheet
from spikecam_env.sensor.effects import CATALOGUE
from spikecam_env.whole import check_file, write_text_whole
from tests.hidden_world.laws import between

ENGINES = ("reference", "fast")
NAME = "within_frame"
"""Of the markers in the page."""


@dataclass(frozen=True)
class Row:
    """One statistic of one setting by one engine."""

    effect: str
    setting: str
    statistic: str
    engine_name: str
    comparison: Comparison

    @property
    def cells(self) -> dict[str, Any]:
        """The row as a table has it."""
        c = self.comparison
        return {
            "effect": self.effect,
            "setting": self.setting,
            "statistic": self.statistic,
            "engine": self.engine_name,
            "hidden world": f"{c.world:.5f}",
            "sensor": f"{c.engine:.5f}",
            "z": f"{c.z:+.1f}",
            "error": f"{c.error:+.2%}",
            "": "" if c.agrees else "DIFFERS",
        }


@dataclass(frozen=True)
class Refusal:
    """A setting that the sensor refuses, and its words."""

    effect: str
    setting: str
    refusal: str


@dataclass(frozen=True)
class WithinFrame:
    """Hold the sensor's engines against the hidden world."""

    only: tuple[str, ...] = ()
    """Effects to compare, `light` among them; default all."""
    quick: bool = False
    """One setting each of the nine hardest effects."""
    seed: int = 1
    groups: int | None = None
    """Independent groups of pixels a setting; default by setting."""
    frames: int | None = None
    """Frames a setting, 64 or more; default by setting."""
    electrons: float | None = None
    """Electrons to a threshold: the hidden world counts them one by one up to 1000; default by setting."""
    out: Path | None = None
    """File for every comparison, a table of Markdown."""
    page: Path | None = None
    """Page for the largest errors, between its markers."""

    def run(self) -> None:
        for path in filter(None, (self.out, self.page)):
            check_file(path)
        chosen = list(chosen_cases(self.only, self.quick, self.groups, self.frames, self.electrons))
        if self.page:
            _written(self.page, "")
        rows: list[Row] = []
        refusals: list[Refusal] = []
        number = {(case.effect, case.label): n for n, case in enumerate(cases())}  # the same alone and among others
        for case in tqdm(chosen, unit="setting"):
            if refusal := refused(case):
                refusals.append(refusal)
                continue
            for row in compare(case, self.seed * 1000 + number[case.effect, case.label]):
                rows.append(row)
                if not row.comparison.agrees:
                    tqdm.write(" | ".join(row.cells.values()))
        print(summary(rows, refusals))
        if self.out:
            write_text_whole(self.out, markdown([row.cells for row in rows]) + "\n")
        if self.page:
            write_text_whole(self.page, _written(self.page, largest_errors(rows, refusals)))


def chosen_cases(
    only: Iterable[str] = (),
    quick: bool = False,
    groups: int | None = None,
    frames: int | None = None,
    electrons: float | None = None,
) -> Iterable[Case]:
    """The settings asked for.  Raises InputError for an effect that has none, and for too few groups or frames."""
    named = {case.effect for case in cases()}
    for name in only:
        if name not in named:
            raise InputError(f"--only {name}: not an effect with settings; choose from {', '.join(sorted(named))}")
    if groups is not None and groups < 8:
        raise InputError(f"--groups {groups}: a standard error needs 8 groups or more")
    if frames is not None and frames < 64:
        raise InputError(f"--frames {frames}: it must be 64 or more")
    if electrons is not None and not 1.0 <= electrons <= 1e6:
        raise InputError(f"--electrons {electrons:g}: it must be from 1 to 1 000 000")
    given = {"groups": groups, "frames": frames, "electrons": electrons}
    changed: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    for case in cases():
        if (case.quick or not quick) and (not only or case.effect in only):
            yield replace(case, **changed)


def refused(case: Case) -> Refusal | None:
    """Whether, and why, the sensor refuses a setting."""
    try:
        case.check()
    except InputError as error:
        return Refusal(case.effect, case.label, str(error))
    return None


def compare(case: Case, seed: int) -> Iterable[Row]:
    """Every statistic of a setting, by both engines."""
    world = case.world(seed)
    for engine in ENGINES:
        spikes = case.engine(engine, seed)
        for statistic in case.statistics:
            yield Row(case.effect, case.label, statistic.name, engine, compared(statistic, world, spikes))


def summary(rows: list[Row], refusals: list[Refusal]) -> str:
    """Number of comparisons, of differences, of those by chance, and of refused settings."""
    differ = sum(not row.comparison.agrees for row in rows)
    by_chance = len(rows) * 2.0 * float(stats.norm.sf(LIMIT))
    return (
        f"{len(rows)} comparisons, {differ} beyond abs(z) = {LIMIT:g} ({by_chance:.2g} by chance alone); "
        f"{len(refusals)} settings are refused."
    )


def largest_errors(rows: list[Row], refusals: list[Refusal]) -> str:
    """A line an effect: how it acts within a frame, and the comparison with the largest |z|; then refused settings."""
    worst = []
    for name in dict.fromkeys(row.effect for row in rows):
        own = [row for row in rows if row.effect == name]
        largest = max(own, key=lambda row: abs(row.comparison.z)).cells
        largest.pop("")
        worst.append({
            "effect": largest.pop("effect"),
            "within a frame": _within(name),
            "comparisons": len(own),
            "beyond": sum(not row.comparison.agrees for row in own),
            "largest abs(z)": "; ".join(largest.pop(key) for key in ("setting", "statistic", "engine")),
            **largest,
            "command": f"`python -m benchmarks.within_frame --only {name}`",
        })  # fmt: skip
    parts = [summary(rows, refusals), markdown(worst)]
    if refusals:
        parts += ["Refused, in the sensor's words:", markdown([vars(refusal) for refusal in refusals])]
    return "\n\n".join(parts)


def _within(name: str) -> str:
    if name not in CATALOGUE:
        return "integrated over the frame"
    return Sheet.of(CATALOGUE[name]).sections.get("Within a frame", "").rstrip(".")


def _written(path: Path, table: str) -> str:
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    try:
        return between(text, NAME, f"\n{table}\n\n")
    except ValueError as error:
        raise InputError(f"--page {path}: {error}") from error


def main(args: list[str] | None = None) -> int:
    """Parse and run; returns the exit code."""
    return run_parsed(lambda: tyro.cli(WithinFrame, prog="python -m benchmarks.within_frame", args=args))


if __name__ == "__main__":
    raise SystemExit(main())
