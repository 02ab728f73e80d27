"""Wavefront OBJ and MTL: made plain for trimesh, and the names of parts that no surface shows.

    (u, v) of the picture = offset + scale x (u, v)         map_Kd -o u v w -s u v w FILE

trimesh takes indices that count backwards from the end of the file, not from the line that has them; it knows no
options of pictures, and clips colours.  Source: Wavefront, Advanced Visualizer, appendix B1; MTL format 4.2.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from scenes.surfaces.unshown import EMISSION, GLOSS, LINES, METAL, NORMAL_MAPS, TRANSPARENCY
from spikecam_env.errors import InputError

PLACE = "map_kd_place"
"""Key of a material, made from the options of its picture: offset u, v; scale u, v; 1 where its edge goes on."""
OPTIONS = {"-o": 3, "-s": 3, "-t": 3, "-mm": 2, "-bm": 1, "-boost": 1, "-texres": 1, "-clamp": 1, "-imfchan": 1}
OPTIONS |= {"-blendu": 1, "-blendv": 1, "-cc": 1, "-type": 1}
"""Of a picture, and the most values of each."""
NUMBERS = ("-o", "-s", "-t", "-mm")
"""Options whose values are numbers, of which the last may be left out."""
HARMLESS = ("-blendu", "-blendv", "-boost", "-cc", "-texres")
"""Options that do not change the light of a picture that is averaged over pixels."""
UNREAD_STATEMENTS = {"l": LINES, "p": LINES} | dict.fromkeys(("curv", "curv2", "surf"), "curves and surfaces")
"""Parts that OBJ's statements give, and no surface shows."""
COUNTS_BACK = re.compile(r"\n *f [ \d/]*-")
IS_COLOURED = re.compile(r"\n *v(?: +[^ \n]+){6}")


def plain_obj(data: bytes) -> tuple[bytes, list[str]]:
    """An OBJ file whose indices count from the start, and the names of its parts that no surface shows.

    Raises:
        InputError: colours of vertices are out of 0 to 1, or an index counts back beyond the first line.
    """
    text = data.decode("utf-8", "replace").replace("\r\n", "\n").replace("\\\n", " ").replace("\t", " ")
    text = f"\n{text}"
    unread = [name for statement, name in UNREAD_STATEMENTS.items() if f"\n{statement} " in text]
    unread += ["further material libraries"] if text.count("\nmtllib ") > 1 else []
    unread += _of_vertices(text) if IS_COLOURED.search(text) else []
    if COUNTS_BACK.search(text):
        text = "\n".join(_counted(text.split("\n")))
    return text.encode(), unread


def materials_used(data: bytes) -> set[str]:
    """Names of the materials that an OBJ file's faces have."""
    return {name.strip().decode("utf-8", "replace") for name in re.findall(rb"^usemtl (.*)$", data, re.M)}


def plain_mtl(data: bytes) -> tuple[bytes, set[str]]:
    """An MTL file whose `map_Kd` names files alone, its options under PLACE; and the names of its materials."""
    lines, names = [], set[str]()
    for line in data.decode("utf-8", "replace").splitlines():
        key, *values = line.split() or [""]
        if key.lower() == "newmtl":
            names.add(" ".join(values))
        if key.lower() == "map_kd" and values:
            lines += _picture_lines(line.split(None, 1)[1])
        else:
            lines.append(line)
    return "\n".join(lines).encode(), names


def unread_of(material: dict[str, Any]) -> Iterator[str]:
    """Names of the parts of a material of MTL that no surface shows; keys as trimesh has them."""

    def most(key: str) -> float:
        values = material.get(key, 0.0)
        return max((float(v) for v in np.atleast_1d(values) if _is_number(v)), default=0.0)

    if most("ke") > 0 or "map_ke" in material:
        yield EMISSION
    opaque = most("d") if "d" in material else 1 - most("tr") % 1  # Tr 1 alone: files in which it stands for opaque
    if opaque < 1 or "map_d" in material:
        yield TRANSPARENCY
    if most("pm") > 0 or "map_pm" in material:
        yield METAL
    if most("ks") > 0 or "map_ks" in material:
        yield GLOSS
    if {"bump", "map_bump", "norm", "map_kn", "disp", "map_disp"} & set(material):
        yield NORMAL_MAPS
    yield from (f"the option {option} of a texture" for option in material.get(PLACE, [])[5:])


def _of_vertices(text: str) -> list[str]:
    """Names of the parts that are left out where vertices have colours: `v x y z red green blue`."""
    rows = [line.split() for line in re.findall(r"^ *v (.*)$", text, re.M)]
    coloured = [row[3:6] for row in rows if len(row) >= 6]
    values = np.array(coloured, np.float64)
    if not (values.min() >= 0 and values.max() <= 1):
        raise InputError(f"colours of vertices run from {values.min():g} to {values.max():g}; they must lie in 0 to 1")
    return ["colours of some vertices"] if len(coloured) < len(rows) else []


def _counted(lines: list[str]) -> Iterator[str]:
    """Lines with indices from 1, whether they counted from the start or back from their line."""
    counts = {"v": 0, "vt": 0, "vn": 0}
    for line in lines:
        key, *values = line.split() or [""]
        if key in counts:
            counts[key] += 1
        if key == "f":
            line = "f " + " ".join(_corner(corner, tuple(counts.values())) for corner in values)
        yield line


def _corner(corner: str, counts: tuple[int, ...]) -> str:
    parts = corner.split("/")
    for place, (part, count) in enumerate(zip(parts, counts, strict=False)):
        if part.startswith("-"):
            index = count + 1 + int(part)
            if index < 1:
                raise InputError(f"a face names {part}, of {count} so far; the file is cut off or damaged")
            parts[place] = str(index)
    return "/".join(parts)


def _picture_lines(rest: str) -> list[str]:
    """`map_Kd` with the file alone, and its place, from the text after the key."""
    offset, scale, clamped, others = [0.0, 0.0], [1.0, 1.0], False, []
    while (option := rest.split(None, 1)[0]) in OPTIONS:
        values, rest = _values(option, rest.split(None, 1)[1])
        if option in ("-o", "-s"):
            numbers = [float(value) for value in values[:2]]
            (offset if option == "-o" else scale)[: len(numbers)] = numbers
        elif option == "-clamp":
            clamped = values == ["on"]
        elif option not in HARMLESS:
            others.append(option)
    place = " ".join(map(str, (*offset, *scale, int(clamped), *others)))
    return [f"map_Kd {rest.strip().replace(chr(92), '/')}", f"{PLACE} {place}"]


def _values(option: str, rest: str) -> tuple[list[str], str]:
    """The values of an option, and the words after them."""
    values: list[str] = []
    belongs: Callable[[str], bool] = _is_number if option in NUMBERS else bool
    while len(values) < OPTIONS[option] and len(parts := rest.split(None, 1)) == 2 and belongs(parts[0]):
        values.append(parts[0])
        rest = parts[1]
    return values, rest


def _is_number(text: Any) -> bool:
    try:
        float(text)
    except (TypeError, ValueError):
        return False
    return True
