"""Functions that are longer than a page: `make lint` runs this, and ruff counts their branches (pyproject.toml).

python -m tools.function_sizes [PATH ...]     lists them; exit status 1 where there is one
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

PACKAGES = ("spikecam_env", "scenes", "denoiser", "benchmarks", "tools")
LINES = 80
"""Longest function, its docstring not counted."""


def sizes(source: str) -> Iterator[tuple[int, str, int]]:
    """Line, name and size of every function of a module.

    Example:
        >>> list(sizes("def f():\\n    return 1\\n"))
        [(1, 'f', 2)]
    """
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            lines = (node.end_lineno or node.lineno) - node.lineno + 1
            text = node.body[0] if ast.get_docstring(node, clean=False) is not None else None
            yield node.lineno, node.name, lines - ((text.end_lineno or 0) - text.lineno + 1 if text else 0)


def main(paths: list[str]) -> int:
    """Number of functions that are too long, each printed."""
    files = [file for path in paths or PACKAGES for file in sorted(Path(path).rglob("*.py"))]
    long = [
        f"{file}:{line}: {name} has {size} lines, {LINES} at most"
        for file in files
        for line, name, size in sizes(file.read_text(encoding="utf-8"))
        if size > LINES
    ]
    print("\n".join(long))
    return len(long)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]) > 0)
