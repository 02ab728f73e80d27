"""The catalogue of effects: every module of this folder that defines an `Effect`, one effect a file."""

from __future__ import annotations

import importlib
import pkgutil

from spikecam_env.sensor.effects.base import Effect, Stage

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")

CATALOGUE: dict[str, type[Effect]] = {
    cls.name: cls for cls in sorted(Effect.__subclasses__(), key=lambda c: (c.stage, c.name))
}
"""Effects by name, in physical order."""

__all__ = ["CATALOGUE", "Effect", "Stage"]
