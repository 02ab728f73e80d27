"""A plain text table, right-aligned but for its first column."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows of one shape as aligned text; floats are printed with four significant digits."""
    if not rows:
        return "(nothing)"
    head = list(rows[0])
    cells = [head, *([_text(row.get(name)) for name in head] for row in rows)]
    widths = [max(len(line[i]) for line in cells) for i in range(len(head))]
    lines = [
        "  ".join(c.ljust(w) if i == 0 else c.rjust(w) for i, (c, w) in enumerate(zip(line, widths, strict=True)))
        for line in cells
    ]
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])


def markdown(rows: Sequence[Mapping[str, Any]]) -> str:
    """The same rows as a table of Markdown."""
    head = list(rows[0]) if rows else ["(nothing)"]
    lines = [head, ["---"] * len(head), *([_text(row.get(name)) for name in head] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _text(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)
