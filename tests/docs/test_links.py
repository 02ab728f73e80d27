"""Links of README and docs lead to files and headings that are there."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

from tools.page_blocks import NAMES, PAGES, ROOT, without_code

LINK = re.compile(r"\[[^\]]*\]\((?P<path>[^)#\s]*)(?:#(?P<anchor>[^)\s]*))?\)|src=\"(?P<src>[^\"]+)\"")
HEADING = re.compile(r"^#{1,6} (.+?)$", re.MULTILINE)


@cache
def headings(page: Path) -> set[str]:
    """Anchors of a page, as Sphinx and code hosts form them."""
    found: set[str] = set()
    for title in HEADING.findall(without_code(page.read_text(encoding="utf-8"))):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title).replace("`", "").lower()
        slug = re.sub(r"[^\w\- ]", "", plain.strip()).replace(" ", "-")
        found.add(slug if slug not in found else next(s for n in range(1, 99) if (s := f"{slug}-{n}") not in found))
    return found


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CHANGELOG.md"], ids=lambda page: NAMES.get(page, page.name))
def test_every_link_within_the_repository_leads_somewhere(page: Path) -> None:
    text = re.sub(r"`[^`\n]*`", "", without_code(page.read_text(encoding="utf-8")))
    for link in LINK.finditer(text):
        path, anchor = link["path"] or link["src"] or "", link["anchor"]
        if "://" in path or path.startswith("mailto:"):
            continue
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{link[0]} leads nowhere"
        assert target.is_relative_to(ROOT), f"{link[0]} leads out of the repository"
        if anchor and target.suffix == ".md":
            assert anchor in headings(target), f"{link[0]}: no such heading"
