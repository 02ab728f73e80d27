"""Every Python block and every command line of README and docs: run, at small size, or read by its parser."""

from __future__ import annotations

import io
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import pytest
from page_running import Page, alternatives, is_name_alone, read

from spikecam_env.cli.first_words import check_words
from spikecam_env.cli.main import COMMANDS as SPIKECAM
from tools.page_blocks import COMMANDS, NAMES, PAGES, PYTHON, ROOT, blocks_of, inline_commands
from tools.site.commands import every_command, examples_of

SLOW = {
    "docs/agents.md",
    "docs/gap.md",
    "docs/howto/train.md",
    "docs/live.md",
    "docs/play_and_view.md",
    "docs/scenes.md",
    "docs/tutorials/calibrate.md",
    "docs/tutorials/denoise.md",
    "docs/tutorials/first_diagnosis.md",
}
"""Pages that take long."""
LONGEST_S = 300
"""In which a page is done, on a busy machine too: a command of it that goes on for ever is an error, and is said so."""


@contextmanager
def ended_within(seconds: int, what: str) -> Iterator[None]:
    def over(*_: object) -> None:
        raise TimeoutError(f"{what} takes more than {seconds} s: does a command of it go on for ever?")

    before = signal.signal(signal.SIGALRM, over)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def with_blocks() -> list[object]:
    runnable = [page for page in PAGES if any(b.kind in (PYTHON, COMMANDS) for b in blocks_of(page.read_text("utf-8")))]
    marks = {name: [pytest.mark.slow] for name in SLOW}
    return [pytest.param(page, id=NAMES[page], marks=marks.get(NAMES[page], [])) for page in runnable]


@pytest.mark.parametrize("page", with_blocks())
def test_what_a_page_shows_works(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, record_property) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    shown = Page(ModuleType("the_page"), monkeypatch)
    monkeypatch.setitem(sys.modules, "the_page", shown.module)
    began = time.process_time()
    blocks = blocks_of(page.read_text(encoding="utf-8"))
    elsewhere = next((block.marks["tested by"] for block in blocks if "tested by" in block.marks), "")
    with ended_within(LONGEST_S, NAMES[page]):
        for block in blocks:
            shown.do(block, f"run by {elsewhere}" if elsewhere else "")
    assert not elsewhere or page.name in (ROOT / elsewhere).read_text(encoding="utf-8")
    record_property("pages", {what: {"count": count} for what, count in shown.counts.items()})
    print(f"{NAMES[page]}: {time.process_time() - began:.1f} s", dict(shown.counts))


def test_a_page_that_goes_on_for_ever_is_an_error() -> None:
    with pytest.raises(TimeoutError, match="the page takes more than 1 s"), ended_within(1, "the page"):
        time.sleep(30)


@pytest.mark.parametrize("page", PAGES, ids=NAMES.get)
def test_command_lines_within_the_text_are_understood(page: Path) -> None:
    for code in inline_commands(page.read_text(encoding="utf-8")):
        if is_name_alone(code):
            check_name(code)
        else:
            for line in alternatives(code):
                read_shorthand(line)


def read_shorthand(line: str) -> None:
    """Read a command line of the text, which may leave out required options, or ask for help."""
    said = io.StringIO()
    try:
        with redirect_stderr(said), redirect_stdout(said):
            read(line)
    except SystemExit as exit:
        assert exit.code == 0 or "required" in said.getvalue().lower(), said.getvalue()


def check_name(code: str) -> None:
    program, *words = code.split()
    if program == "spikecam":
        check_words(words, SPIKECAM)
    elif not words[1].endswith(".NAME"):
        assert find_spec(words[1]), f"no module {words[1]}"


@pytest.mark.parametrize(
    "words, kind", [*every_command()], ids=lambda value: " ".join(value) if isinstance(value, tuple) else ""
)
def test_examples_of_the_help_are_understood(words: tuple[str, ...], kind: type) -> None:
    for line in examples_of(kind):
        read(line.partition("  #")[0])
