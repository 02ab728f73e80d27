"""Docstrings of this repository as reStructuredText, which Sphinx's autodoc reads.

A docstring here is plain text: a summary, prose with `code`, indented equations or Python, and the sections Args,
Returns, Raises and Example.  Arguments may also stand in the prose, as `name: meaning`, or in two columns; a paragraph
of lines such as `Scene: ...` and `Action: ...` is a list of them.  Prose is escaped, indented blocks stay as they are,
sections and such lists become fields.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Collection, Iterable
from textwrap import dedent

SECTION = re.compile(r"(Args|Returns|Raises|Example):$")
ASPECT = re.compile(r"(?P<title>[A-Z][a-z]+): (?P<text>.+)", re.DOTALL)
ENTRY = re.compile(r"^(?=\S)", re.MULTILINE)
ARGUMENT = re.compile(r"(?:^|\n|  )(?P<names>\w+(?:, \w+)*): ")
COLUMNS = re.compile(r"^(?P<name>\w+) {2,}(?P<text>\S.*)$")
RAISES = re.compile(r"(?:^|\n|(?<=[.;])\s+)(?:Raises |Errors: ?|NotReadyError (?=for ))")
ERROR = re.compile(r"(?P<kind>[A-Z]\w+Error) ?(?P<text>.*)", re.DOTALL)
CODE = re.compile(r"(`+)(.+?)\1", re.DOTALL)
IMPORTS = (ast.Import, ast.ImportFrom)


def rendered(text: str, arguments: Collection[str] = ()) -> list[str]:
    """Lines of reStructuredText: prose, then fields, then examples.

    text: a docstring without its common indentation.  arguments: names that may stand as `name: meaning`.
    """
    prose: list[str] = []
    fields: list[str] = []
    examples: list[str] = []
    for paragraph in re.split(r"\n[ \t]*\n", text.strip("\n")):
        lines = paragraph.splitlines() or [""]
        section = SECTION.match(lines[0])
        inside = dedent("\n".join(lines[1:]))
        if section and section[1] == "Example":
            examples += [*inside.splitlines(), ""]
        elif section:
            fields += _section(section[1], inside)
        elif lines[0].lstrip().startswith(">>>"):
            examples += [*lines, ""]
        elif all(line.startswith("  ") for line in lines):
            kind = ".. code-block:: python" if is_python(dedent(paragraph)) else "::"
            prose += [kind, "", *(f"   {line}" for line in lines), ""]
        elif aspects := _aspects(paragraph):
            prose += [*aspects, ""]
        else:
            plain, found = _sorted_out(lines, arguments)
            fields += found
            prose += [*plain, ""] if plain else []
    return [*prose, *fields, "", *examples]


def _aspects(paragraph: str) -> list[str]:
    """Fields of a paragraph each of whose lines begins with a title, further ones indented; none of another one."""
    found = [ASPECT.fullmatch(entry.rstrip()) for entry in ENTRY.split(paragraph) if entry]
    titled = [f":{one['title']}: {escaped(_one_line(one['text']))}" for one in found if one]
    return titled if len(titled) == len(found) > 1 else []


def is_python(text: str) -> bool:
    """Whether an indented block is Python, not a formula: it imports, or calls with a keyword or a string."""
    try:
        parts = list(ast.walk(ast.parse(text)))
    except SyntaxError:
        return False
    calls = [part for part in parts if isinstance(part, ast.Call)]
    texts = [a for call in calls for a in call.args if isinstance(a, ast.Constant) and isinstance(a.value, str)]
    return bool(texts) or any(call.keywords for call in calls) or any(isinstance(p, IMPORTS) for p in parts)


def _section(title: str, text: str) -> list[str]:
    """The fields of a section; in Args and Raises an entry is `name: meaning`, its further lines indented."""
    if title == "Returns":
        return [f":returns: {escaped(_one_line(text))}"]
    kind = "param" if title == "Args" else "raises"
    entries = (entry.partition(": ") for entry in ENTRY.split(text) if entry)
    return [line for names, _, meaning in entries for line in _fields(kind, names, meaning)]


def _sorted_out(lines: list[str], arguments: Collection[str]) -> tuple[list[str], list[str]]:
    """Prose and fields of one paragraph."""
    prose, fields = [], []
    for piece in _in_columns(lines, arguments):
        if isinstance(piece, tuple):
            fields += _fields("param", *piece)
            continue
        before, *parts = RAISES.split(piece)
        kept, found = _by_argument(before, arguments)
        prose += kept
        fields += found
        for part in parts:
            errors, after = _by_argument(part, arguments)
            fields += [*_errors(" ".join(errors)), *after]
    return prose, fields


def _in_columns(lines: list[str], arguments: Collection[str]) -> Iterable[str | tuple[str, str]]:
    """The paragraph cut at rows of two columns, each (name, meaning) with the lines that go on below it."""
    rest: list[str] = []
    row: tuple[str, str] | None = None
    for line in lines:
        found = COLUMNS.match(line)
        if found and found["name"] in arguments:
            yield from ([row] if row else [])
            yield from (["\n".join(rest)] if rest else [])
            row, rest = (found["name"], found["text"]), []
        elif row and line.startswith("   "):
            row = (row[0], f"{row[1]} {line.strip()}")
        else:
            yield from ([row] if row else [])
            row = None
            rest.append(line)
    yield from ([row] if row else [])
    yield from (["\n".join(rest)] if rest else [])


def _by_argument(text: str, arguments: Collection[str]) -> tuple[list[str], list[str]]:
    """Prose before the first argument, and the arguments as fields."""
    found = [m for m in ARGUMENT.finditer(text) if set(m["names"].split(", ")) <= set(arguments)]
    ends = [*(m.start() for m in found[1:]), len(text)][: len(found)]
    before = text[: found[0].start()] if found else text
    fields = [
        field for m, end in zip(found, ends, strict=True) for field in _fields("param", m["names"], text[m.end() : end])
    ]
    return ([escaped(_one_line(before))] if before.strip() else []), fields


def _fields(kind: str, names: str, meaning: str) -> list[str]:
    """A field for each of the names, since Sphinx takes `a, b` for a type and a name."""
    return [f":{kind} {name}: {escaped(_one_line(meaning))}" for name in names.split(", ")]


def _errors(text: str) -> list[str]:
    found = ERROR.match(text)
    return [f":raises {found['kind']}: {found['text']}" if found else f":raises: {text}"]


def escaped(text: str) -> str:
    """Prose in which nothing but `code` is markup."""
    parts, at = [], 0
    for code in CODE.finditer(text):
        parts += [_plain(text[at : code.start()]), _literal(code[2])]
        at = code.end()
    return "".join([*parts, _plain(text[at:])])


def _plain(text: str) -> str:
    return re.sub(r"([\\*|`]|_(?!\w))", r"\\\1", text)


def _literal(code: str) -> str:
    """A role rather than backticks: those need a space on either side."""
    return rf"\ ``{_one_line(code)}``\ " if code.strip() else ""


def _one_line(text: str) -> str:
    return " ".join(text.split())
