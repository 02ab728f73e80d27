"""On a file system without locks reading and writing go on, runs say which lock they lack, and a second run is refused
where there are locks."""

from __future__ import annotations

import errno
import fcntl
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest

from benchmarks import blind_trial
from spikecam_env.cli.main import run
from spikecam_env.errors import InputError
from spikecam_env.locks import VARIABLE, lock
from spikecam_env.run_folder import alone_in
from spikecam_env.streams import read_recording
from tests.commands import said
from tests.faults.writing import SMALL, WRITINGS, EndsInALine, python, tree

RUNS = [name for name, writing in WRITINGS.items() if writing.resumes]
NUMBERS = [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL]
NO_FLOCK = f"""
#include <errno.h>
#include <stdlib.h>
int flock(int file, int operation) {{
    const char *number = getenv("LOCK_ERRNO");
    errno = number ? atoi(number) : {errno.ENOLCK};
    return -1;
}}
"""
"""Stands before the C library, so that HDF5 meets it too."""


@pytest.fixture(scope="module")
def without_locks(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs a command line of Python, for which `flock` fails with a number."""
    if shutil.which("gcc") is None or sys.platform != "linux":
        pytest.skip("no gcc to compile an flock that fails")
    folder = tmp_path_factory.mktemp("no_locks")
    (folder / "flock.c").write_text(NO_FLOCK)
    subprocess.run(["gcc", "-shared", "-fPIC", "-o", "flock.so", "flock.c"], cwd=folder, check=True)

    def started(
        *words: str, number: int = errno.ENOLCK, folder_of_work: Path, **more: str
    ) -> subprocess.CompletedProcess:
        environment = os.environ | {"LD_PRELOAD": str(folder / "flock.so"), "LOCK_ERRNO": str(number)} | more
        return subprocess.run(
            [sys.executable, *words], cwd=folder_of_work, env=environment, capture_output=True, text=True, timeout=120
        )

    return started


@pytest.fixture
def no_flock(monkeypatch: pytest.MonkeyPatch) -> None:
    """In this process, for Python."""

    def flock(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", flock)


def test_a_recording_is_read_and_written_with_one_warning(
    without_locks: Callable[..., subprocess.CompletedProcess[str]], inputs: dict[str, Path], tmp_path: Path
) -> None:
    shutil.copy(inputs["recording"], tmp_path / "x.h5")
    words = ("-m", "spikecam_env", "export", "x.h5", "--frames", "33", "--out", "exported")
    done = without_locks(*words, folder_of_work=tmp_path)
    lines = said(done.stderr)
    print(lines)
    assert done.returncode == 0 and tree(tmp_path) > {"x.h5", "exported/export.json"}
    assert len(lines) == 1 and lines[0].startswith("spikecam: warning: the file system gives no locks"), lines


@pytest.mark.parametrize("number", NUMBERS, ids=errno.errorcode.get)
def test_hdf5_of_ours_and_of_others_is_read_whatever_number_the_lock_fails_with(
    number: int,
    without_locks: Callable[..., subprocess.CompletedProcess[str]],
    inputs: dict[str, Path],
    tmp_path: Path,
) -> None:
    shutil.copy(inputs["recording"], tmp_path / "ours.h5")
    with h5py.File(tmp_path / "others.h5", "w") as file:
        file["spikes"] = read_recording(inputs["recording"]).spikes
    code = (
        "from spikecam_env.streams import read_recording\n"
        "print(len(read_recording('ours.h5').spikes), len(read_recording('others.h5', time_axis=0).spikes))"
    )
    done = without_locks("-c", code, number=number, folder_of_work=tmp_path)
    assert (done.returncode, done.stdout) == (0, "64 64\n"), done.stderr


def test_a_file_that_another_program_writes_is_not_called_damaged(inputs: dict[str, Path], tmp_path: Path) -> None:
    path = tmp_path / "x.h5"
    shutil.copy(inputs["recording"], path)
    handle = lock(path)
    with pytest.raises(InputError, match=r"cannot be locked for reading .* HDF5_USE_FILE_LOCKING"):
        read_recording(path)
    os.close(handle)
    assert len(read_recording(path).spikes) == 64


@pytest.mark.parametrize("command", RUNS)
def test_a_run_that_can_have_no_lock_says_so_and_what_to_set(
    command: str,
    no_flock: None,
    tmp_path: Path,
    ends_in_a_line: EndsInALine,
) -> None:
    writing = WRITINGS[command]
    line = ends_in_a_line(writing.refused, tmp_path / writing.out)
    assert "no locks" in line and VARIABLE in line and "at work" not in line
    assert not tree(tmp_path)


def test_where_locks_may_be_missing_a_run_begins_with_one_warning(
    no_flock: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["campaign", "simulate", str(tmp_path / "c"), "--shape", "8", "8", "--frames", "40", "--recording", "dark"]
    monkeypatch.setenv(VARIABLE, "1")
    assert run(words) == 0
    lines = said(capsys.readouterr().err)
    assert len(lines) == 1 and lines[0].startswith("spikecam: warning: the file system gives no locks"), lines
    monkeypatch.setenv(VARIABLE, "perhaps")
    assert run([*words[:2], str(tmp_path / "d"), *words[3:]]) == 2
    assert f"{VARIABLE} is 'perhaps'" in capsys.readouterr().err


@pytest.mark.parametrize("command", RUNS)
def test_a_second_run_in_a_folder_is_refused_in_a_line(
    command: str, tmp_path: Path, ends_in_a_line: EndsInALine
) -> None:
    writing = WRITINGS[command]
    out = tmp_path / writing.out
    out.mkdir()
    with alone_in(out):
        line = ends_in_a_line(writing.refused, out)
    assert "another run is at work" in line and str(out) in line
    assert not tree(out)


def test_a_second_blind_trial_in_a_folder_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with alone_in(tmp_path):
        assert blind_trial.run(["--set", "small", "--limit", "1", "--out", str(tmp_path)]) == 2
    assert "another run is at work" in capsys.readouterr().err and not tree(tmp_path)


def test_a_run_that_is_killed_holds_nobody_up(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = (
        "import time; from spikecam_env.run_folder import run_folder\n"
        "with run_folder('c'): print('ready', flush=True); time.sleep(60)"
    )
    out = tmp_path / "c"
    words = ["campaign", "simulate", str(out), "--shape", "8", "8", "--frames", "40", "--recording", "dark"]
    first = subprocess.Popen(python(code), cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    try:
        assert first.stdout is not None and first.stdout.readline() == "ready\n"
        assert run(words) == 2
        assert f"another run is at work in {out}" in capsys.readouterr().err and not tree(out)
    finally:
        first.kill()
        first.communicate()
    assert run(words) == 0 and (out / "campaign.json").is_file()


def test_a_recording_of_one_scene_is_written_without_locks(
    no_flock: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["record", "--out", str(tmp_path / "x.h5"), "--frames", "10", *SMALL]) == 0
    assert tree(tmp_path) == {"x.h5"} and len(said(capsys.readouterr().err)) == 1
