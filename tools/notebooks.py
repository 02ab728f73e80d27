"""Notebooks of tutorials: the same text, code and commands, with their printed and drawn results.

python -m tools.notebooks            # all of them, in docs/notebooks: some minutes
python -m tools.notebooks denoise    # one

A page's Python blocks become cells; command lines become cells of `!spikecam ...`; text becomes Markdown, with links as
from the notebook.  A picture that the page shows is left out: the cell that draws it has it.
"""

from __future__ import annotations

import json
import os
import re
import shlex
from base64 import b64encode
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from io import BytesIO, StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, get_args

import tyro
from PIL import Image

from spikecam_env.cli.main import run
from spikecam_env.whole import write_text_whole
from tools.page_blocks import COMMANDS, PYTHON, ROOT, Block, blocks_of, command_lines

TUTORIALS = ROOT / "docs" / "tutorials"
NOTEBOOKS = ROOT / "docs" / "notebooks"
Name = Literal["first_camera", "denoise", "first_diagnosis"]
"""Of a tutorial that is a notebook too."""
NAMES: tuple[Name, ...] = get_args(Name)
COLOURS = 64
"""Of a committed picture; greys and a few lines need no more."""
DPI = 80
"""Of a committed picture [dots an inch]."""


@dataclass(frozen=True)
class Cell:
    """A cell of a notebook."""

    text: str
    """Its source."""
    block: Block | None = None
    """The page's block that it is; None for Markdown."""
    outputs: tuple[dict[str, Any], ...] = ()
    """As nbformat has them."""


def main(names: tyro.conf.Positional[tuple[Name, ...]] = NAMES) -> None:
    """Run tutorials and write their notebooks, with all that they print and draw, to docs/notebooks.

    Args:
        names: Tutorials.
    """
    for name in names:
        cells = cells_of((TUTORIALS / f"{name}.md").read_text(encoding="utf-8"))
        write_text_whole(NOTEBOOKS / f"{name}.ipynb", notebook(executed(cells)))
        print(f"wrote {(NOTEBOOKS / name).relative_to(ROOT)}.ipynb")


def cells_of(page: str) -> list[Cell]:
    """Cells of a page's text in order, not run."""
    lines, cells, at = page.splitlines(), list[Cell](), 0
    for block in blocks_of(page):
        if block.kind in (PYTHON, COMMANDS) and "not run" not in block.marks:
            fence = block.line - 2
            cells += [*_markdown(lines[at:fence]), Cell(_code(block), block)]
            at = fence + len(block.code.splitlines()) + 2
    return [*cells, *_markdown(lines[at:])]


def executed(cells: Sequence[Cell], *, small: bool = False) -> list[Cell]:
    """The cells with their outputs, run in order in an empty folder.  small: at the size at which pages are tested."""
    import matplotlib

    matplotlib.use("Agg")
    namespace: dict[str, Any] = {"__name__": "__main__"}
    with TemporaryDirectory() as folder, _within(folder):
        return [cell if cell.block is None else _run(cell, cell.block, namespace, small) for cell in cells]


def notebook(cells: Sequence[Cell]) -> str:
    """The text of a notebook's file, nbformat 4.5."""
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return json.dumps(
        {
            "cells": [_as_json(number, cell) for number, cell in enumerate(cells)],
            "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}},
            "nbformat": 4,
            "nbformat_minor": 5,
        },
        indent=1,
    )


def _as_json(number: int, cell: Cell) -> dict[str, Any]:
    found = {"id": f"cell-{number}", "metadata": {}, "source": cell.text.splitlines(keepends=True)}
    if cell.block is None:
        return {"cell_type": "markdown", **found}
    return {"cell_type": "code", "execution_count": None, **found, "outputs": list(cell.outputs)}


def _markdown(lines: Sequence[str]) -> Iterator[Cell]:
    """A cell of text as from the notebook: without comments, pictures, and the words that lead to the notebook."""
    text = re.sub(r"<!--.*?-->\n?", "", "\n".join(lines), flags=re.DOTALL)
    text = re.sub(r"^!\[[^\]]*\]\([^)]*\)\n*", "", text, flags=re.MULTILINE)
    text = re.sub(r" This page is \[a notebook\]\(\S+\) too\.", "", text)
    text = re.sub(r"\]\((?=[\w]+\.md)", "](../tutorials/", text).strip()
    if text:
        yield Cell(text)


def _code(block: Block) -> str:
    if block.kind == PYTHON:
        return block.code.rstrip("\n")
    return "\n".join(f"!{line}" for line in command_lines(block.code))


def _run(cell: Cell, block: Block, namespace: dict[str, Any], small: bool) -> Cell:
    import matplotlib.pyplot as plt

    printed, code = StringIO(), block.small if small else block.code
    with redirect_stdout(printed), redirect_stderr(StringIO()):  # progress bars
        if block.kind == PYTHON:
            exec(compile(code, f"line {block.line}", "exec"), namespace)
        else:
            for line in command_lines(code):
                _command(line, block.options if small else [])
    pictures = [_picture() for _ in map(plt.figure, plt.get_fignums())]
    plt.close("all")
    lines = printed.getvalue().splitlines(keepends=True)
    said = [{"output_type": "stream", "name": "stdout", "text": lines}] if lines else []
    return replace(cell, outputs=(*said, *pictures))


def _command(line: str, options: Sequence[str]) -> None:
    program, *words = shlex.split(line)
    if program != "spikecam" or run([*words, *options]) != 0:
        raise RuntimeError(f"{line!r} cannot be run here")


def _picture() -> dict[str, Any]:
    """The current figure as an output, in few colours."""
    import matplotlib.pyplot as plt

    drawn, kept = BytesIO(), BytesIO()
    plt.savefig(drawn, format="png", dpi=DPI)
    Image.open(drawn).convert("RGB").quantize(COLOURS).save(kept, "png", optimize=True)
    data = {"image/png": b64encode(kept.getvalue()).decode(), "text/plain": ["<Figure>"]}
    return {"output_type": "display_data", "data": data, "metadata": {}}


@contextmanager
def _within(folder: str) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


if __name__ == "__main__":
    tyro.cli(main)
