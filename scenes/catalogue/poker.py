"""Poker: cards thrown through the picture, spinning."""

from __future__ import annotations

import numpy as np

from scenes.catalogue import stage
from scenes.drawing import Canvas
from scenes.meshes import assemble, box
from scenes.protocol import Scene
from scenes.renderers.protocol import Renderer
from scenes.textures import Texture
from scenes.trajectories import Ballistic, Repeating, Spinning, Still
from scenes.world import Body, World

CARDS = (("A", "spade"), ("7", "diamond"), ("K", "club"), ("9", "heart"), ("Q", "spade"))


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    cards = []
    for number, (rank, suit) in enumerate(CARDS):
        x, y = -1.3 + 0.62 * number, (0.25, -0.35, 0.42, -0.2, 0.3)[number]
        across = (48.0, -40.0, 62.0, -52.0, 44.0)[number]
        flight = Ballistic((x, y, 0.35 * (number - 2)), (across, rng.uniform(-6, 6), 0))
        tilt = Still(turn=(rng.uniform(-35, 10), rng.uniform(-30, 30), 0))
        spin = Spinning((0, 0, 1), rng.uniform(600, 1300) * np.sign(-across), rng.uniform(0, 360))
        cards.append(
            Body(
                f"{rank} of {suit}s",
                assemble(*box((0.62, 0.9, 0.012), [front(rank, suit), 0.9, back(), 0.9, 0.9, 0.9])),
                Repeating(flight, 5.4 / abs(across), -(2.7 + np.sign(across) * x) / abs(across)) @ tilt @ spin,
            )
        )
    felt = stage.wall(stage.mottled(rng, 0.08, 0.25))
    return World(shape, (felt, *cards), stage.camera(0.0), frame_rate_hz=frame_rate_hz, renderer=renderer)


def front(rank: str, suit: str) -> Texture:
    """A playing card's face."""
    grey = 0.3 if suit in ("heart", "diamond") else 0.03
    canvas = Canvas(248, 360, 0.5).rectangle(0.015, 0.01, 0.985, 0.99, 0.96)
    _pip(canvas, suit, 0.5, 0.5, 0.17, grey)
    for turned, x, y in ((False, 0.14, 0.1), (True, 0.86, 0.9)):
        canvas.text(rank, x, y, 0.1, grey, turned)
        _pip(canvas, suit, x, y + (-0.12 if turned else 0.12), 0.045, grey, turned)
    for x, y in ((0.3, 0.24), (0.7, 0.24), (0.3, 0.76), (0.7, 0.76)):
        _pip(canvas, suit, x, y, 0.06, grey, y > 0.5)
    return canvas.texture()


def _pip(canvas: Canvas, suit: str, x: float, y: float, size: float, grey: float, turned: bool = False) -> None:
    down = -1 if turned else 1
    wide, tall = size * 360 / 248, size * down
    if suit == "diamond":
        canvas.polygon([(x, y - tall), (x + 0.75 * wide, y), (x, y + tall), (x - 0.75 * wide, y)], grey)
        return
    if suit == "club":
        for dx, dy in ((0, -0.45), (-0.45, 0.15), (0.45, 0.15)):
            canvas.ellipse(x + dx * wide, y + dy * tall, 0.4 * wide, 0.4 * size, grey)
    else:
        point = -1 if suit == "spade" else 1
        lobe = -0.3 * point
        for side in (-1, 1):
            canvas.ellipse(x + side * 0.42 * wide, y + lobe * tall, 0.43 * wide, 0.43 * size, grey)
        canvas.polygon(
            [(x - 0.83 * wide, y + 0.6 * lobe * tall), (x, y + point * tall), (x + 0.83 * wide, y + 0.6 * lobe * tall)],
            grey,
        )
    if suit != "heart":
        canvas.polygon([(x, y), (x + 0.35 * wide, y + tall), (x - 0.35 * wide, y + tall)], grey)


def back() -> Texture:
    canvas = Canvas(248, 360, 0.9).rectangle(0.05, 0.035, 0.95, 0.965, 0.12)
    for i in range(9):
        for j in range(13):
            canvas.polygon(
                [
                    (0.1 * i + 0.1 + dx * 0.035, 0.07 * j + 0.08 + dy * 0.026)
                    for dx, dy in ((0, -1), (1, 0), (0, 1), (-1, 0))
                ],
                0.75,
            )
    return canvas.texture()
