"""Every way a dataset can be spoilt is found, and said in one line."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_dataset import small_plan

from spikecam_env.datasets import build, verify
from spikecam_env.errors import InputError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    build(small_plan(64), tmp_path)
    return tmp_path


def test_a_whole_dataset_has_no_faults(folder: Path) -> None:
    assert verify(folder, jobs=2) == []


def test_one_changed_bit_is_found(folder: Path) -> None:
    path = folder / "train/001.h5"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    assert verify(folder) == [
        "train/001.h5: edited, its SHA-256 has changed; delete it and run the same dataset command again"
    ]


def test_every_fault_is_one_line(folder: Path) -> None:
    for name, change in (("train/000.h5", lambda b: b[:-1]), ("train/001.h5", lambda b: b + b"x")):
        (folder / name).write_bytes(change((folder / name).read_bytes()))
    (folder / "test/disk.h5").unlink()
    (folder / "test/notes.txt").write_text("x")
    (folder / "train/.000.77.0badcafe-0badcafe.partial.h5").write_text("x")
    lines = verify(folder)
    print("\n".join(lines))
    assert [line.split(",")[0].split(";")[0] for line in lines] == [
        "train/000.h5: truncated",
        "train/001.h5: too long",
        "test/disk.h5: missing",
        "test/notes.txt: does not belong to this dataset",
        "train/.000.77.0badcafe-0badcafe.partial.h5: left by a run that was killed",
    ]
    build(small_plan(64), folder)
    assert verify(folder) == ["test/notes.txt: does not belong to this dataset"]


def test_a_folder_without_a_dataset_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no dataset: there is no dataset\.json"):
        verify(tmp_path)
