"""Fresh units drawn from a model: what the fixed pattern of rates should look like, and what it does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.refit import BaseFit
from spikecam_env.gap.statistics import Key, pattern
from spikecam_env.gap.world import Shown
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]


def drawn_banks(
    model: SensorModel, base: BaseFit, shown: Sequence[Shown], shape: tuple[int, int], count: int, seed: int
) -> list[dict[Key, float]]:
    """Pattern statistics of `count` units of the model, at the measured unit's mean response, dark level and noise."""
    return [_bank(model, base, shown, shape, seed + n) for n in range(count)]


def drawn(model: SensorModel, base: BaseFit, shape: tuple[int, int], seed: int) -> tuple[Array, Array]:
    """gain, dark (P,) of a fresh unit of the model, scaled to the measured unit's medians."""
    unit = model.draw_unit(shape, seed)
    live = base.live & (base.gain > 0)
    gain = unit.gain * (np.median(base.gain[live]) / max(float(np.median(unit.gain)), 1e-12))
    middle = float(np.median(unit.dark))
    dark = unit.dark * (np.median(base.dark[live]) / middle) if middle > 0 else unit.dark
    return gain, dark


def _bank(
    model: SensorModel, base: BaseFit, shown: Sequence[Shown], shape: tuple[int, int], seed: int
) -> dict[Key, float]:
    gain, dark = drawn(model, base, shape, seed)
    rng = np.random.default_rng([seed, 1])
    found = {}
    for c in shown:
        if c.kind not in ("dark", "flat") or c.light is None:
            continue
        rate = gain * c.picture + dark
        spikes = np.maximum(rate * c.frames, 1.0)
        noise = np.sqrt(base.white / spikes + 1.0 / (3.0 * spikes**2) * np.minimum(rate * 2, 1.0))
        rate = np.clip(rate * (1.0 + noise * rng.standard_normal(rate.size)), 0.0, 1.0)
        for name, value in pattern.statistics(rate.reshape(shape)).items():
            found[Key("pattern", c.name, name)] = value
    return found
