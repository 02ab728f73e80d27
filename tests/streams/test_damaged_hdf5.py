"""HDF5 recordings that are damaged, hostile, or of an earlier version of the package."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from spikecam_env.datasets.window import read_window
from spikecam_env.errors import InputError
from spikecam_env.streams import SpikeWriter, read_recording, read_truth

SHAPE = (16, 40)


def recorded(path: Path) -> np.ndarray:
    """A small recording with all that one can have; returns its spikes."""
    spikes = np.random.default_rng(0).integers(0, 2, (100, *SHAPE), dtype=np.uint8)
    with SpikeWriter(path, SHAPE, 40_000.0, model="name = 'scsim' é", seed=3, scene="", gain=0.5, dark=True) as writer:
        for start in range(0, 100, 40):
            writer.append(spikes[start : start + 40], spikes[start : start + 40])
            writer.append_truth(start + 0.5, radiance=spikes[start].astype(np.float32), pose=np.arange(3.0))
    return spikes


def contents(path: Path) -> dict[str, Any]:
    recording, clean = read_recording(path), read_recording(path, stream="clean")
    truth = {name: array.tobytes() for name, array in read_truth(path).items()}
    return {**recording.attributes, **truth, "spikes": recording.spikes.tobytes(), "clean": clean.spikes.tobytes()}


def test_a_changed_byte_is_noticed_wherever_it_is(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    recorded(path)
    whole, expected = path.read_bytes(), contents(path)
    rng = np.random.default_rng(1)
    changed = rng.choice(len(whole), 120, replace=False)
    refused = silent = 0
    for at in changed:
        path.write_bytes(whole[:at] + bytes([whole[at] ^ (1 << rng.integers(8))]) + whole[at + 1 :])
        try:
            silent += contents(path) != expected
        except InputError as error:
            assert "a.h5" in str(error) and "\n" not in str(error)
            refused += 1
    print(f"{len(changed)} of {len(whole)} bytes changed: {refused} refused, {silent} read wrong, the others unused")
    assert silent == 0 and refused > 70


def test_three_changed_bytes_of_the_spikes_are_an_input_error(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    spikes = recorded(path)
    whole, packed = path.read_bytes(), np.packbits(spikes[33].ravel(), bitorder="little").tobytes()
    at = whole.index(packed)
    path.write_bytes(whole[:at] + bytes(255 - b for b in packed[:3]) + whole[at + 3 :])
    with pytest.raises(InputError, match=r"a\.h5.*cannot be read"):
        read_recording(path)
    with pytest.raises(InputError, match=r"a\.h5.*cannot be read"):
        read_window(path, 40, reach=20)


def test_the_same_calls_write_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.h5", "b.h5"):
        recorded(tmp_path / name)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def as_made_before(path: Path) -> np.ndarray:
    """As earlier versions wrote: oldest HDF5 features, text of varying length, no checksums."""
    packed = np.random.default_rng(0).integers(0, 256, (50, 80), dtype=np.uint8)
    with h5py.File(path, "w", libver=("earliest", "v110")) as file:
        file.attrs.update({"format": "spikecam-recording/1", "height": 16, "width": 40, "model": "scsim"})
        stream = file.create_dataset("spikes", (0, 80), np.uint8, maxshape=(None, 80), chunks=(32, 80))
        stream.resize(50, axis=0)
        stream[:] = packed
    return packed


def test_files_without_checksums_open(tmp_path: Path) -> None:
    packed = as_made_before(tmp_path / "a.h5")
    recording = read_recording(tmp_path / "a.h5")
    assert np.array_equal(np.packbits(recording.spikes.reshape(50, -1), axis=1, bitorder="little"), packed)
    assert recording.attributes["model"] == "scsim" and recording.frame_rate_hz is None
    assert read_truth(tmp_path / "a.h5") == {}


def _replace(file: h5py.File, name: str, **options: Any) -> None:
    del file[name]
    file.create_dataset(name, **options)


def _link(file: h5py.File, name: str, link: Any) -> None:
    del file[name]
    file[name] = link


def _virtual(file: h5py.File) -> None:
    del file["spikes"]
    layout = h5py.VirtualLayout((50, 80), np.uint8)
    layout[:] = h5py.VirtualSource("other.h5", "spikes", (50, 80))
    file.create_virtual_dataset("spikes", layout)


def _external(file: h5py.File) -> None:
    _replace(file, "spikes", shape=(5, 80), dtype=np.uint8, external=[("secret.bin", 0, 400)])


SPOILT: dict[str, tuple[Callable[[h5py.File], Any], str]] = {
    "height is text": (lambda f: f.attrs.update(height="16"), "height = '16'"),
    "height is an array": (lambda f: f.attrs.update(height=[16, 16]), "height"),
    "height is negative": (lambda f: f.attrs.update(height=-16), "height = -16"),
    "height is 0": (lambda f: f.attrs.update(height=0), "height = 0"),
    "height is huge": (lambda f: f.attrs.update(height=2**40), "pixels"),
    "height is unsigned and huge": (lambda f: f.attrs.update(height=np.uint64(2**63)), "height"),
    "height is a fraction": (lambda f: f.attrs.update(height=16.5), "height"),
    "height is a bool": (lambda f: f.attrs.update(height=True), "height"),
    "height is nothing": (lambda f: f.attrs.update(height=h5py.Empty("i")), "height"),
    "height is a reference": (lambda f: f.attrs.update(height=f["spikes"].ref), "height"),
    "height is missing": (lambda f: f.attrs.__delitem__("height"), "height is missing"),
    "width of other data": (lambda f: f.attrs.update(width=41), "need uint8"),
    "format is a number": (lambda f: f.attrs.update(format=1), "not a recording of this package"),
    "format is an array": (lambda f: f.attrs.update(format=["a", "b"]), "not a recording of this package"),
    "format is an empty array": (lambda f: f.attrs.update(format=np.zeros(0)), "not a recording of this package"),
    "format is a record": (
        lambda f: f.attrs.update(format=np.zeros(1, [("a", "u1")])),
        "not a recording of this package",
    ),
    "format is another": (lambda f: f.attrs.update(format="spikecam-maps/1"), "not a recording of this package"),
    "frame rate is text": (lambda f: f.attrs.update(frame_rate_hz="fast"), "frame_rate_hz"),
    "frame rate is NaN": (lambda f: f.attrs.update(frame_rate_hz=np.nan), "frame_rate_hz"),
    "frame rate is negative": (lambda f: f.attrs.update(frame_rate_hz=-1.0), "frame_rate_hz"),
    "frame rate is a list": (lambda f: f.attrs.update(frame_rate_hz=[1.0]), "frame_rate_hz"),
    "spikes are float": (lambda f: _replace(f, "spikes", data=np.zeros((5, 80))), "float64"),
    "spikes are int8": (lambda f: _replace(f, "spikes", data=np.zeros((5, 80), np.int8)), "int8"),
    "spikes are text": (lambda f: _replace(f, "spikes", data=b"text"), "spikes is"),
    "spikes are a record": (lambda f: _replace(f, "spikes", data=np.zeros((5, 80), [("a", "u1")])), "spikes is"),
    "spikes have 3 axes": (lambda f: _replace(f, "spikes", data=np.zeros((5, 16, 40), np.uint8)), r"\(5, 16, 40\)"),
    "spikes are a number": (lambda f: _replace(f, "spikes", data=np.uint8(3)), r"\(\)"),
    "spikes are nothing": (lambda f: _replace(f, "spikes", data=h5py.Empty("u1")), "no array"),
    "spikes are none": (lambda f: f.__delitem__("spikes"), "has no 'spikes'"),
    "no frames": (lambda f: f["spikes"].resize(0, axis=0), "holds 0"),
    "spikes are a group": (lambda f: (f.__delitem__("spikes"), f.create_group("spikes")), "no array"),
    "spikes are an outer link": (lambda f: _link(f, "spikes", h5py.ExternalLink("other.h5", "/spikes")), "link"),
    "spikes are a soft link": (lambda f: _link(f, "spikes", h5py.SoftLink("/truth")), "link"),
    "spikes lie elsewhere": (_external, "other files"),
    "spikes are virtual": (_virtual, "other files"),
    "a million million frames": (lambda f: f["spikes"].resize(10**12, axis=0), "declares"),
    "10^15 frames": (lambda f: f["spikes"].resize(10**15, axis=0), "declares"),
    "some frames never stored": (lambda f: f["spikes"].resize(10**4, axis=0), "declares"),
    "compressed, never stored": (
        lambda f: _replace(f, "spikes", shape=(10**6, 80), dtype=np.uint8, compression="gzip", chunks=(32, 80)),
        "declares",
    ),
}


@pytest.mark.parametrize("name", SPOILT)
def test_a_spoilt_recording_is_one_input_error(name: str, tmp_path: Path) -> None:
    spoil, said = SPOILT[name]
    path = tmp_path / "a.h5"
    recorded(path)
    (tmp_path / "secret.bin").write_bytes(bytes(400))
    with h5py.File(path, "a") as file:
        spoil(file)
    with pytest.raises(InputError, match=said) as refused:
        read_recording(path)
    assert "a.h5" in str(refused.value) and "\n" not in str(refused.value) and len(str(refused.value)) < 400


ODD_TRUTH: dict[str, tuple[Callable[[h5py.File], Any], str]] = {
    "an array": (lambda f: _replace(f, "truth", data=np.zeros(3)), "group"),
    "groups in it": (lambda f: f["truth"].create_group("more"), "more is no array"),
    "a link": (lambda f: _link(f, "truth", h5py.ExternalLink("other.h5", "/truth")), "link"),
    "a link in it": (lambda f: f["truth"].__setitem__("x", h5py.ExternalLink("other.h5", "/x")), "link"),
    "giant": (lambda f: f["truth"].create_dataset("x", (10**15,), np.float64, chunks=(1000,)), "memory"),
    "a broken link": (lambda f: _link(f, "truth", h5py.SoftLink("/nowhere")), "link"),
}


@pytest.mark.parametrize("name", ODD_TRUTH)
def test_odd_truth_is_one_input_error(name: str, tmp_path: Path) -> None:
    spoil, said = ODD_TRUTH[name]
    recorded(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as file:
        spoil(file)
    with pytest.raises(InputError, match=said):
        read_truth(tmp_path / "a.h5")
    assert read_recording(tmp_path / "a.h5").spikes.shape == (100, *SHAPE)


def test_every_length_of_a_truncated_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    recorded(path)
    whole = path.read_bytes()
    for length in range(0, len(whole), 397):
        path.write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"a\.h5"):
            read_recording(path)


@pytest.mark.parametrize(
    ("value", "said"),
    [(1j, "complex"), (2**64, "64 bits"), (10**400, "64 bits"), ("\ud800", "UTF-8"), ([1], "list"), (None, "NoneType")],
)
def test_attributes_that_hdf5_cannot_hold_are_refused(value: Any, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        SpikeWriter(tmp_path / "a.h5", SHAPE, None, note=value)


def test_truth_keeps_its_dtype_and_shape(tmp_path: Path) -> None:
    """A second truth of another dtype would be cast without a word."""
    for first, second, said in (
        (np.arange(3), np.arange(3) + 0.5, "float64"),
        (np.arange(3.0), np.arange(4.0), r"\(4,\)"),
        (np.array(["a"]), None, "<U1"),
        (np.array([{}], object), None, "object"),
        (np.zeros((2, 0)), None, r"\(2, 0\)"),
    ):
        with pytest.raises(InputError, match=said), SpikeWriter(tmp_path / "a.h5", SHAPE, None) as writer:
            writer.append_truth(0.5, pose=first)
            writer.append_truth(1.5, pose=second)
    assert not list(tmp_path.iterdir())
