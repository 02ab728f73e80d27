"""The version of the code that makes a result: a digest of the modules that take part, whatever their form.

A module counts by its syntax tree without docstrings, and so without comments and layout; data files beside it
(presets, templates) count too.  Imports of its own package take part, and theirs; a package that loads its modules by
`pkgutil`, as the catalogue of effects does, imports all of them.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent
"""Folder of the package whose modules count."""

DIGITS = 12
"""Hexadecimal digits of a digest: two of a thousand versions are the same by chance once in 1e9."""

UNREADABLE = "unknown"
"""The version where the package was installed without its sources."""

DATA_SUFFIXES = (".npz", ".toml", ".jinja")
"""Endings of the data files that count."""


@cache
def code_version(*modules: str, root: Path = ROOT) -> str:
    """The digest of modules, named from their package on, and of all that they import of it.

    Args:
        modules: names such as "spikecam_env.gap.diagnose".
        root: folder of the package.

    Returns:
        DIGITS hexadecimal digits; UNREADABLE where a source is missing.
    """
    digest = hashlib.sha256()
    try:
        for path in sources_of(modules, root):
            digest.update(f"{path.relative_to(root.parent).as_posix()}\n".encode())
            digest.update(meaning_of(path).encode() if path.suffix == ".py" else path.read_bytes())
    except FileNotFoundError:
        return UNREADABLE
    return digest.hexdigest()[:DIGITS]


def sources_of(modules: tuple[str, ...], root: Path = ROOT) -> list[Path]:
    """Files of modules and of all that they import of the package in `root`, with the data beside them, in order.

    Raises:
        FileNotFoundError: where a module has no source.
    """
    waiting, sources = [_file_of(name, root) for name in modules], dict.fromkeys((root / "__init__.py",))
    while waiting:
        path = waiting.pop()
        if path not in sources:
            sources[path] = None
            waiting += imported_by(path, root)
    folders = {path.parent for path in sources}
    data = [p for f in folders for p in (*f.glob("*"), *f.glob("presets/*")) if p.suffix in DATA_SUFFIXES]
    return sorted({*sources, *data})


def imported_by(path: Path, root: Path = ROOT) -> Iterator[Path]:
    """Files of the package in `root` that a file imports, wherever in it, and the packages that they are in."""
    names = {n for node in statements_of(ast.parse(path.read_text(encoding="utf-8"))) for n in _names_in(node)}
    for name in sorted(names):
        if name == "pkgutil":
            yield from path.parent.glob("*.py")
        elif name.split(".")[0] == root.name:
            yield from _files_of(name, root)


def statements_of(node: ast.AST) -> Iterator[ast.AST]:
    """All statements within a node, and not the expressions, of which there are ten times as many."""
    for block in ("body", "orelse", "finalbody", "handlers", "cases"):
        inside = getattr(node, block, None)
        for part in inside if isinstance(inside, list) else ():
            yield part
            yield from statements_of(part)


@cache
def _files_of(name: str, root: Path) -> tuple[Path, ...]:
    """The file of a module of the package in `root`, and those of the packages that it is in."""
    inside = root.parent.joinpath(*name.split("."))
    places = (inside.with_suffix(".py"), *(p / "__init__.py" for p in (inside, *inside.parents)))
    return tuple(p for p in places if p.is_relative_to(root) and p.is_file())


def _names_in(node: ast.AST) -> Iterator[str]:
    """Modules that a statement imports; of `from a import b` both a and a.b."""
    if isinstance(node, ast.Import):
        yield from (name.name for name in node.names)
    elif isinstance(node, ast.ImportFrom) and node.module:
        yield node.module
        yield from (f"{node.module}.{name.name}" for name in node.names)


def _file_of(name: str, root: Path) -> Path:
    place = root.parent.joinpath(*name.split("."))
    return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")


def meaning_of(path: Path) -> str:
    """The syntax of a source, the same for every layout and every version of Python; `ast.dump` differs by version."""
    return _syntax(ast.parse(path.read_text(encoding="utf-8")))


def _syntax(node: object) -> str:
    """A part of a syntax tree: kinds and fields of nodes, without empty fields and without bare strings."""
    if isinstance(node, ast.AST):
        inside = [(name, value) for name, value in ast.iter_fields(node) if value is not None and value != []]
        return f"{type(node).__name__}({','.join([f'{name}={_syntax(value)}' for name, value in inside])})"
    if isinstance(node, list):
        return f"[{','.join([_syntax(part) for part in node if not _is_bare_string(part)])}]"
    return repr(node)


def _is_bare_string(node: object) -> bool:
    """Whether a statement is a string alone: a docstring, of a module, a class, a function or a constant."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
