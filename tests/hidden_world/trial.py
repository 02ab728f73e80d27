"""Run a trial: generate, diagnose, keep the answers; then open the keys and score.

A case that has a result is not run again, so that a trial can be stopped and gone on with.  Its campaign is deleted.

    OUT/manifest.json, sealed/     see `keys`          OUT/results/ID.json   the answer to a case
    OUT/trial.json, trial.md       the figures         OUT/campaigns/ID      only while it is at work, or with `keep`
"""

from __future__ import annotations

import importlib
import json
import resource
import shutil
import subprocess
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from tests.hidden_world.cases import GROUPS, Case, cases
from tests.hidden_world.keys import open_key, seal, write_whole
from tests.hidden_world.score import Figure, Scored, by_category, by_degree, by_effect, figures, score_case
from tests.hidden_world.world import write_campaign

Diagnose = Callable[[Path, str, Path, int, "tuple[str, ...]", int], "dict[str, Any]"]
"""(campaign folder, model, folder for its results, seed, names withheld, threads) -> diagnosis.json as a dictionary."""


def chosen(
    which: str, part: str, only: Sequence[str] = (), limit: int | None = None, hiding: Sequence[str] = ()
) -> list[Case]:
    """The cases of a set and part; of these groups; that hide one of these mechanisms, or are named after it; of each
    group at most `limit`, evenly spread."""
    for group in only:
        if group not in GROUPS:
            raise ValueError(f"there is no group {group!r}; choose of {', '.join(GROUPS)}")
    all_cases = cases(which, part)
    names = {name for case in all_cases for name in (case.what, *case.truth)}
    for name in hiding:
        if name not in names:
            raise ValueError(f"no case hides {name!r}; choose of {', '.join(sorted(names))}")
    if hiding:
        all_cases = [case for case in all_cases if {case.what, *case.truth} & set(hiding)]
    picked: list[Case] = []
    for group in only or GROUPS:
        some = [case for case in all_cases if case.group == group]
        count = len(some) if limit is None else min(limit, len(some))
        picked += [some[i * len(some) // count] for i in range(count)]
    return picked


def run_trial(
    out: Path,
    which: str,
    part: str,
    diagnose: str,
    *,
    picked: Sequence[Case],
    threads: int = 1,
    keep: bool = False,
    spread: Callable[[Callable[[Case], None], Sequence[Case]], Iterable[None]] = map,
) -> Iterator[tuple[int, int]]:
    """Do the missing cases; yields (done, all) as it goes on.  diagnose: `module:function`, see `Diagnose`.

    threads: of each diagnosis.  spread: does cases, one at a time or several.

    Keys are sealed and their hashes published before the first diagnosis.  Cases go in the order of their ids, which is
    that of no group: the cases of a trial that is cut short are a fair sample.
    """
    (out / "results").mkdir(parents=True, exist_ok=True)
    seal(cases(which, part), out, {"set": which, "part": part})
    waiting = sorted((case for case in picked if not is_done(out, case.id)), key=lambda case: case.id)
    done = len(picked) - len(waiting)
    yield done, len(picked)
    for _ in spread(partial(run_case, out=out, diagnose=diagnose, threads=threads, keep=keep), waiting):
        done += 1
        yield done, len(picked)


def is_done(out: Path, case_id: str) -> bool:
    """Whether a case has a diagnosis; one that ended in an error is tried again."""
    path = out / "results" / f"{case_id}.json"
    return path.exists() and "diagnosis" in json.loads(path.read_text(encoding="utf-8"))


def run_case(case: Case, out: Path, diagnose: str, threads: int, keep: bool) -> None:
    """Generate one campaign, have it diagnosed, and write down the answer; an exception is a result too."""
    campaign, work = out / "campaigns" / case.id, out / "diagnoses" / case.id
    began = time.perf_counter()
    write_campaign(case.recipe, campaign)
    took = round(time.perf_counter() - began, 2)
    result: dict[str, Any] = {"id": case.id, "code": code(), "threads": threads, "generate_s": took}
    began = time.perf_counter()
    try:
        function: Diagnose = _named(diagnose)
        result["diagnosis"] = function(campaign, case.model, work, 1, case.exclude, threads)
    except ImportError:
        raise
    except Exception:
        result["error"] = traceback.format_exc()
    result["seconds"] = round(time.perf_counter() - began, 2)
    result["peak_gib"] = round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20, 2)
    write_whole(out / "results" / f"{case.id}.json", json.dumps(result, indent=1) + "\n")
    if not keep:
        shutil.rmtree(campaign)


@lru_cache(maxsize=1)
def code() -> str:
    """The commit that this checkout is at, `-dirty` with changes; empty where there is no git."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--abbrev=7", "--exclude=*"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def _named(name: str) -> Diagnose:
    module, _, attribute = name.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except AttributeError as error:
        raise ImportError(f"{module} has no {attribute!r}") from error


def score_trial(out: Path, picked: Sequence[Case]) -> dict[str, Any]:
    """Open the keys of all cases with a result, score, and write trial.json and trial.md; returns the former."""
    scored: list[Scored] = []
    memory, by = 0.0, Counter[str]()
    for case in picked:
        path = out / "results" / f"{case.id}.json"
        if path.exists():
            result = json.loads(path.read_text(encoding="utf-8"))
            scored.append(score_case(open_key(out, case.id), result))
            memory = max(memory, float(result.get("peak_gib", 0.0)))
            by[result.get("code") or "unknown code"] += 1
    made = figures(scored)
    if memory:
        made.append(Figure("7", "largest process [GiB]", memory, "<= 4", len(scored)))
    trial = {
        "format": "spikecam-trial-score/1",
        "cases": len(scored),
        "of": len(picked),
        "errors": sum(bool(s.error) for s in scored),
        "code": dict(by),
        "figures": [{**asdict(f), "met": f.met} for f in made],
        "categories": by_category(scored),
        "degrees": by_degree(scored),
        "effects": by_effect(scored),
        "scored": [asdict(s) for s in scored],
    }
    write_whole(out / "trial.json", json.dumps(trial, indent=1) + "\n")
    write_whole(out / "trial.md", as_text(trial))
    return trial


def as_text(trial: dict[str, Any]) -> str:
    """The trial as a page of Markdown."""
    rows = [
        {
            "item": f["item"],
            "figure": f["what"],
            "value": f"{f['value']:.3g}" if f["low"] is None else f"{100 * f['value']:.0f} %",
            "90 %": "" if f["low"] is None else f"{100 * f['low']:.0f} - {100 * f['high']:.0f} %",
            "asked": f["asked"],
            "cases": f["cases"],
            "met": "yes" if f["met"] else "NO",
        }
        for f in trial["figures"]
    ]
    wrong = [s for s in trial["scored"] if not s["right"]]
    lines = [
        f"# Blind trial: {trial['cases']} of {trial['of']} cases, {trial['errors']} ended in an error",
        "",
        f"Diagnosed by {', '.join(f'{name} ({count})' for name, count in trial['code'].items()) or 'nobody'}.",
        "",
        _table(rows),
        "## By category and law",
        "",
        _table(trial["categories"]),
        "## By degree",
        "",
        _table(trial["degrees"]),
        "## By effect: right of tried, by group",
        "",
        _table(
            trial["effects"], ("effect", "strong", "severe", "weak", "base", "outside", "strength/limit", "answers")
        ),
        "## Not right",
        "",
        _table([{"id": s["id"], "group": s["group"], "true": _hidden(s), "said": s["answer"]} for s in wrong]),
    ]
    return "\n".join(lines)


def _hidden(scored: dict[str, Any]) -> str:
    """The hidden effect of a case, far laws named."""
    laws = ", ".join(law for law in scored["laws"] if law)
    return f"{scored['what']} ({laws})" if laws else scored["what"]


def _table(rows: Sequence[dict[str, Any]], columns: Sequence[str] = ()) -> str:
    if not rows:
        return "(none)\n"
    columns = columns or tuple(rows[0])
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    lines += ["| " + " | ".join(str(row.get(c, "")).replace("|", "/") for c in columns) + " |" for row in rows]
    return "\n".join(lines) + "\n"
