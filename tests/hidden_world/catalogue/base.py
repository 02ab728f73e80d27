"""The base model's own effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter

from tests.hidden_world.catalogue.drawing import Array, swung
from tests.hidden_world.catalogue.threshold import uneven_draw, wide_draw
from tests.hidden_world.mechanism import Law, Mechanism, OnCamera, Parameters, Rng
from tests.hidden_world.unit import SWING_V, Camera

SMOOTH = 1 / 16
"""Scale of a pattern that varies over the chip, in its width."""
Pattern = Callable[[Rng, tuple[int, int]], Array]


def _normal(rng: Rng, shape: tuple[int, int]) -> Array:
    return rng.standard_normal(shape)


def _smooth(rng: Rng, shape: tuple[int, int]) -> Array:
    """Mean 0, variance 1 over the chip, the same over a sixteenth of its width."""
    made = gaussian_filter(rng.standard_normal(shape), SMOOTH * shape[1])
    return (made - made.mean()) / made.std()


def _skewed(rng: Rng, shape: tuple[int, int]) -> Array:
    """A gamma law of four defects a pixel: mean 0, variance 1, skewness 1."""
    return rng.gamma(4.0, 0.5, shape) - 2.0


def _shot_noise(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    phi0 = camera.phi_fc.mean()
    return replace(camera, quiet=phi0 / camera.phi_fc / p["quanta"])


def _gain(pattern: Pattern) -> OnCamera:
    return lambda camera, p, rng: replace(
        camera, gain=camera.gain * np.maximum(1.0 + p["sigma"] * pattern(rng, camera.shape), 0.0)
    )


def _dark_current(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    return replace(camera, dark=camera.dark + camera.charge_of(p["mean_pA"]))


def _warmer_on_one_side(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    slope = 2.0 * np.arange(camera.shape[1]) / (camera.shape[1] - 1)
    return replace(camera, dark=camera.dark + camera.charge_of(p["mean_pA"]) * slope)


def _dark_spread(pattern: Pattern) -> OnCamera:
    def spread(camera: Camera, p: Parameters, rng: Rng) -> Camera:
        extra = pattern(rng, camera.shape) * camera.charge_of(p["sigma_pA"])
        return replace(camera, dark=np.maximum(camera.dark + extra, 0.0))

    return spread


def _capacitor(pattern: Pattern) -> OnCamera:
    def spread(camera: Camera, p: Parameters, rng: Rng) -> Camera:
        capacitance = camera.phi_fc / SWING_V
        changed = swung(camera, 1.0 + p["sigma_fF"] / capacitance * pattern(rng, camera.shape))
        return replace(changed, kappa=camera.kappa, per_mv=camera.per_mv)

    return spread


def _bias(pattern: Pattern) -> OnCamera:
    return lambda camera, p, rng: swung(camera, 1.0 + 1e3 * p["sigma_V"] * camera.per_mv * pattern(rng, camera.shape))


_SMOOTH = ("smooth over the chip", "n has a scale of a sixteenth of its width")
_PELGROM = "Pelgrom, Matching properties of MOS transistors (1989): the term of distance"

MECHANISMS = (
    Mechanism("shot_noise", "Poisson electrons", camera=_shot_noise),
    Mechanism(
        "reset_noise",
        "a threshold drawn at each reset",
        camera=wide_draw,
        far=(
            Law("each its own", "by another deviation in each pixel, squares exponential", camera=uneven_draw,
                source="Janesick, Photon Transfer (2007): noise histograms with a tail"),
        ),
    ),
    Mechanism(
        "conversion_gain_spread",
        "alpha (1 + sigma n)",
        camera=_gain(_normal),
        far=(Law(*_SMOOTH, camera=_gain(_smooth), source=_PELGROM),),
    ),
    Mechanism(
        "dark_current",
        "I the same in all pixels",
        camera=_dark_current,
        far=(
            Law("warmer on one side", "from 0 to 2 I along the row", camera=_warmer_on_one_side,
                source="heat of a circuit beside the array"),
        ),
    ),
    Mechanism(
        "dark_current_spread",
        "I + sigma n",
        camera=_dark_spread(_normal),
        far=(
            Law("skewed", "n of a gamma law of skewness 1", camera=_dark_spread(_skewed),
                source="Baer, A model for dark current characterization (2006)"),
        ),
    ),
    Mechanism(
        "capacitor_spread",
        "C + sigma n",
        camera=_capacitor(_normal),
        far=(Law(*_SMOOTH, camera=_capacitor(_smooth), source=_PELGROM),),
    ),
    Mechanism(
        "bias_voltage_spread",
        "V_d + sigma n",
        camera=_bias(_normal),
        far=(Law(*_SMOOTH, camera=_bias(_smooth), source=_PELGROM),),
    ),
)  # fmt: skip
