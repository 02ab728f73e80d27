"""Colours and coordinates in mesh files that trimesh passes over: their names."""

from __future__ import annotations

import re

import numpy as np
import trimesh

PLY_READ = {
    *("x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "alpha", "u", "v", "s", "t", "texture_u", "texture_v"),
    *("vertex_indices", "vertex_index", "texcoord"),
}
"""Properties of a PLY that become shape or albedo."""
OF_LOOKS = re.compile(r"red|green|blue|alpha|colou?r|intensity|gr[ae]y|luminance|albedo|tex|^[rgbastuv]$")
"""Names of properties that bear on albedo."""


def unread_properties(kind: str, data: bytes, meshes: list[trimesh.Trimesh]) -> list[str]:
    """Names of the properties of a file that bear on albedo, and that trimesh does not read.

    Args:
        kind: ending of the file, without the dot.
        data: its content.
        meshes: as trimesh read them.
    """
    if kind == "ply":
        head = data[: max(data.find(b"end_header"), 0)].decode("ascii", "replace")
        names = re.findall(r"^property .*?(\S+)\s*$", head, re.M)
        return [
            f"the property {name}" for name in dict.fromkeys(names) if name not in PLY_READ and OF_LOOKS.search(name)
        ]
    if kind == "stl" and any(np.any(mesh.face_attributes.get("stl", 0)) for mesh in meshes):
        return ["colours of faces (attribute bytes)"]
    return _of_off(data.decode("ascii", "replace").split("\n")) if kind == "off" else []


def _of_off(lines: list[str]) -> list[str]:
    """Of an OFF file: `COFF` has colours of vertices; numbers after a face's corners are its colour."""
    lines = [text for line in lines if (text := line.partition("#")[0].strip())]
    names = ["colours of vertices"] if "C" in lines[0].split("OFF")[0] else []
    words = [line.split() for line in lines]
    coloured = [row for row in words[-1:] if row[0].isdigit() and len(row) > int(row[0]) + 1 > 3]
    return names + (["colours of faces"] if coloured else [])
