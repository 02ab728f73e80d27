"""Another sensor, or other light, in every episode: agents that learn so do not lean on one camera.

    env = RandomizeSensor(env, {"dead_time.tau_us": (0.0, 2.0), "reset_noise.temperature_K": (280.0, 330.0)})
    env = RandomizeLight(env, (0.1, 1.0))

The draws follow from the seed of `reset` alone; without one they go on.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np

from scenes.protocol import MOST_LIGHT
from spikecam_env.checked import checked_number
from spikecam_env.envs.wrappers.any_env import spike_camera_of
from spikecam_env.errors import InputError, shown, unknown_name
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.sensor.model import generator

Ranges = Mapping[str, tuple[float, float]]
"""`effect.parameter` -> lowest and highest value."""


class _Randomize(gymnasium.Wrapper):
    """An option of reset that is drawn anew for every episode, unless the caller gives it."""

    option: str

    def __init__(self, env: gymnasium.Env) -> None:
        super().__init__(env)
        camera = spike_camera_of(env)
        if camera is None:
            raise InputError(f"the environment is {shown(env.unwrapped)}; it must be a spike camera's")
        self._usual = camera.model
        self._rng = np.random.default_rng()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """A new episode with the drawn option, or with the one in `options`."""
        if seed is not None:
            self._rng = generator(seed, f"randomized {self.option}")
        drawn = self._draw(self._rng)
        return self.env.reset(seed=seed, options={self.option: drawn, **(options or {})})

    def _draw(self, rng: np.random.Generator) -> Any:
        raise NotImplementedError


class RandomizeSensor(_Randomize, gymnasium.utils.RecordConstructorArgs):
    """In every episode the environment's model with other parameters, each drawn evenly from its range.

    An effect that the model does not have is added, its other parameters as they are by default.

    Args:
        env: a spike camera's.
        ranges: see `Ranges`.

    Raises:
        InputError: for an unknown effect or parameter, one that is no number, and a range outside its bounds.

    Example:
        >>> from spikecam_env.envs.rotating_disk import RotatingDiskEnv
        >>> env = RandomizeSensor(RotatingDiskEnv(shape=(16, 24)), {"dead_time.tau_us": (0.1, 2.0)})
        >>> spikes, info = env.reset(seed=0)
        >>> [effect.name for effect in env.unwrapped.sensor.model.effects if effect not in env.unwrapped.model.effects]
        ['dead_time']
    """

    option = "model"

    def __init__(self, env: gymnasium.Env, ranges: Ranges) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self, ranges=ranges)
        super().__init__(env)
        self._ranges = {name: checked_range(name, limits) for name, limits in ranges.items()}
        for end in (0, 1):  # both ends of all ranges must make a model
            with_parameters(self._usual, {name: limits[end] for name, limits in self._ranges.items()})

    def _draw(self, rng: np.random.Generator) -> SensorModel:
        return with_parameters(self._usual, {name: rng.uniform(*limits) for name, limits in self._ranges.items()})


class RandomizeLight(_Randomize, gymnasium.utils.RecordConstructorArgs):
    """In every episode the scene's light times a factor, whose logarithm is drawn evenly.

    Args:
        env: a spike camera's.
        limits: lowest and highest factor, above 0.

    Raises:
        InputError: for other limits.

    Example:
        >>> from spikecam_env.envs.rotating_disk import RotatingDiskEnv
        >>> env = RandomizeLight(RotatingDiskEnv(shape=(16, 24)), limits=(0.1, 1.0))
        >>> bright, dim = (int(env.reset(seed=seed)[0].sum()) for seed in (0, 1))  # spikes of the first frames
        >>> bright > 2 * dim
        True
    """

    option = "light"

    def __init__(self, env: gymnasium.Env, limits: tuple[float, float]) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self, limits=limits)
        super().__init__(env)
        self._limits = checked_range("light", limits)
        for end in self._limits:
            checked_number(end, "light", 0.0, MOST_LIGHT, above=True)

    def _draw(self, rng: np.random.Generator) -> float:
        return float(np.exp(rng.uniform(*np.log(self._limits))))


def with_parameters(model: SensorModel, values: Mapping[str, float]) -> SensorModel:
    """The model with these parameters of its effects, `effect.parameter`; whole numbers are rounded."""
    effects = {effect.name: effect for effect in model.effects}
    for place, value in values.items():
        name, _, parameter = place.partition(".")
        if name not in CATALOGUE:
            raise unknown_name("effect", name, CATALOGUE)
        effect = effects.get(name) or CATALOGUE[name]()
        current = effect.parameters()
        if parameter not in current:
            raise unknown_name(f"parameter of {name}", parameter, current)
        now = current[parameter]
        if isinstance(now, (bool, str)):
            raise InputError(f"{place} is {now!r}; only numbers have ranges")
        changed = round(value) if isinstance(now, int) else value
        effects[name] = dataclasses.replace(effect, **{parameter: changed})
    return dataclasses.replace(model, effects=tuple(effects.values()))


def checked_range(name: str, limits: Any) -> tuple[float, float]:
    """(low, high) of a range.

    Raises:
        InputError: unless they are two finite numbers in this order.
    """
    try:
        low, high = limits
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} = {shown(limits)}; a range is two numbers, (lowest, highest)") from error
    return checked_number(low, name), checked_number(high, name, low)
