"""Links of README and docs lead to files and headings that are there; no page names a commit or somebody's own path."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
from page_blocks import NAMES, PAGES, ROOT, without_code

LINK = re.compile(r"\[[^\]]*\]\((?P<path>[^)#\s]*)(?:#(?P<anchor>[^)\s]*))?\)|src=\"(?P<src>[^\"]+)\"")
HEADING = re.compile(r"^#{1,6} (.+?)$", re.MULTILINE)
COMMIT = re.compile(r"(?<!code )(?<![\w./-])(?=[0-9a-f]*[a-f])(?=[0-9a-f]*[0-9])[0-9a-f]{7,40}(?![\w-])")
"""A word of hexadecimal digits with figures and letters in it; `code ...` is a digest of the sources, not a commit."""
ELSEWHERE = re.compile(r"\.\./shared|(?<![\w.])/work/|(?<![\w.])/home/(?!user\b)\w+")

STILL_TO_MEND = {
    "docs/calibration.md": ELSEWHERE,
    "docs/clock_feedthrough.md": ELSEWHERE,
    "docs/real_data.md": ELSEWHERE,
}
"""Pages that name a path which readers do not have, or the commit by which figures were made."""


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


@pytest.mark.parametrize("page", PAGES, ids=NAMES.get)
def test_no_page_names_a_commit_or_a_path_that_a_reader_does_not_have(page: Path) -> None:
    lines = page.read_text(encoding="utf-8").splitlines()
    known = STILL_TO_MEND.get(NAMES[page])
    said = {pattern: [f"{i}: {line.strip()}" for i, line in enumerate(lines, 1) if pattern.search(line)]
            for pattern in (COMMIT, ELSEWHERE)}  # fmt: skip
    assert not any(found for pattern, found in said.items() if pattern is not known), said
    assert known is None or said[known], f"{NAMES[page]} is mended: take it off STILL_TO_MEND"


@pytest.mark.parametrize("line, seen", [("since f73f6cd.", True), ("1000000 frames", False), ("defaced", False)])
def test_a_commit_is_seen_in_a_line_and_a_number_or_a_word_is_not(line: str, seen: bool) -> None:
    assert bool(COMMIT.search(line)) is seen
