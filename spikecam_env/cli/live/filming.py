"""Episodes on a screen, in a window or a film: the same pictures, at the same pace."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import gymnasium

from spikecam_env.cli.live.episode_screen import EpisodeScreen
from spikecam_env.cli.live.episodes import FPS, Moment, episode, pictures_due
from spikecam_env.cli.live.players import Player
from spikecam_env.cli.screen.window import End

END_S = 1.0
"""For which the last picture of an episode stays."""
IDLE_S = 0.04
"""From look to look at the keys while the scene rests [s]."""


def watch(
    env: gymnasium.Env[Any, Any], acting: Player, screen: EpisodeScreen, seeds: Iterable[int], slow: float, end: End
) -> list[Moment]:
    """Show episodes; space pauses, n goes to the next episode, escape ends.

    Args:
        env: the environment.
        acting: who acts in it.
        screen: that makes the pictures.
        seeds: of the episodes.
        slow: times slower than life.
        end: a window or a film.

    Returns:
        The last moment of each episode that came to its end.
    """
    ended: list[Moment] = []
    for seed in seeds:
        for moment, due in _paced(env, acting, screen, seed, slow):
            if due:
                end.show(screen.picture(moment), due / FPS)
            keys = _keys(end)
            if "escape" in keys:
                return ended
            if "n" in keys:
                break
        if moment.over:
            ended.append(moment)
    return ended


def _paced(
    env: gymnasium.Env[Any, Any], acting: Player, screen: EpisodeScreen, seed: int, slow: float
) -> Iterator[tuple[Moment, int]]:
    """(moment, how many pictures of it are due); those of the last stay for END_S."""
    before = 0.0
    for moment in episode(env, acting, seed):
        screen.see(moment)
        yield moment, pictures_due(before, moment.time_s, slow) + moment.over * round(END_S * FPS)
        before = moment.time_s


def _keys(end: End) -> list[str]:
    """Keys that were pressed; after a space, once another has come.  A window that was closed is an escape."""
    keys = end.taken()
    while "space" in keys and not end.closed:
        end.wait(IDLE_S)
        later = end.taken()
        if later:
            keys = [key for key in later if key != "space"]
    return ["escape"] if end.closed else keys
