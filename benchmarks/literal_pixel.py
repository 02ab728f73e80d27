"""Do the engines do what a pixel does within a frame?  Every effect, beside a camera simulated electron by electron.

The literal camera (`benchmarks/literal`) lives in continuous time and shares no code with the engines.  At each setting
both make independent groups of pixels; a statistic's standard error is its spread over these groups, on either side,
and z the difference over both errors.  The relative error stands beside it, as enough spikes make any difference
significant.  Correlations, lines and slopes have absolute errors.

python -m benchmarks.literal_pixel --only dead_time
python -m benchmarks.literal_pixel --page docs/within_the_frame.md
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))  # as a file: `python benchmarks/literal_pixel.py`

from scipy import stats
from tqdm import tqdm

from benchmarks.literal.cases import Case, cases
from benchmarks.literal.statistics import LIMIT, Comparison, compared
from spikecam_env.errors import InputError
from spikecam_env.sensor.effect_sheet import Sheet
from spikecam_env.sensor.effects import CATALOGUE
from spikecam_env.whole import check_file, write_text_whole

ENGINES = ("reference", "fast")
COMMAND = "python -m benchmarks.literal_pixel"
BEGIN, END = "<!-- literal_pixel: begin -->", "<!-- literal_pixel: end -->"


@dataclass(frozen=True)
class Row:
    """One statistic of one setting by one engine."""

    effect: str
    setting: str
    statistic: str
    engine_name: str
    comparison: Comparison

    @property
    def verdict(self) -> str:
        return "agrees" if self.comparison.agrees else "DIFFERS"


@dataclass(frozen=True)
class Refusal:
    """A setting that the sensor refuses, and its words."""

    effect: str
    setting: str
    words: str


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="NAME", help="effects to compare, `light` among them; default all")
    parser.add_argument("--quick", action="store_true", help="one setting each of the nine hardest effects")
    parser.add_argument("--seed", type=_count, default=1)
    parser.add_argument("--groups", type=_count, help="independent groups of pixels a setting; default by setting")
    parser.add_argument("--frames", type=_count, help="frames a setting, 64 or more; default by setting")
    parser.add_argument(
        "--out", type=Path, help="write every comparison: JSON, or a Markdown table where it ends in .md"
    )
    parser.add_argument("--page", type=Path, help="write the largest errors into this page, between its markers")
    parser.add_argument("--all", action="store_true", help="print comparisons that agree too")
    options = parser.parse_args()
    try:
        for path in filter(None, (options.out, options.page)):
            check_file(path)
        chosen = list(chosen_cases(options.only, options.quick, options.groups, options.frames))
        text = options.page and _page_text(options.page)
    except InputError as error:
        parser.error(str(error))
    rows: list[Row] = []
    refusals: list[Refusal] = []
    for number, case in enumerate(tqdm(chosen, unit="setting")):
        refusal = refused(case)
        if refusal:
            refusals.append(refusal)
            tqdm.write(f"{refusal.effect:27s} {refusal.setting:32s} REFUSED: {refusal.words}")
            continue
        for row in compare(case, options.seed * 1000 + number):
            rows.append(row)
            if options.all or not row.comparison.agrees:
                tqdm.write(_line(row))
    if not rows:
        print("nothing compared: every setting is refused")
        return 0
    print(summary(rows, refusals))
    if options.out:
        write_text_whole(options.out, _written(rows, options.out.suffix))
    if text:
        write_text_whole(options.page, _between_markers(text, largest_errors(rows, refusals)))
    return int(any(not row.comparison.agrees for row in rows))


def chosen_cases(
    only: list[str] | None = None, quick: bool = False, groups: int | None = None, frames: int | None = None
) -> Iterable[Case]:
    """The settings asked for.  Raises InputError for an effect that has none, and for too few groups or frames."""
    named = {case.effect for case in cases()}
    for name in only or ():
        if name not in named:
            raise InputError(f"--only {name}: not an effect with settings; choose from {', '.join(sorted(named))}")
    if groups is not None and groups < 8:
        raise InputError(f"--groups {groups}: a standard error needs 8 groups or more")
    if frames is not None and frames < 64:
        raise InputError(f"--frames {frames}: it must be 64 or more")
    for case in cases():
        if (case.quick or not quick) and (not only or case.effect in only):
            yield replace(case, groups=groups or case.groups, frames=frames or case.frames)


def refused(case: Case) -> Refusal | None:
    """Whether, and why, the sensor refuses a setting."""
    try:
        case.check()
    except InputError as error:
        return Refusal(case.effect, case.label, str(error))
    return None


def compare(case: Case, seed: int) -> Iterable[Row]:
    """Every statistic of a setting, by both engines."""
    literal = case.literal(seed)
    for engine in ENGINES:
        spikes = case.engine(engine, seed)
        for statistic in case.statistics:
            yield Row(case.effect, case.label, statistic.name, engine, compared(statistic, literal, spikes))


def summary(rows: list[Row], refusals: list[Refusal]) -> str:
    """Number of comparisons, of differences, of those by chance, and of refused settings."""
    worst = max(rows, key=lambda row: abs(row.comparison.z))
    differ = sum(not row.comparison.agrees for row in rows)
    by_chance = len(rows) * 2.0 * float(stats.norm.sf(LIMIT))
    return (
        f"{len(rows)} comparisons, {differ} beyond |z| = {LIMIT:g}; by chance alone one or more would be in "
        f"{by_chance:.1%} of runs (Bonferroni); {len(refusals)} settings are refused\n"
        f"largest: {_line(worst)}\n{'FAIL' if differ else 'PASS'}"
    )


def largest_errors(rows: list[Row], refusals: list[Refusal]) -> str:
    """A line an effect: how it acts within a frame, and the comparison with the largest |z|; then refused settings."""
    lines = [
        f"{len(rows)} comparisons, {sum(not row.comparison.agrees for row in rows)} beyond abs(z) = {LIMIT:g}; "
        f"{len(refusals)} settings are refused.",
        "",
        _head(
            "effect", "within a frame", "comparisons", "largest abs(z)", "literal", "engine", "z", "error", "command"
        ),
    ]
    for name in dict.fromkeys(row.effect for row in rows):
        own = [row for row in rows if row.effect == name]
        worst = max(own, key=lambda row: abs(row.comparison.z))
        c = worst.comparison
        lines.append(
            f"| {name} | {_within(name)} | {len(own)} | {worst.setting}; {worst.statistic}; {worst.engine_name} | "
            f"{c.literal:.5f} | {c.engine:.5f} | {c.z:+.1f} | {c.error:+.2%} | `{COMMAND} --only {name}` |"
        )
    if refusals:
        lines += ["", "Refused, in the sensor's words:", "", _head("effect", "setting", "refusal")]
        lines += [f"| {r.effect} | {r.setting} | {r.words} |" for r in refusals]
    return "\n".join(lines)


def _head(*names: str) -> str:
    return "\n".join(["".join(f"| {name} " for name in names) + "|", "|---" * len(names) + "|"])


def _within(name: str) -> str:
    if name not in CATALOGUE:
        return "integrated over the frame"
    return Sheet.of(CATALOGUE[name]).sections.get("Within a frame", "").rstrip(".")


def _line(row: Row) -> str:
    c = row.comparison
    return (
        f"{row.effect:27s} {row.setting:32s} {row.statistic:22s} {row.engine_name:9s} literal {c.literal:9.5f}  "
        f"engine {c.engine:9.5f}  z {c.z:+7.1f}  error {c.error:+8.2%}  {row.verdict}"
    )


def _written(rows: list[Row], suffix: str) -> str:
    if suffix != ".md":
        return json.dumps([{**asdict(row), "verdict": row.verdict} for row in rows], indent=1) + "\n"
    head = _head("effect", "setting", "statistic", "engine", "literal", "engine's", "z", "error", "verdict") + "\n"
    return head + "".join(
        f"| {r.effect} | {r.setting} | {r.statistic} | {r.engine_name} | {r.comparison.literal:.5f} | "
        f"{r.comparison.engine:.5f} | {r.comparison.z:+.2f} | {r.comparison.error:+.3%} | {r.verdict} |\n"
        for r in rows
    )


def _page_text(path: Path) -> str:
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    if text.count(BEGIN) != 1 or text.count(END) != 1 or text.index(BEGIN) > text.index(END):
        raise InputError(f"--page {path}: it must hold the lines {BEGIN} and {END} once, in this order")
    return text


def _between_markers(text: str, table: str) -> str:
    return f"{text[: text.index(BEGIN)]}{BEGIN}\n\n{table}\n\n{text[text.index(END) :]}"


def _count(text: str) -> int:
    number = int(text)
    if not 1 <= number <= 10**6:
        raise ValueError
    return number


if __name__ == "__main__":
    raise SystemExit(main())
