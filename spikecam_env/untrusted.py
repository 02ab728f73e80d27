"""Files from outside, read in one place: JSON, TOML, arrays and HDF5, checked before anyone uses them.

A format declares its entries once, as a `Declared` class with types and ranges; `declared` checks data against it.
Faults are InputErrors that name the file, the entry, its value and the allowed ones.

    class Camera(Declared):
        height: Count
        frame_rate_hz: Positive

    camera = declared(Camera, read_json(path)["camera"], f"{path}: camera")
"""

from __future__ import annotations

import csv
import errno
import io
import json
import math
import os
import sys
import zipfile
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from spikecam_env.checked import checked_memory, each_once
from spikecam_env.errors import InputError, shown, unknown_name
from spikecam_env.locks import warn_without_locks
from spikecam_env.numbers import (
    Count as Count,
)
from spikecam_env.numbers import (
    Positive as Positive,
)
from spikecam_env.numbers import (
    Seed as Seed,
)
from spikecam_env.numbers import (
    Side as Side,
)
from spikecam_env.numbers import (
    Whole as Whole,
)

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

MOST_TEXT_BYTES = 64 << 20
"""Largest JSON or TOML file that is read; the largest this package writes take a few MB."""

Name = Annotated[str, Field(min_length=1, max_length=255)]
"""Text that is not empty."""


class Declared(BaseModel):
    """Entries of a file: no others are allowed, types are taken as they are, numbers are finite."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


D = TypeVar("D", bound=BaseModel)


def declared(kind: type[D], data: Any, where: str) -> D:
    """Data as an instance of a `Declared` class.

    Args:
        kind: the class.
        data: of a file.
        where: begins the error's text, e.g. a file's path.

    Raises:
        InputError: names the first entry that is missing, unknown, of another type or out of range.
    """
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise _as_input_error(error, kind, where) from error
    except RecursionError as error:
        raise InputError(f"{where}: nested too deeply") from error


def checked_format(data: Any, expected: str, where: str) -> dict[str, Any]:
    """The data; raises InputError unless it is a table whose entry `format` is the one expected."""
    found = data.get("format") if isinstance(data, dict) else type(data).__name__
    if found != expected or not isinstance(data, dict):
        raise InputError(f"{where}: format is {shown(found)}, expected {expected!r}")
    return data


def read_json(path: str | Path) -> Any:
    """The value in a JSON file.

    Raises:
        InputError: the file is missing, too large, not UTF-8, not JSON, nested too deeply, or has NaN or Infinity.
    """
    return parse_json(read_text(path), str(path))


def parse_json(text: str, where: str) -> Any:
    """The value in a JSON text; raises InputError where it is not one."""
    try:
        return json.loads(text, parse_constant=_no_constant, object_pairs_hook=_each_key_once)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where} is not a JSON file: {_short(error)}") from error


def read_toml(path: str | Path) -> dict[str, Any]:
    """The table in a TOML file; raises InputError as `read_json` does."""
    return parse_toml(read_text(path), str(path))


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """The table in a TOML text; raises InputError where it is not one."""
    try:
        table: dict[str, Any] = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where} is not a TOML file: {_short(error)}") from error
    return table


def read_text(path: str | Path) -> str:
    """UTF-8 text; raises InputError where the file cannot be read, is larger than MOST_TEXT_BYTES or is not UTF-8."""
    source = existing_file(path)
    try:
        size = source.stat().st_size
        if size > MOST_TEXT_BYTES:
            raise InputError(f"{source} has {size} bytes; text of at most {MOST_TEXT_BYTES} is read")
        return source.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"cannot read {source}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{source} is not UTF-8 text: {_short(error)}") from error


def read_table(
    path: str | Path, columns: Collection[str], needed: Sequence[str] = ()
) -> list[tuple[int, dict[str, str]]]:
    """Rows of a CSV table whose first line names its columns; a row may be shorter than these, not longer.

    Args:
        path: of the table.
        columns: allowed ones.
        needed: those that must be there.

    Returns:
        (line, cell by column) of each row, cells without spaces about them.

    Raises:
        InputError: with the line, for unknown, repeated and missing columns, rows that are too long, and no table.
    """
    lines = csv.reader(io.StringIO(read_text(path), newline=""), skipinitialspace=True)
    rows: list[tuple[int, dict[str, str]]] = []
    try:
        names = [name.strip() for name in next(lines, [])]
        for name in names:
            if name not in columns:
                raise unknown_name(f"column of {path}", name, columns)
            if names.count(name) > 1:
                raise InputError(f"{path} has {names.count(name)} columns {name!r}; leave one")
        for name in needed:
            if name not in names:
                raise InputError(
                    f"{path} has no column {name!r}; its first line must name the columns: {','.join(needed)}"
                )
        for cells in lines:
            if len(cells) > len(names):
                raise InputError(f"{path}, line {lines.line_num} has more cells than there are columns")
            if cells:
                rows.append((lines.line_num, dict(zip(names, (cell.strip() for cell in cells), strict=False))))
    except csv.Error as error:
        raise InputError(f"{path}, line {lines.line_num} is no line of a table: {_short(error)}") from error
    return rows


def array_names(path: str | Path) -> set[str]:
    """Names of the arrays of an `.npz`; raises InputError where it is missing or none."""
    source = existing_file(path)
    try:
        with zipfile.ZipFile(source) as archive:
            return {name.removesuffix(".npy") for name in archive.namelist()}
    except Exception as error:
        raise InputError(f"{source} is not a readable .npz of plain arrays ({_short(error)})") from error


def read_arrays(path: str | Path, names: Iterable[str] | None = None) -> dict[str, NDArray[Any]]:
    """Arrays of an `.npz` by name, all of them or those of `names`; Python objects are never unpickled.

    Raises:
        InputError: the file is missing, no `.npz`, damaged, lacks a name, holds Python objects, or declares more data
            than it has.
    """
    source = existing_file(path)
    try:
        with zipfile.ZipFile(source) as archive:
            held = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            each_once((info.filename for info in archive.infolist()), str(source))
            wanted = list(held) if names is None else list(names)
            missing = [name for name in wanted if name not in held]
            if missing:
                raise InputError(f"{source} lacks {', '.join(missing)}; it holds {', '.join(held) or 'nothing'}")
            return {name: _array(archive, held[name], source) for name in wanted}
    except InputError:
        raise
    except MemoryError as error:
        raise InputError(f"{source} does not fit in memory; read a part of it or give a smaller one") from error
    except Exception as error:  # zlib, struct, tokenize, ...: the many ways in which a damaged archive fails
        raise InputError(f"{source} is not a readable .npz of plain arrays ({_short(error)})") from error


def open_hdf5(path: str | Path) -> h5py.File:
    """An HDF5 file, open for reading, without a lock where the file system has none.

    Raises:
        InputError: the file is missing, truncated or none, or another program has it locked.
    """
    source = existing_file(path)
    try:
        return _hdf5(source)
    except (OSError, RuntimeError, ValueError) as error:
        if _is_of_a_lock(error):
            raise InputError(
                f"{source} cannot be locked for reading ({_short(error)}); if no other program writes to it, set "
                "HDF5_USE_FILE_LOCKING=FALSE"
            ) from error
        raise InputError(f"{source} is truncated or not an HDF5 file ({_short(error)})") from error


def hdf5_attributes(item: h5py.HLObject, where: str) -> dict[str, Any]:
    """Attributes by name, as Python's own numbers, text and lists; anything else as h5py has it."""
    try:
        return {str(name): _plain(item.attrs[name]) for name in item.attrs}
    except Exception as error:  # h5py has no words for many types
        raise InputError(f"{where}: its attributes cannot be read ({_short(error)})") from error


def hdf5_item(group: h5py.Group, path: str, where: str, *, outside: bool = False) -> h5py.Group | h5py.Dataset:
    """The group or array at a path in a file, e.g. "truth/frame".

    Args:
        group: file, or group in it.
        path: in the group.
        where: begins the error's text.
        outside: follow links, external storage and virtual data, which may lie in other files.

    Raises:
        InputError: there is nothing; or, unless `outside`, it is a link or its values are in another file.
    """
    item: Any = group
    for part in filter(None, path.split("/")):
        if not isinstance(item, h5py.Group) or part not in item.keys():  # noqa: SIM118 - `in` follows links
            held = ", ".join(item.keys()) if isinstance(item, h5py.Group) else "values"
            raise InputError(f"{where} has no {path!r}; it holds {_cut(held) or 'nothing'}")
        try:
            if not outside and item.id.links.get_info(part.encode()).type != h5py.h5l.TYPE_HARD:
                raise InputError(f"{where}: {path} is a link; copy the data into the file, or allow it (outside=True)")
            item = item[part]
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"{where}: {path} cannot be read ({_short(error)})") from error
    if not outside and isinstance(item, h5py.Dataset) and (item.external or item.is_virtual):
        raise InputError(f"{where}: {path} is stored in other files; copy it into one, or allow it (outside=True)")
    return item


def hdf5_values(group: h5py.Group, path: str, where: str, part: Any = (), *, outside: bool = False) -> NDArray[Any]:
    """An array, or its part, e.g. `slice(0, 100)`; raises InputError as `hdf5_item`, and where it cannot be read."""
    item = hdf5_item(group, path, where, outside=outside)
    if not isinstance(item, h5py.Dataset) or item.shape is None:
        raise InputError(f"{where}: {path} is no array")
    try:
        size = math.prod(_selected(item.shape, part))
        checked_memory(size * item.dtype.itemsize, f"{where}: {path}, {item.dtype} of shape {item.shape},")
        return np.asarray(item[part])
    except InputError:
        raise
    except MemoryError as error:
        raise InputError(f"{where}: {path} of shape {item.shape} does not fit in memory; read a part") from error
    except Exception as error:  # filters, checksums, types without a numpy counterpart
        raise InputError(f"{where}: {path} cannot be read ({_short(error)})") from error


def number(arrays: Mapping[str, NDArray[Any]], name: str, where: str) -> float:
    """A single finite number out of an array of any shape; raises InputError where it is none."""
    value = arrays[name]
    if value.size != 1 or value.dtype.kind not in "iuf" or not math.isfinite(value.item()):
        raise InputError(f"{where}: {name} is {value.dtype} of shape {value.shape}; it must be one finite number")
    return float(value.item())


def numbers(array: NDArray[Any], name: str, where: str) -> NDArray[Any]:
    """An array of real numbers as it is; raises InputError for text, dates, complex numbers or records."""
    if array.dtype.kind not in "biuf":
        raise InputError(f"{where}: {name} is {array.dtype}; it must be real numbers")
    return array


def existing_file(path: str | Path) -> Path:
    """The path; raises InputError where it is no file."""
    source = Path(path)
    try:
        if source.is_file():
            return source
        found = "a folder" if source.is_dir() else ""
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {str(source)[:200]!r}: {_short(error)}") from error
    raise InputError(f"{source} is {found}, not a file" if found else f"there is no file {source}")


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo, source: Path) -> NDArray[Any]:
    with archive.open(info) as member:
        version = np.lib.format.read_magic(member)
        read_header = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }.get(version)
        if read_header is None:
            raise InputError(f"{source}: {info.filename} is an .npy of version {version}; save it again")
        shape, _, dtype = read_header(member)
        if dtype.hasobject:
            raise InputError(f"{source}: {info.filename} holds Python objects; save plain arrays")
        declared_bytes = math.prod(shape) * dtype.itemsize
        if min(shape, default=0) < 0 or declared_bytes > info.file_size:
            raise InputError(
                f"{source}: {info.filename} declares {dtype} of shape {_cut(str(shape))}; it has {info.file_size} bytes"
            )
        checked_memory(declared_bytes, f"{source}: {info.filename}, {dtype} of shape {shape},")
    with archive.open(info) as member:
        return np.lib.format.read_array(member, allow_pickle=False)


def _selected(shape: tuple[int, ...], part: Any) -> list[int]:
    """Lengths of the axes that a selection of slices leaves, at most."""
    parts = part if isinstance(part, tuple) else (part,)
    cut = [len(range(*p.indices(n))) if isinstance(p, slice) else n for p, n in zip(parts, shape, strict=False)]
    return [*cut, *shape[len(cut) :]]


def _hdf5(source: Path) -> h5py.File:
    try:
        return h5py.File(source, "r")
    except OSError as error:
        if not _is_of_a_lock(error) or isinstance(error, BlockingIOError):
            raise
        file = h5py.File(source, "r", locking=False)
        warn_without_locks(os.strerror(error.errno or errno.ENOLCK))
        return file


def _is_of_a_lock(error: Exception) -> bool:
    """Whether HDF5 could open a file, and not lock it."""
    return "unable to lock file" in str(error)


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode("utf-8")
    return value.tolist() if isinstance(value, (np.generic, np.ndarray)) else value


def _each_key_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = next(key for number, (key, _) in enumerate(pairs) if key in dict(pairs[:number]))
        raise ValueError(f"{shown(twice)} is given more than once in one object")
    return table


def _no_constant(name: str) -> Any:
    raise ValueError(f"{name} is no JSON number")


def _as_input_error(error: ValidationError, kind: type[BaseModel], where: str) -> InputError:
    first = error.errors(include_url=False)[0]
    place = ".".join(str(part) for part in first["loc"])
    value = shown(first["input"])
    if first["type"] == "extra_forbidden" and len(first["loc"]) == 1:
        return unknown_name(f"entry of {where}", first["loc"][0], kind.model_fields)
    if first["type"] == "missing":
        return InputError(f"{where}: {place} is missing")
    if first["type"] == "value_error":
        return InputError(f"{where}: {place or 'it'} = {value}: {first['ctx']['error']}")
    if first["type"] == "literal_error":
        allowed = first["ctx"]["expected"].replace("'", "").replace(" or ", ", ")
        return InputError(f"{where}: {place} = {value}; choose one of {allowed}")
    message = first["msg"].removeprefix("Input should ")
    return InputError(f"{where}: {place or 'it'} = {value}; it must {message}")


def _short(error: BaseException) -> str:
    return _cut((str(error).splitlines() or [""])[0] or type(error).__name__)


def _cut(text: str) -> str:
    return text if len(text) <= 160 else f"{text[:157]}..."
