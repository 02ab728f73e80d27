"""The moving picture of Return: the ball and the paddle, and what two cameras in one place show of them.

python -m tools.return_picture    # docs/return.webp; a minute

An episode of the test split, fifty times slower than life, played by the task's classical controller from the spike
camera's pictures.  The frame camera sees the same light by a sensor of its own.
"""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from spikecam_env.agents.controllers import classical
from spikecam_env.cli.screen.screen import PicturePanel, compose
from spikecam_env.envs.mujoco_tasks import make_task
from spikecam_env.envs.observations import ObservedStream, observation
from spikecam_env.errors import InputError
from tools.demo_picture import write_webp

PICTURE = Path(__file__).parents[1] / "docs/return.webp"
LEVEL, EPISODES = 3, range(50)
"""15 m/s among two other balls; the first of these test episodes in which the ball is returned is shown."""
WHITE = (110.0, 90.0, 90.0)
"""Values of each panel's pictures, 0 to 255 in linear light, that are shown white: a ball of the middle level."""
MS = 50.0
"""Time of a picture [ms], which is a millisecond of the scene."""
LAST = 15
"""Pictures for which the end is shown."""


def played(episode: int) -> tuple[list[Image.Image], bool]:
    """A picture of every step of an episode, and whether the ball was returned."""
    options: dict[str, Any] = {"obs_state": True, "obs_inner": True, "render_mode": "rgb_array"}
    with closing(make_task("Return", level=LEVEL, split="test", **options)) as env:
        player, frames = classical(env), ObservedStream(observation("frame120"), env.view, has_gaze=False)
        seen, info = env.reset(seed=episode, options={"episode": episode})
        player.begin()
        frames.begin()
        pictures, over = [], False
        while not over:
            frame, _ = frames.step(env.blocks)
            colour = env.render()
            assert isinstance(colour, np.ndarray) and isinstance(frame, np.ndarray)
            pictures.append(_screen(colour, frame[0], seen["picture"][0], f"{info['time_s'] * 1e3:.0f} ms"))
            seen, _, terminated, truncated, info = env.step(player.act(seen))
            over = terminated or truncated
    return pictures, bool(info["is_success"])


def _screen(colour: NDArray[Any], frame: NDArray[Any], counts: NDArray[Any], line: str) -> Image.Image:
    factor = len(colour) // len(counts)
    large = [colour, *(np.kron(picture, np.ones((factor, factor))) for picture in (frame, counts))]
    titles = "the scene", "a frame camera, 120 a second", "a spike camera, counts of 1 ms"
    panels = [PicturePanel(p / white, title) for p, white, title in zip(large, WHITE, titles, strict=True)]
    return Image.fromarray(compose(panels, status=line))


def main() -> None:
    """Play episodes until a ball is returned, and write that one."""
    for episode in EPISODES:
        pictures, returned = played(episode)
        if returned:
            write_webp(PICTURE, pictures + pictures[-1:] * LAST, MS)
            print(f"{PICTURE.name}: episode {episode}, {len(pictures)} ms, {PICTURE.stat().st_size / 1e6:.2f} MB")
            return
    raise InputError("the controller returned no ball")


if __name__ == "__main__":
    main()
