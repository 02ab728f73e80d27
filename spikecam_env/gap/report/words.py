"""The catalogue in plain words: names, units and meanings of effects and their parameters."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
from collections.abc import Sequence
from typing import NamedTuple

from spikecam_env.errors import InputError
from spikecam_env.gap import statistics
from spikecam_env.sensor import CATALOGUE
from spikecam_env.sensor.effect_sheet import Sheet


def human(name: str) -> str:
    """A name of the catalogue in plain words."""
    return "IR drop" if name == "ir_drop" else name.replace("_", " ")


def bare(effect: str, parameter: str) -> str:
    """A parameter's name in plain words, without its unit."""
    unit = parameter_unit(effect, parameter)
    ending = f"_{unit.lower()}"
    return human(parameter[: -len(ending)] if unit and parameter.lower().endswith(ending) else parameter)


def parameter_unit(effect: str, parameter: str) -> str:
    """Unit of an effect's parameter; empty where the catalogue has none of that name."""
    for field in dataclasses.fields(CATALOGUE[effect]) if effect in CATALOGUE else ():
        if field.name == parameter:
            return str(field.metadata["unit"])
    return ""


def meaning_of(effect: str, parameter: str) -> str:
    """The meaning of a parameter, in the catalogue's words."""
    for field in dataclasses.fields(CATALOGUE[effect]) if effect in CATALOGUE else ():
        if field.name == parameter:
            return str(field.metadata["doc"])
    return ""


class EffectInWords(NamedTuple):
    """An effect as the catalogue describes it; of an effect that it does not hold, the name."""

    title: str
    said: str = ""
    law: str = ""
    seen_in: str = ""


def described(effect: str) -> EffectInWords:
    """The catalogue's words on an effect."""
    try:
        sheet = Sheet.of(CATALOGUE[effect])
    except (KeyError, InputError):
        return EffectInWords(human(effect).capitalize())
    title, _, said = sheet.summary.partition(": ")
    law = inspect.cleandoc(sheet.law)
    return EffectInWords(title, said[:1].upper() + said[1:], law, sheet.sections.get("Seen in", ""))


def group_meaning(group: str) -> str:
    """The subject of a group of statistics, as its file says; empty where the bank has none of this name."""
    try:
        module = importlib.import_module(f"{statistics.__name__}.{group}")
    except ModuleNotFoundError:
        return ""
    opening = (inspect.getdoc(module) or "").partition("\n\n")[0]
    return " ".join(opening.partition("Reveals ")[0].split())


def listed(names: Sequence[str], last: str) -> str:
    """Names in a row, the last one after "and" or "or"."""
    return f" {last} ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))
