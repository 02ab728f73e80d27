"""Pages of the documentation: how long they may be, the pictures they promise, and words that no reader can use."""

from __future__ import annotations

import ast
import re
import shlex
from pathlib import Path

import pytest

from tools import code_width, diagnosis_figure
from tools.code_width import WIDTH
from tools.page_blocks import TEXT, blocks_of, command_lines, without_code

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(page for page in DOCS.rglob("*.md") if "_build" not in page.parts)]
TUTORIALS = sorted((DOCS / "tutorials").glob("*.md"))
LENGTHS = {
    "README.md": 120,
    **{f"docs/howto/add_{what}.md": 50 for what in ("an_effect", "a_scene", "a_statistic", "a_task")},
    **{f"docs/tutorials/{page.name}": 95 for page in TUTORIALS},
    "docs/explanation/diagnosis.md": 100,
    "docs/results.md": 60,
}
"""Most lines of a page, whose code has 88 columns."""
LONG = 3000
"""Words of a page from which on a list of its contents stands on top: ten minutes of reading and more."""
MOST_BYTES = 100_000
"""Of a tutorial's picture."""
UNUSABLE = {
    "a commit": r"\b(?=[0-9a-f]*[a-f])(?=[0-9a-f]*[0-9])[0-9a-f]{7,40}\b",
    "the history of the work": r"git log",
    "a folder that only the authors have": r"\.\./shared|(?<![\w/])/work/",
}


@pytest.mark.parametrize(("page", "most"), LENGTHS.items())
def test_a_page_is_short(page: str, most: int) -> None:
    shown = re.sub(r"^<!--.*-->\n", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.MULTILINE)
    lines = len(shown.splitlines())
    print(f"{page}: {lines} lines of at most {most}")
    assert lines <= most


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_long_page_begins_with_links_to_all_its_chapters(page: Path) -> None:
    text = without_code(page.read_text(encoding="utf-8"))
    top, *chapters = re.split(r"^## ", text, flags=re.MULTILINE)
    words = len(text.split())
    print(f"{page.name}: {words} words, {len(chapters)} chapters")
    assert words < LONG or top.count("](#") == len(chapters)


@pytest.mark.parametrize("page", PAGES[1:], ids=lambda page: page.relative_to(ROOT).as_posix())
def test_no_line_of_code_is_longer_than_the_article_shows(page: Path) -> None:
    blocks = blocks_of(page.read_text(encoding="utf-8"))
    lines = {f"{block.line + i}: {line}" for block in blocks if block.kind != TEXT
             for i, line in enumerate(block.code.splitlines()) if len(line) > WIDTH}  # fmt: skip
    assert not lines, f"python -m tools.code_width {page.relative_to(ROOT)}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_the_size_at_which_code_is_tested_replaces_words_that_are_in_it(page: Path) -> None:
    for block in blocks_of(page.read_text(encoding="utf-8")):
        assert block.small or not block.code


def test_wrapped_code_says_the_same() -> None:
    """Words of a command line, and the syntax tree of Python, stay as they were; code that fits stays too."""
    line = "spikecam film clip.mp4 --film-rate 1000 --transfer linear --mean-interval 6 --out clip.h5  # 'a' clip"
    assert [shlex.split(one) for one in command_lines(code_width.commands(f"{line}\n"))] == [
        shlex.split(line, comments=True)
    ]
    code = f"value = dict({', '.join(f'name_{n}={n}' for n in range(12))})  # all of them\n"
    made = code_width.python(code)
    assert ast.dump(ast.parse(made)) == ast.dump(ast.parse(code)) and "# all of them\n" in made
    assert max(map(len, made.splitlines())) <= WIDTH < len(code)
    assert code_width.commands("spikecam demo  # a disk\n") == "spikecam demo  # a disk\n"


def test_there_are_eight_tutorials() -> None:
    assert len(TUTORIALS) == 8


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_a_tutorial_shows_the_picture_that_its_own_code_makes(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    (shown,) = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", text)
    (saved,) = re.findall(r'savefig\("([^"]+)"', text)
    assert shown == saved and (page.parent / shown).stat().st_size < MOST_BYTES


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_page_names_nothing_that_its_reader_does_not_have(page: Path) -> None:
    text = re.sub(r"code [0-9a-f]{12}", "", page.read_text(encoding="utf-8"))  # generated figures state their code
    found = {what: re.findall(pattern, text) for what, pattern in UNUSABLE.items()}
    assert not any(found.values()), found


def test_every_link_of_the_readme_leads_to_a_file() -> None:
    links = re.findall(r"\]\(([^)#\s]+)", (ROOT / "README.md").read_text(encoding="utf-8"))
    missing = [link for link in links if not link.startswith("http") and not (ROOT / link).exists()]
    assert links and not missing, missing


def test_the_figure_of_the_diagnosis_is_drawn_by_its_command(tmp_path: Path) -> None:
    diagnosis_figure.main([str(tmp_path / "diagnosis.svg")])
    drawn, shipped = (
        re.findall(r">([^<>]+)</text>", path.read_text(encoding="utf-8"))
        for path in (tmp_path / "diagnosis.svg", DOCS / "explanation" / "diagnosis.svg")
    )
    assert drawn == shipped and {name for stages, _ in diagnosis_figure.ROWS for name, _ in stages} <= set(drawn)


def test_the_figure_s_command_says_how_to_call_it() -> None:
    with pytest.raises(SystemExit, match=r"tools\.diagnosis_figure docs/explanation/diagnosis\.svg"):
        diagnosis_figure.main([])
