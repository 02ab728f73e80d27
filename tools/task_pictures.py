"""The observations of every task, at four moments of an oracle's episode, as one picture.

python -m tools.task_pictures docs/tasks.jpg
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

import spikecam_env.envs  # noqa: F401
from spikecam_env.cli.screen.screen import BACKGROUND, FAINT, INK, font
from spikecam_env.envs.oracle import oracle
from spikecam_env.envs.tasks import Catch, ReadSpin, Saccade, Track
from spikecam_env.envs.tasks.digits import DIGITS
from spikecam_env.envs.tasks.env import TaskEnv
from spikecam_env.envs.tasks.exposure import Lit
from spikecam_env.envs.tasks.read_spin import RPM, ReadSpinEpisode
from spikecam_env.whole import check_file, whole_file

EPISODE = 3
MOMENTS = 4
ZOOM, MARGIN, CAPTION, TEXT = 3, 10, 24, 250  # [pixels], but for the first
BESIDE = 1.5  # from a target to its mark [pixels of the observation]
QUALITY = 80  # of the JPEG

TARGET, MIDDLE = (80, 220, 120), (255, 200, 60)

WORDS = {
    "Track": "A disc turns and bounces.\nKeep it in the middle.",
    "Saccade": "Four discs move. Look at the\none with spokes, and hold it\nfor 20 ms.",
    "Catch": "A ball falls to a bright line.\nSlide the camera, so that it\ncrosses between the bars.",
    "ReadSpin": "Look at the disc, and say how\nfast it spins: 1000, 2000,\n4000 or 8000 rpm.",
    "ReadDigit": "Look at the disc, and say\nwhich digit is on it.\nThe bar is below the digit.",
    "LowLight": "As Track, in dim light: a pixel\nfires every 20 to 200 frames.",
    "Exposure": "As Track, while the light\nchanges a thousandfold. An iris\nmakes up for it.",
}
"""The aim of each task, in a few lines."""

LEGEND = (
    ("Four moments of an episode, as an agent is shown them (tfp). Marks for the reader: ", INK),
    ("the target, ", TARGET),
    ("the middle of the view", MIDDLE),
)


@dataclass(frozen=True)
class Moment:
    """A moment of an episode."""

    seen: NDArray[np.uint8]
    """The observation, (H, W)."""
    target: tuple[float, float]
    """(x, y) [pixels]."""
    radius: float
    """Of the target [pixels]."""
    near: float
    """Largest distance to the middle that counts as on target [pixels]."""
    axes: int
    """Axes about which the camera turns."""
    line: str
    """Text below the picture."""


def moments(name: str) -> list[Moment]:
    """Of the oracle's episode: the first, the last, and those that share the time between them evenly."""
    env: Any = gymnasium.make(f"spikecam_env/{name}-v1", obs="tfp").unwrapped
    shown = list(_played(env))
    chosen = np.linspace(0, len(shown) - 1, MOMENTS).round().astype(int)
    return [shown[number] for number in chosen]


def page() -> Image.Image:
    """The legend, and a row a task."""
    rows = [_row(name, moments(name)) for name in WORDS]
    width, height = rows[0].size
    picture = Image.new("RGB", (width, height * len(rows) + 2 * MARGIN + CAPTION), BACKGROUND)
    draw, left = ImageDraw.Draw(picture), float(MARGIN)
    for words, colour in LEGEND:
        draw.text((left, MARGIN), words, colour, font(14))
        left += font(14).getlength(words)
    for number, row in enumerate(rows):
        picture.paste(row, (0, number * height + MARGIN + CAPTION))
    return picture


def _played(env: TaskEnv) -> Iterator[Moment]:
    seen, _ = env.reset(seed=0, options={"split": "test", "episode": EPISODE})
    yield _moment(env, seen[0])
    while not (env.course.terminated or env.course.truncated):
        seen, *_ = env.step(oracle(env.course))
        yield _moment(env, seen[0])


def _moment(env: TaskEnv, seen: NDArray[np.uint8]) -> Moment:
    course, task = env.course, env.task
    episode, frame = course.episode, course.standing.frame
    assert isinstance(task, Track | Saccade | Catch | ReadSpin)
    target = episode.scene.places(frame, course.gaze)[episode.target]
    said = [f"{1e3 * frame / course.drive.frame_rate_hz:.1f} ms"]
    if isinstance(episode, Lit):
        said.append(f"iris {10 ** episode.iris.values[1]:.2g} x")
    if isinstance(episode, ReadSpinEpisode) and episode.is_right:
        said.append(f"a {episode.truth}" if task.answers == len(DIGITS) else f"{RPM[episode.truth]:.0f} rpm")
    if course.end:
        said.append("success")
    return Moment(seen, target, task.radius * min(env.shape), episode.success_px, env.axes, ", ".join(said))


def _row(name: str, shown: list[Moment]) -> Image.Image:
    side = ZOOM * shown[0].seen.shape[0]
    width = TEXT + len(shown) * (side + MARGIN) + MARGIN
    row = Image.new("RGB", (width, side + MARGIN + CAPTION), BACKGROUND)
    draw = ImageDraw.Draw(row)
    draw.text((MARGIN, MARGIN), name, INK, font(20))
    draw.text((MARGIN, MARGIN + 32), WORDS[name], FAINT, font(14), spacing=5)
    for number, moment in enumerate(shown):
        left = TEXT + number * (side + MARGIN)
        row.paste(_marked(moment), (left, MARGIN))
        draw.text((left, MARGIN + side + 4), moment.line, FAINT, font(14))
    return row


def _marked(moment: Moment) -> Image.Image:
    """The observation for a screen (gamma 2.2), enlarged.

    A green square is about the target.  Yellow marks the middle of the view: a circle, or two bars where the camera
    only pans.
    """
    light = (255 * (moment.seen / 255) ** (1 / 2.2)).astype(np.uint8)
    rows, columns = light.shape
    picture = Image.fromarray(light).resize((ZOOM * columns, ZOOM * rows), Image.Resampling.NEAREST).convert("RGB")
    draw = ImageDraw.Draw(picture)
    (x, y), near = ((ZOOM * (place + 0.5) for place in moment.target), ZOOM * moment.near)
    reach = ZOOM * (moment.radius + BESIDE)
    draw.rectangle((x - reach, y - reach, x + reach, y + reach), outline=TARGET, width=2)
    middle = ZOOM * columns / 2
    if moment.axes == 2:
        draw.ellipse((middle - near, middle - near, middle + near, middle + near), outline=MIDDLE, width=2)
    else:
        for bar in (middle - near, middle + near):
            draw.line((bar, 0, bar, ZOOM * rows), fill=MIDDLE, width=2)
    return picture


def main() -> None:
    """Write the picture; it appears whole."""
    if len(sys.argv) != 2:
        sys.exit("give one file, e.g. python -m tools.task_pictures docs/tasks.jpg")
    check_file(sys.argv[1])
    picture = page()
    with whole_file(sys.argv[1]) as beside:
        picture.save(beside, format="JPEG", quality=QUALITY, optimize=True)


if __name__ == "__main__":
    main()
