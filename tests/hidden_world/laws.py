"""The table of laws in docs/blind_trial.md.

python -m tests.hidden_world.laws            writes it there
"""

from __future__ import annotations

from pathlib import Path

from tests.hidden_world.catalogue import BASE_EFFECTS, CATALOGUE

PAGE = Path(__file__).resolve().parents[2] / "docs" / "blind_trial.md"


def table() -> str:
    """Markdown: every law of every catalogue effect, near ones first."""
    lines = ["| effect | near or far | law | source |", "|---|---|---|---|"]
    for mechanism in (CATALOGUE | BASE_EFFECTS).values():
        lines.append(_row(mechanism.name, "near", mechanism.law, ""))
        lines += [_row("", f"far: {law.name}", law.law, law.source) for law in mechanism.far]
    return "\n".join(lines) + "\n"


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def between(page: str, name: str, text: str) -> str:
    """The page with this text between its markers; raises ValueError unless it has both lines once, in this order."""
    begin, end = (f"<!-- {name}: {side} -->\n" for side in ("begin", "end"))
    before, found, rest = page.partition(begin)
    _, closed, after = rest.partition(end)
    if not found or not closed or begin in rest or end in before + after:
        raise ValueError(f"it must hold the lines {begin.strip()} and {end.strip()} once, in this order")
    return before + begin + text + end + after


def with_table(page: str) -> str:
    """The page with the table in its place."""
    return between(page, "laws", table())


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
