"""A setting in the hidden world: the parameters of the sensor's effects, given to physics that knows nothing of it.

What a model of the sensor leaves to convention is set as in the sensor: a spike is of the frame of its crossing, before
the comparator's delay; the reference that a clock's edge is coupled into has its nominal value in the mean over time;
slow noise has an octave a process; the lens' spread is a normal law sampled at pixels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from spikecam_env.sensor.effects import CATALOGUE
from spikecam_env.types import Floats, Spikes
from tests.hidden_world.bench import plain_camera
from tests.hidden_world.catalogue.optics import normal_law
from tests.hidden_world.integrator import Physics
from tests.hidden_world.light import Light, Shot
from tests.hidden_world.mechanism import Hidden, Parameters
from tests.hidden_world.world import MECHANISMS, Recipe, film

PIECES = 80
"""Of a frame; every moment at which the settings' light bends is among its cuts."""
WALK_STEPS = 64
"""Of a lamp's walk, a frame."""


def filmed(
    effects: Mapping[str, Mapping[str, Any]], electrons: float, picture: Floats, light: Light, frames: int, seed: int
) -> Spikes:
    """Spikes (F, H, W) of a camera of equal pixels with these effects.

    Args:
        effects: parameters of the sensor's effects, by name; the others are the sensor's defaults.
        electrons: to a threshold.
        picture: (H, W) light of each pixel over `light`.
        light: uniform light at its keys.
        frames: length of the recording.
        seed: of the recording.
    """
    parameters = {name: asdict(CATALOGUE[name](**effects[name])) for name in CATALOGUE if name in effects}
    blur = parameters.pop("optical_blur", None)
    if blur:
        picture = normal_law(picture, blur["sigma_pixels"])
    shape = (picture.shape[0], picture.shape[1])
    hidden = [_hidden(name, p, shape, seed) for name, p in parameters.items()]
    camera = replace(plain_camera(shape, electrons, spread=0.0), gain=picture)
    recipe = Recipe(seed, "ideal", tuple(hidden), shape=shape, frames=frames)

    def as_in_the_sensor(physics: Physics) -> None:
        physics.substeps = PIECES
        if physics.laws.delay:
            physics.laws = physics.laws._replace(delay_reports=0.0)
        if clock := physics.clock:  # its mean over a frame, taken off all thresholds
            mean = float(clock.height(np.zeros(1))[0]) * clock.tau * (1.0 - np.exp(-1.0 / clock.tau))
            physics.row_mv = np.full((frames, shape[0]), -mean, np.float32)
        if flicker := parameters.get("threshold_flicker_noise"):
            physics.slow_tau = 2.0 ** np.arange(1.0, flicker["octaves"] + 1.0)
            physics.slow_mv = np.full(physics.slow_tau.size, flicker["sigma_mV"])

    return film(recipe, camera, Shot("", "", light), as_in_the_sensor)


def _hidden(name: str, p: Parameters, shape: tuple[int, int], seed: int) -> Hidden:
    """The mechanism with the sensor's parameters, and its own."""
    law = ""
    if name == "vignetting":
        law, p = "off centre", _off_centre(p, shape)
    elif name == "random_telegraph_noise":
        p = {**p, "traps": float(seed)}
    elif name == "lamp_drift":
        p = {**p, "steps": WALK_STEPS}
    assert name in MECHANISMS, f"the hidden world has no {name}"
    return Hidden(name, p, 1.0, law=law)


def _off_centre(p: Parameters, shape: tuple[int, int]) -> Parameters:
    """The sensor's centre is a share of the width, and its fall-off that of the furthest corner."""
    off = [2.0 * p[name] - 1.0 for name in ("centre_y", "centre_x")]
    half = [0.5 * (size - 1) for size in shape]
    furthest = sum((h * (1.0 + abs(o))) ** 2 for h, o in zip(half, off, strict=True))
    falloff = p["falloff"] * sum(h * h for h in half) / furthest
    return {"falloff": falloff, "rows_off": off[0], "columns_off": off[1]}
