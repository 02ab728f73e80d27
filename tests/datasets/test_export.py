"""Spike-Zoo's layout: as its own reader would read it, and back again with the same spikes and truth."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from small_dataset import SHAPE, small_plan

from spikecam_env.cli.export import Export
from spikecam_env.datasets import build
from spikecam_env.datasets.export import export_spikezoo
from spikecam_env.datasets.spikezoo import CLIP_FRAMES, RATE, find_clips, read_clip, write_clip
from spikecam_env.errors import InputError, WriteError
from spikecam_env.streams import SpikeWriter, read_recording, read_truth


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("small")
    build(small_plan(200), folder)
    return folder


@pytest.fixture
def stream() -> tuple[np.ndarray, np.ndarray]:
    """Spikes (45, 16, 24) and a light that is brighter from row to row."""
    light = np.linspace(0.02, 0.59, 16)[:, None] + np.zeros(24)
    charge = np.random.default_rng(7).random((16, 24)) + light * np.arange(46)[:, None, None]
    return np.diff(np.floor(charge), axis=0).astype(np.uint8), light


def test_a_clip_reads_as_spike_zoo_reads_it(stream, tmp_path: Path) -> None:
    """Bits from the lowest, rows from below; the picture times 0.6 is the light."""
    spikes, light = stream
    write_clip(tmp_path, "a", spikes, light)
    packed = np.fromfile(tmp_path / "spike" / "a.dat", np.uint8).reshape(45, -1)
    bits = np.stack([packed >> b & 1 for b in range(8)], axis=-1).reshape(45, 16, 24)
    assert np.array_equal(bits[:, ::-1], spikes)
    picture = np.asarray(Image.open(tmp_path / "gt" / "a.png"))
    assert picture.dtype == np.uint8 and np.abs(picture / 255 * 0.6 - light).max() <= 0.5 / 255 * 0.6 + 1e-12


@pytest.mark.parametrize("bits, steps", [(8, 255), (16, 65535)])
def test_what_is_written_is_read_back_within_half_a_step(bits, steps, stream, tmp_path: Path) -> None:
    spikes, light = stream
    assert write_clip(tmp_path, "a", spikes, light, rate=0.5, bits=bits) == pytest.approx((light > 0.5).mean())
    back, picture = read_clip(*find_clips(tmp_path))
    assert np.array_equal(back, spikes)
    error = np.abs(picture - np.minimum(light / 0.5, 1)).max()
    print(f"{bits} bits: {error * steps:.3f} steps")
    assert error <= 0.5 / steps + 1e-6


def test_a_coloured_picture_is_read_as_grey(stream, tmp_path: Path) -> None:
    spikes, light = stream
    write_clip(tmp_path, "a", spikes, light)
    Image.fromarray(np.full((16, 24, 3), (100, 50, 200), np.uint8)).save(tmp_path / "gt" / "a.png")
    assert read_clip(*find_clips(tmp_path))[1] == pytest.approx((0.299 * 100 + 0.587 * 50 + 0.114 * 200) / 255)


def test_clips_are_cut_from_the_part_of_a_recording_that_is_asked_for(dataset: Path, tmp_path: Path) -> None:
    """Its light is known every 50 frames."""
    scene = next(dataset.rglob("disk.h5"))
    for first, count, frames in ((0, None, [50, 100, 150]), (60, None, [100, 150]), (30, 100, [50, 100])):
        done = export_spikezoo([scene], tmp_path / f"{first}-{count}", frames=41, clips=9, first=first, count=count)
        assert [clip.frame for clip in done] == frames
    with pytest.raises(InputError, match="of 40 frames, none of known light has 20 before and after it"):
        export_spikezoo([scene], tmp_path / "few", frames=41, first=60, count=40)
    with pytest.raises(InputError, match=r"frames 150 to 210 asked of .*disk.h5, which holds 200"):
        export_spikezoo([scene], tmp_path / "many", frames=41, first=150, count=60)


def test_a_dataset_is_exported_with_its_splits_and_truths(dataset: Path, tmp_path: Path) -> None:
    done = export_spikezoo([dataset], tmp_path / "zoo", frames=81, clips=2)
    assert [f"{clip.split}/{clip.name}" for clip in done] == [
        *(f"train/{scene}-{frame}" for scene in ("000", "001") for frame in (50, 150)),
        *(f"test/disk-{frame}" for frame in (50, 150)),
    ]
    for clip in done:
        source = dataset / clip.split / clip.source
        found = next(c for c in find_clips(tmp_path / "zoo" / clip.split) if c.name == clip.name)
        spikes, picture = read_clip(found)
        truth = read_truth(source)
        light = truth["radiance"][list(truth["frame"]).index(clip.frame + 0.5)]
        assert spikes.shape == (81, *SHAPE)
        assert np.array_equal(spikes, read_recording(source, first=clip.frame - 40, count=81).spikes)
        assert np.abs(picture - np.minimum(light / 0.6, 1)).max() <= 0.5 / 255 + 1e-6
        assert clip.cut == (light > 0.6).mean() and clip.light == pytest.approx(light.mean(), rel=1e-5)
    record = json.loads((tmp_path / "zoo" / "export.json").read_text())
    assert record["rate"] == 0.6 and len(record["clips"]) == 6


def test_the_twin_can_be_exported(dataset: Path, tmp_path: Path) -> None:
    done = export_spikezoo([dataset / "test" / "disk.h5"], tmp_path / "zoo", frames=81, stream="clean")
    spikes, _ = read_clip(*find_clips(tmp_path / "zoo"))
    clean = read_recording(dataset / "test" / "disk.h5", first=done[0].frame - 40, count=81, stream="clean").spikes
    assert np.array_equal(spikes, clean)


@pytest.mark.parametrize("clips, frames", [(1, [100]), (2, [50, 150]), (3, [50, 100, 150]), (9, [50, 100, 150])])
def test_clips_are_spread_over_the_recording(clips, frames, dataset: Path, tmp_path: Path) -> None:
    done = export_spikezoo([dataset / "test" / "disk.h5"], tmp_path / "zoo", frames=41, clips=clips)
    assert [clip.frame for clip in done] == frames


def recording(path: Path, truth: bool, columns: int = 24) -> Path:
    with SpikeWriter(path, (16, columns), None) as writer:
        writer.append(np.zeros((60, 16, columns), np.uint8))
        if truth:
            writer.append_truth(30.5, radiance=np.full((16, columns), 0.1))
    return path


def test_what_cannot_be_exported_is_refused_with_nothing_left(tmp_path: Path) -> None:
    good, out = recording(tmp_path / "good.h5", True), tmp_path / "zoo"
    for sources, frames, message in (
        ([], 41, "nothing to export"),
        ([good], 40, "must be odd"),
        ([good], 61, "none of known light has 30"),
        ([recording(tmp_path / "plain.h5", False)], 41, "holds no truth"),
        ([good, good], 41, "are named 'test/good'"),
        ([tmp_path], 41, "is no dataset"),
        ([tmp_path / "none.h5"], 41, "there is no file"),
    ):
        with pytest.raises(InputError, match=message):
            export_spikezoo(sources, out, frames=frames)
        assert not out.exists()
    out.mkdir()
    (out / "mine").touch()
    with pytest.raises(WriteError, match="not an empty folder"):
        export_spikezoo([good], out, frames=41)


def test_frames_of_no_whole_bytes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="15 x 23"):
        write_clip(tmp_path, "a", np.zeros((3, 15, 23), np.uint8), np.zeros((15, 23)))
    with pytest.raises(InputError, match="clip name"):
        write_clip(tmp_path, "../a", np.zeros((3, 16, 24), np.uint8), np.zeros((16, 24)))
    assert not list(tmp_path.iterdir())


def test_a_folder_of_another_layout_is_refused(stream, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no folder spike"):
        find_clips(tmp_path)
    (tmp_path / "spike").mkdir()
    with pytest.raises(InputError, match=r"no \.dat file"):
        find_clips(tmp_path)
    write_clip(tmp_path, "a", *stream)
    (tmp_path / "gt" / "a.png").unlink()
    with pytest.raises(InputError, match="has no picture"):
        find_clips(tmp_path)


def test_defaults_are_those_of_spike_zoo() -> None:
    """Clips of 301 frames whose white is 0.6 spikes a frame, in the library as in the command."""
    options = {field.name: field.default for field in fields(Export)}
    assert (CLIP_FRAMES, RATE) == (301, 0.6) == (options["frames"], options["rate"])
