"""`spikecam effects`: the catalogue of effects, from their own declarations."""

from __future__ import annotations

from dataclasses import Field, dataclass, fields
from typing import TYPE_CHECKING, Any

import tyro

if TYPE_CHECKING:
    from spikecam_env.sensor import Effect


@dataclass
class Effects:
    """List the sensor's effects in physical order, or say all about one.

    example:  spikecam effects dead_time
    """

    name: tyro.conf.Positional[str] = ""
    """Effect to explain; without it all are listed."""

    def run(self) -> None:
        from spikecam_env.cli.table import table
        from spikecam_env.errors import unknown_name
        from spikecam_env.sensor import CATALOGUE
        from spikecam_env.sensor.effect_sheet import Sheet

        if not self.name:
            print(table([_line(effect) for effect in CATALOGUE.values()]))
            return
        if self.name not in CATALOGUE:
            raise unknown_name("effect", self.name, CATALOGUE)
        effect = CATALOGUE[self.name]
        sheet = Sheet.of(effect)
        print(f"{effect.name}: {sheet.summary}\n\n{sheet.law}\n")
        print(table([_parameter(f, effect) for f in fields(effect)]))
        for title, text in sheet.sections.items():
            print(f"\n{title}: {text}")


def _line(effect: type[Effect]) -> dict[str, str]:
    return {"effect, with its defaults": _option(effect), "stage": effect.stage.name.lower()}


def _option(effect: type[Effect]) -> str:
    """As `--effect` takes it."""
    values = ",".join(f"{f.name}={_plain(f.default)}" for f in fields(effect))
    return f"{effect.name}:{values}" if values else effect.name


def _parameter(f: Field[Any], effect: type[Effect]) -> dict[str, str]:
    from spikecam_env.sensor.ranges import range_text

    neutral = f" (the strength; {effect.neutral:g} changes nothing)" if f.name == effect.strength else ""
    return {
        "parameter": f.name,
        "default": _plain(f.default),
        "unit": f.metadata["unit"],
        "bounds": range_text(f) or "-",
        "meaning": f.metadata["doc"] + neutral,
    }


def _plain(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value).lower()
