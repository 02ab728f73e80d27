"""Shapes: a primitive of a glTF mesh as triangles at a place in the world.

    targets   attribute + sum of weight x displacement                      morph targets, 3.7.2.2
    skin      sum over joints of weight x world of joint @ inverse bind     3.7.3; the node's own place does not count
    normals   those of the file; without any, each triangle is flat         3.7.2.1

Poses are those at rest: weights and joints as the file has them, without its animations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.surfaces.assembly import unit_vectors
from scenes.surfaces.gltf.accessors import numbers, wholes
from scenes.surfaces.gltf.container import File, Tree
from scenes.surfaces.gltf.nodes import Matrix, instances
from scenes.surfaces.unshown import LINES
from spikecam_env.errors import InputError
from spikecam_env.types import Floats, Masks

Table = Floats
TRIANGLES, STRIP, FAN = 4, 5, 6
MOST_CORNERS = 1 << 26
"""Of the triangles of a file, its instances counted: each takes some 100 bytes."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Triangles of a primitive."""

    faces: NDArray[np.int64]
    """(F, 3) numbers of vertices."""
    tables: dict[str, Table]
    """A row for each vertex, by the names of the file: POSITION (V, 3), NORMAL, TEXCOORD_0, COLOR_0, ..."""


def shape(file: File, primitive: Tree, weights: list[float]) -> Shape | None:
    """A primitive in the coordinates of its mesh; without normals its triangles share no vertices.

    Args:
        file: the file that holds it.
        primitive: its entry in the tree.
        weights: of its morph targets.

    Returns:
        The shape; None, with a note in `file.unread`, where it has no triangles.

    Raises:
        InputError: a table has not one row for each vertex, or the corners are not of whole triangles.
    """
    mode, names = primitive.get("mode", TRIANGLES), primitive["attributes"]
    if mode not in (TRIANGLES, STRIP, FAN):
        file.without(LINES)
        return None
    if "POSITION" not in names:
        file.without("parts without positions")
        return None
    wanted = [name for name in names if name.startswith(("POSITION", "NORMAL", "TEXCOORD_", "COLOR_0"))]
    tables = {name: numbers(file, names[name]) for name in wanted}
    for target, weight in zip(primitive.get("targets", []), weights, strict=False):
        for name in set(target) & set(tables) if weight else ():
            tables[name] = tables[name] + weight * numbers(file, target[name])
    tables |= _skinned(file, names)
    count = len(tables["POSITION"])
    odd = {name: len(table) for name, table in tables.items() if len(table) != count}
    if odd:
        raise InputError(f"a part has {count} vertices, and rows {odd}; it needs one for each")
    corners = wholes(file, primitive["indices"])[:, 0] if "indices" in primitive else np.arange(count)
    if len(corners) and corners.max() >= count:
        raise InputError(
            f"faces name vertices {corners.min()} to {corners.max()}; the mesh has {count}, counted from 0"
        )
    whole = Shape(_faces(corners, mode), tables)
    return whole if "NORMAL" in tables else _apart(whole)


def placed(file: File, whole: Shape, node: Tree, worlds: dict[int, Matrix], world: Matrix) -> Iterator[Shape]:
    """The shape at each place that a node gives it, with normals of length 1.

    Args:
        file: the file that holds it.
        whole: the shape in the coordinates of its mesh.
        node: the node's entry in the tree.
        worlds: (4, 4) of each node.
        world: (4, 4) of this one.
    """
    if "skin" in node and "JOINTS" in whole.tables:
        yield _moved(whole, _of_joints(file, whole, file.item("skins", node["skin"]), worlds))
        return
    for instance in instances(file, node):
        yield _moved(whole, world @ instance)


def _apart(whole: Shape) -> Shape:
    """With vertices that no two triangles share."""
    corners = whole.faces.ravel()
    tables = {name: table[corners] for name, table in whole.tables.items()}
    return Shape(np.arange(len(corners)).reshape(-1, 3), tables)


def _faces(corners: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """(F, 3) of a list of triangles, a strip or a fan, all with the same side in front."""
    if mode == TRIANGLES:
        if len(corners) % 3:
            raise InputError(f"a part has {len(corners)} corners of triangles; it must be three for each")
        return corners.reshape(-1, 3)
    first = np.arange(max(len(corners) - 2, 0))
    if mode == FAN:
        return corners[np.stack([first + 1, first + 2, 0 * first], -1)]
    odd = first % 2
    return corners[np.stack([first, first + 1 + odd, first + 2 - odd], -1)]


def _skinned(file: File, names: dict[str, Any]) -> dict[str, Table]:
    """JOINTS and WEIGHTS (V, 4 n) of all n sets; empty where there are none."""
    sets = [k for k in range(len(names)) if f"JOINTS_{k}" in names and f"WEIGHTS_{k}" in names]
    if not sets:
        return {}
    joints = np.concatenate([wholes(file, names[f"JOINTS_{k}"]) for k in sets], 1).astype(np.float64)
    return {"JOINTS": joints, "WEIGHTS": np.concatenate([numbers(file, names[f"WEIGHTS_{k}"]) for k in sets], 1)}


def _of_joints(file: File, whole: Shape, skin: Tree, worlds: dict[int, Matrix]) -> Matrix:
    """(V, 4, 4) from the mesh to the world, of each vertex."""
    missing = [joint for joint in skin["joints"] if joint not in worlds]
    if missing:
        raise InputError(f"a skin's joint is node {missing[0]}, which the scene does not have; export the file again")
    at = np.stack([worlds[joint] for joint in skin["joints"]])
    if "inverseBindMatrices" in skin:
        at = at @ numbers(file, skin["inverseBindMatrices"])[: len(at)].reshape(-1, 4, 4).transpose(0, 2, 1)
    joints, weights = whole.tables["JOINTS"].astype(int), whole.tables["WEIGHTS"]
    if len(joints) and joints.max() >= len(at):
        raise InputError(f"a vertex hangs on joint {joints.max()}, its skin has {len(at)}; export the file again")
    shares = weights / np.maximum(weights.sum(1, keepdims=True), np.finfo(np.float64).tiny)
    return np.asarray(np.einsum("vj,vjab->vab", shares, at[joints]))


def _moved(whole: Shape, matrix: Matrix) -> Shape:
    """Through one matrix (4, 4), or one for each vertex (V, 4, 4); mirrored triangles keep their front."""
    linear, faces, tables = matrix[..., :3, :3], whole.faces, dict(whole.tables)
    tables["POSITION"] = np.einsum("...ab,...b->...a", linear, tables["POSITION"]) + matrix[..., :3, 3]
    mirrored = np.linalg.det(linear) < 0
    if mirrored.any():
        faces = np.where(np.broadcast_to(mirrored, len(tables["POSITION"]))[faces[:, :1]], faces[:, ::-1], faces)
    if "NORMAL" in tables:
        tables["NORMAL"] = _turned(tables["NORMAL"], linear, mirrored)
    else:
        tables["NORMAL"] = _flat(tables["POSITION"], faces)
    return replace(whole, faces=faces, tables=tables)


def _turned(normals: Table, linear: Matrix, mirrored: Masks) -> Table:
    """Normals (V, 3) on a surface that goes through (3, 3) or (V, 3, 3): by its inverse, transposed."""
    if not np.isfinite(normals).all():
        raise InputError("normals of the mesh hold NaN or infinity; they must be finite")
    across = np.cross(linear[..., (1, 2, 0), :], linear[..., (2, 0, 1), :])  # inverse transposed times determinant
    turned = np.einsum("...ab,...b->...a", across / (np.abs(across).max() or 1.0), normals)
    return unit_vectors(np.where(mirrored[..., None], -turned, turned))


def _flat(places: Table, faces: NDArray[np.int64]) -> Table:
    """(V, 3) normals of triangles that share no vertices."""
    a, b, c = (places[faces[:, k]] for k in range(3))
    scale = max(np.abs(b - a).max(initial=0), np.abs(c - a).max(initial=0)) or 1.0
    normals = np.zeros_like(places)
    normals[faces] = unit_vectors(np.cross((b - a) / scale, (c - a) / scale))[:, None]
    return normals
