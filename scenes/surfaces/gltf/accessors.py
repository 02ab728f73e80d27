"""Accessors: tables of numbers in a glTF file, as arrays.

Whole numbers that are `normalized` stand for 0..1, signed ones for -1..1 (glTF 2.0, 3.11).  Rows may lie apart
(byteStride), and some may be replaced (sparse; 3.6.2.3).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.surfaces.gltf.container import File, Tree
from spikecam_env.errors import InputError, shown
from spikecam_env.types import Floats

COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
MOST_ITEMS = 1 << 27
"""Numbers of the largest table that is read, 1 GB: a few bytes can state any number of rows."""


def numbers(file: File, index: Any) -> Floats:
    """An accessor as it is meant, (rows, columns) float64; whole numbers that are normalized become shares of 1.

    Raises:
        InputError: the table does not lie within its bytes, or has more than MOST_ITEMS numbers.
    """
    stored = _stored(file, index)
    values = stored.astype(np.float64)
    if file.item("accessors", index).get("normalized") and stored.dtype.kind in "iu":
        values = np.maximum(values / np.iinfo(stored.dtype).max, -1.0)
    return values


def wholes(file: File, index: Any) -> NDArray[np.int64]:
    """An accessor of whole numbers, (rows, columns) int64.

    Raises:
        InputError: as `numbers`, and for floats.
    """
    stored = _stored(file, index)
    if stored.dtype.kind not in "iu":
        raise InputError(f"accessor {index} has numbers of type {stored.dtype}; whole numbers belong there")
    return stored.astype(np.int64)


def _stored(file: File, index: Any) -> NDArray[Any]:
    accessor = file.item("accessors", index)
    kind, columns = np.dtype(COMPONENTS[accessor["componentType"]]), COLUMNS[accessor["type"]]
    count = accessor["count"]
    if not 0 <= count * columns <= MOST_ITEMS:
        raise InputError(
            f"accessor {index} has {shown(count)} rows of {columns}; at most {MOST_ITEMS} numbers are read"
        )
    if "bufferView" in accessor:
        values = _rows(file, accessor, kind, columns, count)
    else:
        values = np.zeros((count, columns), kind)
    return _with_replaced(file, values, accessor["sparse"]) if "sparse" in accessor else values


def _rows(file: File, place: Tree, kind: np.dtype[Any], columns: int, count: int) -> NDArray[Any]:
    """(count, columns) of a bufferView, from the place's byteOffset on."""
    data, start, width = file.view(place["bufferView"]), place.get("byteOffset", 0), columns * kind.itemsize
    stride = file.item("bufferViews", place["bufferView"]).get("byteStride", width)
    if count == 0:
        return np.zeros((0, columns), kind)
    if start < 0 or stride < width or start + (count - 1) * stride + width > len(data):
        rows = f"{shown(count)} rows of {width} bytes, {shown(stride)} apart from byte {shown(start)},"
        raise InputError(
            f"{rows} do not fit into the {len(data)} bytes of their bufferView; the file is cut off or damaged"
        )
    return np.array(np.ndarray((count, columns), kind, data, start, (stride, kind.itemsize)))


def _with_replaced(file: File, values: NDArray[Any], sparse: Tree) -> NDArray[Any]:
    """A copy with the rows of a sparse accessor in place."""
    count, at = sparse["count"], sparse["indices"]
    rows = _rows(file, at, np.dtype(COMPONENTS[at["componentType"]]), 1, count)[:, 0].astype(np.int64)
    if count and rows.max() >= len(values):
        raise InputError(f"a sparse accessor replaces row {rows.max()} of {len(values)}; the file is damaged")
    values = values.copy()
    values[rows] = _rows(file, sparse["values"], values.dtype, values.shape[1], count)
    return values
