"""The renderer that the scenes of a thread share, unless they were given one.

It is chosen on first use.  Environments register as users; it is closed with the last of them, and a scene that draws
after that gets a new one.
"""

from __future__ import annotations

import os
from threading import local
from weakref import WeakSet

from scenes.renderers.protocol import Renderer


class _OfThread(local):
    """OpenGL's contexts belong to the thread and the process that made them."""

    renderer: Renderer | None = None
    process: int = -1


_here = _OfThread()
_users: WeakSet[object] = WeakSet()


def shared_renderer() -> Renderer:
    """The renderer of this thread."""
    from scenes.renderers.choose import choose_renderer

    if _here.renderer is None or _here.process != os.getpid():
        _here.renderer, _here.process = choose_renderer(), os.getpid()
    return _here.renderer


def register_user(user: object) -> None:
    """Keep the shared renderer until this user is released, or collected."""
    _users.add(user)


def release_user(user: object) -> None:
    """Close the shared renderer where nobody else uses it; may be called again."""
    _users.discard(user)
    if not _users and _here.renderer is not None and _here.process == os.getpid():
        _here.renderer.close()
        _here.renderer = None
