"""Code of the pages in lines that fit the site's article.

    python -m tools.code_width docs/scenes.md docs/gap.md       wraps their Python and command lines
    python -m tools.code_width                                  those of all pages

Remarks move above their line, Python is laid out by ruff, command lines break before an option.  Text, such as a
drawing or a formula, stays as it is.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from textwrap import wrap

from spikecam_env.whole import write_text_whole

DOCS = Path(__file__).parents[1] / "docs"
WIDTH = 88
"""Columns of a line of code that the site shows at a window of 1280 pixels."""
BLOCK = re.compile(r"(?P<head>^```(?P<language>python|bash)\n)(?P<code>.*?)(?P<end>^```$)", re.MULTILINE | re.DOTALL)
PLAIN = re.compile(r"(?P<head>^```(?:text)?\n)(?P<code>(?:spikecam|python|export) .*?)(?P<end>^```$)", re.M | re.DOTALL)
INDENTED = re.compile(r"(?P<head>\n\n)(?P<code>(?: {4}(?:spikecam|python|pip|export) .*\n)+)(?P<end>(?=\n|\Z))")
REMARK = re.compile(r"^(?P<indent> *)(?P<code>\S+(?: \S+)*)(?P<gap>  +# ?|  +)(?P<remark>\S.*)$")


def wrapped(page: str) -> str:
    """A page with its Python and its command lines wrapped."""
    page = BLOCK.sub(lambda found: _written(found, found["language"]), page)
    return INDENTED.sub(lambda found: _written(found, "bash"), PLAIN.sub(lambda found: _written(found, "bash"), page))


def commands(code: str) -> str:
    """Command lines of which none is too long: remarks above, further options on lines of their own."""
    if not _too_long(code):
        return code
    lines = (above for line in code.splitlines() for above in _remark_above(line, REMARK.match(line)))
    return "".join(f"{part}\n" for line in lines for part in _broken(line))


def python(code: str) -> str:
    """Python of which no line is too long, as far as ruff can; unchanged where none is."""
    if not _too_long(code):
        return code
    lines = [above for line in code.splitlines() for above in _python_remark_above(line)]
    code = "\n".join([*lines, ""])
    words = [sys.executable, "-m", "ruff", "format", "--isolated", "--line-length", str(WIDTH), "-"]
    return subprocess.run(words, input=code, capture_output=True, text=True, check=True).stdout


def _written(found: re.Match[str], language: str) -> str:
    return found["head"] + (python if language == "python" else commands)(found["code"]) + found["end"]


def _too_long(code: str) -> bool:
    return any(len(line) > WIDTH for line in code.splitlines())


def _python_remark_above(line: str) -> Iterator[str]:
    found = REMARK.match(line) if len(line) > WIDTH else None
    yield from _remark_above(line, found if found and "#" in found["gap"] else None)


def _remark_above(line: str, found: re.Match[str] | None) -> Iterator[str]:
    """The line's remark as lines of their own, then its code; the line itself where nothing is found."""
    if found is None:
        yield line
        return
    head = f"{found['indent']}# "
    yield from wrap(found["remark"], WIDTH, initial_indent=head, subsequent_indent=head)
    yield f"{found['indent']}{found['code']}"


def _broken(line: str) -> Iterator[str]:
    """A command in lines that end in a backslash, each as full as it can be."""
    indent, at = line[: len(line) - len(line.lstrip())], ""
    for part in re.split(r" (?=--?[a-z])", line) if not line.lstrip().startswith("#") else [line]:
        if at and len(at) + len(part) + len(" " + " \\") > WIDTH:
            yield f"{at} \\"
            at = f"{indent}    {part}"
        else:
            at = f"{at} {part}" if at else part
    yield at


def main() -> None:
    """Wrap the pages that the command line names, or all; a page appears whole."""
    for page in [*map(Path, sys.argv[1:])] or sorted(DOCS.rglob("*.md")):
        text = page.read_text(encoding="utf-8")
        if "_build" not in page.parts and wrapped(text) != text:
            write_text_whole(page, wrapped(text))
            print(page)


if __name__ == "__main__":
    main()
