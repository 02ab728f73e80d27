"""The table of laws in docs/blind_trial.md.

python -m tests.hidden_world.laws            writes it there
"""

from __future__ import annotations

from pathlib import Path

from tests.hidden_world.catalogue import BASE_EFFECTS, CATALOGUE

PAGE = Path(__file__).resolve().parents[2] / "docs" / "blind_trial.md"
BEGIN, END = "<!-- laws: begin -->\n", "<!-- laws: end -->\n"


def table() -> str:
    """Markdown: every law of every catalogue effect, near ones first."""
    lines = ["| effect | near or far | law | source |", "|---|---|---|---|"]
    for mechanism in (CATALOGUE | BASE_EFFECTS).values():
        lines.append(_row(mechanism.name, "near", mechanism.law, ""))
        lines += [_row("", f"far: {law.name}", law.law, law.source) for law in mechanism.far]
    return "\n".join(lines) + "\n"


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def with_table(page: str) -> str:
    """The page with the table in its place."""
    before, rest = page.split(BEGIN)
    return before + BEGIN + table() + END + rest.split(END)[1]


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
