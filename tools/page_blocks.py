"""Blocks of the pages, and the comments above them that say how they are tested (CONTRIBUTING.md, "Docs that run").

<!-- at small size: OLD -> NEW; --option value -->   replacements, and options added to every `spikecam` line
<!-- given: CODE -->                                 Python that is run before the block: names that the reader has
<!-- file: NAME -->                                  the block is written as the file NAME, not run
<!-- not run: REASON -->                             Python is compiled, command lines are read by their parser
<!-- tested by: FILE -->                             above the first block: that test runs the page, this one reads it
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import dedent

ROOT = Path(__file__).resolve().parents[1]
PAGES = tuple(
    sorted(
        [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
        + [page for page in (ROOT / "docs").rglob("*.md") if "_build" not in page.parts]
    )
)
NAMES = {page: page.relative_to(ROOT).as_posix() for page in PAGES}

COMMENT = re.compile(r"<!-- (?P<mark>at small size|given|file|not run|tested by): (?P<text>.*?) ?-->", re.DOTALL)
FENCE = re.compile(r"^(?P<indent> *)```(?P<language>[\w{}-]*).*$")
PYTHON, COMMANDS, TEXT = "python", "commands", "text"
SHELLS = ("bash", "sh", "shell", "console")
PROGRAMS = ("spikecam", "python", "make", "pip", "mkdir", "export", ".venv/bin/spikecam", ".venv/bin/python")
"""A block without a language, or of text, whose first line begins with one of these is one of command lines."""


@dataclass(frozen=True)
class Block:
    """A block of code on a page."""

    kind: str
    """PYTHON, COMMANDS or TEXT."""
    code: str
    line: int
    """Where its code begins, from 1."""
    marks: dict[str, str] = field(default_factory=dict)
    """Comments above it, by their first words."""

    @property
    def small(self) -> str:
        """The code with its replacements; ValueError for one whose old text the block does not hold."""
        code = self.code
        for old, new in self.replacements:
            if old not in code:
                raise ValueError(f"line {self.line}: `{old}` is to be replaced, and is not in the block")
            code = code.replace(old, new)
        return code

    @property
    def replacements(self) -> list[tuple[str, str]]:
        parts = (part.strip().partition(" -> ") for part in self.marks.get("at small size", "").split(";"))
        return [(old.strip(), new.strip()) for old, arrow, new in parts if arrow]

    @property
    def options(self) -> list[str]:
        """Words to add to every `spikecam` line."""
        parts = [part.strip() for part in self.marks.get("at small size", "").split(";")]
        return " ".join(part for part in parts if " -> " not in part).split()


def blocks_of(text: str) -> list[Block]:
    """Every fenced block and every indented one, with the comments that stand right above it.

    Command lines in a block that says it is text are shown for reading: they are not run.
    """
    return list(_blocks(text.splitlines()))


def inline_commands(text: str) -> list[str]:
    """Command lines within prose and tables, as `code`."""
    found = re.findall(r"(?<!`)`([^`\n]+)`(?!`)", without_code(text))
    return [code for code in found if re.match(r"(spikecam|python -m|make) [a-z]", code)]


def without_code(text: str) -> str:
    """A page without its fenced blocks."""
    return re.sub(r"^( *)```.*?^\1```", "", text, flags=re.DOTALL | re.MULTILINE)


def command_lines(code: str) -> list[str]:
    """The lines of a block of commands: continued ones and loops joined, remarks (`# ...`, or after two spaces) cut."""
    continued = re.sub(r"\s*\\\n\s*", " ", code)
    joined = re.sub(r"^for .*?^done.*?$", lambda found: _in_one_line(found[0]), continued, flags=re.M | re.S)
    lines = (re.sub(r"(^|\s+)#.*$|(?<=\S) {2,}\S.*$", "", line).strip() for line in joined.splitlines())
    return [line.removeprefix("$ ") for line in lines if line]


def _in_one_line(loop: str) -> str:
    return re.sub(r"(\bdo)?\n\s*", lambda found: "do " if found[1] else "; ", loop)


def _blocks(lines: list[str]) -> Iterator[Block]:
    at = 0
    above: list[str] = []
    while at < len(lines):
        fence = FENCE.match(lines[at])
        if fence:
            end = _closing(lines, at + 1, fence["indent"])
            yield _block(fence["language"], lines[at + 1 : end], at + 2, above)
            at, above = end + 1, []
        elif lines[at].startswith("    ") and not above[-1:] and _before_is_blank(lines, at):
            end = next((i for i in range(at, len(lines)) if lines[i] and not lines[i].startswith("    ")), len(lines))
            yield _block("", lines[at:end], at + 1, [])
            at = end
        else:
            above = _comment(lines, at, above)
            at += 1


def _comment(lines: list[str], at: int, above: list[str]) -> list[str]:
    """Lines of the comments that end at this line, with nothing but blank lines behind them."""
    line = lines[at].strip()
    if line.startswith("<!--") or (above and "-->" not in above[-1]):
        return [*above, line]
    return above if not line else []


def _before_is_blank(lines: list[str], at: int) -> bool:
    return at == 0 or not lines[at - 1].strip()


def _closing(lines: list[str], at: int, indent: str) -> int:
    return next((i for i in range(at, len(lines)) if lines[i].rstrip() == f"{indent}```"), len(lines))


def _block(language: str, lines: list[str], line: int, above: list[str]) -> Block:
    code = dedent("\n".join(lines)).strip("\n") + "\n"
    marks = {found["mark"]: found["text"].strip() for found in COMMENT.finditer("\n".join(above))}
    kind = _kind(language, code)
    if kind == COMMANDS and language == "text":
        marks.setdefault("not run", "shown as text")
    return Block(kind, code, line, marks)


def _kind(language: str, code: str) -> str:
    if language in SHELLS:
        return COMMANDS
    first = next((line for line in code.splitlines() if line.strip() and not line.startswith("#")), "")
    if language in ("", "text") and first.split()[:1] and first.split()[0] in PROGRAMS:
        return COMMANDS
    return PYTHON if language in ("python", "py") else TEXT
