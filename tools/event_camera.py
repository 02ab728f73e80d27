"""The event camera beside others on the same light, as a picture; and the effect of its parameters, as a table.

python -m tools.event_camera docs/events.png
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

import spikecam_env.envs  # noqa: F401
from spikecam_env.cli.screen.screen import BACKGROUND, FAINT, INK, font
from spikecam_env.cli.table import table
from spikecam_env.sensor import EventCamera, EventList, EventPixel, Keyframes
from spikecam_env.whole import check_file, whole_file

SHAPE, STEPS = (96, 96), 40
"""Of the pictures; steps of a millisecond, after which the last is shown."""
ZOOM, MARGIN, CAPTION = 3, 10, 44  # the first a factor, the others [pixels]
ON, OFF = (235, 70, 60), (70, 130, 255)

CHANGES: tuple[dict[str, float], ...] = (
    {},
    {"threshold_on": 0.1, "threshold_off": 0.1},
    {"threshold_on": 0.4, "threshold_off": 0.4},
    {"mismatch": 0.0},
    {"refractory_us": 0.0},
    {"refractory_us": 2000.0},
    {"leak_hz": 0.0},
    {"leak_hz": 10.0},
    {"noise_hz": 0.0},
    {"noise_hz": 50.0},
    {"dark": 0.2},
)
"""Parameters that are not the default."""


def lights() -> tuple[list[Keyframes], dict[str, NDArray[np.uint8]], dict[str, float]]:
    """The light of each step of a disk at 2000 rpm; by camera its last picture, and bits a second."""
    light: list[Keyframes] = []
    pictures, bits = {}, {}
    for obs in ("frame30", "frame1000", "tfp", "events"):
        env: Any = gymnasium.make("spikecam_env/RotatingDisk-v0", shape=SHAPE, obs=obs, drift_px_s=0.0).unwrapped
        seen, info = env.reset(seed=0)
        sent, light = info["camera_bits"], [env.blocks.light[0]]
        for _ in range(STEPS - 1):
            seen, *_, info = env.step(np.zeros(2, np.float32))
            sent += info["camera_bits"]
            light.append(env.blocks.light[0])
        pictures[obs], bits[obs] = seen, sent / info["time_s"]
    return light, pictures, bits


def recorded(pixel: EventPixel, light: list[Keyframes]) -> tuple[EventList, float]:
    """The events of a camera, and the processor's time of a step [ms]."""
    camera = EventCamera(pixel, SHAPE)
    camera.step(light[0], 40)  # compiles
    camera.reset()
    begun = time.process_time()
    events = EventList.joined([camera.step(its, 40) for its in light])
    return events, 1e3 * (time.process_time() - begun) / len(light)


def rows(light: list[Keyframes]) -> list[dict[str, object]]:
    """The effect of each change on the events."""
    found: list[dict[str, object]] = []
    for change in CHANGES:
        events, step_ms = recorded(replace(EventPixel(), **change), light)
        pixel_seconds = STEPS * 1e-3 * SHAPE[0] * SHAPE[1]
        on = int(events.p.sum())
        found.append(
            {
                "parameters": ", ".join(f"{name} {value:g}" for name, value in change.items()) or "default",
                "ON/pixel/s": f"{on / pixel_seconds:.0f}",
                "OFF/pixel/s": f"{(len(events) - on) / pixel_seconds:.0f}",
                "processor ms/step": f"{step_ms:.2f}",
            }
        )
    return found


def page(light: list[Keyframes], pictures: dict[str, NDArray[np.uint8]], bits: dict[str, float]) -> Image.Image:
    """Panels side by side: cameras on the same light, and a column of events over time."""
    names = {"frame30": "frame camera, 30 Hz", "frame1000": "frame camera, 1 kHz", "tfp": "spike camera, 1 ms"}
    panels = [(for_screen(pictures[obs][0]), title, f"{bits[obs] / 1e6:.1f} Mbit/s") for obs, title in names.items()]
    panels.append(
        (signed(pictures["events"]), "event camera, 1 ms", f"{bits['events'] / 1e6:.1f} Mbit/s, ON red, OFF blue")
    )
    events, _ = recorded(EventPixel(), light)
    panels.append((over_time(events), "its middle column", "time to the right, 8 ms"))
    side = ZOOM * SHAPE[0]
    canvas = Image.new("RGB", (len(panels) * (side + MARGIN) + MARGIN, side + MARGIN + CAPTION), BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    for number, (picture, title, line) in enumerate(panels):
        left = MARGIN + number * (side + MARGIN)
        canvas.paste(picture.resize((side, side), Image.Resampling.NEAREST), (left, MARGIN))
        draw.text((left, MARGIN + side + 4), title, INK, font(14))
        draw.text((left, MARGIN + side + 22), line, FAINT, font(14))
    return canvas


def for_screen(picture: NDArray[np.uint8]) -> Image.Image:
    """Grey (H, W) in linear light, with a screen's gamma of 2.2."""
    return Image.fromarray((255 * (picture / 255) ** (1 / 2.2)).astype(np.uint8)).convert("RGB")


def signed(counts: NDArray[np.uint8]) -> Image.Image:
    """ON and OFF (2, H, W) in their colours; one event is bright enough to be seen."""
    canvas = np.full((*counts.shape[1:], 3), BACKGROUND, np.uint8)
    for colour, picture in ((OFF, counts[1]), (ON, counts[0])):
        canvas[picture > 0] = colour
    return Image.fromarray(canvas)


def over_time(events: EventList, milliseconds: float = 8.0) -> Image.Image:
    """The last events of the middle column: rows down, time to the right."""
    canvas = np.full((SHAPE[0] * ZOOM, SHAPE[1] * ZOOM, 3), BACKGROUND, np.uint8)
    end = STEPS * 1e-3
    chosen = (events.x == SHAPE[1] // 2) & (events.t >= end - milliseconds * 1e-3)
    across = (events.t[chosen] - end) / (milliseconds * 1e-3) + 1.0
    for at, row, rose in zip(across, events.y[chosen], events.p[chosen], strict=True):
        x, y = int(at * canvas.shape[1]), int(row) * ZOOM
        canvas[y : y + ZOOM, x : x + 2] = ON if rose else OFF
    return Image.fromarray(canvas)


def main() -> None:
    """Write the picture, which appears whole, and print the table."""
    if len(sys.argv) != 2:
        sys.exit("give one file, e.g. python -m tools.event_camera docs/events.png")
    check_file(sys.argv[1])
    light, pictures, bits = lights()
    with whole_file(sys.argv[1]) as beside:
        page(light, pictures, bits).save(beside, format="PNG", optimize=True)
    print(table(rows(light)))


if __name__ == "__main__":
    main()
