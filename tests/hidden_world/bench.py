"""A workbench for those who try the hidden world: small cameras with every number given."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.hidden_world.integrator import Physics
from tests.hidden_world.light import Light, Shot, flat
from tests.hidden_world.mechanism import Hidden
from tests.hidden_world.unit import CAPACITANCE_FF, SWING_V, Camera
from tests.hidden_world.world import Recipe, film


def plain_camera(
    shape: tuple[int, int], electrons: float = 5e4, kappa: float = 0.0, dark: float = 0.0, spread: float = 0.02
) -> Camera:
    """Pixels that differ in gain alone, evenly over 1 -+ spread; dark: charge a frame."""
    gain = 1.0 + spread * np.linspace(-1, 1, shape[0] * shape[1]).reshape(shape)
    gain = np.random.default_rng(0).permutation(gain.reshape(-1)).reshape(shape)
    full = np.full
    return Camera(
        shape=shape,
        gain=gain,
        dark=full(shape, dark),
        quiet=full(shape, 1.0 / electrons if electrons else 0.0),
        kappa=full(shape, kappa),
        per_mv=full(shape, 1e-3 / SWING_V),
        phi_fc=full(shape, CAPACITANCE_FF * SWING_V),
        drawn={},
    )


def near(value: float, expected: float, tolerance: float) -> None:
    print(f"{value:.5g}, expected {expected:.5g} +- {tolerance:.2g}")
    assert abs(value - expected) <= tolerance


def filmed(
    camera: Camera, light: Light | float, frames: int, hidden: Sequence[Hidden] = (), seed: int = 1, pieces: int = 0
) -> NDArray[np.uint8]:
    """(frames, rows, columns) bits under a light, or a flat of that radiance; pieces: of a frame, at least."""
    shown = light if isinstance(light, Light) else flat(light)
    recipe = Recipe(seed, "scsim", tuple(hidden), shape=camera.shape, frames=frames)

    def cut(physics: Physics) -> None:
        physics.substeps = max(physics.substeps, pieces)

    return film(recipe, camera, Shot("shot", "fit", shown), cut)


def hidden(name: str, law: str = "", **parameters: float) -> Hidden:
    """A mechanism with these parameters, by its near law or a far one."""
    return Hidden(name, parameters, 1.0, law=law)


def step_up(low: float, high: float, at: int) -> Light:
    """Uniform light that rises within frame `at`."""
    return Light(np.array([0.0, at, at + 1.0]), np.array([low, low, high], np.float32)[:, None, None])


def intervals(bits: NDArray[np.uint8]) -> NDArray[np.int64]:
    """All intervals of all pixels, one after the other."""
    flat_bits = bits.reshape(len(bits), -1)
    return np.concatenate([np.diff(np.flatnonzero(flat_bits[:, p])) for p in range(flat_bits.shape[1])])


def walk_of_spikes(bits: NDArray[np.uint8], k: int) -> float:
    """A_k = E[(t_(n+2k) - 2 t_(n+k) + t_n)^2] over all pixels."""
    flat_bits = bits.reshape(len(bits), -1)
    squares = []
    for p in range(flat_bits.shape[1]):
        t = np.flatnonzero(flat_bits[:, p])
        squares.append((t[2 * k :] - 2 * t[k:-k] + t[: -2 * k]) ** 2)
    return float(np.concatenate(squares).mean())


def says_dead_time(
    campaign: Path, model: str, out: Path, seed: int, exclude: tuple[str, ...], threads: int
) -> dict[str, Any]:
    """A diagnosis that always says the same, and keeps a list of its inputs."""
    log = campaign.parents[1] / "asked.txt"
    files = " ".join(sorted({p.suffix for p in campaign.iterdir()}))
    with log.open("a", encoding="utf-8") as file:
        file.write(f"{campaign.name} {model} {threads} {files}\n")
    return {
        "verdict": "named",
        "effects": [{"name": "dead_time", "parameters": {"tau_us": {"value": 0.1, "sd": 0.01}}}],
    }


def fails(campaign: Path, model: str, out: Path, seed: int, exclude: tuple[str, ...], threads: int) -> dict[str, Any]:
    """A diagnosis that breaks."""
    raise RuntimeError("no light in here")
