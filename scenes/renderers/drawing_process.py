"""`python -m scenes.renderers.drawing_process KIND PIPE`: the other side of `scenes.renderers.own_process`."""

from __future__ import annotations

import signal
import sys
from multiprocessing.connection import Connection

from scenes.renderers.choose import make
from scenes.renderers.protocol import Surface


def serve(kind: str, pipe: Connection) -> None:
    """Draw the pictures requested through the pipe, until it closes."""
    surfaces: dict[int, Surface] = {}
    try:
        renderer = make(kind)
        pipe.send(renderer.name)
        while True:
            forgotten, number, surface, view = pipe.recv()
            for gone in forgotten:
                surfaces.pop(gone, None)
            if surface is not None:
                surfaces[number] = surface
            try:
                pipe.send(renderer.render(surfaces[number], *view))
            except Exception as error:
                pipe.send(error)
    except (EOFError, OSError):
        return
    except Exception as error:
        pipe.send(RuntimeError(str(error)))


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; this process ends with its pipe
    serve(sys.argv[1], Connection(int(sys.argv[2])))
