"""The file that HDF5 writes to never fails, and reads back all writes, kept on disk or not."""

from __future__ import annotations

import io
import resource
from pathlib import Path

import h5py
import numpy as np
import pytest

from spikecam_env.errors import WriteError
from spikecam_env.streams.whole_hdf5 import WholeHDF5, _Disk


@pytest.mark.parametrize("seed", range(8))
def test_a_disk_that_fails_reads_back_what_one_that_does_not_holds(seed: int, tmp_path: Path, monkeypatch) -> None:
    rng, disk, reference = np.random.default_rng(seed), _Disk(tmp_path / "file"), io.BytesIO()
    fails_at = int(rng.integers(0, 60))
    for step in range(60):
        if step == fails_at:
            monkeypatch.setattr(disk, "_file", Full(tmp_path / "file"))
        at, size = (int(n) for n in rng.integers(0, 5000, 2))
        at = min(at, len(reference.getbuffer()))
        for file in (disk, reference):
            file.seek(at)
        if rng.random() < 0.6:
            block = rng.bytes(size)
            assert disk.write(block) == reference.write(block)
        else:
            assert disk.read(size) == reference.read(size)
        assert disk.tell() == reference.tell() and disk.seek(0, io.SEEK_END) == reference.seek(0, io.SEEK_END)
    assert isinstance(disk.failure, OSError) == bool(disk._kept)


class Full(io.FileIO):
    """Opened again as it is; takes no more."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "r+")

    def write(self, data, /):
        raise OSError(28, "No space left on device")


def test_an_interrupt_while_hdf5_writes_is_raised_when_it_has_closed_the_file(tmp_path: Path, monkeypatch) -> None:
    writes = []

    def write(self, data, /):
        writes.append(len(data))
        raise KeyboardInterrupt

    monkeypatch.setattr(io, "FileIO", type("FileIO", (io.FileIO,), {"write": write}))
    with pytest.raises(KeyboardInterrupt), WholeHDF5(tmp_path / "x.h5") as file:
        file["data"] = np.arange(100_000)
    assert len(writes) == 1 and not list(tmp_path.iterdir())


def test_a_failure_in_the_last_write_is_one_too(tmp_path: Path) -> None:
    """Small files are written when they are closed."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (64, hard))
    try:
        with pytest.raises(WriteError, match=r"cannot write .*x\.h5"), WholeHDF5(tmp_path / "x.h5") as file:
            file.attrs["name"] = "x"
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not list(tmp_path.iterdir())


def test_the_same_calls_write_the_same_bytes_that_hdf5_reads(tmp_path: Path) -> None:
    for name in ("a.h5", "b.h5"):
        with WholeHDF5(tmp_path / name) as file:
            file.create_dataset("data", data=np.arange(1000).reshape(10, 100), compression="gzip")
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    with h5py.File(tmp_path / "a.h5") as file:
        assert file["data"][3, 4] == 304
