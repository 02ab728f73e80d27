"""The page of a diagnosis' settings: a table a stage, from their declarations."""

from __future__ import annotations

import inspect
from dataclasses import Field, fields
from typing import Any

from spikecam_env.gap.settings import Deviance, DiagnosisSettings


def page() -> str:
    """A section a stage, Markdown."""
    stages = DiagnosisSettings()
    return "\n".join(_section(f.name, getattr(stages, f.name)) for f in fields(stages))


def _section(stage: str, settings: Any) -> str:
    rows = [_row(f, getattr(settings, f.name)) for f in fields(settings)]
    table = ["| setting | value | unit | what it decides | source |", "|---|---|---|---|---|", *rows]
    lines = [f"## {stage}", "", inspect.getdoc(settings) or "", "", *table, ""]
    return "\n".join([*lines, *(_derived() if isinstance(settings, Deviance) else [])])


def _row(declared: Field[Any], value: Any) -> str:
    said = declared.metadata
    number = " to ".join(f"{v:g}" for v in value) if isinstance(value, tuple) else f"{value:g}"
    return f"| `{declared.name}` | {number} | {said['unit']} | {' '.join(said['what'].split())} | {said['source']} |"


def _derived() -> list[str]:
    """What follows from the thresholds of deviance."""
    default = Deviance()
    properties = {name: of for name, of in vars(Deviance).items() if isinstance(of, property)}
    rows = [
        f"| `{n}` | {getattr(default, n):g} | {' '.join((of.__doc__ or '').split())} |" for n, of in properties.items()
    ]
    return ["What follows from them:", "", "| threshold | value | what it decides |", "|---|---|---|", *rows, ""]
