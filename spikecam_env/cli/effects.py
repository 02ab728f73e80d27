"""`spikecam effects`: the catalogue of effects, from their own declarations, and files for a new one."""

from __future__ import annotations

from dataclasses import Field, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from spikecam_env.cli.effect_files import EffectFiles

if TYPE_CHECKING:
    from spikecam_env.sensor import Effect


@dataclass
class List:
    """A line an effect, in physical order, written as --effect takes it.

    example:  spikecam effects list --effect-file threshold_sag.py
    """

    effect_file: EffectFiles = ()
    """A Python file of your own effects.  The file is run: give only files that you trust.  May be repeated."""

    def run(self) -> None:
        from spikecam_env.cli.table import table
        from spikecam_env.sensor import CATALOGUE

        print(table([_line(effect) for effect in CATALOGUE.values()]))


@dataclass
class Show:
    """All about one effect: its law, parameters, where it is seen, its twins, its source.

    example:  spikecam effects show dead_time
    """

    name: tyro.conf.Positional[str]
    """Effect to explain."""
    effect_file: EffectFiles = ()
    """A Python file of your own effects.  The file is run: give only files that you trust.  May be repeated."""

    def run(self) -> None:
        from spikecam_env.cli.table import table
        from spikecam_env.errors import unknown_name
        from spikecam_env.sensor import CATALOGUE
        from spikecam_env.sensor.effect_sheet import Sheet

        if self.name not in CATALOGUE:
            raise unknown_name("effect", self.name, CATALOGUE)
        effect = CATALOGUE[self.name]
        sheet = Sheet.of(effect)
        print(f"{effect.name}: {sheet.summary}\n\n{sheet.law}\n")
        print(table([_parameter(f, effect) for f in fields(effect)]))
        for title, text in sheet.sections.items():
            print(f"\n{title}: {text}")


@dataclass
class New:
    """Write an effect of your own to begin with, NAME.py, and its test, test_NAME.py; both run as they stand.

    example:  spikecam effects new threshold_sag
    """

    name: tyro.conf.Positional[str]
    """Name of the effect: lower-case words joined by underscores, not a name of the catalogue."""
    out: Path = Path()
    """Folder for the two files; it is made if it does not exist."""
    force: bool = False
    """Overwrite files of these names."""

    def run(self) -> None:
        from spikecam_env.sensor.beginning import write_new_effect

        effect, test = write_new_effect(self.name, self.out, force=self.force)
        print(f"wrote {effect} and {test}")
        print(f"test it: python -m pytest {test}   use it: spikecam record --effect-file {effect} --effect {self.name}")


@dataclass
class Effects:
    """The sensor's effects: list them, explain one, or begin one of your own.

    example:  spikecam effects show dead_time
    """

    action: (
        Annotated[List, tyro.conf.subcommand("list", prefix_name=False)]
        | Annotated[Show, tyro.conf.subcommand("show", prefix_name=False)]
        | Annotated[New, tyro.conf.subcommand("new", prefix_name=False)]
    ) = field(default_factory=List)

    def run(self) -> None:
        self.action.run()


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
