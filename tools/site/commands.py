"""The command line reference: the texts of `spikecam ... --help` as Markdown."""

from __future__ import annotations

import inspect
import io
import os
import re
from collections.abc import Iterator
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

from spikecam_env.cli.first_words import commands_of
from spikecam_env.cli.main import COMMANDS, run

COLUMNS = "100"
"""Of the terminal that help is printed for; wide enough for one column of boxes, too narrow for two."""
ENDING = re.compile(r" ?\((?:(default): (?P<default>.*)|(?P<word>required|repeatable))\)$")


@dataclass(frozen=True)
class Option:
    """One entry of a help text; its default may be "required" or "repeatable"."""

    written: str
    meaning: str
    default: str


def page() -> str:
    """Markdown: a section a command, its commands below it, an entry an option."""
    return "\n".join(line for words, kind in every_command() for line in _section(words, kind))


def every_command() -> Iterator[tuple[tuple[str, ...], Any]]:
    """(words, class of options) of each command, and of those below it, in the order of the help."""
    for name, kind in COMMANDS.items():
        yield (name,), kind
        for word, below in commands_of(kind).items():
            yield (name, word), below


def options_of(words: tuple[str, ...]) -> list[Option]:
    """The options that the parser prints for a command, without --help."""
    found = (option for box in _boxes(_help(words)) for option in _options(box))
    return [option for option in found if not option.written.startswith("-h")]


def _section(words: tuple[str, ...], kind: Any) -> Iterator[str]:
    yield from (f"{'#' * (len(words) + 1)} spikecam {' '.join(words)}", "")
    yield from _described(kind)
    if not commands_of(kind):
        for option in options_of(words):
            yield from (f"`{option.written}`{_given(option.default)}", f": {_prose(option.meaning) or '(no text)'}", "")


def _given(default: str) -> str:
    """How the default stands behind an option; that of a switch goes without saying."""
    if default in ("required", "repeatable"):
        return f" *{default}*"
    return f" (default `{default}`)" if default not in ("", "False") else ""


def examples_of(kind: Any) -> list[str]:
    """Command lines that a command's help shows, remarks behind them."""
    paragraphs = (inspect.getdoc(kind) or "").split("\n\n")
    shown = [lines for paragraph in paragraphs for lines in [_example(paragraph)] if lines]
    return [_remark_last(line) for lines in shown for line in lines]


def _example(paragraph: str) -> list[str]:
    head, colon, lines = paragraph.partition(":")
    if not colon or head not in ("example", "examples"):
        return []
    return [line.strip() for line in lines.splitlines() if line.strip()]


def _described(kind: Any) -> Iterator[str]:
    for paragraph in (inspect.getdoc(kind) or "").split("\n\n"):
        if not _example(paragraph):
            yield from (_prose(paragraph), "")
    if examples_of(kind):
        yield from ("```bash", *examples_of(kind), "```", "")


def _remark_last(line: str) -> str:
    """`on a GPU: spikecam ...` as a command line, the remark behind it."""
    remark, command, words = line.partition("spikecam ")
    return f"{command}{words}  # {remark.strip(': ')}" if remark else line


def _prose(text: str) -> str:
    """Text that Markdown leaves as it is, but for `code`; options become code too."""
    marked = re.sub(r"(?<![\w`-])(--[a-z][a-z-]*)(?![^`]*`(?:[^`]*`[^`]*`)*[^`]*$)", r"`\1`", " ".join(text.split()))
    parts = re.split(r"(`[^`]+`)", marked)
    return "".join(part if part.startswith("`") else re.sub(r"([*_<>|\[\]])", r"\\\1", part) for part in parts)


def _help(words: tuple[str, ...]) -> str:
    printed = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")  # of an encoding that has the corners of boxes
    with patch.dict(os.environ, COLUMNS=COLUMNS), redirect_stdout(printed), suppress(SystemExit):
        run([*words, "--help"])
    printed.seek(0)
    return printed.read()


def _boxes(text: str) -> list[list[str]]:
    """Lines of each framed part of a help text, without its introduction."""
    boxes: list[list[str]] = []
    for line in text.splitlines():
        if line.startswith("╭"):
            boxes.append([])
        elif line.startswith("│") and boxes:
            inside = line[2:-1].rstrip()
            boxes[-1] = [] if set(inside) == {"─"} else [*boxes[-1], inside]
    return boxes


def _options(box: list[str]) -> list[Option]:
    entries: list[list[str]] = []
    for line in box:
        if line.startswith(" ") and entries:
            entries[-1].append(line.strip())
        elif line:
            entries.append(list(line.partition("  ")[::2]))
    return [_option(head, " ".join(part.strip() for part in rest if part.strip())) for head, *rest in entries]


def _option(written: str, text: str) -> Option:
    ending = ENDING.search(text)
    if ending is None:
        return Option(written, text, "")
    default = ending["word"] or ending["default"]
    return Option(written.replace("{None}|", ""), text[: ending.start()], "" if default == "None" else default)
