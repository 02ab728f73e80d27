"""SIGINT and SIGTERM at any moment: the command stops within two seconds, says so in a line, and leaves nothing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from spikecam_env.cli.main import run
from spikecam_env.stopping import NAMES, is_command
from spikecam_env.whole import PARTIAL
from tests.commands import said
from tests.faults.writing import SMALL, python, tree

SOON_S = 2.0
"""In which the command has stopped, at nine moments of ten: other work may hold a machine up."""
HARD_S = 10.0
START_S = 60.0
LIFE_S = 2.0
"""Moments are drawn from so long after the handlers are there, half of them; the other half from when files are in the
making.  Before, Python itself is starting, which takes a loaded machine as long as it likes."""
AT_WORK_S = 0.5
SIGNALS_CAUGHT = "SigCgt:"
"""In /proc/PID/status: a mask in hexadecimal."""


@dataclass(frozen=True)
class Stop:
    """A signal at a moment, and how the command took it."""

    what: str
    signum: int
    writing: bool
    at_s: float
    """Time [s] after the handlers were there, or after the first file was begun."""
    code: int | None
    took_s: float
    error: str
    left: set[str]
    alive: list[str]

    @property
    def faults(self) -> list[str]:
        """Faults of the stop, apart from its duration."""
        lines = said(self.error)
        wrong = {
            f"code {self.code}": self.code != 128 + self.signum,
            "a traceback": "Traceback" in self.error or "ignored" in self.error,
            f"said {lines}": lines != ["spikecam: stopped"],
            f"left {sorted(self.left)}": any(PARTIAL.fullmatch(Path(name).name) for name in self.left),
            f"alive {self.alive}": bool(self.alive),
            "too late": self.took_s > HARD_S,
        }
        return [what for what, is_wrong in wrong.items() if is_wrong]

    def __str__(self) -> str:
        when = "writing" if self.writing else "handlers"
        how = f"{self.what:8} {signal.Signals(self.signum).name:8} {when:8} + {self.at_s:4.2f} s"
        return f"{how}   code {self.code}   {self.took_s:5.2f} s   {', '.join(self.faults)}"


def stopped(what: str, args: list[str], folder: Path, signum: int, writing: bool, at_s: float) -> Stop:
    """Start a command in a folder of its own, stop it at a moment, and look."""
    folder.mkdir()
    command = [sys.executable, "-m", "spikecam_env", *args]
    process = subprocess.Popen(
        command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    until = time.monotonic() + START_S
    while not (is_writing(folder) if writing else catches(process.pid, signal.SIGTERM)):
        assert process.poll() is None and time.monotonic() < until, process.communicate()
        time.sleep(0.01)
    time.sleep(at_s)
    assert process.poll() is None, f"{what} ended by itself: {process.communicate()}"
    began = time.monotonic()
    os.killpg(process.pid, signum)  # as a terminal does: workers too
    try:
        _, error = process.communicate(timeout=START_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        _, error = process.communicate()
    took_s = time.monotonic() - began
    return Stop(what, signum, writing, at_s, process.returncode, took_s, error, tree(folder), members(process.pid))


def is_writing(folder: Path) -> bool:
    return any(PARTIAL.fullmatch(Path(name).name) for name in tree(folder))


def catches(process: int, signum: int) -> bool:
    """Whether a process has a handler for a signal."""
    for line in Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith(SIGNALS_CAUGHT):
            return bool(int(line.split()[1], 16) >> (signum - 1) & 1)
    return False


def members(group: int) -> list[str]:
    """Processes of a group that live on.  One that was killed takes as long to end as its memory to be given back."""
    until = time.monotonic() + SOON_S
    while (living := listed(group)) and time.monotonic() < until:
        time.sleep(0.05)
    return living


def listed(group: int) -> list[str]:
    """Processes of a group that have not ended."""
    printed = subprocess.run(["ps", "-e", "-o", "pgid=,stat=,args="], capture_output=True, text=True).stdout
    rows = [line.split(None, 2) for line in printed.splitlines()]
    return [row[2] for row in rows if row[0] == str(group) and row[1][0] not in "ZX"]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Spikes that never come twice in a row, so that a reading of the file has no doubt to warn of."""
    path = tmp_path_factory.mktemp("recording") / "long.dat"
    phase = np.random.default_rng(0).integers(0, 3, 250 * 400)
    path.write_bytes(np.packbits((np.arange(60)[:, None] + phase) % 3 == 0, axis=1).tobytes())
    return path


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="no /proc on this system")
def test_a_command_stops_at_any_moment_within_two_seconds_and_leaves_nothing(tmp_path: Path, recording: Path) -> None:
    size = ["--size", "64", "96"]
    commands = {  # longer than any moment, and a few GB at most: the disk is asked for all of it beforehand
        "record": (2, ["record", "--out", "x.h5", "--frames", "4000000", *size]),
        "film": (2, ["scenes", "fan", "--film", "x.mp4", "--frames", "2800000", *size]),
        "dataset": (2, ["dataset", "phm-n", "--out", "x", "--jobs", "2", "--frames", "400000", *size]),
        "live": (2, ["live", "disk", "--film", "x.mp4", *size]),
        "denoise": (2, ["denoise", str(recording), "--mode", "paper", "--out", "x"]),
    }
    rng = np.random.default_rng(41)
    planned = []
    for number, (what, (count, args)) in enumerate(commands.items()):
        for i in range(count):
            writing = i % 2 == 1 and what != "denoise"  # which writes at its end
            at_s = float(rng.uniform(0, AT_WORK_S if writing else LIFE_S))
            signum = (signal.SIGINT, signal.SIGTERM)[(number + i // 2 + i) % 2]
            planned.append((what, args, tmp_path / f"{what}{i}", signum, writing, at_s))
    with ThreadPoolExecutor(2) as pool:
        stops = list(pool.map(lambda plan: stopped(*plan), planned))
    print("\n".join(map(str, stops)))
    soon = sum(stop.took_s < SOON_S for stop in stops)
    print(f"{soon} of {len(stops)} within {SOON_S:g} s, the slowest {max(stop.took_s for stop in stops):.2f} s")
    assert not [str(stop) for stop in stops if stop.faults]
    assert soon >= 0.9 * len(stops)
    made = {name for stop in stops for name in stop.left}
    assert not [name for name in made if not name.startswith("x") or name.endswith(".mp4")]
    assert "x.h5" not in made


def test_handlers_are_there_before_anything_is_imported_that_takes_long() -> None:
    code = (
        "import os, signal, sys\n"
        "class Finder:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name in ('numpy', 'numba', 'torch', 'gymnasium'):\n"
        "            print(name, signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL, flush=True)\n"
        "            os._exit(0)\n"
        "sys.meta_path.insert(0, Finder())\n"
        "sys.argv = sys.orig_argv = ['spikecam']\n"
        "import spikecam_env.cli.main\n"
    )
    first = subprocess.run(python(code), capture_output=True, text=True, check=True).stdout.split()
    print(first)
    assert first[1:] == ["True"]


@pytest.mark.parametrize("name", [name for name in NAMES if hasattr(signal, name)])
def test_a_signal_that_comes_as_soon_as_there_is_a_handler_stops_the_command(name: str) -> None:
    code = (
        "import os, signal, sys\n"
        "from spikecam_env.stopping import watched\n"
        "set_handler = signal.signal\n"
        "def set_and_send(number, handler):\n"
        "    set_handler(number, handler)\n"
        "    if number == signal.Signals[sys.argv[1]]:\n"
        "        os.kill(os.getpid(), number)\n"
        "signal.signal = set_and_send\n"
        "with watched():\n"
        "    print('begun')\n"
    )
    done = subprocess.run([*python(code), name], capture_output=True, text=True, timeout=START_S)
    assert (done.returncode, done.stdout, done.stderr) == (128 + signal.Signals[name], "", "spikecam: stopped\n")


SWALLOWED = {
    "a bare except": "\ntry: time.sleep(9)\nexcept BaseException: pass\ntime.sleep(9)",
    "a finaliser": "\nclass A:\n    def __del__(self): time.sleep(9)\nA(); time.sleep(9)",
    "a callback of compiled code": "ctypes.CFUNCTYPE(None)(lambda: time.sleep(9))(); time.sleep(9)",
    "another error": "\ntry: time.sleep(9)\nexcept BaseException: raise ValueError('x')",
    "a loop that goes on": "\nwhile True:\n    try: time.sleep(9)\n    except BaseException: pass",
    "a call that does not come back": "signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT]); time.sleep(9)",
    "an endless clean-up": "\ntry: time.sleep(9)\nfinally: time.sleep(9)",
    "a lock that nobody opens": "lock = threading.Lock(); lock.acquire(); lock.acquire()",
    "a thread that goes on": "threading.Thread(target=time.sleep, args=(9,)).start()",
    "a child that hears nothing": (
        "subprocess.run([sys.executable, '-c', 'import signal, time; "
        "signal.signal(signal.SIGINT, signal.SIG_IGN); signal.signal(signal.SIGTERM, signal.SIG_IGN); time.sleep(9)'])"
    ),
}


def test_a_signal_that_is_swallowed_or_meets_a_call_that_does_not_end_stops_the_command_all_the_same(
    tmp_path: Path,
) -> None:
    """All at once: each waits, and takes next to no time of a processor."""
    head = (
        "import ctypes, signal, subprocess, sys, threading, time\n"
        "from pathlib import Path\n"
        "from spikecam_env.whole import whole_file\n"
        "from spikecam_env.stopping import watched\n"
    )
    running = {}
    for how, code in SWALLOWED.items():
        block = f"print('ready', flush=True)\n{code}".replace("\n", "\n        ")
        script = f"{head}with watched():\n    with whole_file(sys.argv[1]):\n        {block}"
        running[how] = subprocess.Popen(
            [*python(script), str(tmp_path / how)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
    for process in running.values():
        assert process.stdout and process.stdout.readline() == "ready\n", process.communicate()
    time.sleep(0.3)
    began = time.monotonic()
    for process in running.values():
        process.send_signal(signal.SIGINT)
    for how, process in running.items():
        _, error = process.communicate(timeout=HARD_S)
        print(f"{how:32} {time.monotonic() - began:.2f} s")
        assert (process.returncode, said(error)) == (130, ["spikecam: stopped"]), (how, error)
        assert not members(process.pid), how
    assert time.monotonic() - began < HARD_S / 2
    left = tree(tmp_path)
    assert left <= {"a thread that goes on"}, left  # its file was whole before


@pytest.mark.parametrize(
    ("block", "signals"),
    [
        ("try: time.sleep(9)\n    finally: time.sleep(9)", (signal.SIGTERM, signal.SIGINT)),
        ("import begins", (signal.SIGTERM,)),
    ],
    ids=["a second signal", "an import"],
)
def test_a_second_signal_and_one_within_an_import_leave_at_once(
    block: str, signals: tuple[int, ...], tmp_path: Path
) -> None:
    """No exception may pass an import: C++ that begins itself in one, as torch's does, would end the process."""
    (tmp_path / "begins.py").write_text("import os, time\ntry: time.sleep(9)\nexcept BaseException: os._exit(7)\n")
    code = f"import sys, time\nsys.path.insert(0, {str(tmp_path)!r})\nfrom spikecam_env.stopping import watched\n"
    code += f"with watched():\n    print('ready', flush=True)\n    {block}"
    process = subprocess.Popen(python(code), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout and process.stdout.readline() == "ready\n"
    time.sleep(0.2)  # the import has begun
    began = time.monotonic()
    for i, number in enumerate(signals):
        time.sleep(0.4 * i)
        process.send_signal(number)
    _, error = process.communicate(timeout=HARD_S)
    assert (process.returncode, error) == (128 + signals[0], "spikecam: stopped\n")
    assert time.monotonic() - began < 0.9


def test_in_a_library_an_interrupt_is_what_it_always_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = [signal.getsignal(getattr(signal, name)) for name in NAMES]
    assert not is_command()
    assert run(["record", "--out", str(tmp_path / "x.h5"), "--frames", "8", *SMALL]) == 0
    assert [signal.getsignal(getattr(signal, name)) for name in NAMES] == before

    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("spikecam_env.sensor.SpikeSensor.step", interrupt)
    assert run(["record", "--out", str(tmp_path / "y.h5"), "--frames", "8", *SMALL]) == 130
    assert tree(tmp_path) == {"x.h5"}
