"""A trial in one file: a line a case, its secret, its diagnosis and the code that made it, to be scored anew or gone on
with.

Parts of a diagnosis that scoring does not need are left out.
"""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

from tests.hidden_world.keys import open_key, write_whole
from tests.hidden_world.trial import is_done

SAID = ("verdict", "effects", "unknown", "class", "parameters", "data", "not_testable", "simulated")
"""Entries of a diagnosis that are kept; of its gap, all but those by recording."""


def pack(out: Path, record: Path) -> int:
    """Write all results in OUT that hold a diagnosis to a record, in the order of their ids; returns how many."""
    found = [json.loads(p.read_text(encoding="utf-8")) for p in sorted((out / "results").glob("*.json"))]
    lines = [json.dumps({**in_short(r), "hidden": _hidden(out, r["id"])}) for r in found if "diagnosis" in r]
    write_whole(record, "".join(line + "\n" for line in lines))
    return len(lines)


def unpack(record: Path, out: Path, ids: Collection[str]) -> int:
    """Add the results of a record that OUT lacks; returns their number.

    ids: of the trial's cases.
    Errors: ValueError if a line of it is no result, or of another trial; OSError if its folder can't be made.
    """
    (out / "results").mkdir(parents=True, exist_ok=True)
    record.parent.mkdir(parents=True, exist_ok=True)
    lines = record.read_text(encoding="utf-8").splitlines() if record.exists() else []
    results = [_result(line, record) for line in lines]
    if others := {r["id"] for r in results} - set(ids):
        raise ValueError(
            f"{record} is of another trial (other set, part or cases): it has {min(others)}; take another file"
        )
    lacking = [r for r in results if not is_done(out, r["id"])]
    for result in lacking:
        write_whole(out / "results" / f"{result['id']}.json", json.dumps(result, indent=1) + "\n")
    return len(lacking)


def _hidden(out: Path, case_id: str) -> list[str]:
    """The secret of a case, `name` by its near law or `name/law` by a far one; its diagnosis is done."""
    hidden = open_key(out, case_id)["recipe"]["hidden"]
    return [f"{h['name']}/{h['law']}" if h["law"] else h["name"] for h in hidden]


def _result(line: str, record: Path) -> dict[str, Any]:
    try:
        result: dict[str, Any] = json.loads(line)
        if {"id", "diagnosis"} <= set(result):
            return result
    except (ValueError, TypeError):
        pass
    raise ValueError(f"{record} is no record of a trial: {line[:60]!r} is no result")


def in_short(result: dict[str, Any]) -> dict[str, Any]:
    """A result with the scored parts of its diagnosis."""
    said = result["diagnosis"]
    gap = said.get("gap")
    kept = {key: said[key] for key in SAID if key in said}
    kept["gap"] = gap and {key: value for key, value in gap.items() if key != "by_recording"}
    return {**result, "diagnosis": kept}
