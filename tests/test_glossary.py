"""The glossary: every word once, in a sentence or two, with files that are there; and the docs that lead to it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
GLOSSARY = (ROOT / "docs/glossary.md").resolve()
ROW = re.compile(r"^\| (?P<term>.+?) \| (?P<meaning>.+) \| (?P<files>`[^|]+`) \|$", re.MULTILINE)
ROWS = [row.groupdict() for row in ROW.finditer(GLOSSARY.read_text(encoding="utf-8"))]
FILES = sorted({file for row in ROWS for file in re.findall(r"`([^`]+)`", row["files"])})


def test_every_line_of_a_table_is_a_term() -> None:
    lines = [line for line in GLOSSARY.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    assert len(ROWS) == len([line for line in lines if not line.startswith("| term |")]) >= 30


@pytest.mark.parametrize("file", FILES)
def test_a_file_that_it_names_exists(file: str) -> None:
    assert (ROOT / file).is_file() or (ROOT / "spikecam_env/gap" / file).is_file()


def test_a_term_has_one_meaning() -> None:
    terms = [term for row in ROWS for term in row["term"].split(", ")]
    assert len(terms) == len(set(terms))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["term"])
def test_a_meaning_is_a_sentence_or_two(row: dict[str, str]) -> None:
    assert 1 <= len(re.findall(r"[.] (?=[A-Z*])|[.]$", row["meaning"])) <= 2
    assert len(row["meaning"].split()) <= 50


@pytest.mark.parametrize("page", ["README.md", "docs/architecture.md", "docs/gap.md"])
def test_a_page_leads_to_it(page: str) -> None:
    links = re.findall(r"\]\(([^)]+)\)", (ROOT / page).read_text(encoding="utf-8"))
    assert GLOSSARY in [((ROOT / page).parent / link).resolve() for link in links]
