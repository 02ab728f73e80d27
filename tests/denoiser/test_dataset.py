"""The torch dataset: items that follow from seed, epoch and index, equal to a naive reading."""

from __future__ import annotations

import copy
import pickle
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from torch.utils.data import DataLoader

from denoiser.dataset import SpikeWindows
from denoiser.training.pairs import WARM_UP
from spikecam_env.datasets import Plan, PlannedScene, build
from spikecam_env.errors import InputError
from spikecam_env.streams import SpikeWriter, isi_plane, read_recording

FRAMES = 200
PLAN = Plan(
    "small",
    (
        PlannedScene("train/a.h5", "collage", 1, 2),
        PlannedScene("train/b.h5", "disk", 3, 4),
        PlannedScene("test/a.h5", "collage", 5, 6),
    ),
    shape=(32, 48),
    frames=FRAMES,
    truth_every=0,
    renderer="embree",
)


@pytest.fixture(scope="module")
def folder():
    with tempfile.TemporaryDirectory() as made:
        build(PLAN, made)
        yield Path(made)


def test_items_equal_naive_reading(folder: Path) -> None:
    data = SpikeWindows(folder, crop=(16, 24), stride=7)
    streams = {
        scene: [read_recording(path, stream=s).spikes for s in ("spikes", "clean")]
        for scene, path in enumerate(data.paths)
    }
    assert len(data) == 2 * len(range(WARM_UP + 20, FRAMES - 20, 7))
    for index in range(0, len(data), 3):
        item = data[index]
        noisy, clean = streams[item["scene"]]
        crop = np.s_[item["row"] : item["row"] + 16, item["column"] : item["column"] + 24]
        frames = slice(item["frame"] - 20, item["frame"] + 21)
        np.testing.assert_array_equal(item["spikes"], noisy[(frames, *crop)])
        np.testing.assert_array_equal(item["clean_isi"], isi_plane(clean, item["frame"], normalised=True)[crop])


def test_items_follow_from_seed_epoch_and_index(folder: Path) -> None:
    def corners(data: SpikeWindows) -> list[tuple[int, int]]:
        return [(data[i]["row"], data[i]["column"]) for i in range(0, len(data), 20)]

    data, same = SpikeWindows(folder, crop=(8, 8)), SpikeWindows(folder, crop=(8, 8))
    assert corners(data) == corners(same) != corners(SpikeWindows(folder, crop=(8, 8), seed=1))
    same.epoch = 1
    assert corners(data) != corners(same)


@pytest.mark.slow
def test_loader_processes_give_the_same_items(folder: Path) -> None:
    data = SpikeWindows(folder, "test", crop=(16, 16), stride=16)
    here = [data[i] for i in range(len(data))]
    there = list(DataLoader(data, batch_size=None, num_workers=2))
    assert len(there) == len(here) > 3
    for a, b in zip(here, there, strict=True):
        assert all(np.array_equal(a[name], b[name]) for name in ("spikes", "clean_isi", "frame", "row", "column"))


def test_the_whole_picture_without_a_crop(folder: Path) -> None:
    item = SpikeWindows(folder, "test", crop=None, reach=3)[0]
    assert item["spikes"].shape == (7, 32, 48) and item["clean_isi"].shape == (32, 48)
    assert (item["row"], item["column"], item["frame"]) == (0, 0, WARM_UP + 3)


def test_files_of_several_sizes_and_lengths_are_one_data_set(tmp_path: Path) -> None:
    """Every window of every file once, each equal to a reading of the file."""
    rng = np.random.default_rng(0)
    for name, shape in (("a.h5", (150, 16, 24)), ("b.h5", (170, 32, 16))):
        with SpikeWriter(tmp_path / name, shape[1:], 40_000.0) as writer:
            writer.append(*(rng.random((2, *shape)) < 0.3).astype(np.uint8))
    files = [tmp_path / "a.h5", tmp_path / "b.h5"]
    data = SpikeWindows(files, crop=(16, 16), stride=2)
    items = [data[index] for index in range(len(data))]
    expected = [(scene, t) for scene, frames in enumerate((150, 170)) for t in range(WARM_UP + 20, frames - 20, 2)]
    assert [(item["scene"], item["frame"]) for item in items] == expected
    for item in items[::7]:
        path, t = files[item["scene"]], item["frame"]
        crop = np.s_[item["row"] : item["row"] + 16, item["column"] : item["column"] + 16]
        noisy, clean = (read_recording(path, stream=name).spikes for name in ("spikes", "clean"))
        np.testing.assert_array_equal(item["spikes"], noisy[(np.s_[t - 20 : t + 21], *crop)])
        np.testing.assert_array_equal(item["clean_isi"], isi_plane(clean, t, normalised=True)[crop])
    assert len(SpikeWindows(files[0], crop=None)) == len(range(WARM_UP + 20, 130))
    with pytest.raises(InputError, match="crop is None for recordings of several sizes"):
        SpikeWindows(files, crop=None)
    with pytest.raises(InputError, match=r"a.h5: crop \(32, 16\); it must be at most \(16, 24\)"):
        SpikeWindows(files, crop=(32, 16))
    with pytest.raises(InputError, match="no recordings are given"):
        SpikeWindows([])


def test_a_file_without_a_clean_twin_is_refused(tmp_path: Path) -> None:
    with SpikeWriter(tmp_path / "a.h5", (16, 16), 40_000.0) as writer:
        writer.append(np.zeros((150, 16, 16), np.uint8))
    with pytest.raises(InputError, match=r"a.h5 holds no clean twin; make it with `spikecam film --clean`"):
        SpikeWindows(tmp_path / "a.h5", crop=(8, 8))


def test_datasets_that_will_not_do_are_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no scenes of split 'valid'; it has test, train"):
        SpikeWindows(folder, "valid")
    with pytest.raises(InputError, match=r"crop \(64, 64\)"):
        SpikeWindows(folder)
    with pytest.raises(InputError, match="no window of 161 after the first 64"):
        SpikeWindows(folder, crop=None, reach=80)
    with pytest.raises(InputError, match="no dataset"):
        SpikeWindows(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_persistent_workers_draw_other_crops_in_every_epoch(folder: Path, context: str) -> None:
    """Those that a loader without workers draws."""
    data = SpikeWindows(folder, "test", crop=(8, 8), stride=16)
    loader = DataLoader(data, batch_size=None, num_workers=1, persistent_workers=True, multiprocessing_context=context)
    plain = SpikeWindows(folder, "test", crop=(8, 8), stride=16)
    epochs = []
    for epoch in (0, 1, 5, 0):
        data.epoch = plain.epoch = epoch
        found = [(item["row"], item["column"]) for item in loader]
        assert found == [(plain[i]["row"], plain[i]["column"]) for i in range(len(plain))]
        epochs.append(found)
    assert epochs[0] == epochs[3] and epochs[0] != epochs[1] != epochs[2] != epochs[0]


@pytest.mark.slow
@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda data: pickle.loads(pickle.dumps(data))])
def test_a_copy_hands_its_epoch_to_persistent_workers_too(folder: Path, copied: Any) -> None:
    data = copied(SpikeWindows(folder, "test", crop=(8, 8), stride=40))
    loader = DataLoader(data, batch_size=None, num_workers=1, persistent_workers=True)
    first = [(item["row"], item["column"]) for item in loader]
    data.epoch = 1
    assert first != [(item["row"], item["column"]) for item in loader]


@pytest.mark.parametrize(
    "bad", [{"reach": -1}, {"reach": 1.5}, {"stride": 0}, {"stride": np.nan}, {"seed": -1}, {"crop": (0, 8)}]
)
def test_options_out_of_range_are_named(folder: Path, bad: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(bad)).replace("crop", "shape")):
        SpikeWindows(folder, **{"crop": (8, 8), **bad})


@pytest.mark.parametrize("epoch", [-1, 1.5, np.nan, None, 2**63])
def test_an_epoch_that_is_none_is_refused(folder: Path, epoch: Any) -> None:
    with pytest.raises(InputError, match="epoch"):
        SpikeWindows(folder, crop=(8, 8)).epoch = epoch
