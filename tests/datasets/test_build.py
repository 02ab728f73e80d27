"""Same bytes by one process or several, killed or not; and never two datasets in one folder."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_dataset import LONG, bytes_in, small_plan

from spikecam_env.datasets import build, verify
from spikecam_env.errors import InputError
from spikecam_env.run_folder import alone_in
from spikecam_env.whole import is_unfinished


def test_the_same_call_writes_the_same_bytes_later(tmp_path: Path) -> None:
    build(small_plan(), tmp_path / "a")
    time.sleep(1.1)  # times in files have a resolution of a second
    build(small_plan(), tmp_path / "b")
    assert bytes_in(tmp_path / "a") == bytes_in(tmp_path / "b")
    assert verify(tmp_path / "a") == []


@pytest.mark.slow
def test_killed_worker_is_replaced_and_the_bytes_are_the_same(tmp_path: Path, whole: dict[str, bytes]) -> None:
    killed = kill_first_writer(tmp_path)
    built = build(small_plan(LONG), tmp_path, jobs=2)
    assert killed() and built.made == 3
    assert bytes_in(tmp_path) == whole


def kill_first_writer(folder: Path):
    """SIGKILL for the first other process that is seen to write in `folder`; the function given back says which."""
    pids: list[int] = []

    def watch() -> None:
        until = time.monotonic() + 300  # a local cluster has taken more than a minute to start on a busy machine
        while not pids and time.monotonic() < until:
            pids.extend(writers(folder))
            time.sleep(0.005)
        if pids:
            os.kill(pids[0], signal.SIGKILL)

    watcher = threading.Thread(target=watch)
    watcher.start()

    def killed() -> int:
        watcher.join()
        assert pids and pids[0] != os.getpid()
        return pids[0]

    return killed


@pytest.mark.slow
def test_killed_twice_and_resumed_gives_the_same_bytes(tmp_path: Path, whole: dict[str, bytes]) -> None:
    plan = small_plan(LONG)
    rng = np.random.default_rng(0)
    folder = tmp_path / "killed"
    for group in (False, True):
        run = start_in_another_process(plan, folder)
        wait_until(lambda: writers(folder) & set(children_of(run.pid)), run)  # noqa: B023
        time.sleep(float(rng.uniform(0, 0.1)))
        workers = children_of(run.pid)
        assert run.poll() is None and workers, "it was done before it could be killed"
        if group:
            os.killpg(run.pid, signal.SIGKILL)
        else:
            run.kill()
        run.wait()
        wait_until(lambda: not any(is_alive(pid) for pid in workers), None)  # noqa: B023
        files = json.loads((folder / "dataset.json").read_text())["files"]
        print(f"killed with {sum(f['sha256'] is not None for f in files)} of {len(files)} done")
        assert verify(folder)
    resumed = build(plan, folder, jobs=1)
    assert resumed.made + resumed.kept == 3 and resumed.made >= 1
    assert bytes_in(folder) == whole


def writers(folder: Path) -> set[int]:
    """Processes that have a file in the making; its name says which."""
    return {int(path.name.split(".")[2]) for path in folder.glob("*/.*") if is_unfinished(path)}


def start_in_another_process(plan, folder: Path) -> subprocess.Popen:
    code = "import small_dataset, pathlib, sys; from spikecam_env.datasets import build\n"
    made = f"build(small_dataset.small_plan({plan.frames}), pathlib.Path({str(folder)!r}), jobs=2)"
    code += f"if __name__ == '__main__': {made}"
    script = folder.parent / "make.py"
    script.write_text(code)
    roots = [str(Path(__file__).parent), str(Path(__file__).parents[2])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(roots)}
    return subprocess.Popen([sys.executable, str(script)], env=environment, start_new_session=True)


def wait_until(condition, run: subprocess.Popen | None) -> None:
    until = time.monotonic() + 300  # compiled code is new in a fresh checkout, and the machine may be busy
    while not condition():
        assert time.monotonic() < until and (run is None or run.poll() is None)
        time.sleep(0.005)


def children_of(pid: int) -> list[int]:
    """Python workers of a process."""
    pids = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(p) for p in pids if b"spawn_main" in command_of(p)]


def command_of(pid: str) -> bytes:
    """Its command line; nothing of a process that has ended since it was listed."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except (FileNotFoundError, ProcessLookupError):
        return b""


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_lost_and_truncated_files_are_made_again(tmp_path: Path) -> None:
    build(small_plan(), tmp_path)
    before = bytes_in(tmp_path)
    (tmp_path / "test/disk.h5").unlink()
    (tmp_path / "train/000.h5").write_bytes(before["train/000.h5"][:-1])
    (tmp_path / "train/.000.1.0badcafe-0badcafe.partial.h5").write_bytes(b"left over")
    built = build(small_plan(), tmp_path)
    assert (built.made, built.kept) == (2, 1)
    assert bytes_in(tmp_path) == before


def test_other_settings_in_the_same_folder_are_refused_by_name(tmp_path: Path) -> None:
    plan = small_plan()
    build(plan, tmp_path)
    before = bytes_in(tmp_path)
    with pytest.raises(InputError, match=r"other settings: frames 200 \(asked: 100\), seed 3 \(asked: 4\);"):
        build(replace(plan, frames=100, seed=4), tmp_path)
    with pytest.raises(InputError, match="other settings: model;"):
        build(replace(plan, model=plan.model.without("shot_noise")), tmp_path)
    with pytest.raises(InputError, match="other settings: scenes;"):
        build(replace(plan, entries=plan.entries[:2]), tmp_path)
    assert bytes_in(tmp_path) == before


def test_a_folder_with_other_things_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("x")
    with pytest.raises(InputError, match="not empty and holds no dataset"):
        build(small_plan(), tmp_path)
    (tmp_path / "dataset.json").write_text("{}")
    with pytest.raises(InputError, match="damaged"):
        build(small_plan(), tmp_path)
    with pytest.raises(InputError, match="as a folder for a dataset"):
        build(small_plan(), tmp_path / "thesis.tex")


def test_two_runs_at_once_in_a_folder_are_refused(tmp_path: Path) -> None:
    with alone_in(tmp_path), pytest.raises(InputError, match="another run is at work"):
        build(small_plan(), tmp_path)


def test_what_a_worker_refuses_reaches_the_caller(tmp_path: Path) -> None:
    (tmp_path / "train").mkdir()
    (tmp_path / "dataset.json").mkdir()
    with pytest.raises(InputError, match="no dataset"):
        build(small_plan(), tmp_path, jobs=2)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"frames": 0}, "frames = 0"),
        ({"shape": (0, 5)}, "two positive whole numbers"),
        ({"truth_every": -1}, "truth_every = -1"),
        ({"mean_interval": 0.5}, "mean_interval = 0.5"),
        ({"entries": ()}, "no scenes"),
    ],
)
def test_plans_that_cannot_be_are_refused(wrong: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        replace(small_plan(), **wrong)
