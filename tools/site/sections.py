"""Parts of a page, Markdown."""

from __future__ import annotations

import re

TABLE = re.compile(r"^\|.*\n\|[-|]+\n(?:\|.*\n)+", re.MULTILINE)


def section(text: str, title: str) -> str:
    """The text below a heading of second rank, up to the next one.

    Raises:
        ValueError: for a title that the page has not, or has twice.
    """
    [inside] = re.findall(rf"^## {re.escape(title)}\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    return str(inside)


def rows_of(text: str, task: str) -> list[str]:
    """Lines of the first table: its head, and the rows of one task; none where it has no row.

    Args:
        text: Markdown.
        task: as the first column names it, e.g. `Track-v1`.
    """
    table = TABLE.search(text)
    head, line, *rows = table[0].splitlines() if table else ("", "")
    found = [row for row in rows if re.match(rf"\| {re.escape(task)}\b", row)]
    return [head, line, *found] if found else []
