"""Files of `torch.save` from outside, read without trust: numbers, text, lists, tables and plain tensors.

`torch.load(weights_only=True)` runs no foreign code, but believes the sizes in a file and checks no sums.  Here the CRC
of every record is checked.  A tensor is refused that is larger than its record, sparse, or of complex or reduced type.
"""

from __future__ import annotations

import io
import os
import pickle
import zipfile
from collections import OrderedDict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from spikecam_env.errors import InputError
from spikecam_env.untrusted import existing_file

LARGEST_BYTES = 1 << 30
"""Largest file that is read; the largest that training writes has a few MB."""


class _Storage(NamedTuple):
    dtype: np.dtype[Any]


_STORAGES = {
    f"{name}Storage": _Storage(np.dtype(kind))
    for name, kind in (
        *(("Double", "<f8"), ("Float", "<f4"), ("Half", "<f2")),
        *(("Long", "<i8"), ("Int", "<i4"), ("Short", "<i2"), ("Char", "i1"), ("Byte", "u1"), ("Bool", "?")),
    )
}


def read_plain(path: str | os.PathLike[str]) -> Any:
    """The value in a file of `torch.save`; its tensors are on the processor.

    Args:
        path: of the file.

    Raises:
        InputError: the file is missing, damaged, foreign, or holds more than plain values.
    """
    source = existing_file(Path(path))
    try:
        size = source.stat().st_size
        if size > LARGEST_BYTES:
            raise InputError(f"{source} has {size} bytes; checkpoints of at most {LARGEST_BYTES} are read")
        with zipfile.ZipFile(source) as archive:
            records = {info.filename.partition("/")[2]: archive.read(info) for info in _stored(archive)}
        if records.get("byteorder", b"little") != b"little":
            raise ValueError("its numbers are not little-endian")
        return _Plain(records).load()
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"cannot read {source}: {error.strerror or error}") from error
    except Exception as error:  # zipfile, pickle and struct fail in many ways on a damaged file
        reason = (str(error).splitlines() or [""])[0][:160] or type(error).__name__
        raise InputError(
            f"{source} is not a whole torch file of plain values ({reason}); copy it again or train anew"
        ) from error


def _stored(archive: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    """The records of a file.  Torch compresses nothing, so they take no more memory than the file."""
    members = archive.infolist()
    if any(info.compress_type != zipfile.ZIP_STORED or info.file_size != info.compress_size for info in members):
        raise ValueError("it is compressed")
    if sum(info.file_size for info in members) > LARGEST_BYTES:
        raise ValueError("its records overlap")
    return members


class _Plain(pickle._Unpickler):  # the one in Python: damaged files cannot crash it
    def __init__(self, records: dict[str, bytes]) -> None:
        super().__init__(io.BytesIO(records["data.pkl"]))
        self._records = records

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == ("collections", "OrderedDict"):
            return OrderedDict
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return _tensor
        if module == "torch" and name in _STORAGES:
            return _STORAGES[name]
        raise pickle.UnpicklingError(f"it holds {module}.{name}")

    def persistent_load(self, pid: Any) -> NDArray[Any]:
        kind, storage, key, _, count = pid
        if kind != "storage" or not isinstance(storage, _Storage):
            raise pickle.UnpicklingError("it refers to something that is no tensor")
        numbers = np.frombuffer(self._records[f"data/{key}"], storage.dtype)
        if len(numbers) != count:
            raise ValueError(f"a tensor has {len(numbers)} numbers, {count} are declared")
        return numbers


def _tensor(storage: Any, offset: Any, shape: Any, strides: Any, *_: Any) -> Tensor:
    if not isinstance(storage, np.ndarray) or len(shape) != len(strides):
        raise ValueError("a tensor is not plain")
    if any(type(n) is not int or n < 0 for n in (offset, *shape, *strides)):
        raise ValueError(f"a tensor has offset {offset}, shape {shape}, strides {strides}")
    numbers, last = 1, offset
    for size, stride in zip(shape, strides, strict=True):
        numbers, last = numbers * size, last + max(size - 1, 0) * stride
    if numbers and (last >= len(storage) or numbers > len(storage)):
        raise ValueError(f"a tensor of shape {shape} is declared over {len(storage)} numbers")
    return (
        torch.from_numpy(storage.copy()).as_strided(shape, strides, offset).clone(memory_format=torch.preserve_format)
    )


def tensors_like(expected: dict[str, Tensor], found: Any, where: str) -> dict[str, Tensor]:
    """The `found` tensors; InputError unless they have the names, shapes and types of `expected`, and are finite."""
    names = set(found) if isinstance(found, dict) else set()
    if not isinstance(found, dict) or names != set(expected):
        differ = sorted(map(str, names ^ set(expected)))[:3]
        raise InputError(f"{where} holds weights of another network ({', '.join(differ)[:120]} differ); train again")
    for name, tensor in expected.items():
        given = found[name]
        kind = f"{given.dtype} {tuple(given.shape)}" if isinstance(given, Tensor) else type(given).__name__
        if kind != f"{tensor.dtype} {tuple(tensor.shape)}":
            raise InputError(
                f"{where} holds weights of another network ({name} is {kind}, here {tuple(tensor.shape)}); train again"
            )
        if not bool(torch.isfinite(given).all()):
            raise InputError(
                f"{where}: {name} is not finite; the file is damaged or its training went wrong: train again"
            )
    return found
