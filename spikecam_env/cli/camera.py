"""Which camera a command simulates: a model, with effects added or taken away."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import tyro

from spikecam_env.checked import each_once
from spikecam_env.cli.effect_files import EffectFiles

if TYPE_CHECKING:
    from spikecam_env.sensor import SensorModel


@dataclass(frozen=True)
class CameraOptions:
    """The camera's model."""

    model: str = "scsim"
    """Sensor model: a preset (ideal, scsim, physical, measured) or a model TOML."""
    effect: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="NAME[:PARAM=VALUE,...]")] = ()
    """Add an effect, or replace the model's own of that name, e.g. dead_time:tau_us=0.2; may be repeated.  `spikecam
    effects` lists them."""
    without: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="NAME")] = ()
    """Remove an effect from the model; may be repeated."""
    effect_file: EffectFiles = ()
    """A Python file of your own effects.  The file is run: give only files that you trust.  May be repeated."""

    frame_rate: float | None = None
    """Frames a second; default: the model's, 40 000 in the presets.  Light is per frame, dark current per second."""

    def load(self) -> SensorModel:
        """The model as asked; raises InputError for an unknown model, effect or parameter."""
        from spikecam_env.cli.named import named
        from spikecam_env.sensor import CATALOGUE, SensorModel

        each_once((text.partition(":")[0] for text in self.effect), "--effect")
        model = SensorModel.load(self.model)
        for name in self.without:
            model = model.without(name)
        for text in self.effect:
            model = model.with_effect(named(text, CATALOGUE, "effect"))
        return model if self.frame_rate is None else replace(model, frame_rate_hz=self.frame_rate)
