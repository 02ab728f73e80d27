"""Ends of a screen: what they have in common, and a window with its keys, by whichever toolkit matplotlib finds."""

from __future__ import annotations

import time
from collections.abc import Collection
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from spikecam_env.cli.screen.screen import BACKGROUND

DPI = 100
SHORTEST_WAIT_S = 0.001
"""A window is given at least this long to see its keys, however late the picture is."""


class End(Protocol):
    """Where the pictures of a screen go: a window, or a film (`screen.film.FilmEnd`)."""

    closed: bool
    """Whether it takes no more."""

    def show(self, picture: NDArray[np.uint8], seconds: float) -> None:
        """A picture (rows, columns, 3), for so long."""

    def wait(self, seconds: float) -> None:
        """The same picture for longer."""

    def taken(self) -> list[str]:
        """Keys that were pressed since the last call, those that steer apart."""


class DisplayWindow:
    """A window that opens at its first picture.

    Args:
        title: of the window.
        steering: keys that steer; they count while they are down.
        held: set that holds those of them that are down.
    """

    def __init__(self, title: str, steering: Collection[str] = (), held: set[str] | None = None) -> None:
        self.held = set[str]() if held is None else held
        self.pressed: list[str] = []
        self.closed = False
        self._steering = steering
        self._title = title
        self._figure: Any = None
        self._until = time.perf_counter()

    def show(self, picture: NDArray[np.uint8], seconds: float) -> None:
        """Show a picture for so long, less the delay of the last one."""
        if self.closed:
            return
        if self._figure is None:
            self._open(picture)
        self._image.set_data(picture)
        self._figure.canvas.draw_idle()
        self._until = max(self._until, time.perf_counter() - seconds) + seconds
        self._listen(self._until - time.perf_counter())

    def wait(self, seconds: float) -> None:
        """Leave the picture as it is, and see to the keys."""
        if self._figure is not None and not self.closed:
            self._listen(seconds)

    def taken(self) -> list[str]:
        """The keys that were pressed since, oldest first."""
        pressed, self.pressed = self.pressed, []
        return pressed

    def _open(self, picture: NDArray[np.uint8]) -> None:
        import matplotlib.pyplot as plt

        rows, columns = picture.shape[:2]
        with plt.rc_context({"toolbar": "None"}):
            self._figure = plt.figure(self._title, figsize=(columns / DPI, rows / DPI), dpi=DPI)
        self._figure.set_facecolor("#{:02x}{:02x}{:02x}".format(*BACKGROUND))
        axes = self._figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        self._image = axes.imshow(picture, interpolation="nearest", aspect="equal")
        canvas = self._figure.canvas
        if canvas.manager is not None:
            canvas.mpl_disconnect(canvas.manager.key_press_handler_id)  # its own keys: s saves, q quits
        canvas.mpl_connect("key_press_event", self._press)
        canvas.mpl_connect("key_release_event", lambda event: self.held.discard(plain(event.key)))
        canvas.mpl_connect("close_event", self._close)
        self._figure.show()

    def _listen(self, seconds: float) -> None:
        self._figure.canvas.start_event_loop(max(seconds, SHORTEST_WAIT_S))

    def _press(self, event: Any) -> None:
        key = plain(event.key)
        if key in self._steering:
            self.held.add(key)
        elif key:
            self.pressed.append(key)

    def _close(self, event: Any) -> None:
        self.closed = True
        self._figure.canvas.stop_event_loop()


def plain(key: str | None) -> str:
    """A key's name without shift and the like: `shift+LEFT` and `left` steer alike."""
    name = (key or "").rpartition("+")[2].lower()
    return "space" if name == " " else name


def has_display() -> bool:
    """Whether matplotlib finds a toolkit, and a display for it."""
    import matplotlib.pyplot as plt

    figure: Any = plt.figure()
    toolkit = getattr(figure.canvas, "required_interactive_framework", None)
    plt.close(figure)
    return toolkit is not None
