"""Options of the form NAME:parameter=value,parameter=value, read by the fields of the class of that name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, Field, fields
from typing import Any

from spikecam_env.errors import InputError, shown, unknown_name


def named(text: str, catalogue: Mapping[str, type[Any]], kind: str) -> Any:
    """An instance of a dataclass of a catalogue, made from text.

    Args:
        text: name and parameters; the others have their defaults.
        catalogue: class by name.
        kind: of the classes, for messages.

    Raises:
        InputError: an unknown name or parameter, a value of another type, or one that is missing or given twice.

    Example:
        >>> from spikecam_env.sensor import CATALOGUE
        >>> named("dead_time:tau_us=0.2", CATALOGUE, "effect")
        DeadTime(tau_us=0.2)
    """
    name, _, rest = text.partition(":")
    if name not in catalogue:
        raise unknown_name(kind, name, catalogue)
    known = {f.name: f for f in fields(catalogue[name])}
    values: dict[str, Any] = {}
    for part in filter(None, rest.split(",")):
        key, equals, value = (word.strip() for word in part.partition("="))
        if key not in known:
            raise unknown_name(f"parameter of {name}", key, known)
        if key in values:
            raise InputError(f"{kind} {shown(text)}: {key} is given more than once; give it once")
        if not equals:
            raise InputError(f"{kind} {shown(text)}: {key} has no value; write {name}:{key}=...")
        values[key] = _value(value, known[key], f"{name}.{key}")
    for f in known.values():
        if f.name not in values and f.default is MISSING and f.default_factory is MISSING:
            raise InputError(f"{kind} {shown(text)} needs {f.name}; write {name}:{f.name}=...")
    return catalogue[name](**values)


def _value(text: str, f: Field[Any], what: str) -> Any:
    """A value of the field's declared type."""
    declared = f.type if isinstance(f.type, str) else f.type.__name__
    if "bool" in declared:
        if text.lower() not in ("true", "false"):
            raise InputError(f"{what} = {shown(text)}; it must be true or false")
        return text.lower() == "true"
    for python_type, words in ((float, "a number"), (int, "a whole number")):
        if python_type.__name__ in declared:
            try:
                return python_type(text)
            except ValueError as error:
                raise InputError(f"{what} = {shown(text)}; it must be {words}") from error
    return text
