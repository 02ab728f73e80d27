"""Answers under seal: written before anything is diagnosed, their hashes published, opened by the scorer alone.

OUT/manifest.json        the trial: opaque ids, model, names left out, SHA-256 of each key
OUT/sealed/ID.json       the key: hidden mechanisms and right answers
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tests.hidden_world.cases import Case


class BrokenSealError(RuntimeError):
    """A key that is not the one whose hash was published."""


def seal(cases: Sequence[Case], out: Path, title: dict[str, str]) -> dict[str, Any]:
    """Write the keys and then the manifest, in the order of ids; returns the manifest.

    Errors: ValueError if `out` holds a manifest of other cases.
    """
    (out / "sealed").mkdir(parents=True, exist_ok=True)
    texts = {case.id: key_text(case) for case in cases}
    entries = [
        {"id": case.id, "model": case.model, "exclude": list(case.exclude), "key_sha256": _hash(texts[case.id])}
        for case in sorted(cases, key=lambda case: case.id)
    ]
    manifest = {"format": "spikecam-trial/1", **title, "cases": entries}
    path = out / "manifest.json"
    if path.exists() and json.loads(path.read_text(encoding="utf-8")) != manifest:
        raise ValueError(f"{path} is of another trial (other set, part or cases); take another folder or remove it")
    for name, text in texts.items():
        write_whole(out / "sealed" / f"{name}.json", text)
    write_whole(path, json.dumps(manifest, indent=1) + "\n")
    return manifest


def open_key(out: Path, case_id: str) -> dict[str, Any]:
    """The key of a case; raises BrokenSealError unless it is the one that was published."""
    manifest = json.loads((out / "manifest.json").read_text(encoding="utf-8"))
    published = {entry["id"]: entry["key_sha256"] for entry in manifest["cases"]}[case_id]
    text = (out / "sealed" / f"{case_id}.json").read_text(encoding="utf-8")
    if _hash(text) != published:
        raise BrokenSealError(f"the key of {case_id} is not the one sealed: {_hash(text)}, published {published}")
    return json.loads(text)


def key_text(case: Case) -> str:
    """The key as it is hashed."""
    return json.dumps(asdict(case), indent=1, sort_keys=True) + "\n"


def write_whole(path: Path, text: str) -> None:
    """Write beside, then rename."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        beside.write_text(text, encoding="utf-8")
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
