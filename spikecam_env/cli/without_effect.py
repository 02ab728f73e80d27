"""Options that have no effect beside others: each command declares its own, and a line that types one is refused.

without_effect: ClassVar = (WithoutEffect(("rpm",), is_no_disk, "the scene {scene} has a speed of its own"),)
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

from spikecam_env.cli.first_words import options_of
from spikecam_env.errors import InputError


@dataclass(frozen=True)
class WithoutEffect:
    """Options of a command that change nothing where a condition holds.

    Example:
        >>> rule = WithoutEffect(("frames", "every"), lambda command: command.film is None, "there is no --film")
    """

    options: tuple[str, ...]
    """Fields of the command and of its groups of options; a group stands for all in it."""
    where: Callable[[Any], bool]
    """The condition, of a command."""
    why: str
    """Fields of the command stand in it in braces."""


def refuse_without_effect(command: Any, given: Collection[str]) -> None:
    """Refuse options that were typed and change nothing.

    Args:
        command: with its options; commands and groups of options in it are looked at too.
        given: options that were typed, as they are written after the two dashes.

    Raises:
        InputError: the first of them.
    """
    for part in _parts(command):
        for rule in rules_of(part):
            typed = [name for name in names_of(rule, part) if name in given]
            if typed and rule.where(part):
                raise InputError(f"--{typed[0]} has no effect: {rule.why.format(**vars(part))}; leave it out")


def rules_of(command: Any) -> tuple[WithoutEffect, ...]:
    """The rules that a command declares, those of its groups of options apart."""
    rules: tuple[WithoutEffect, ...] = getattr(command, "without_effect", ())
    return rules


def names_of(rule: WithoutEffect, command: Any) -> Iterator[str]:
    """The options of a rule, as they are written after the two dashes."""
    for option in rule.options:
        value = getattr(command, option, None)  # None: an option of a group
        yield from options_of(type(value)) if is_dataclass(value) else (option.replace("_", "-"),)


def _parts(command: Any) -> Iterator[Any]:
    yield command
    for field in fields(command):
        if is_dataclass(value := getattr(command, field.name)):
            yield from _parts(value)
