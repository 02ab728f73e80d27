"""SCFlow's layout: as its own loader would read it, with the spikes of the recording and the true way of its points."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from small_dataset import SHAPE, small_plan

from denoiser import denoise
from spikecam_env.datasets import build, phm_n
from spikecam_env.datasets.export import export_scflow
from spikecam_env.datasets.manifest import Manifest
from spikecam_env.datasets.scflow import first_frames, read_flo, write_flo
from spikecam_env.errors import InputError, WriteError
from spikecam_env.streams import read_recording
from tests.commands import said, spikecam

PAN = (0.5, -0.25)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("small")
    build(small_plan(200), folder)
    return folder


@pytest.fixture(scope="module")
def panned(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("panned")
    build(phm_n(scenes=("disk",), shape=SHAPE, frames=200, pan=PAN, renderer="embree"), folder)
    return folder


@pytest.fixture(scope="module")
def windows(dataset: Path, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("scflow") / "out"
    export_scflow([dataset], out)
    return out


def loaded(folder: Path, scene: str, dt: int) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Samples as SCFlow's loader collects them: it counts the windows, and goes to the last but one."""
    spikes, truth = folder / scene / f"encoding25_dt{dt}", folder / scene / f"dt={dt}" / "motion_vector"
    found = []
    for st in range(0, len(list(spikes.glob("*.npy"))) - 1):
        first, second, flow = spikes / f"{st}.npy", spikes / f"{st + 1}.npy", truth / f"{st:04d}.flo"
        if first.exists() and second.exists() and flow.exists():
            with flow.open("rb") as file:
                assert np.fromfile(file, np.float32, 1) == 202021.25
                columns, rows = np.fromfile(file, np.int32, 2)
                values = np.fromfile(file, np.float32, 2 * columns * rows).reshape(rows, columns, 2)
            found.append((np.load(first), np.load(second), values))
    return found


@pytest.mark.parametrize("dt, pairs", [(10, 6), (20, 3)])
@pytest.mark.parametrize("file, scene", [("test/disk", "test/disk"), ("train/001", "train/1")])
def test_windows_are_those_of_the_recording_from_frame_100(
    dt, pairs, file, scene, dataset: Path, windows: Path
) -> None:
    recorded = read_recording(dataset / f"{file}.h5").spikes
    samples = loaded(windows, scene, dt)
    assert len(samples) == pairs == len(first_frames(200, dt))
    for number, (first, second, flow) in enumerate(samples):
        middle = 100 + number * dt
        assert first.dtype == np.uint8 and flow.shape == (*SHAPE, 2)
        assert np.array_equal(first, recorded[middle - 12 : middle + 13])
        assert np.array_equal(second, recorded[middle + dt - 12 : middle + dt + 13])
    assert len(list((windows / scene / f"dt={dt}" / "motion_vector").iterdir())) == pairs


def test_the_truth_leads_to_the_light_of_the_next_window(dataset: Path, windows: Path) -> None:
    """Upright, x before y, in pixels: light at the end of the way is that of its beginning; elsewhere it is not."""
    manifest = Manifest.read(dataset)
    disk = manifest.scene(next(file for file in manifest.files if file["scene"] == "disk"))
    y, x = np.indices(SHAPE)
    inside = np.hypot(x - 23.5, y - 15.5) < 11
    for number, (_, _, flow) in enumerate(loaded(windows, "test/disk", 20)):
        before, after = (disk.truth(100.5 + 20 * (number + i)).radiance for i in (0, 1))
        errors = {}
        for name, way in {"flow": flow, "none": 0 * flow, "swapped": flow[..., ::-1], "turned": flow[::-1]}.items():
            at = np.rint(np.stack([y + way[..., 1], x + way[..., 0]])).astype(int)
            later = after[tuple(np.clip(at, 0, np.array(SHAPE)[:, None, None] - 1))]
            errors[name] = float(np.abs(later - before)[inside].mean())
        print({name: round(error, 4) for name, error in errors.items()})
        assert errors["flow"] < 0.8 * min(errors["none"], errors["swapped"], errors["turned"])


def test_before_a_moving_camera_everything_at_rest_goes_the_other_way(panned: Path, tmp_path: Path) -> None:
    done = export_scflow([panned], tmp_path / "out", intervals=(10,))
    for _, _, flow in loaded(tmp_path / "out", "test/disk", 10):
        assert np.abs(np.median(flow[:4].reshape(-1, 2), axis=0) - (-5.0, 2.5)).max() < 0.01
    assert done[0].flow > 5
    assert Manifest.read(panned).pan == PAN


def test_any_stream_is_exported_and_how_it_was_made_is_recorded(dataset: Path, tmp_path: Path, monkeypatch) -> None:
    disk = dataset / "test" / "disk.h5"
    clean = read_recording(disk, stream="clean").spikes
    noisy = read_recording(disk).spikes
    wanted = {
        "clean": ((*("--stream", "clean"),), clean),
        "best": (("--denoise", "fast", "--brightness", 2), denoise(noisy, "fast", brightness=2)),
    }
    for name, (options, stream) in wanted.items():
        assert spikecam("export", dataset, "--layout", "scflow", "--out", tmp_path / name, *options) == 0
        for number, (first, _, _) in enumerate(loaded(tmp_path / name, "test/disk", 20)):
            assert np.array_equal(first, stream[100 + 20 * number - 12 : 100 + 20 * number + 13])
    scene = json.loads((tmp_path / "best" / "export.json").read_text())["scenes"][-1]
    assert scene["denoiser"]["mode"] == "fast" and scene["denoiser"]["brightness"] == 2.0
    assert scene["rate"] == pytest.approx(2 * noisy.mean(), rel=0.1)


def test_what_cannot_be_exported_is_refused_in_a_line_with_nothing_left(dataset: Path, tmp_path: Path, capsys) -> None:
    short = tmp_path / "short"
    build(small_plan(150), short)
    disk, out = dataset / "test" / "disk.h5", tmp_path / "out"
    for source, options, message in (
        (disk, (), "is no folder of a dataset"),
        (tmp_path, (), "is no dataset"),
        (short, (), "two windows 20 frames apart need 160"),
        (dataset, ("--denoise", "fast", "--brightness", 0), "brightness = 0"),
    ):
        capsys.readouterr()
        assert spikecam("export", source, "--layout", "scflow", "--out", out, *options) == 2
        error = capsys.readouterr().err
        assert message in error and len(said(error)) == 1, error
        assert not out.exists()
    with pytest.raises(InputError, match="are named 'train/0'"):
        export_scflow([dataset, dataset], out)
    out.mkdir()
    (out / "mine").touch()
    with pytest.raises(WriteError, match="not an empty folder"):
        export_scflow([dataset], out)


def test_a_flow_is_read_as_it_was_written(tmp_path: Path) -> None:
    flow = np.random.default_rng(1).normal(size=(5, 7, 2)).astype(np.float32)
    write_flo(tmp_path / "a.flo", flow)
    assert np.array_equal(read_flo(tmp_path / "a.flo", (5, 7)), flow)
    with pytest.raises(InputError, match=r"\(5, 7, 3\)"):
        write_flo(tmp_path / "b.flo", np.zeros((5, 7, 3)))


@pytest.mark.parametrize(
    "damage, message",
    [
        (lambda data: b"", "is no .flo file"),
        (lambda data: data[:11], "is no .flo file"),
        (lambda data: b"PIE1" + data[4:], "is no .flo file"),
        (lambda data: data[:-1], "has 291 bytes; 5 x 7 pixels take 292"),
        (lambda data: data + b"x", "has 293 bytes"),
        (lambda data: data[:4] + b"\xff" * 8 + data[12:], "is no .flo file"),
        (lambda data: data[:4] + b"\xff\xff\xff\x7f" * 2 + data[12:], "2147483647 x 2147483647"),
        (lambda data: data[:12] + b"\x00\x00\xc0\x7f" + data[16:], "not finite"),
    ],
)
def test_a_damaged_flow_is_refused(damage, message: str, tmp_path: Path) -> None:
    write_flo(tmp_path / "a.flo", np.zeros((5, 7, 2)))
    (tmp_path / "a.flo").write_bytes(damage((tmp_path / "a.flo").read_bytes()))
    with pytest.raises(InputError, match=message):
        read_flo(tmp_path / "a.flo")


def test_a_dataset_that_moves_has_files_and_settings_of_its_own(panned: Path, tmp_path: Path) -> None:
    """A still one has the settings that it had before there were moving ones."""
    still = phm_n(scenes=("disk",), shape=SHAPE, frames=200, renderer="embree")
    assert "pan" not in still.settings()
    other = phm_n(scenes=("disk",), shape=SHAPE, frames=200, pan=(1.0, 0.0), renderer="embree")
    with pytest.raises(InputError, match="other settings: pan"):
        build(other, panned)
    found = read_recording(panned / "test" / "disk.h5").attributes
    assert (found["pan_x"], found["pan_y"]) == PAN
    for pan in ((float("nan"), 0), (1,), (200, 0), "12"):
        with pytest.raises(InputError, match="pan"):
            phm_n(scenes=("disk",), pan=pan)
