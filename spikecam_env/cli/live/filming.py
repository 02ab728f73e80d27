"""Episodes as a film, or in a window: the same pictures, at the same pace."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol

import gymnasium
import numpy as np
from numpy.typing import NDArray

from spikecam_env.cli.live.episodes import FPS, Moment, episode, pictures_due
from spikecam_env.cli.live.players import Player
from spikecam_env.cli.live.screen import Screen

Frame = NDArray[np.uint8]
"""(rows, columns, 3)."""

END_S = 1.0
"""For which the last picture of an episode stays."""
IDLE_S = 0.04
"""From look to look at the keys while the scene rests [s]."""


class Shows(Protocol):
    """A window; `live.window.DisplayWindow` is one."""

    closed: bool

    def show(self, picture: Frame, seconds: float) -> None:
        """A picture, for so long."""

    def wait(self, seconds: float) -> None:
        """The same picture for longer."""

    def taken(self) -> list[str]:
        """Keys that were pressed since the last call, those that steer apart."""


def pictures(
    env: gymnasium.Env[Any, Any], acting: Player, screen: Screen, seeds: Iterable[int], slow: float, ended: list[Moment]
) -> Iterator[Frame]:
    """Of a film of these episodes, FPS a second; the last moment of each episode is added to `ended`."""
    for seed in seeds:
        for moment, due in _paced(env, acting, screen, seed, slow):
            if due:
                picture = screen.picture(moment)
                yield from (picture for _ in range(due))
        ended.append(moment)


def watch(
    env: gymnasium.Env[Any, Any],
    acting: Player,
    screen: Screen,
    seeds: Iterable[int],
    slow: float,
    opened: Callable[[Frame], Shows],
) -> list[Moment]:
    """Show episodes in a window; space pauses, n goes to the next episode, escape ends.

    Returns:
        The last moment of each episode that came to its end.
    """
    ended: list[Moment] = []
    window: Shows | None = None
    for seed in seeds:
        for moment, due in _paced(env, acting, screen, seed, slow):
            if due:
                picture = screen.picture(moment)
                window = window or opened(picture)
                window.show(picture, due / FPS)
            keys = _keys(window)
            if "escape" in keys:
                return ended
            if "n" in keys:
                break
        if moment.over:
            ended.append(moment)
    return ended


def _paced(
    env: gymnasium.Env[Any, Any], acting: Player, screen: Screen, seed: int, slow: float
) -> Iterator[tuple[Moment, int]]:
    """(moment, how many pictures of it are due); those of the last stay for END_S."""
    before = 0.0
    for moment in episode(env, acting, seed):
        screen.see(moment)
        yield moment, pictures_due(before, moment.time_s, slow) + moment.over * round(END_S * FPS)
        before = moment.time_s


def _keys(window: Shows | None) -> list[str]:
    """Keys that were pressed; after a space, once another has come.  A window that was closed is an escape."""
    if window is None:
        return []
    keys = window.taken()
    while "space" in keys and not window.closed:
        window.wait(IDLE_S)
        later = window.taken()
        if later:
            keys = [key for key in later if key != "space"]
    return ["escape"] if window.closed else keys
