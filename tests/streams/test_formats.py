"""Every format that `read_recording` reads: written streams come back; whatever is wrong is one InputError."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from spikecam_env.errors import InputError
from spikecam_env.streams import SpikeWriter, read_recording, read_truth, save_npz, save_vidar_dat
from spikecam_env.streams.recording import ENDINGS, reading_options


def regular(frames: int = 40, shape: tuple[int, int] = (6, 11), seed: int = 0) -> np.ndarray:
    """Pixels of rates 0.1 to 0.3, phases at random."""
    rng = np.random.default_rng(seed)
    rate = rng.uniform(0.1, 0.3, shape)
    return np.diff(np.floor(rng.random(shape) + np.arange(frames + 1)[:, None, None] * rate), axis=0).astype(np.uint8)


def write_mat73(path: Path, **arrays: np.ndarray) -> None:
    """As MATLAB writes version 7.3: HDF5 after 512 bytes, axes the other way about."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, array in arrays.items():
            file[name] = array.T
        file.create_group("#refs#")["a"] = np.zeros((2, 2, 2), np.uint8)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def write_foreign(path: Path, **arrays: np.ndarray) -> None:
    with h5py.File(path, "w") as file:
        for name, array in arrays.items():
            file.create_dataset(f"group/{name}", data=array, compression="gzip")


def write_own(path: Path, spikes: np.ndarray) -> None:
    with SpikeWriter(path, spikes.shape[1:], 40_000.0) as writer:
        writer.append(spikes)


FOREIGN: dict[str, Callable[..., Any]] = {
    ".npz": lambda path, **arrays: np.savez_compressed(path, **arrays),
    ".npy": lambda path, **arrays: np.save(path, *arrays.values()),
    ".mat": lambda path, **arrays: savemat(path, arrays, do_compression=True),
    ".MAT": lambda path, **arrays: write_mat73(path, **arrays),
    ".h5": write_foreign,
    ".hdf5": write_foreign,
}
NAMED = [ending for ending in FOREIGN if ending != ".npy"]


@pytest.mark.parametrize("ending", FOREIGN)
@pytest.mark.parametrize("axis", [0, 2])
@pytest.mark.parametrize("kind", ["uint8", "int8", "bool", "int16", "float32", "float64"])
def test_an_array_comes_back_time_first(tmp_path: Path, ending: str, axis: int, kind: str) -> None:
    path, spikes = tmp_path / f"a{ending}", regular()
    FOREIGN[ending](path, spikes=np.moveaxis(spikes, 0, axis).astype(kind))
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.spikes, spikes)
    assert recording.spikes.dtype == np.uint8 and recording.spikes.flags.c_contiguous
    assert recording.spikes.flags.writeable and not isinstance(recording.spikes.base, np.memmap)
    assert recording.attributes["time_axis"] == axis and f"time_axis {axis}" in str(recording)
    assert recording.attributes["time_axis_from"] == "spike statistics"
    part = read_recording(path, first=3, count=5, flip=True, time_axis=axis)
    np.testing.assert_array_equal(part.spikes, spikes[3:8, ::-1])


@pytest.mark.parametrize("ending", FOREIGN)
def test_one_stream_of_a_batch_is_read(tmp_path: Path, ending: str) -> None:
    path, streams = tmp_path / f"a{ending}", [regular(seed=seed) for seed in range(3)]
    FOREIGN[ending](path, batch=np.stack(streams))
    with pytest.raises(InputError, match=r"batch of 3 streams along axis 0; say which with item, 0 to 2"):
        read_recording(path)
    for item, spikes in enumerate(streams):
        recording = read_recording(path, item=item)
        np.testing.assert_array_equal(recording.spikes, spikes)
        assert recording.attributes["item"] == item
    with pytest.raises(InputError, match="item is 3"):
        read_recording(path, item=3)
    FOREIGN[ending](path, batch=np.stack(streams, axis=3))
    np.testing.assert_array_equal(read_recording(path, item=1, batch_axis=3).spikes, streams[1])
    FOREIGN[ending](path, batch=streams[2][:, None])
    np.testing.assert_array_equal(read_recording(path, batch_axis=1).spikes, streams[2])
    FOREIGN[ending](path, one=streams[0])
    with pytest.raises(InputError, match="no batch"):
        read_recording(path, item=0)


@pytest.mark.parametrize("ending", NAMED)
def test_one_array_of_several_is_read_by_its_name(tmp_path: Path, ending: str) -> None:
    path, a, b = tmp_path / f"a{ending}", regular(seed=1), regular(seed=2)
    FOREIGN[ending](path, a=a, b=b, label=np.arange(4.0))
    group = "/group/" if ending in (".h5", ".hdf5") else ""
    np.testing.assert_array_equal(read_recording(path, key=f"{group}b").spikes, b)
    with pytest.raises(InputError, match="2 of these.*no format attribute" if group else "2 of these"):
        read_recording(path)
    with pytest.raises(InputError, match="label"):
        read_recording(path, key=f"{group}c")
    with pytest.raises(InputError, match="3 axes"):
        read_recording(path, key=f"{group}label")


NOT_STREAMS: dict[str, Any] = {
    "grey": regular() * 200,
    "negative": -regular().view(np.int8),
    "fractions": regular() * 0.5,
    "NaN": np.where(regular(), np.nan, 0.0),
    "infinite": np.where(regular(), np.inf, 0.0),
    "complex": regular() * 1j,
    "two axes": regular()[0],
    "five axes": regular()[None, None],
    "no frames": regular()[:0],
    "no pixels": regular()[:, :0],
}


@pytest.mark.parametrize("ending", FOREIGN)
@pytest.mark.parametrize("name", NOT_STREAMS)
@pytest.mark.parametrize("options", [{}, {"time_axis": 0}])
def test_an_array_that_is_no_stream_is_one_input_error(
    tmp_path: Path, ending: str, name: str, options: dict[str, Any]
) -> None:
    path = tmp_path / f"a{ending}"
    FOREIGN[ending](path, data=NOT_STREAMS[name])
    with pytest.raises(InputError, match=r"a\.") as refused:
        read_recording(path, **options)
    assert "\n" not in str(refused.value) and len(str(refused.value)) < 500


@pytest.mark.parametrize(
    "options",
    [
        {"time_axis": 3},
        {"time_axis": True},
        {"time_axis": "0"},
        {"first": 40},
        {"first": -1},
        {"count": 41},
        {"count": 0.5},
        {"item": -1},
        {"item": 1.0},
        {"key": 3},
        {"batch_axis": 4},
        {"height": 6},
        {"speed": 1},
    ],
)
@pytest.mark.parametrize("ending", FOREIGN)
def test_options_out_of_range_are_refused(tmp_path: Path, ending: str, options: dict[str, Any]) -> None:
    path = tmp_path / f"a{ending}"
    array = regular() if "item" not in options and "batch_axis" not in options else regular()[None]
    FOREIGN[ending](path, spikes=array)
    with pytest.raises(InputError):
        read_recording(path, **options)


def test_another_time_axis_than_the_spikes_say_is_warned_of(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.moveaxis(regular(60, (50, 60)), 0, 2))
    with pytest.warns(UserWarning, match=r"time_axis=0; its spikes say time_axis=2") as warned:
        read_recording(tmp_path / "a.npy", time_axis=0)
    assert warned[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_recording(tmp_path / "a.npy", time_axis=2)


def test_a_recording_of_this_package_takes_its_own_options(tmp_path: Path) -> None:
    write_own(tmp_path / "a.h5", regular())
    assert reading_options(tmp_path / "a.h5") == ("stream", "first", "count")
    with pytest.raises(InputError, match=r"flip does not apply to \.h5 files of this package"):
        read_recording(tmp_path / "a.h5", flip=True)


def test_what_a_foreign_file_keeps_elsewhere_is_refused(tmp_path: Path) -> None:
    """External links, external storage, virtual data, arrays that were never stored."""
    np.save(tmp_path / "secret.bin", regular())
    write_foreign(tmp_path / "other.h5", spikes=regular())
    layout = h5py.VirtualLayout((40, 6, 11), np.uint8)
    layout[:] = h5py.VirtualSource("other.h5", "group/spikes", (40, 6, 11))
    makers: dict[str, Callable[[h5py.File], Any]] = {
        "link": lambda f: f.__setitem__("x", h5py.ExternalLink("other.h5", "/group/spikes")),
        "other files": lambda f: f.create_dataset("x", (5, 6, 11), np.uint8, external=[("secret.bin", 0, 330)]),
        "in other": lambda f: f.create_virtual_dataset("x", layout),
        "declares": lambda f: f.create_dataset("x", (10**9, 6, 11), np.uint8, chunks=(100, 6, 11), compression="gzip"),
    }
    for said, make in makers.items():
        path = tmp_path / f"{said.replace(' ', '-')}.h5"
        with h5py.File(path, "w") as file:
            make(file)
        for options in ({"key": "x"}, {}):
            with pytest.raises(InputError, match=said if options else r"\.h5"):
                read_recording(path, time_axis=0, **options)


GOOD: dict[str, Callable[[Path], Any]] = {
    ".dat": lambda path: save_vidar_dat(path, regular(20, (250, 400))),
    ".npz": lambda path: save_npz(path, regular()),
    ".npy": lambda path: np.save(path, regular()),
    ".mat": lambda path: savemat(path, {"spikes": regular()}),
    ".MAT": lambda path: write_mat73(path, spikes=regular()),
    ".h5": lambda path: write_own(path, regular()),
    ".hdf5": lambda path: write_foreign(path, spikes=regular()),
    ".raw": lambda path: regular(20, (6, 11)).tofile(path),
}


def sized(ending: str) -> dict[str, Any]:
    return {"height": 6, "width": 11} if ending in (".raw", ".bin") else {}


def reads_or_refuses(path: Path, options: dict[str, Any]) -> bool:
    """Whether a file is read; it may be refused, by an InputError of one line, and nothing else."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            spikes = read_recording(path, **options).spikes
        except InputError as error:
            assert "\n" not in str(error) and len(str(error)) < 600
            return False
    assert spikes.ndim == 3 and spikes.dtype == np.uint8 and spikes.max(initial=0) <= 1
    return True


@pytest.mark.parametrize("ending", GOOD)
def test_damaged_files_are_read_or_refused(tmp_path: Path, ending: str) -> None:
    """Bytes changed, cut out, put in: never another exception."""
    path = tmp_path / f"a{ending}"
    GOOD[ending](path)
    whole, rng = path.read_bytes(), np.random.default_rng(0)
    assert reads_or_refuses(path, sized(ending))
    read = 0
    for _ in range(60):
        at, length = int(rng.integers(min(len(whole), 4000))), int(rng.integers(1, 9))
        kind = rng.integers(4)
        put = rng.bytes(length) if kind else b""
        path.write_bytes(whole[:at] + put + whole[at + (length if kind < 2 else 0) :] if kind < 3 else whole[:at])
        read += reads_or_refuses(path, sized(ending))
    print(f"{ending}: {read} of 60 damaged files read, the others refused")


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    data=st.binary(max_size=400) | st.binary(min_size=12_400, max_size=12_600),
    ending=st.sampled_from(ENDINGS),
    head=st.sampled_from([b"", b"PK\x03\x04", b"\x93NUMPY\x01\x00", b"\x89HDF\r\n\x1a\n", b"MATLAB 5.0".ljust(124)]),
    options=st.dictionaries(
        st.sampled_from(["height", "width", "crop_width", "first", "count", "time_axis", "item", "key", "flip"]),
        st.none() | st.integers() | st.floats() | st.text(max_size=3) | st.booleans(),
        max_size=3,
    ),
)
def test_random_bytes_and_options_raise_input_errors_only(
    tmp_path: Path, data: bytes, ending: str, head: bytes, options: dict[str, Any]
) -> None:
    path = tmp_path / f"a{ending}"
    path.write_bytes(head + data)
    reads_or_refuses(path, options)
    if ending == ".h5":
        with pytest.raises(InputError):
            read_truth(path)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(header=st.text(max_size=60) | st.sampled_from(["{'descr': '|O', 'fortran_order': False, 'shape': (3, 4, 5)}"]))
def test_npy_headers_of_any_text_raise_input_errors_only(tmp_path: Path, header: str) -> None:
    text = header.encode("utf-8", "replace")
    (tmp_path / "a.npy").write_bytes(b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + bytes(60))
    reads_or_refuses(tmp_path / "a.npy", {})


@pytest.mark.parametrize("shape", ["(10**15, 250, 400)", "(1000000000000, 250, 400)", "(-1, 250, 400)", "(3, 4, 5)"])
def test_npy_that_declares_more_than_it_holds_is_refused(tmp_path: Path, shape: str) -> None:
    header = io.BytesIO()
    text = f"{{'descr': '|u1', 'fortran_order': False, 'shape': {shape}, }}".encode()
    header.write(b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + bytes(16))
    (tmp_path / "a.npy").write_bytes(header.getvalue())
    with pytest.raises(InputError, match=r"a\.npy"):
        read_recording(tmp_path / "a.npy")


@pytest.mark.parametrize("ending", ENDINGS)
def test_what_is_no_file_is_refused(tmp_path: Path, ending: str) -> None:
    (tmp_path / f"folder{ending}").mkdir()
    (tmp_path / f"empty{ending}").touch()
    for name in ("none", "folder", "empty", "n" * 300, "a\0b"):
        with pytest.raises(InputError):
            read_recording(f"{tmp_path}/{name}{ending}", **sized(ending))
