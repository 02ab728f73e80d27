"""Checks of an effect's class: is all declared?  A user's own passes them before it joins the catalogue."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields
from typing import Any

from spikecam_env.errors import InputError, shown, unknown_name
from spikecam_env.sensor.effect_sheet import Sheet
from spikecam_env.sensor.effects.base import Effect, Stage
from spikecam_env.sensor.effects.identification import Identification, Needs, Response
from spikecam_env.sensor.own_hooks import CHECKS

NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
COUNTED = ("pixels", "spikes", "frames")
"""Countable things of which a parameter can be a share."""

PARTNERS = {"sway": "parts", "parts": "sway", "kinks": "sway"}
"""Hook -> the hook without which it is never called, or changes nothing."""
IDLE = ("begin", "parts", "kinks", "off_the_line", "feedback")
"""Hooks that change nothing by themselves."""


def check_declaration(effect: type[Effect]) -> None:
    """Raise InputError for the first fault of an effect's class, with its remedy."""
    _check_class(effect)
    known = {f.name: f for f in fields(effect)}
    for field in known.values():
        _check_parameter(effect, field)
    if getattr(effect, "strength", None) not in known:
        raise unknown_name(f"strength of {effect.name}", getattr(effect, "strength", None), known)
    if isinstance(known[effect.strength].default, bool):
        raise _wrong(effect, f"its strength {effect.strength} is a switch; a strength is a number")
    _check_hooks(effect)
    Sheet.of(effect)
    _made(effect, {})
    _made(effect, {effect.strength: effect.neutral})
    _check_identification(effect, known)


def _check_class(effect: type[Effect]) -> None:
    if not NAME.fullmatch(effect.name):
        raise _wrong(effect, f"its class {effect.__name__} has no plain name; write it as ThresholdSag")
    parameters = vars(effect).get("__dataclass_params__")
    if parameters is None or not parameters.frozen:
        raise _wrong(effect, "it is no frozen dataclass; write @dataclass(frozen=True) above the class")
    if not isinstance(getattr(effect, "stage", None), Stage):
        raise _wrong(effect, f"it has no stage; write stage = Stage.X, one of {', '.join(s.name for s in Stage)}")


def _check_hooks(effect: type[Effect]) -> None:
    for hook, partner in PARTNERS.items():
        if effect.overrides(hook) and not effect.overrides(partner):
            raise _wrong(effect, f"its hook {hook} does nothing without {partner}; write {partner} too")
    acting = [hook for hook in CHECKS if hook not in IDLE]
    if not any(effect.overrides(hook) for hook in acting):
        raise _wrong(effect, f"it has no hook, so that it does nothing; write one of {', '.join(acting)}")


def _check_parameter(effect: type[Effect], field: Field[Any]) -> None:
    if not {"unit", "bounds", "doc"} <= set(field.metadata):
        raise _wrong(effect, f"{field.name} has no unit and bounds; declare it by parameter(...)")
    if field.default is MISSING:
        raise _wrong(effect, f"{field.name} has no default; a parameter's default is one that shows")
    if not (field.metadata["bounds"] or field.metadata["choices"] or isinstance(field.default, bool)):
        raise _wrong(effect, f"{field.name} has no bounds; give the lowest and the highest value")


def _check_identification(effect: type[Effect], known: Mapping[str, Field[Any]]) -> None:
    declared = effect.identification
    if not isinstance(declared, Identification) or not isinstance(declared.needs, Needs):
        raise _wrong(effect, "its identification is none; write identification = Identification(needs=Needs.STEADY)")
    if not isinstance(declared.response, Response):
        kinds = ", ".join(kind.name for kind in Response)
        raise _wrong(effect, f"its response is none; write response=Response.X, one of {kinds}")
    for name in (*declared.fitted, *declared.shapes, *((declared.share or ())[:1])):
        if name not in known:
            raise unknown_name(f"parameter of {effect.name} in its identification", name, known)
    if declared.fitted and declared.fitted[0] != effect.strength:
        raise _wrong(effect, f"fitted begins with {declared.fitted[0]}; the strength, {effect.strength}, comes first")
    if declared.share and declared.share[1] not in COUNTED:
        raise unknown_name(f"kind of share of {effect.name}", declared.share[1], COUNTED)
    if not math.isfinite(declared.shape_step) or declared.shape_step == 0:
        raise _wrong(effect, f"shape_step = {shown(declared.shape_step)}; it is a step, -0.5 as a rule")
    for name in declared.start_with:
        if name not in declared.acts_through:
            raise _wrong(effect, f"start_with names {name}, which is not in acts_through")
    for name, values in declared.shapes.items():
        if not values:
            raise _wrong(effect, f"shapes of {name} are empty; give values to start from")
        for value in values:
            _made(effect, {name: value})


def _made(effect: type[Effect], values: Mapping[str, Any]) -> None:
    try:
        effect(**values)
    except InputError:
        raise
    except Exception as error:
        raise _wrong(effect, f"it cannot be made with {shown(dict(values))}: {error}") from error


def _wrong(effect: type[Effect], what: str) -> InputError:
    return InputError(f"effect {effect.name}: {what}")
