"""Docstrings for `sphinx.ext.napoleon`: in prose only `code` is markup, and an indented block is shown as it stands.

Napoleon reads the sections.  Where a section has one entry it takes the words before a colon for a type: a colon in
front of the entry keeps the words together.
"""

from __future__ import annotations

import re

TASK_SECTIONS = (
    "Scene",
    "Observation",
    "Action",
    "Encoders",
    "Reward",
    "End",
    "Success",
    "Reset",
    "Options",
    "Info",
    "Render",
)
HEADING = re.compile(r"[A-Z]\w+:$")
CODE = re.compile(r"(`+)(.+?)\1", re.DOTALL)
ONE_ENTRY = re.compile(rf"^({'|'.join((*TASK_SECTIONS, 'Returns', 'Yields'))}):\n +", re.MULTILINE)


def as_restructured(text: str, *, attribute: bool = False) -> list[str]:
    """Lines of a docstring as Napoleon reads them.

    Args:
        text: the docstring without its common indentation.
        attribute: whether it explains an attribute, and so has no sections.
    """
    lines: list[str] = []
    opening = ""
    for paragraph in re.split(r"\n[ \t]*\n", text.strip("\n")):
        indented = paragraph.startswith(" ")
        opening = opening if indented else paragraph.partition("\n")[0]
        if opening == "Example:" or paragraph.lstrip().startswith(">>>"):
            made = paragraph
        elif HEADING.match(opening):
            made = ONE_ENTRY.sub(r"\1:\n    : ", escaped(paragraph))
        elif indented:
            made = f"::\n\n{paragraph}"
        else:
            made = escaped(paragraph if paragraph.startswith("- ") else re.sub(r"\n +", "\n", paragraph))
        lines += [*made.splitlines(), ""]
    return [f": {lines[0]}", *lines[1:]] if attribute else lines


def escaped(text: str) -> str:
    """Prose in which nothing but `code` is markup."""
    pieces = CODE.split(text)
    plain = [re.sub(r"([\\*|`]|_(?!\w))", r"\\\1", piece) for piece in pieces[::3]]
    code = [rf"\ ``{' '.join(piece.split())}``\ " for piece in pieces[2::3]]
    return "".join(part for pair in zip(plain, [*code, ""], strict=True) for part in pair)
