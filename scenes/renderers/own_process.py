"""A renderer in a process of its own, for a fork of a process that has used OpenGL, in which OpenGL cannot start.

Same library, same driver, same bits.  The process is started afresh, not forked.  It is sent each surface once.  It
ends when its pipe closes, and so does not outlive the process that started it.
"""

from __future__ import annotations

import os
import subprocess
import sys
from itertools import count
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any
from weakref import WeakKeyDictionary, finalize

from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole, Sprite, Surface
from spikecam_env.errors import NotReadyError
from spikecam_env.types import Floats


class ProcessRenderer:
    """Back-end in another process; see `scenes.renderers.protocol.Renderer`.

    Args:
        kind: of `scenes.renderers.choose.BACKENDS`.

    Raises:
        RuntimeError: the back-end does not work in it, for the reason given.
    """

    def __init__(self, kind: str) -> None:
        self._pipe, theirs = Pipe()
        process = subprocess.Popen(
            [sys.executable, "-m", "scenes.renderers.drawing_process", kind, str(theirs.fileno())],
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
        pose: Floats,
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
        view = (pose, camera, lighting, window, supersample)
        self._pipe.send((forgotten, self._numbers[surface], surface if new else None, view))
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
