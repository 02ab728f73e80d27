"""A disk that fills up while a command writes: one line, exit code 2, and nothing half written."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.faults.writing import WRITINGS, EndsInALine, files_up_to, tree

PAGE = 4096
"""Bytes."""


@pytest.mark.slow
@pytest.mark.parametrize("command", WRITINGS)
def test_a_disk_that_fills_up_ends_every_command_in_a_line(
    command: str,
    tmp_path: Path,
    disk: Callable[[int], Path],
    inputs: dict[str, Path],
    monkeypatch: pytest.MonkeyPatch,
    ends_in_a_line: EndsInALine,
) -> None:
    writing = WRITINGS[command]
    assert writing.run(tmp_path / writing.out, inputs, monkeypatch) == 0
    pages = sum(
        -(-path.stat().st_size // PAGE)
        for path in (tmp_path / writing.out, *(tmp_path / writing.out).rglob("*"))
        if path.is_file()
    )
    sizes = sorted({PAGE, PAGE * max(1, pages - 1)})  # there is room for nothing, and for all but the end
    roomy = SimpleNamespace(free=1 << 40)  # as if others fill it up meanwhile: nothing is refused beforehand
    monkeypatch.setattr("shutil.disk_usage", lambda _: roomy)
    for size in sizes:
        folder = disk(size)
        line = ends_in_a_line(writing.run, folder / writing.out)
        print(f"{command}: {size} bytes, {line}")
        assert "full" in line
        left = tree(folder)
        assert not any("partial" in name for name in left), left
        assert writing.resumes or not left, left


@pytest.mark.parametrize("command", ["record h5", "record dat", "film", "dataset"])
def test_what_a_disk_has_no_room_for_is_refused_before_the_work(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ends_in_a_line: EndsInALine
) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=100))
    line = ends_in_a_line(WRITINGS[command].run, tmp_path / WRITINGS[command].out)
    assert "on disk" in line and "100 bytes free" in line
    assert not tree(tmp_path)


@pytest.mark.parametrize("command", WRITINGS)
def test_a_limit_on_the_size_of_files_ends_every_command_in_a_line(
    command: str, tmp_path: Path, ends_in_a_line: EndsInALine
) -> None:
    writing = WRITINGS[command]
    with files_up_to(100):
        line = ends_in_a_line(writing.run, tmp_path / writing.out)
    assert "ulimit" in line
    left = tree(tmp_path)
    assert not any("partial" in name for name in left), left
    assert writing.resumes or not left, left


@pytest.mark.parametrize("size", [700, 3000, 30_000])
def test_hdf5_survives_a_full_disk_up_to_the_end_of_the_process(size: int, tmp_path: Path) -> None:
    """HDF5 itself crashes at exit after a write that failed."""
    code = (
        "import resource, numpy, spikecam_env.streams as s\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({size}, {size}))\n"
        "frames = (numpy.random.default_rng(0).random((64, 50, 80)) < 0.1).astype('uint8')\n"
        "try:\n"
        "    with s.SpikeWriter('x.h5', (50, 80), 4e4) as writer:\n"
        "        for i in range(20):\n"
        "            writer.append(frames, frames)\n"
        "            writer.append_truth(i, radiance=numpy.random.default_rng(i).random((50, 80)))\n"
        "except OSError as error:\n"
        "    print(type(error).__name__, error)\n"
    )
    done = subprocess.run([sys.executable, "-B", "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, (done.returncode, done.stderr[-500:])
    assert "WriteError cannot write x.h5" in done.stdout
    assert not tree(tmp_path)
