"""Nodes: where the meshes of a glTF file are.

    world = world of the parent @ (matrix, or T R S)          glTF 2.0, 3.5.2

A mesh may be at several places: several nodes, or instances of one (EXT_mesh_gpu_instancing).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from trimesh.transformations import quaternion_matrix

from scenes.surfaces.gltf.accessors import numbers
from scenes.surfaces.gltf.container import File, Tree
from spikecam_env.errors import InputError
from spikecam_env.types import Floats

Matrix = Floats
INSTANCING = "EXT_mesh_gpu_instancing"
VISIBILITY = "KHR_node_visibility"


def worlds(file: File) -> dict[int, Matrix]:
    """(4, 4) of each node of the scene that is shown, by its number; the parents come first.

    The scene is the one that the file names, else its first, else all nodes without a parent.  Nodes that
    KHR_node_visibility hides are left out, with those below them.

    Raises:
        InputError: a node is below two others, or below itself.
    """
    places: dict[int, Matrix] = {}
    waiting = [(root, np.eye(4)) for root in reversed(_roots(file))]
    while waiting:
        number, above = waiting.pop()
        node = file.item("nodes", number)
        if number in places:
            raise InputError(f"node {number} is below two nodes, or below itself; export the file again")
        places[number] = above @ _own(node)
        if extension(node, VISIBILITY).get("visible", True):
            waiting += [(child, places[number]) for child in reversed(node.get("children", []))]
        else:
            del places[number]
    return places


def instances(file: File, node: Tree) -> Iterator[Matrix]:
    """(4, 4) from the node to each instance of its mesh."""
    of = extension(node, INSTANCING).get("attributes")
    if not of:
        yield np.eye(4)
        return
    tables = {name: numbers(file, of[name]) for name in ("TRANSLATION", "ROTATION", "SCALE") if name in of}
    for row in zip(*tables.values(), strict=True):
        yield _own({name.lower(): values for name, values in zip(tables, row, strict=True)})


def extension(thing: Tree, name: str) -> Tree:
    """An extension of a part of the tree; empty where it has none."""
    return dict(thing.get("extensions", {}).get(name, {}))


def _roots(file: File) -> list[Any]:
    scenes = file.tree.get("scenes", [])
    if not scenes:
        below = {child for node in file.tree.get("nodes", []) for child in node.get("children", [])}
        return [number for number in range(len(file.tree.get("nodes", []))) if number not in below]
    return list(file.item("scenes", file.tree.get("scene", 0)).get("nodes", []))


def _own(node: Tree) -> Matrix:
    """(4, 4) of a node to its parent."""
    matrix = np.eye(4)
    if "matrix" in node:
        matrix[:] = np.array(node["matrix"], np.float64).reshape(4, 4).T
        return matrix
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    turn = quaternion_matrix((w, x, y, z))
    matrix[:3, :3] = turn[:3, :3] * np.array(node.get("scale", (1, 1, 1)), np.float64)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix
