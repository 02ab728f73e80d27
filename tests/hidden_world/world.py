"""A campaign of the hidden world from its hidden mechanisms: camera, light, integration, read-out, labels.

A camera with a mechanism in one place only is filmed twice, with and without it, and each pixel taken from its film;
a mechanism that starts on the way is switched on between two frames, the charge of every pixel going on.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.hidden_world.campaign import Recorded, write_index, write_recording
from tests.hidden_world.catalogue import BASE_EFFECTS, CATALOGUE
from tests.hidden_world.integrator import Physics, Recording
from tests.hidden_world.light import Light, Shot, plan
from tests.hidden_world.mechanism import Bits, Hidden, Law, Mechanism
from tests.hidden_world.outside import OUTSIDE
from tests.hidden_world.tricky import changed_labels, changed_plan
from tests.hidden_world.unit import Camera, draw_camera

MECHANISMS: dict[str, Mechanism] = {**CATALOGUE, **BASE_EFFECTS, **OUTSIDE}


@dataclass(frozen=True)
class Recipe:
    """All that makes a campaign.  base: of `unit.BASES`.  trick: of `tricky.TRICKS`, or none."""

    seed: int
    base: str
    hidden: tuple[Hidden, ...] = ()
    trick: str = ""
    reset_noise_times: float = 1.0
    shape: tuple[int, int] = (64, 64)
    frames: int = 8000

    @property
    def pixel_steps(self) -> int:
        """Pixels times frames of one recording."""
        return self.frames * self.shape[0] * self.shape[1]


def stream(seed: int, *names: object) -> np.random.Generator:
    """A generator for each purpose, so that the draws of one change nothing for another."""
    return np.random.default_rng([seed, *(zlib.crc32(str(name).encode()) for name in names)])


def law_of(hidden: Hidden) -> Law:
    """By which a mechanism acts in a camera."""
    return MECHANISMS[hidden.name].by(hidden.law)


def write_campaign(recipe: Recipe, folder: str | Path) -> dict[str, Any]:
    """Write the campaign's folder; returns the draws of its camera.  The same recipe gives the same bytes."""
    root = Path(folder)
    root.mkdir(parents=True, exist_ok=True)
    camera = draw_camera(recipe.base, recipe.shape, stream(recipe.seed, "unit"), recipe.reset_noise_times)
    shots = changed_plan(recipe.trick, plan(recipe.shape, recipe.frames, stream(recipe.seed, "light")))
    made = ((shot, film(recipe, camera, shot)) for shot in shots)
    entries = [
        write_recording(root, recorded)
        for recorded in changed_labels(recipe.trick, _labelled(made), stream(recipe.seed, "labels"))
    ]
    write_index(root, recipe.shape, entries)
    return dict(camera.drawn)


def _labelled(made: Iterator[tuple[Shot, Bits]]) -> Iterator[Recorded]:
    for shot, bits in made:
        yield Recorded(shot.name, shot.use, bits, shot.light)


def film(
    recipe: Recipe, camera: Camera, shot: Shot, change: Callable[[Physics], object] = lambda physics: None
) -> Bits:
    """(T, rows, columns) bits of one recording; change: of its physics, after all mechanisms."""
    everywhere = [h for h in recipe.hidden if h.rows is None and h.columns is None]
    bits = _film(recipe, camera, shot, everywhere, change)
    if len(everywhere) < len(recipe.hidden):
        there = _film(recipe, camera, shot, recipe.hidden, change)
        for hidden in recipe.hidden:
            where = (slice(None), slice(*(hidden.rows or (None,))), slice(*(hidden.columns or (None,))))
            bits[where] = there[where]
    return bits


def _film(
    recipe: Recipe, camera: Camera, shot: Shot, hidden: Sequence[Hidden], change: Callable[[Physics], object]
) -> Bits:
    """One recording with these mechanisms all over the array."""
    rng = stream(recipe.seed, "temporal", shot.name)
    begins = sorted({0, *(round(h.since * recipe.frames) for h in hidden)})
    parts, under_way = [], None
    for first, stop in zip(begins, [*begins[1:], recipe.frames], strict=True):
        acting = [h for h in hidden if round(h.since * recipe.frames) <= first]
        physics = physics_of(recipe, camera, shot, acting)
        change(physics)
        recording = Recording(physics, rng)
        under_way = recording if under_way is None else recording.resume(under_way)
        parts.append(under_way.frames(first, stop))
    bits = (parts[0] if len(parts) == 1 else np.concatenate(parts)).reshape(recipe.frames, *recipe.shape)
    for h in hidden:
        report = law_of(h).bits
        if report is not None:
            first = round(h.since * recipe.frames)
            bits[first:] = report(bits[first:], h.parameters, stream(recipe.seed, h.name, "bits", shot.name))
    return bits


def physics_of(recipe: Recipe, camera: Camera, shot: Shot, hidden: Sequence[Hidden]) -> Physics:
    """The physics of a recording with these mechanisms."""
    light: Light = shot.light
    for h in hidden:
        law = law_of(h)
        if law.camera is not None:
            camera = law.camera(camera, h.parameters, stream(recipe.seed, h.name, "camera"))
        if law.light is not None:
            light = law.light(light, recipe.shape, h.parameters)
    radiance = light.radiance.reshape(len(light.radiance), -1)
    physics = Physics(
        recipe.shape,
        recipe.frames,
        camera.gain.reshape(-1),
        camera.dark.reshape(-1),
        camera.quiet.reshape(-1),
        camera.kappa.reshape(-1),
        camera.per_mv.reshape(-1),
        light.key_frame,
        radiance,
        before=float(shot.order * recipe.frames),
    )
    for h in hidden:
        change = law_of(h).physics
        if change is not None:
            rng = stream(recipe.seed, h.name, "physics", shot.name)
            change(physics, camera, recipe.frames, h.parameters, rng)
    return physics
