"""A renderer in a process of its own: what draws where OpenGL cannot begin, after a fork of a process that has used it.

Same library, same driver, same bits.  The process is started afresh, not forked.  It is sent each surface once.  It
ends when its pipe closes, and so does not outlive the process that asked for it.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from itertools import count
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any
from weakref import WeakKeyDictionary, finalize

import numpy as np
from numpy.typing import NDArray

from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole, Sprite, Surface
from spikecam_env.errors import NotReadyError


class Elsewhere:
    """Back-end in another process; see `scenes.renderers.protocol.Renderer`.

    kind   of `scenes.renderers.choose.BACKENDS`
    Errors: RuntimeError with the process's reason where the back-end does not work in it.
    """

    def __init__(self, kind: str) -> None:
        self._pipe, theirs = Pipe()
        process = subprocess.Popen(
            [sys.executable, "-m", "scenes.renderers.elsewhere", kind, str(theirs.fileno())],
            stdin=subprocess.DEVNULL,
            pass_fds=[theirs.fileno()],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
        theirs.close()
        self.close = finalize(self, _end, self._pipe, process)
        self._numbers: WeakKeyDictionary[Surface, int] = WeakKeyDictionary()
        self._next = count()
        self._forgotten: list[int] = []
        self.name: str = self._answer()

    def render(
        self,
        surface: Surface,
        pose: NDArray[np.float64],
        camera: Pinhole,
        lighting: Lighting,
        window: PictureWindow,
        supersample: int = 2,
    ) -> Sprite:
        if not self.close.alive:
            raise NotReadyError("this renderer is closed; make a new one with choose_renderer()")
        new = surface not in self._numbers
        if new:
            self._numbers[surface] = next(self._next)
            finalize(surface, self._forgotten.append, self._numbers[surface]).atexit = False
        forgotten, self._forgotten[:] = self._forgotten.copy(), []
        what = (pose, camera, lighting, window, supersample)
        self._pipe.send((forgotten, self._numbers[surface], surface if new else None, what))
        return self._answer()  # type: ignore[no-any-return]

    def _answer(self) -> Any:
        try:
            answer = self._pipe.recv()
        except (EOFError, OSError) as gone:
            raise RuntimeError("the process that draws has ended") from gone
        if isinstance(answer, BaseException):
            raise answer
        return answer


def _end(pipe: Connection, process: subprocess.Popen[bytes]) -> None:
    pipe.close()
    process.wait()


def serve(kind: str, pipe: Connection) -> None:
    """Draw what is asked for until the pipe closes."""
    from scenes.renderers.choose import make

    surfaces: dict[int, Surface] = {}
    try:
        renderer = make(kind)
        pipe.send(renderer.name)
        while True:
            forgotten, number, surface, what = pipe.recv()
            for gone in forgotten:
                surfaces.pop(gone, None)
            if surface is not None:
                surfaces[number] = surface
            try:
                pipe.send(renderer.render(surfaces[number], *what))
            except Exception as error:
                pipe.send(error)
    except (EOFError, OSError):
        return
    except Exception as error:
        pipe.send(RuntimeError(str(error)))


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; this process ends with its pipe
    serve(sys.argv[1], Connection(int(sys.argv[2])))
