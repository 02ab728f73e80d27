"""A glTF file as pieces: triangles in the world, each with its look."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import trimesh

from scenes.surfaces.assembly import Albedo
from scenes.surfaces.gltf.container import File, Tree, opened
from scenes.surfaces.gltf.looks import Look, Looks
from scenes.surfaces.gltf.nodes import worlds
from scenes.surfaces.gltf.shapes import MOST_CORNERS, Shape, placed, shape
from scenes.surfaces.gltf.unread import check_required, note_unread
from spikecam_env.errors import InputError


@dataclass(frozen=True, eq=False)
class MeshPart:
    """A part of a mesh with one material, at one place."""

    mesh: trimesh.Trimesh
    """In the world, with normals, and texture coordinates where it has some."""
    albedo: Albedo | None = None
    """One value, one for each vertex (V,), or a texture (h, w); None: as the mesh's material has it."""
    emission: float = 0.0
    """Radiance that it gives by itself."""


def read_gltf(data: bytes, beside: Callable[[str], bytes], own: bool = True) -> tuple[list[MeshPart], list[str]]:
    """The scene that a glTF file shows, at rest.

    Args:
        data: content of a .glb or .gltf file.
        beside: returns the bytes of a file that this one names, and raises an error where there is none.
        own: whether the file's own albedo is wanted; else pieces have one value, and coordinates for another texture.

    Returns:
        The pieces, and the names of the parts of the file that they do not show.

    Raises:
        InputError: the file is no glTF 2, is damaged, or needs an extension that is not read.  A damaged file may
            raise other errors too.
    """
    file = opened(data, beside)
    check_required(file.tree)
    looks, places, pieces, corners = Looks(file, own), worlds(file), [], 0
    for number, world in places.items():
        node = file.item("nodes", number)
        if "mesh" not in node:
            continue
        for whole, look in _parts(file, node, looks):
            for at in placed(file, whole, node, places, world):
                corners += at.faces.size
                if corners > MOST_CORNERS:
                    raise InputError(f"the file has more than {MOST_CORNERS} corners; make it simpler first")
                pieces.append(_piece(file, at, look))
    note_unread(file)
    return pieces, list(file.unread)


def _parts(file: File, node: Tree, looks: Looks) -> Iterator[tuple[Shape, Look]]:
    """The shapes of a node's mesh that can be seen, in the coordinates of the mesh."""
    mesh = file.item("meshes", node["mesh"])
    for primitive in mesh["primitives"]:
        whole = shape(file, primitive, node.get("weights") or mesh.get("weights") or [])
        if whole is None or not len(whole.faces):
            continue
        look = looks.of(whole, primitive)
        if look is None:
            continue
        if looks.is_two_sided(primitive) and not trimesh.Trimesh(whole.tables["POSITION"], whole.faces).is_watertight:
            file.without("two-sided parts (shaded by their front)")
        yield whole, look


def _piece(file: File, at: Shape, look: Look) -> MeshPart:
    mesh = trimesh.Trimesh(at.tables["POSITION"], at.faces, vertex_normals=at.tables["NORMAL"], process=False)
    if look.uv is not None:
        mesh.visual = trimesh.visual.TextureVisuals(uv=look.uv)
    return MeshPart(mesh, look.albedo, look.emission)
