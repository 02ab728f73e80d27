from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from spikecam_env.errors import InputError, NotReadyError
from spikecam_env.streams import SpikeWriter, read_recording, read_truth, save_npz, save_vidar_dat
from spikecam_env.version import __version__

SHARED = Path(__file__).parents[2].parent / "shared" / "data" / "real"
needs_shared = pytest.mark.skipif(not SHARED.is_dir(), reason="needs the shared data folder")


def integrating_pixels(frames: int, height: int, width: int, rate: float = 0.2) -> np.ndarray:
    """Regular spikes at rates that vary over the picture, phases at random."""
    rng = np.random.default_rng(0)
    rates = rate * (0.5 + np.linspace(0, 1, width)) * np.ones((height, 1))
    charge = rng.random((height, width)) + np.arange(frames + 1)[:, None, None] * rates
    return np.diff(np.floor(charge), axis=0).astype(np.uint8)


@needs_shared
@pytest.mark.parametrize(
    ("name", "shape", "axis", "rate"),
    [("wall.npz", (500, 250, 400), 2, 0.220), ("helicopter_low_light.npz", (200, 250, 250), 0, 0.031)],
)
def test_real_files_are_read_with_their_time_axis(name: str, shape: tuple[int, ...], axis: int, rate: float) -> None:
    recording = read_recording(SHARED / name)
    assert recording.spikes.shape == shape and recording.spikes.dtype == np.uint8
    assert recording.attributes["time_axis"] == axis
    assert recording.attributes["time_axis_from"] == "spike statistics"
    assert recording.spikes.mean() == pytest.approx(rate, abs=5e-4)
    assert recording.frame_rate_hz is None


def test_time_axis_is_told_from_the_shape_where_spikes_say_nothing(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 2, (250, 400, 30), dtype=np.uint8)
    np.savez_compressed(tmp_path / "a.npz", noise)
    attributes = read_recording(tmp_path / "a.npz").attributes
    assert (attributes["time_axis"], attributes["time_axis_from"]) == (2, "sensor shape")


def test_time_axis_that_cannot_be_told_is_asked_for(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).random((40, 40, 40)) < 0.3
    np.savez(tmp_path / "a.npz", noise)
    with pytest.raises(InputError, match="time_axis=0"):
        read_recording(tmp_path / "a.npz")
    asked = read_recording(tmp_path / "a.npz", time_axis=1, flip=True)
    np.testing.assert_array_equal(asked.spikes, np.moveaxis(noise, 1, 0)[:, ::-1])


def test_packed_along_time_is_unpacked(tmp_path: Path) -> None:
    spikes = integrating_pixels(37, 6, 11)
    for axis in (0, 2):
        packed = np.packbits(np.moveaxis(spikes, 0, axis), axis=axis)
        np.savez(tmp_path / "a.npz", seq=packed, tag=np.zeros((6, 11)), length=37)
        np.testing.assert_array_equal(read_recording(tmp_path / "a.npz").spikes, spikes)
    np.savez(tmp_path / "a.npz", seq=packed, length=80)
    with pytest.raises(InputError, match="80 frames"):
        read_recording(tmp_path / "a.npz")


def test_npz_saved_here_says_its_time_axis(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 2, (20, 6, 11), dtype=np.uint8)
    save_npz(tmp_path / "a.npz", noise)
    recording = read_recording(tmp_path / "a.npz")
    assert recording.attributes == {"key": "spikes", "time_axis": 0, "time_axis_from": "file"}
    np.testing.assert_array_equal(recording.spikes, noise)
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def test_hdf5_gives_back_spikes_attributes_and_truth(tmp_path: Path) -> None:
    spikes = integrating_pixels(50, 5, 9)
    path = tmp_path / "a.h5"
    with SpikeWriter(path, (5, 9), 20_000.0, model="scsim", seed=3) as writer:
        for piece in (spikes[:1], spikes[1:30], spikes[30:]):
            writer.append(piece)
            writer.append_truth(len(piece), radiance=np.full((5, 9), len(piece), np.float32))
        assert not path.exists()
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.spikes, spikes)
    assert recording.frame_rate_hz == 20_000.0
    expected = {"model": "scsim", "seed": 3, "package_version": __version__, "format": "spikecam-recording/1"}
    assert expected.items() <= recording.attributes.items()
    np.testing.assert_array_equal(read_recording(path, first=28, count=5).spikes, spikes[28:33])
    truth = read_truth(path)
    assert truth["frame"].tolist() == [1, 29, 20] and truth["radiance"].shape == (3, 5, 9)
    with h5py.File(path) as file:
        assert file["spikes"].shape == (50, 6) and file["spikes"].chunks[1] == 6


def test_hdf5_that_fails_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="one shape"), SpikeWriter(tmp_path / "a.h5", (5, 9), None) as writer:
        writer.append(np.zeros((2, 9, 5), np.uint8))
    assert not list(tmp_path.iterdir())
    with pytest.raises(NotReadyError, match="not open"):
        SpikeWriter(tmp_path / "a.h5", (5, 9), None).append(np.zeros((1, 5, 9), np.uint8))


def test_attributes_are_plain_and_not_reserved(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="seed is a dict"):
        SpikeWriter(tmp_path / "a.h5", (5, 9), None, seed={})
    with pytest.raises(InputError, match="height"):
        SpikeWriter(tmp_path / "a.h5", (5, 9), None, height=4)
    with pytest.raises(InputError, match="frame_rate_hz = 0"):
        SpikeWriter(tmp_path / "a.h5", (5, 9), 0)


def test_options_belong_to_their_format(tmp_path: Path) -> None:
    save_vidar_dat(tmp_path / "a.dat", np.zeros((2, 4, 8), np.uint8))
    assert read_recording(tmp_path / "a.dat", height=4, width=8).spikes.shape == (2, 4, 8)
    with pytest.raises(InputError, match="time_axis does not apply"):
        read_recording(tmp_path / "a.dat", time_axis=0)
    with pytest.raises(InputError, match=r"one of \.dat"):
        read_recording(tmp_path / "a.avi")
