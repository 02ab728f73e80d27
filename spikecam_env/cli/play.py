"""`spikecam play`: steer the camera with the keyboard, or watch a policy steer it; in a window, or as a film."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import tyro

from spikecam_env.cli.camera import CameraOptions
from spikecam_env.cli.options import Size
from spikecam_env.cli.without_effect import WithoutEffect
from spikecam_env.errors import InputError
from spikecam_env.numbers import Range, Seed, WholeRange

if TYPE_CHECKING:
    import gymnasium

    from spikecam_env.cli.live.episode_screen import EpisodeScreen
    from spikecam_env.cli.live.episodes import Moment
    from spikecam_env.cli.live.players import Player
    from spikecam_env.cli.screen.window import End

KEYBOARD = "keyboard"
MOST_SLOW = 10_000.0
"""Times slower than life: a step of a millisecond then takes ten seconds."""
MOST_EPISODES = 1000
MOST_PICTURES = 90_000
"""Of a film: an hour."""


@dataclass
class Play:
    """Steer a spike camera with the keyboard, or watch a policy steer it.

    In a window where there is a display; else, and with --film, a film is written.  In the window, arrow keys or WASD
    turn the camera.  1 to 4 answer (ReadSpin), 0 to 9 answer (ReadDigit), E and Q open and close the iris (Exposure).
    Space pauses, N begins another episode, Esc ends.

    example:  spikecam play Track-v1
              spikecam play Catch-v1 --policy oracle --denoise --film catch.mp4
    """

    id: tyro.conf.Positional[str]
    """Environment, with or without `spikecam_env/`, e.g. Track-v1, Catch-v1, Fan-v0 (docs/environments.md)."""
    policy: str | None = None
    """Policy: keyboard, oracle, nothing, random, classical, an agent's name or its file (.pt); default: keyboard in a
    window, oracle in a film.  classical-OBS, as in classical-frame120, plays Read and Return through another camera."""
    film: Path | None = None
    """Write a film (.mp4) of it instead of opening a window; default where there is no display: ID.mp4."""
    episodes: Annotated[int | None, WholeRange(1, MOST_EPISODES)] = None
    """Number of episodes; default: one in a film, no limit in a window."""
    denoise: bool = False
    """Show the online denoiser's picture too; it is 17 to 32 frames old."""
    show_target: bool = False
    """Draw a ring about the target."""
    score: bool = False
    """Also play the oracle and nothing on the same episodes, and print the score: 0 is nothing's, 1 the oracle's."""
    slow: Annotated[float, Range(1.0, MOST_SLOW)] = 40.0
    """Times slower than life: 40 shows a millisecond of the scene, 40 frames, in 40 ms."""
    split: Literal["train", "test"] = "test"
    """Training or test episodes of a task of version 1."""
    seed: Seed = 0
    """Seed of the first episode; each further episode has the next number."""
    size: Size | None = None
    """Rows and columns, instead of the environment's."""
    camera: CameraOptions = field(default_factory=CameraOptions)

    without_effect: ClassVar = (
        WithoutEffect(("split",), lambda c: not c.has_splits, "{id} has no training and test episodes"),
    )

    @property
    def has_splits(self) -> bool:
        """Whether there are training and test episodes."""
        from spikecam_env.cli.live.episodes import has_splits

        return has_splits(self.id)

    def run(self) -> None:
        from spikecam_env.cli.files import check_place
        from spikecam_env.cli.live.episodes import full_name
        from spikecam_env.cli.live.filming import watch
        from spikecam_env.cli.live.players import Player, player, steering
        from spikecam_env.cli.screen.window import has_display
        from spikecam_env.envs.registration import MUJOCO_ENVIRONMENTS

        film = self.film
        if film is None and not has_display():
            film = Path(f"{self.id.rpartition('/')[2]}.mp4")
        who = (KEYBOARD if film is None else "oracle") if self.policy is None else self.policy
        if who == KEYBOARD and full_name(self.id) in MUJOCO_ENVIRONMENTS:
            raise InputError(f"{self.id} has no camera that keys could turn; watch a policy: --policy oracle")
        if film is not None and who == KEYBOARD:
            raise InputError("--policy keyboard needs a window: run it where there is a display, without --film")
        check_place("film", film, ".mp4")
        held: set[str] = set()
        acting = Player(steering(held)) if who == KEYBOARD else player(who, self.id)
        env = self._environment(acting)
        try:
            episodes = self.episodes or (None if film is None else 1)
            seeds = count(self.seed) if episodes is None else range(self.seed, self.seed + episodes)
            with self._end(env, film, held) as end:
                ended = watch(env, acting, self._screen(env, who), seeds, self.slow, end)
            if film is not None:
                print(f"wrote {film}: {who} at {self.id}, {self.slow:g} times slower than life")
            self._print(env, ended)
        finally:
            env.close()

    def _environment(self, acting: Player) -> gymnasium.Env[Any, Any]:
        from spikecam_env.cli.live.episodes import environment

        size = {} if self.size is None else {"shape": self.size}
        return environment(self.id, acting, model=self.camera.load(), split=self.split, **size)

    def _screen(self, env: gymnasium.Env[Any, Any], who: str) -> EpisodeScreen:
        from spikecam_env.cli.live.episode_screen import EpisodeScreen
        from spikecam_env.cli.live.keys import explained

        camera: Any = env.unwrapped
        keys = (
            explained(camera.axes, camera.action_space.shape[0] - camera.axes, camera.answers)
            if who == KEYBOARD
            else ""
        )
        name = self.id.rpartition("/")[2]
        return EpisodeScreen(name, who, denoise=self.denoise, show_target=self.show_target, keys=keys)

    def _end(self, env: gymnasium.Env[Any, Any], path: Path | None, held: set[str]) -> AbstractContextManager[End]:
        """A film, or a window in which keys are held down."""
        from spikecam_env.cli.live.episodes import FPS, most_seconds
        from spikecam_env.cli.live.keys import STEERING
        from spikecam_env.cli.screen.film import film
        from spikecam_env.cli.screen.window import DisplayWindow

        if path is None:
            return nullcontext(DisplayWindow(f"spikecam {self.id}", STEERING, held))
        episodes = self.episodes or 1
        most = episodes * most_seconds(env) * self.slow * FPS
        if most > MOST_PICTURES:
            raise InputError(
                f"up to {most:.0f} pictures (--episodes {episodes}, --slow {self.slow:g}); at most {MOST_PICTURES}"
            )
        return film(path, FPS)

    def _print(self, env: gymnasium.Env[Any, Any], ended: list[Moment]) -> None:
        from spikecam_env.cli.live.episodes import scored
        from spikecam_env.cli.table import table

        if not ended:
            print("no episode was played to its end")
            return
        rows = [
            {
                "seed": str(last.seed),
                "steps": last.step,
                "time [ms]": 1e3 * last.time_s,
                "return": last.total,
                "distance at the end [px]": last.info["distance_px"],
                "performance": float(last.info["performance"]),
                "success": "yes" if last.info["is_success"] else "no",
            }
            for last in ended
        ]
        print(table(rows))
        if self.score:
            ends = scored(env, ended)
            means = f"performance {ends.mean:.3f}, nothing {ends.nothing:.3f}, oracle {ends.oracle:.3f}"
            print(f"score {ends.score:.3f}: {means}")
