"""How the `spikecam` command stops: on the first SIGINT, SIGTERM or SIGHUP, within two seconds, whatever it is at.

    signal ──▶ handler raises `Stopped` in the main thread ──▶ everything unwinds and cleans up behind itself ──▶ leave
          │                                               └──▶ it is swallowed, and so deleted ─────────────────▶ leave
          ├──▶ a module is being imported: no exception may pass it ─────────────────────────────────────────────▶ leave
          └──▶ a thread, woken through a pipe, waits GRACE_S, for a call that does not come back ────────────────▶ leave

Callbacks of compiled code, finalisers and a bare `except` swallow the exceptions of signal handlers.  So `leave` needs
nobody's help: it kills the processes that were started, runs the actions of `when_stopped`, writes one line, and ends
the process.  A second signal leaves at once.

Only the command stops so: in a library's user the handlers are the user's.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, NoReturn

GRACE_S = 1.0
"""Time to unwind in [s]; the rest of the two seconds is for `leave`."""
SAME_S = 0.2
"""Signals that follow the first within this time [s] are the same request: `timeout` sends to process and group."""
IMPORTING = "<frozen importlib._bootstrap>"
"""Where Python's own code is that imports a module."""
NAMES = ("SIGINT", "SIGTERM", "SIGHUP")
"""Signals that stop the command, where the system has them; SIGHUP unless it is ignored, as under `nohup`."""


class Stopped(KeyboardInterrupt):
    """The command was asked to stop; libraries treat this as Ctrl-C.  Its `code` is 128 + the signal's number."""

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        self.code = 128 + signum


class _State:
    """Of this process."""

    code: int | None = None
    """Exit code, once a signal has come."""
    raised: weakref.ref[Stopped] | None = None
    done = False
    """Whether the command's work is over."""
    watching = False
    leaving = threading.Lock()


_actions: dict[object, Callable[[], object]] = {}


def is_command() -> bool:
    """Whether this interpreter was started as `spikecam ...` or `python -m spikecam_env ...`, not by one that was."""
    words = sys.orig_argv
    by_name = os.path.basename(sys.argv[0] if sys.argv else "") == "spikecam" and sys.argv[0] in words
    return by_name or ("-m" in words[:-1] and words[words.index("-m") + 1] == "spikecam_env")


def watch() -> None:
    """From now on the signals stop this process as the module says.  Does nothing outside the main thread."""
    if _State.watching or threading.current_thread() is not threading.main_thread():
        return
    _State.watching = True
    _occupy_standard_streams()
    reading, writing = os.pipe()
    if hasattr(os, "set_blocking"):  # Windows needs none
        os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    threading.Thread(target=_wait_for_signals, args=(reading,), name="stopping", daemon=True).start()
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_forget)
    _hush("excepthook", sys)
    _hush("unraisablehook", sys)
    _hush("excepthook", threading)
    for name in NAMES:  # last: a signal may come at once
        number = getattr(signal, name, None)
        if number is not None and not (name == "SIGHUP" and signal.getsignal(number) is signal.SIG_IGN):
            signal.signal(number, _on_signal)


@contextmanager
def watched() -> Iterator[None]:
    """`watch`, and leave where a signal came, however the block ended: other errors may have followed from it."""
    watch()
    try:
        yield
    finally:
        _State.done = True
        if _State.code is not None:
            leave(_State.code)


@contextmanager
def when_stopped(action: Callable[[], object]) -> Iterator[None]:
    """Run an action before the process ends if it must end within the block, and not on other ways out of it.

    The action removes half-made files.  It may run in another thread, while the block goes on.
    """
    key = object()
    _actions[key] = action
    try:
        yield
    finally:
        _actions.pop(key, None)


@contextmanager
def without_interrupts() -> Iterator[None]:
    """Processes started within are deaf to Ctrl-C, which a terminal sends to all: the one that started them ends them.

    An interrupt that comes meanwhile comes at the end.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def finish(code: int) -> NoReturn:
    """End the command that is done.  Python takes a tenth of a second to take itself apart, deaf to our handlers."""
    if is_command():
        with suppress(Exception):
            atexit._run_exitfuncs()
        with suppress(Exception):
            sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


def is_stopping() -> bool:
    """Whether a signal has come: later faults follow from it, and are not worth a word."""
    return _State.code is not None


def leave(code: int) -> NoReturn:
    """End this process now: its children and half-made files go; one line, exit code."""
    if not _State.leaving.acquire(blocking=False):
        time.sleep(60)  # another thread is leaving, and takes this one with it
    for _ in range(3):  # one killed may have just started another
        _kill_descendants()
    for action in reversed(list(_actions.values())):
        with suppress(Exception):
            action()
    with suppress(OSError):
        # Not through sys.stderr: the main thread may hold its lock.
        os.write(2, b"\n" * _is_bar_open() + b"spikecam: stopped\n")
    os._exit(code)


def _swallowed(reference: object) -> None:
    if _State.code is not None:
        leave(_State.code)


def _is_bar_open() -> bool:
    """Whether a progress bar waits at the end of its line."""
    bars = getattr(sys.modules.get("tqdm"), "tqdm", None)
    return bool(getattr(bars, "_instances", ()))


def _on_signal(signum: int, frame: FrameType | None) -> None:
    if _State.leaving.locked():
        return
    if _State.done or _is_importing(frame):
        leave(128 + signum)
    if _State.code is None:
        _State.code = 128 + signum
        raise _noticed(Stopped(signum))  # no variable here: its traceback would keep it alive


def _is_importing(frame: FrameType | None) -> bool:
    """Whether a module is being imported.  C++ that begins itself there ends the process where an exception passes it,
    as torch does with `terminate`."""
    while frame is not None:
        if frame.f_code.co_filename == IMPORTING:
            return True
        frame = frame.f_back
    return False


def _noticed(stopped: Stopped) -> Stopped:
    """While it unwinds it is alive; when it no longer is, somebody has swallowed it."""
    _State.raised = weakref.ref(stopped, _swallowed)
    return stopped


def _wait_for_signals(pipe: int) -> None:
    first: float | None = None
    numbers = {getattr(signal, name) for name in NAMES if hasattr(signal, name)}
    while number := os.read(pipe, 1):
        if number[0] not in numbers:
            continue
        code = 128 + number[0]
        if first is None:
            first = time.monotonic()
            threading.Thread(target=_leave_after, args=(GRACE_S, code), daemon=True).start()
        elif time.monotonic() - first > SAME_S:
            leave(_State.code or code)


def _leave_after(wait_s: float, code: int) -> None:
    time.sleep(wait_s)
    leave(_State.code or code)


def _occupy_standard_streams() -> None:
    """Open closed ones: their numbers would go to the next files that are opened, and output into these."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)


def _forget() -> None:
    """A forked process is not the command: signals act there as before."""
    signal.set_wakeup_fd(-1)
    for name in NAMES:
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is _on_signal:
            signal.signal(number, signal.default_int_handler if name == "SIGINT" else signal.SIG_DFL)
    _State.code = None
    _actions.clear()


def _hush(name: str, module: Any) -> None:
    """After a signal no hook prints a traceback: exceptions then follow from it.  One that nobody caught leaves."""
    before = getattr(module, name)

    def hook(*args: Any) -> None:
        if _State.code is None:
            before(*args)
        elif threading.current_thread() is threading.main_thread():
            leave(_State.code)

    setattr(module, name, hook)


def _kill_descendants() -> None:
    """All processes that this one started, and those that they did; without /proc those of `multiprocessing`."""
    children = _children()
    waiting = list(children.get(os.getpid(), ()))
    while waiting:
        pid = waiting.pop()
        waiting += children.get(pid, ())
        with suppress(OSError):
            os.kill(pid, getattr(signal, "SIGKILL", signal.SIGTERM))
    if not children and "multiprocessing" in sys.modules:
        import multiprocessing

        for process in multiprocessing.active_children():
            process.kill()


def _children() -> dict[int, list[int]]:
    """Processes by the one that started them, of those that live."""
    children: dict[int, list[int]] = {}
    try:
        pids = [name for name in os.listdir("/proc") if name.isdigit()]
    except OSError:
        return children
    for name in pids:
        with suppress(OSError, ValueError, IndexError):
            with open(f"/proc/{name}/stat", encoding="utf-8", errors="replace") as file:
                state, parent = file.read().rpartition(")")[2].split()[:2]
            if state not in "ZX":
                children.setdefault(int(parent), []).append(int(name))
    return children
