"""How often a diagnosis is right, on campaigns whose effects it cannot know (docs/blind_trial.md).

    python -m benchmarks.blind_trial --set quick --part tune --jobs 2 --out trial

It runs in a checkout: the hidden effects are in `tests/hidden_world`, which is not installed.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

import tyro

from spikecam_env import stopping
from spikecam_env.cli.main import run_parsed
from spikecam_env.errors import InputError
from spikecam_env.numbers import Count, Workers
from spikecam_env.pool import spread
from spikecam_env.run_folder import run_folder
from spikecam_env.whole import reason
from tests.hidden_world import record, trial
from tests.hidden_world.cases import cases


@dataclass
class BlindTrial:
    """Generate campaigns with hidden effects, diagnose them, open the keys and score.

    Cases that are done in OUT are not repeated.  trial.md has the figures so far at any time, of cases in the order of
    their opaque ids, a fair sample.  The part `report` is for figures: do not tune on it.

    example:  python -m benchmarks.blind_trial --set quick --part tune --jobs 2 --out trial
    """

    out: Path
    """Folder for manifest, sealed keys, results, trial.json and trial.md."""
    set: Literal["quick", "full", "laws", "small"] = "quick"
    """Effects by their near laws, few or many; by near and far ones, with pairs and triples; these in small cameras."""
    part: Literal["tune", "report", "verify"] = "tune"
    """Disjoint seeds: one to work on, two to judge by, of other outside mechanisms; `verify` was looked at last."""
    jobs: Workers = 1
    """Cases at once, each in a process of its own."""
    threads: Workers = 1
    """Threads of each diagnosis."""
    only: list[str] = field(default_factory=list)
    """Groups: none, strong, weak, severe, base, outside, left_out, pair, tricky, strong_pair, triple; default all."""
    hiding: list[str] = field(default_factory=list)
    """Mechanisms: cases that hide one of them, alone or beside another; default all."""
    limit: Count | None = None
    """At most so many cases of each group."""
    record: Path | None = None
    """File of all results, a line each: its cases are not repeated, and new ones are added."""
    keep: bool = False
    """Keep the campaigns' data (some 100 MB each)."""
    diagnose: str = "benchmarks.blind_trial:diagnosed"
    """module:function that is tried: (campaign, model, out, seed, exclude, threads) -> content of diagnosis.json."""

    def run(self) -> None:
        with run_folder(self.out, "a trial"):
            self._go_on()

    def _go_on(self) -> None:
        from tqdm import tqdm

        try:
            picked = trial.chosen(self.set, self.part, self.only, self.limit, self.hiding)
            if self.record:
                record.unpack(self.record, self.out, {case.id for case in cases(self.set, self.part)})
            steps = trial.run_trial(
                self.out,
                self.set,
                self.part,
                self.diagnose,
                picked=picked,
                threads=self.threads,
                keep=self.keep,
                spread=partial(spread, jobs=self.jobs),
            )
            with tqdm(total=len(picked), unit="case") as bar:
                for done, _ in steps:
                    bar.update(done - bar.n)
                    scored = trial.score_trial(self.out, picked)
                    if self.record:
                        record.pack(self.out, self.record)
        except (ValueError, ImportError) as error:
            raise InputError(str(error)) from error
        except OSError as error:
            raise InputError(f"cannot use {error.filename or self.out}: {reason(error)}") from error
        print(trial.as_text(scored))
        print(f"wrote {self.out / 'trial.json'} and {self.out / 'trial.md'}")


def diagnosed(campaign: Path, model: str, out: Path, seed: int, exclude: Sequence[str], threads: int) -> dict[str, Any]:
    """`spikecam diagnose` as a trial wants it, its report included."""
    try:
        from spikecam_env.gap.diagnose import diagnose
        from spikecam_env.gap.report.page import write_report
    except ImportError as error:
        raise ImportError(f"this checkout has no spikecam_env.gap.diagnose to be tried ({error})") from error
    diagnosis = diagnose(campaign, model, seed=seed, exclude=exclude, jobs=threads, progress=False)
    diagnosis.write(out)
    write_report(diagnosis, out / "report.html")
    written: dict[str, Any] = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    return written


def run(args: list[str] | None = None) -> int:
    """Parse and run; returns the exit code."""
    options: Any = (tyro.conf.OmitArgPrefixes,)
    return run_parsed(lambda: tyro.cli(BlindTrial, prog="python -m benchmarks.blind_trial", args=args, config=options))


def main() -> None:
    """The program, which a signal stops as it stops the `spikecam` command."""
    with stopping.watched():
        code = run()
    stopping.finish(code)


if __name__ == "__main__":
    main()
