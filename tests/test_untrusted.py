"""Files from outside: declared data opens, all else is one InputError."""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np
import pytest

from spikecam_env.errors import InputError
from spikecam_env.untrusted import (
    Count,
    Declared,
    Positive,
    declared,
    number,
    numbers,
    read_arrays,
    read_json,
    read_toml,
)


class Camera(Declared):
    height: Count
    rate_hz: Positive = 40_000.0
    note: str = ""


def test_what_is_declared_is_taken():
    camera = declared(Camera, {"height": 3, "rate_hz": 20_000}, "x.json")
    assert (camera.height, camera.rate_hz, camera.note) == (3, 20_000.0, "")


@pytest.mark.parametrize(
    "data, said",
    [
        ({}, "height is missing"),
        ({"heigth": 3, "height": 3}, r"'heigth'.*\(height\?\)"),
        ({"height": True}, "height = True"),
        ({"height": "3"}, "height = '3'"),
        ({"height": 3.5}, "height = 3.5"),
        ({"height": 0}, "height = 0"),
        ({"height": 10**400}, "height = 1000"),
        ({"height": 10**5000}, "height = a int"),
        ({"height": 3, "rate_hz": 10**400}, "rate_hz"),
        ({"height": 3, "rate_hz": float("nan")}, "finite"),
        ({"height": 3, "rate_hz": -1.0}, "above 0"),
        ({"height": 3, "rate_hz": True}, "rate_hz = True"),
        ({"height": 3, "note": ["a"]}, "note"),
        ([1], "dictionary"),
        (None, "dictionary"),
        ({1: 2, "height": 3}, "x.json"),
    ],
)
def test_what_is_not_declared_is_named(data, said):
    with pytest.raises(InputError, match=said) as refused:
        declared(Camera, data, "x.json")
    assert len(str(refused.value)) < 300


@pytest.mark.parametrize(
    "text", ["", "{", "[" * 100_000, '{"a": NaN}', '{"a": Infinity}', "1" * 5000, '{"a": 1}}', "\ufffe"]
)
def test_what_is_not_json_is_said(tmp_path, text):
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"x\.json"):
        read_json(path)


@pytest.mark.parametrize("text", ["a", "a = ", "a = " + "[" * 100_000, "a = 1\na = 2", "a = 1979-99-99"])
def test_what_is_not_toml_is_said(tmp_path, text):
    path = tmp_path / "x.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"x\.toml"):
        read_toml(path)


@pytest.mark.parametrize("read", [read_json, read_toml, read_arrays])
def test_what_is_no_file_is_said(tmp_path, read):
    for path in (tmp_path / "none", tmp_path, tmp_path / ("n" * 5000), "a\0b"):
        with pytest.raises(InputError):
            read(path)
    (tmp_path / "bytes").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InputError, match="bytes"):
        read(tmp_path / "bytes")


def test_arrays_come_back_by_name(tmp_path):
    np.savez_compressed(tmp_path / "x.npz", a=np.arange(6).reshape(2, 3), b=2.5)
    arrays = read_arrays(tmp_path / "x.npz")
    assert set(arrays) == {"a", "b"} and arrays["a"].shape == (2, 3) and number(arrays, "b", "x") == 2.5
    assert set(read_arrays(tmp_path / "x.npz", ["b"])) == {"b"}
    with pytest.raises(InputError, match="lacks c"):
        read_arrays(tmp_path / "x.npz", ["c"])
    with pytest.raises(InputError, match="one finite number"):
        number(arrays, "a", "x")
    with pytest.raises(InputError, match="real numbers"):
        numbers(np.array(["1"]), "a", "x")


def test_python_objects_are_not_unpickled(tmp_path):
    np.savez(tmp_path / "x.npz", a=np.array([{}, None], dtype=object))
    with pytest.raises(InputError, match="Python objects"):
        read_arrays(tmp_path / "x.npz")


@pytest.mark.parametrize("shape", [(10**6, 10**6, 10**6), (2**40,), (-4,), (3,)])
def test_a_declared_shape_without_its_data_is_refused_before_memory_is_taken(tmp_path, shape):
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(tmp_path / "x.npz", "w") as archive:
        archive.writestr("a.npy", header.getvalue() + b"\0" * 16)
    with pytest.raises(InputError, match=r"x\.npz"):
        read_arrays(tmp_path / "x.npz")


def test_a_damaged_archive_is_refused_wherever_it_is_damaged(tmp_path):
    """Each byte in turn: the arrays come back as they were, or the file is refused."""
    path = tmp_path / "x.npz"
    np.savez_compressed(path, a=np.arange(20, dtype=np.int32))
    whole = path.read_bytes()
    refused = 0
    for at in range(len(whole)):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        try:
            arrays = read_arrays(path)
        except InputError:
            refused += 1
        else:
            assert all(np.array_equal(a, np.arange(20)) for a in arrays.values())
    print(f"{refused} of {len(whole)} refused")
    assert refused > len(whole) // 2


def test_json_numbers_keep_their_value(tmp_path):
    path = tmp_path / "x.json"
    path.write_text(json.dumps({"height": 250, "rate_hz": 0.1}))
    assert read_json(path) == {"height": 250, "rate_hz": 0.1}
