"""Half-written files of a killed process are known, and go when the next one writes into the folder."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from spikecam_env.cli.main import run
from spikecam_env.errors import InputError, WriteError
from spikecam_env.run_folder import alone_in
from spikecam_env.whole import (
    ABANDONED_S,
    PARTIAL,
    clear_unfinished,
    is_unfinished,
    whole_file,
    whole_folder,
    write_text_whole,
)
from tests.faults.writing import SMALL, python, tree

LONG_S = 60.0


def wait_for(condition: Callable[[], object], process: subprocess.Popen) -> None:
    until = time.monotonic() + LONG_S
    while not condition():
        assert time.monotonic() < until and process.poll() is None, process.communicate()
        time.sleep(0.01)


@contextmanager
def started(command: list[str], folder: Path) -> Iterator[subprocess.Popen]:
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def partial(folder: Path) -> set[str]:
    return {name for name in os.listdir(folder) if PARTIAL.fullmatch(name)}


def test_what_a_killed_recording_left_goes_with_the_next_into_the_folder(tmp_path: Path) -> None:
    arguments = "'record', '--out', 'long.h5', '--frames', '4000000', '--size', '24', '40'"
    long = python(f"from spikecam_env.cli.main import run; run([{arguments}])")
    with started(long, tmp_path) as killed:
        wait_for(lambda: partial(tmp_path), killed)
        killed.send_signal(signal.SIGKILL)
        killed.wait()
    assert partial(tmp_path)
    assert run(["record", "--out", str(tmp_path / "short.h5"), "--frames", "10", *SMALL]) == 0
    assert tree(tmp_path) == {"short.h5"}


def test_what_a_living_process_is_writing_stays_and_a_killed_ones_folder_goes(tmp_path: Path) -> None:
    code = (
        "import sys, time; from spikecam_env.whole import whole_folder\n"
        "with whole_folder(sys.argv[1]) as beside:\n"
        "    (beside / 'part').write_text('x'); print('ready', flush=True); time.sleep(60)"
    )
    with (
        started([*python(code), "dead"], tmp_path) as dead,
        started([*python(code), "alive"], tmp_path) as alive,
    ):
        assert dead.stdout and alive.stdout
        assert dead.stdout.readline() == alive.stdout.readline() == "ready\n"
        dead.kill()
        dead.wait()
        write_text_whole(tmp_path / "next", "x")
        assert {name.split(".")[1] for name in partial(tmp_path)} == {"alive"}
    with whole_folder(tmp_path / "folder"):
        pass
    assert tree(tmp_path) == {"next", "folder"}


def test_what_another_machine_began_stays_for_a_day(tmp_path: Path) -> None:
    """Its lock may not be seen from here."""
    fresh, old = tmp_path / ".a.12.00000000-01234567.partial.h5", tmp_path / ".b.12.00000000-01234567.partial.h5"
    for path, age_s in ((fresh, ABANDONED_S - 60), (old, ABANDONED_S + 60)):
        path.touch()
        os.utime(path, (time.time() - age_s,) * 2)
    write_text_whole(tmp_path / "next", "x")
    assert tree(tmp_path) == {"next", fresh.name}


def test_two_threads_of_a_process_do_not_clear_each_other(tmp_path: Path) -> None:
    with whole_file(tmp_path / "a") as first, whole_file(tmp_path / "a") as second:
        first.write_text("1")
        second.write_text("2")
    assert (tmp_path / "a").read_text() == "1" and tree(tmp_path) == {"a"}


def test_names_as_long_as_the_file_system_takes_can_be_written(tmp_path: Path) -> None:
    for name in ("x" * 255, "é" * 120 + ".json", "x." + "y" * 200):
        write_text_whole(tmp_path / name, "x")
    assert len(tree(tmp_path)) == 3


def test_a_link_is_followed_and_stays(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "far" / "file")
    write_text_whole(tmp_path / "link", "x")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "far" / "file").read_text() == "x"


def test_an_error_about_another_file_is_not_said_to_be_of_this_one(tmp_path: Path) -> None:
    try:
        with whole_file(tmp_path / "a"):
            (tmp_path / "absent").read_text()
    except OSError as error:
        assert not isinstance(error, WriteError) and str(error.filename).endswith("absent")
    assert not tree(tmp_path)


def test_one_who_is_alone_in_a_folder_clears_all_below_it_and_nothing_else(tmp_path: Path) -> None:
    below = tmp_path / "train"
    below.mkdir()
    kept = below / ".x.partial.h5"
    kept.write_bytes(b"of somebody who names files so")
    with alone_in(tmp_path), whole_file(below / "a") as beside:
        assert is_unfinished(beside) and not is_unfinished(kept)
        with pytest.raises(InputError, match="another run is at work"), alone_in(tmp_path):
            pass
        clear_unfinished(tmp_path)
        assert not beside.exists() and kept.exists()
        beside.write_bytes(b"whole")
    assert {path.name for path in below.iterdir()} == {"a", kept.name}
