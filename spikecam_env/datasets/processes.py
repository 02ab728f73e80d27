"""Scenes in several processes on this machine.

Processes are spawned: OpenGL does not survive a fork.  Each is given one scene at a time through a pipe of its own; one
that dies is replaced, and its scene made again.  Workers end with the run that started them, even if that is killed.
"""

from __future__ import annotations

import os
import threading
import traceback
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import connection, get_context, parent_process
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

from spikecam_env.datasets.plan import Plan, PlannedScene
from spikecam_env.datasets.write import Written, write_scene
from spikecam_env.errors import InputError
from spikecam_env.stopping import without_interrupts
from spikecam_env.threads import use_one_thread

ATTEMPTS = 3
"""Deaths of workers over one scene before the run gives up."""


def on_processes(plan: Plan, folder: Path, entries: tuple[PlannedScene, ...], jobs: int) -> Iterator[Written | int]:
    """Write scenes in several processes.

    Yields:
        Counts and files as of `write_scene`, in any order; a count is negative where frames were lost.

    Raises:
        InputError: if workers keep dying.
        Exception: as a worker raised it.
    """
    waiting = deque(entries)
    deaths: dict[str, int] = {}
    workers = [_Worker.start(plan, folder, waiting.popleft()) for _ in range(min(jobs, len(entries)))]
    try:
        while workers:
            ready = connection.wait([worker.pipe for worker in workers])
            for worker in [w for w in workers if w.pipe in ready]:
                try:
                    news = worker.pipe.recv()
                except (EOFError, OSError):
                    _count_death(deaths, worker.entry)
                    news = -worker.frames
                    workers[workers.index(worker)] = _Worker.start(plan, folder, worker.entry)
                if isinstance(news, BaseException):
                    raise news
                worker.frames += news if isinstance(news, int) else 0
                if isinstance(news, Written) and waiting:
                    worker.give(waiting.popleft())
                elif isinstance(news, Written):
                    worker.end()
                    workers.remove(worker)
                yield news
    finally:
        for worker in workers:
            worker.process.kill()
            worker.process.join()


@dataclass
class _Worker:
    """A process, and the scene it works on."""

    process: BaseProcess
    pipe: Connection
    """Our end of its pipe."""
    entry: PlannedScene
    frames: int = 0
    """Frames of the scene that are done."""

    @classmethod
    def start(cls, plan: Plan, folder: Path, entry: PlannedScene) -> _Worker:
        context = get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_work, args=(theirs, plan, folder), daemon=True)
        with without_interrupts():
            process.start()
        theirs.close()
        worker = cls(process, ours, entry)
        worker.give(entry)
        return worker

    def give(self, entry: PlannedScene) -> None:
        """Hand out a scene."""
        self.entry, self.frames = entry, 0
        with suppress(OSError):  # it is dead, and the next look at its pipe finds that
            self.pipe.send(entry)

    def end(self) -> None:
        """There is no more to do."""
        with suppress(OSError):
            self.pipe.send(None)
        self.process.join()


def _count_death(deaths: dict[str, int], entry: PlannedScene) -> None:
    deaths[entry.path] = deaths.get(entry.path, 0) + 1
    if deaths[entry.path] == ATTEMPTS:
        raise InputError(
            f"worker processes died {ATTEMPTS} times over {entry.path}, perhaps for want of memory; "
            "run the same command with fewer jobs: it makes the others"
        )


def _work(pipe: Connection, plan: Plan, folder: Path) -> None:
    """A worker's life: scenes from the pipe, news back."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    use_one_thread()
    try:
        while entry := pipe.recv():
            for news in write_scene(plan, entry, folder):
                pipe.send(news)
    except EOFError:
        pass
    except InputError as error:
        pipe.send(error)
    except Exception:
        pipe.send(RuntimeError(f"a worker failed:\n{traceback.format_exc()}"))


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
