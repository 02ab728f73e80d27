"""An effect file to be varied: a share of the light is lost."""

from __future__ import annotations

from pathlib import Path

TEXT = '''"""Grey filter: a share of the light is lost.

    x <- x (1 - loss)

Stage: optics.  Seen in: flats.  Twins: vignetting.  Source: made up.
"""

from __future__ import annotations

from dataclasses import dataclass

from spikecam_env.sensor.effects.base import Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs


@dataclass(frozen=True)
class GreyFilter(Effect):
    loss: float = parameter(0.05, unit="relative", bounds=(0.0, 1.0), doc="share that is lost")

    stage = Stage.OPTICS
    strength = "loss"
    identification = Identification(needs=Needs.STEADY)

    def collect(self, light, dark, now, memory):
        return light.scaled(1.0 - self.loss), dark, memory
'''


def written(path: Path, *changes: tuple[str, str]) -> Path:
    """The file, with parts of its text replaced."""
    text = TEXT
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return path
