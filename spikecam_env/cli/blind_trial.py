"""`spikecam blind-trial`: how often a diagnosis is right, on campaigns whose effects it cannot know."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import spikecam_env
from spikecam_env.cli.options import Count, Workers
from spikecam_env.errors import InputError
from spikecam_env.stopping import without_interrupts
from spikecam_env.whole import reason

WORLD = Path(spikecam_env.__file__).resolve().parents[1] / "tests" / "hidden_world"


@dataclass
class BlindTrial:
    """Generate campaigns with hidden effects, diagnose them, open the keys and score.

    What is done already in OUT is not done again; trial.md has the figures so far at any time, of cases in the order
    of their opaque ids, a fair sample.  The part `report` is for figures: do not tune on it.

    example:  spikecam blind-trial --set quick --part tune --jobs 2 --out trial
    """

    out: Path
    """Folder for manifest, sealed keys, results, trial.json and trial.md."""
    set: Literal["quick", "full"] = "quick"
    """Which set of cases."""
    part: Literal["tune", "report", "verify"] = "tune"
    """Disjoint seeds: one to work on, two to judge by, of other outside mechanisms; `verify` was looked at last."""
    jobs: Workers = 1
    """Cases at once, each in a process of its own."""
    threads: Workers = 1
    """Threads of each diagnosis."""
    only: list[str] = field(default_factory=list)
    """Groups: none, strong, weak, base, outside, left_out, pair, tricky, severe; default all."""
    hiding: list[str] = field(default_factory=list)
    """Mechanisms: cases that hide one of them, alone or beside another; default all."""
    limit: Count | None = None
    """At most so many cases of each group."""
    record: Path | None = None
    """File that holds all results, a line each: what it has is not done again, and what is done is written to it."""
    keep: bool = False
    """Keep the campaigns' data (some 100 MB each)."""
    world: Path = WORLD
    """Folder of the hidden world, in the package's checkout."""
    diagnose: str = "spikecam_env.cli.blind_trial:diagnosed"
    """module:function that is tried: (campaign, model, out, seed, exclude, threads) -> what diagnosis.json holds."""

    def run(self) -> None:
        from spikecam_env.cli.files import out_folder

        with out_folder(self.out):
            self._go_on()

    def _go_on(self) -> None:
        from tqdm import tqdm

        trial = hidden_world(self.world)
        record = importlib.import_module("tests.hidden_world.record")
        try:
            picked = trial.chosen(self.set, self.part, self.only, self.limit, self.hiding)
            if self.record:
                record.unpack(self.record, self.out, {case.id for case in trial.cases(self.set, self.part)})
            steps = trial.run_trial(
                self.out,
                self.set,
                self.part,
                self.diagnose,
                picked=picked,
                jobs=self.jobs,
                threads=self.threads,
                keep=self.keep,
                starting=without_interrupts,
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
    found = diagnose(campaign, model, seed=seed, exclude=exclude, jobs=threads, progress=False)
    found.write(out)
    write_report(found, out / "report.html")
    return json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))


def hidden_world(folder: Path) -> Any:
    """Its module `trial`; raises InputError where the folder is not the hidden world."""
    if not (folder / "trial.py").is_file():
        raise InputError(
            f"there is no hidden world at {folder}; it comes with the source checkout, not with the installed "
            "package: clone the repository and give its tests/hidden_world as --world"
        )
    root = str(folder.resolve().parents[1])
    if root not in sys.path:
        sys.path.insert(0, root)
    return importlib.import_module("tests.hidden_world.trial")
