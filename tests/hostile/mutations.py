"""Malformed files, made of a good one: every entry, array and byte of it in turn is something else."""

from __future__ import annotations

import copy
import io
import json
import random
import zipfile
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import tomli_w

HERE = "@@here@@"

LITERALS = {
    "true": "true",
    "text": '"text"',
    "empty text": '""',
    "-1": "-1",
    "0": "0",
    "0.5": "0.5",
    "1e308": "1e308",
    "400 digits": "9" * 400,
    "[]": "[]",
    "{}": "{}",
    "long text": f'"{"x" * 100_000}"',
    "NUL": '"a\\u0000b"',
}
JSON_LITERALS = LITERALS | {
    "null": "null",
    "1e999": "1e999",
    "NaN": "NaN",
    "5000 digits": "9" * 5000,
    "deep": "[" * 1000 + "]" * 1000,
    "up and out": '"../../evil"',
    "absolute": '"/etc/hostname"',
    "lone surrogate": '"\\ud800"',
}
TOML_LITERALS = LITERALS | {
    "nan": "nan",
    "inf": "inf",
    "deep": "[" * 200 + "]" * 200,
    "very deep": "[" * 5000 + "]" * 5000,
    "a date": "1979-05-27",
}


def json_files(good: Any, within: int = 99) -> Iterator[tuple[str, bytes]]:
    """(fault, the file) for a JSON document; of lists only the first `within` entries are changed."""
    return _documents(good, json.dumps, JSON_LITERALS, within)


def toml_files(good: Any) -> Iterator[tuple[str, bytes]]:
    """(fault, the file) for a TOML document."""
    return _documents(good, tomli_w.dumps, TOML_LITERALS, 99)


def _documents(
    good: Any, dump: Callable[[Any], str], literals: Mapping[str, str], within: int
) -> Iterator[tuple[str, bytes]]:
    for path in _paths(good):
        if any(isinstance(part, int) and part >= within for part in path):
            continue
        name = ".".join(map(str, path))
        text = dump(_with(good, path, HERE))
        for label, literal in literals.items():
            yield f"{name} is {label}", text.replace(f'"{HERE}"', literal).encode()
        yield f"{name} is missing", dump(_without(good, path)).encode()
        if isinstance(_at(good, path), dict):
            yield f"{name} has more", dump(_with(good, (*path, "extra"), 1)).encode()
    yield "more", dump({**good, "extra": 1}).encode()
    yield from damaged(dump(good).encode())
    for label in ("null", "text", "[]", "deep", "400 digits"):
        if label in literals:
            yield f"all is {label}", literals[label].encode()


def damaged(good: bytes, flips: int = 12) -> Iterator[tuple[str, bytes]]:
    """(fault, the file) for any file: cut, padded, flipped, of other bytes."""
    for share in (0.0, 0.25, 0.5, 0.75, 0.99):
        yield f"cut to {share:.0%}", good[: int(share * len(good))]
    yield "NUL bytes", bytes(len(good))
    yield "0xff bytes", b"\xff" * len(good)
    yield "UTF-16", good[:1000].decode("latin-1").encode("utf-16")
    yield "twice", good + good
    rng = random.Random(0)
    for _ in range(flips):
        at, bit = rng.randrange(len(good)), rng.randrange(8)
        yield f"bit {bit} of byte {at} flipped", good[:at] + bytes([good[at] ^ 1 << bit]) + good[at + 1 :]


def npz_files(good: Mapping[str, Any]) -> Iterator[tuple[str, bytes]]:
    """(fault, the file) for an `.npz` of these arrays."""
    whole = {name: np.asarray(array) for name, array in good.items()}
    for name, array in whole.items():
        others = {k: v for k, v in whole.items() if k != name}
        yield f"{name} is missing", npz(others)
        for label, other in _arrays(array).items():
            yield f"{name} is {label}", npz({**others, name: other})
        for shape in ((1 << 60,), (1 << 40, 8, 8), (-1, 8), (2**70,)):
            yield f"{name} declares {shape}", npz(others, {f"{name}.npy": _header(shape, array.dtype) + bytes(64)})
        yield f"{name} is no .npy", npz(others, {f"{name}.npy": b"text"})
        yield (
            f"{name} has an odd header",
            npz(others, {f"{name}.npy": b"\x93NUMPY\x01\x00\x10\x00{'descr': 'x', (((\n"}),
        )
        yield f"{name} is of version 9", npz(others, {f"{name}.npy": b"\x93NUMPY\x09\x00"})
    yield "nothing in it", npz({})
    yield from damaged(npz(whole))


def npz(arrays: Mapping[str, Any], raw: Mapping[str, bytes] | None = None) -> bytes:
    """An `.npz` of arrays, and of members as they are given."""
    out = io.BytesIO()
    np.savez(out, **arrays)
    with zipfile.ZipFile(out, "a") as archive:
        for name, data in (raw or {}).items():
            archive.writestr(name, data)
    return out.getvalue()


def _arrays(array: np.ndarray[Any, Any]) -> dict[str, Any]:
    as_float = array.astype(np.float64)
    return {
        "objects": np.array([None, {}, "x"], dtype=object),
        "text": np.array("text"),
        "texts": np.full(array.shape, "a"),
        "bytes": np.array(b"\xff\x00"),
        "dates": np.zeros(array.shape, "M8[s]"),
        "complex": as_float + 1j,
        "records": np.zeros(array.shape, [("a", "u1"), ("b", "f4")]),
        "bools": as_float > 0.5,
        "empty": as_float.reshape(-1)[:0],
        "no axes": np.float64(3.0),
        "one axis more": as_float[None],
        "one axis": as_float.reshape(-1),
        "six axes": as_float.reshape((1,) * max(0, 6 - as_float.ndim) + as_float.shape),
        "larger": np.zeros(tuple(n + 3 for n in array.shape)),
        "NaN": np.full(array.shape, np.nan),
        "infinite": np.full(array.shape, np.inf),
        "1e308": np.full(array.shape, 1e308),
        "negative": -1.0 - as_float,
        "whole": np.full(array.shape, 2**62),
        "half precision": as_float.astype(np.float16),
        "big-endian": as_float.astype(">f8"),
    }


def _header(shape: tuple[int, ...], dtype: np.dtype[Any]) -> bytes:
    text = f"{{'descr': '{dtype.str}', 'fortran_order': False, 'shape': {shape!r}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


def _paths(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield (*path, key)
        yield from _paths(item, (*path, key))


def _at(value: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        value = value[key]
    return value


def _with(good: Any, path: tuple[Any, ...], value: Any) -> Any:
    changed = copy.deepcopy(good)
    _at(changed, path[:-1])[path[-1]] = value
    return changed


def _without(good: Any, path: tuple[Any, ...]) -> Any:
    changed = copy.deepcopy(good)
    del _at(changed, path[:-1])[path[-1]]
    return changed
