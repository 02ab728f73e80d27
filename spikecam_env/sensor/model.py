"""A sensor model: a nominal circuit and an ordered list of named effects.  It reads and writes as TOML."""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, fields, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from pydantic import ConfigDict, Field

from spikecam_env.errors import InputError, shown, unknown_name
from spikecam_env.sensor.effects import CATALOGUE, Effect
from spikecam_env.sensor.effects.base import build, check_parts
from spikecam_env.sensor.own_effects import files_of
from spikecam_env.sensor.ranges import check_parameters, parameter
from spikecam_env.sensor.unit import Circuit, PixelArray, Unit, firing_law
from spikecam_env.untrusted import Declared, Name, Positive, checked_format, declared, parse_toml, read_toml
from spikecam_env.whole import write_text_whole

FORMAT = "spikecam-model/1"
PRESETS = ("ideal", "measured", "physical", "scsim")


FRAME_RATES_HZ = (1.0, 1e6)
"""Lowest and highest frame rate of a camera [Hz]."""

_CIRCUIT = {f.name for f in fields(Circuit)}


class _EffectEntry(Declared):
    """An [[effect]] of a model file: its name, and parameters that the effect itself declares."""

    model_config = ConfigDict(extra="allow")

    name: Name


class _ModelFile(Declared):
    format: str
    name: Name = "unnamed"
    frame_rate_hz: Positive
    circuit: dict[str, float] = Field(default_factory=dict)
    effect: list[_EffectEntry] = Field(default_factory=list)


@dataclass(frozen=True)
class SensorModel:
    """A kind of camera: circuit, frame rate and effects, in physical order whatever order they are given in.

    Raises:
        InputError: for a frame rate outside its range, an effect listed twice, a reference that moves too fast within a
            frame, and effects that together leave no sensor: spreads or noise as large as the swing, for example.

    Example:
        >>> SensorModel.preset("scsim").without("shot_noise").effects[0].name
        'conversion_gain_spread'
    """

    name: str
    circuit: Circuit
    frame_rate_hz: float = parameter(unit="Hz (40000 for a Vidar)", bounds=FRAME_RATES_HZ, doc="frames a second")
    effects: tuple[Effect, ...] = ()

    def __post_init__(self) -> None:
        check_parameters(self, "")
        if not isinstance(self.name, str):
            raise InputError(f"name = {shown(self.name)}; it must be text")
        if not isinstance(self.circuit, Circuit):
            raise InputError(f"circuit = {shown(self.circuit)}; it must be a Circuit")
        object.__setattr__(self, "effects", _in_physical_order(self.effects))
        check_parts(self.effects, self.frame_rate_hz)
        alike = np.random.default_rng(0)
        self._pixels((1, 1), lambda _: alike).check()

    @classmethod
    def preset(cls, name: str = "scsim", *, script: bool = False) -> SensorModel:
        """A shipped model: one of PRESETS; `script=True` gives SCSim's public script to the letter."""
        if name not in PRESETS:
            raise unknown_name("preset", name, PRESETS)
        if script and name != "scsim":
            raise InputError(f"script=True belongs to the preset 'scsim', not to {name!r}")
        file = "scsim-script" if script else name
        text = (resources.files("spikecam_env.sensor") / "presets" / f"{file}.toml").read_text(encoding="utf-8")
        return cls._from_data(parse_toml(text, f"preset {file}"), where=f"preset {file}")

    @classmethod
    def from_toml(cls, path: str | os.PathLike[str]) -> SensorModel:
        """Read a model file; effects of a user's own must be loaded before (`load_effects`).

        Raises:
            InputError: for a missing file, broken TOML, unknown effect or parameter.
        """
        try:
            data = read_toml(os.fspath(path))
        except InputError as error:
            raise InputError(f"cannot read model file {path}: {error}") from error
        return cls._from_data(data, where=str(path))

    @classmethod
    def load(cls, name_or_path: str | os.PathLike[str]) -> SensorModel:
        """A preset by its name, or a model file by its path (anything that ends in .toml)."""
        if str(name_or_path).endswith(".toml"):
            return cls.from_toml(name_or_path)
        return cls.preset(str(name_or_path))

    @classmethod
    def _from_data(cls, data: dict[str, Any], where: str) -> SensorModel:
        file = declared(_ModelFile, checked_format(data, FORMAT, where), where)
        for key in file.circuit:
            if key not in _CIRCUIT:
                raise unknown_name(f"circuit entry of {where}", key, _CIRCUIT)
        for entry in file.effect:
            if entry.name not in CATALOGUE:
                unknown = unknown_name("effect", entry.name, CATALOGUE)
                raise InputError(
                    f"{where}: {unknown}; if it is of your own, give its file (--effect-file, load_effects)"
                )
        try:
            effects = tuple(build(CATALOGUE, entry.name, entry.model_extra or {}) for entry in file.effect)
            return cls(file.name, Circuit(**file.circuit), file.frame_rate_hz, effects)
        except InputError as error:
            raise InputError(f"{where}: {error}") from error

    def to_toml(self, path: str | os.PathLike[str]) -> None:
        """Write the model; the file appears whole and loads back equal."""
        write_text_whole(Path(path), self.toml())

    def toml(self) -> str:
        """The text of the model's file; a comment names the files of a user's own effects."""
        effects = [{"name": e.name, **e.parameters()} for e in self.effects]
        data = {
            "format": FORMAT,
            "name": self.name,
            "frame_rate_hz": self.frame_rate_hz,
            "circuit": asdict(self.circuit),
            "effect": effects,
        }
        own = "".join(f"# needs --effect-file {Path(file).name}\n" for file in files_of(e.name for e in self.effects))
        return own + tomli_w.dumps(data)

    def with_effect(self, effect: Effect) -> SensorModel:
        """This model with an effect added, or replaced where it has one of that name.

        Args:
            effect: an instance of its class, e.g. `DeadTime(tau_us=0.5)`.

        Raises:
            InputError: for anything else, such as a name or a class.
        """
        if not isinstance(effect, Effect):
            raise InputError(f"effect = {shown(effect)}; give an instance of its class, e.g. DeadTime(tau_us=0.5)")
        return replace(self, effects=(*(e for e in self.effects if e.name != effect.name), effect))

    def without(self, name: str) -> SensorModel:
        """This model without one of its effects; InputError when it has none of that name."""
        if name not in {e.name for e in self.effects}:
            raise unknown_name(f"effect of {self.name}", name, [e.name for e in self.effects])
        return replace(self, effects=tuple(e for e in self.effects if e.name != name))

    def difference(self, other: SensorModel) -> str:
        """The first difference from another model, as `value: this, that`; empty where only names differ."""
        ours, theirs = _flat(self), _flat(other)
        for name in ours | theirs:
            if ours.get(name) != theirs.get(name):
                return f"{name}: {ours.get(name, 'none')}, {theirs.get(name, 'none')}"
        return ""

    def noise_free(self) -> SensorModel:
        """The ideal pixel with this circuit and frame rate."""
        return replace(self, name="ideal", effects=())

    def draw_unit(self, shape: tuple[int, int], seed: int) -> Unit:
        """One camera of this model: every effect leaves its fixed pattern, each from a random stream of its own."""
        return firing_law(self._pixels(shape, lambda effect: generator(seed, effect.name))).owned()

    def _pixels(self, shape: tuple[int, int], generator_of: Callable[[Effect], np.random.Generator]) -> PixelArray:
        pixels = PixelArray.nominal(self.circuit, self.frame_rate_hz, shape)
        for effect in self.effects:
            pixels = effect.imprint(pixels, generator_of(effect))
        return pixels


def _flat(model: SensorModel) -> dict[str, Any]:
    """All values of a model by their places."""
    circuit = {f"circuit.{name}": value for name, value in asdict(model.circuit).items()}
    effects = {f"{e.name}.{name}": value for e in model.effects for name, value in e.parameters().items()}
    return {"frame_rate_hz": model.frame_rate_hz, **circuit, **effects}


def _in_physical_order(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """The effects sorted; InputError for one that is not in the catalogue, or is listed twice."""
    listed = list(effects) if isinstance(effects, Iterable) else [effects]
    order = list(CATALOGUE)
    for effect in listed:
        if not isinstance(effect, Effect):
            raise InputError(f"effects hold {shown(effect)}; give instances of CATALOGUE's classes")
        if effect.name not in order:
            raise unknown_name("effect", effect.name, CATALOGUE)
        if sum(other.name == effect.name for other in listed) > 1:
            raise InputError(f"effect {effect.name!r} is listed more than once; list it once")
    return tuple(sorted(listed, key=lambda effect: order.index(effect.name)))


def generator(seed: int, purpose: str, *numbers: int) -> np.random.Generator:
    """A random generator for one purpose of one seed, independent of all others; `numbers`: which one of many."""
    return np.random.default_rng([seed, zlib.crc32(purpose.encode()), *numbers])
