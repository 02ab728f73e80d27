"""The page of a diagnosis' settings: a table a stage, from their declarations."""

from __future__ import annotations

import inspect
import math
from dataclasses import Field, fields
from typing import Any

from spikecam_env.gap.settings import DiagnosisSettings


def page() -> str:
    """A section a stage, Markdown."""
    stages = DiagnosisSettings()
    return "\n".join(_section(f.name, getattr(stages, f.name)) for f in fields(stages))


def _section(stage: str, settings: Any) -> str:
    rows = [_row(f, getattr(settings, f.name)) for f in fields(settings)]
    table = ["| setting | value | unit | range | what it decides | source |", "|---|---|---|---|---|---|", *rows]
    lines = [f"## {stage}", "", inspect.getdoc(settings) or "", "", *table, ""]
    return "\n".join([*lines, *_derived(settings)])


def _row(declared: Field[Any], value: Any) -> str:
    said = declared.metadata
    what = " ".join(said["meaning"].split())
    return f"| `{declared.name}` | {value:g} | {said['unit']} | {_range(declared)} | {what} | {said['source']} |"


def _range(declared: Field[Any]) -> str:
    """What a setting may be."""
    (least, most), whole = declared.metadata["range"], isinstance(declared.default, int)
    least = max(least, 1) if whole else least
    low = f"{least:g} or more" if least else "above 0"
    return low if most == math.inf else f"{least:g} to {most:g}" if least else f"above 0, to {most:g}"


def _derived(settings: Any) -> list[str]:
    """What follows from the settings of a stage."""
    properties = {name: of for name, of in vars(type(settings)).items() if isinstance(of, property)}
    rows = [
        f"| `{name}` | {_number(getattr(settings, name))} | {' '.join((of.__doc__ or '').split())} |"
        for name, of in properties.items()
    ]
    table = ["| what follows | value | what it decides |", "|---|---|---|", *rows, ""]
    return table if rows else []


def _number(value: Any) -> str:
    return " to ".join(f"{v:.3g}" for v in value) if isinstance(value, tuple) else f"{value:.4g}"
