"""The fast engine (stand-in until the numba kernels land): carries nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from spikecam_env.sensor.effects import Effect

CARRIES: frozenset[str] = frozenset(
    {
        "shot_noise",
        "reset_noise",
        "conversion_gain_spread",
        "dark_current",
        "dark_current_spread",
        "capacitor_spread",
        "bias_voltage_spread",
    }
)


def missing(effects: Sequence[Effect]) -> list[str]:
    """Names of effects, or options of them, that this engine does not carry."""
    names = [e.name for e in effects if e.name not in CARRIES]
    names += ["shot_noise.dark_is_noisy=false" for e in effects if getattr(e, "dark_is_noisy", True) is False]
    return names


def start(*args: Any) -> Any:
    raise NotImplementedError


def run(*args: Any) -> Any:
    raise NotImplementedError
