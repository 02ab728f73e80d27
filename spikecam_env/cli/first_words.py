"""Names of commands and options on a command line, before its values are read: a wrong one suggests the right one.

tyro's own errors are boxes of many lines; those of this command are one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import tyro

from spikecam_env.checked import each_once
from spikecam_env.errors import InputError, shown

START = """spikecam: a spike camera that you can step, record and denoise.

Three commands to begin with:
  spikecam demo --quick                         a fast disk, noisy and denoised, as a picture
  spikecam record --frames 4000 --out disk.h5   a tenth of a second of that disk as a recording
  spikecam denoise disk.h5 --out denoised       the recording denoised: spikes, pictures, a film

`spikecam --help` lists all commands, `spikecam record --help` the options of one."""
"""Printed for `spikecam` alone."""

ALWAYS = ("help",)
"""Options of every command."""
OF_THE_PARSER = "tyro-"
"""Prefix of the options that the parser adds, such as --tyro-print-completion."""
APPENDS = get_args(tyro.conf.UseAppendAction[str])[1]
"""Marks options that may be repeated."""


def check_words(args: Sequence[str], commands: Mapping[str, type]) -> set[str]:
    """Check names of commands and options.

    Args:
        args: the command line, without the program's name.
        commands: the class of options of each command, which may hold commands of its own.

    Returns:
        The options that are given, as they are written after the two dashes; of a switch its name without `no-`.

    Raises:
        InputError: a word is no command, the command does not have an option, or one is given twice and may not be.
    """
    said, choices, options = "spikecam", dict(commands), dict.fromkeys(ALWAYS, False)
    once: list[str] = []
    given: set[str] = set()
    for word in args:
        if choices and not word.startswith("-"):
            if word not in choices:
                raise _unknown("command", word, f"`{said}`", choices)
            chosen = choices[word]
            said, choices = f"{said} {word}", commands_of(chosen)
            options = {**dict.fromkeys(ALWAYS, False), **options_of(chosen)}
        elif word.startswith("--") and not choices:
            name = word[2:].partition("=")[0].replace("_", "-")
            if name and name not in options and not name.startswith(OF_THE_PARSER):
                raise _unknown("option", name, f"`{said}`", options)
            bare = name.removeprefix("no-")
            switch = bare if {bare, f"no-{bare}"} <= set(options) else name
            given.add(switch)
            if not options.get(switch):
                once.append(f"--{switch}")
    each_once(once, f"`{said}`")
    return given


def _unknown(kind: str, name: str, of: str, allowed: Iterable[str]) -> InputError:
    nearest = get_close_matches(name, sorted(allowed), n=1)
    dashes = "--" if kind == "option" else ""
    if nearest:
        hint = f"did you mean {dashes}{nearest[0]}? "
    else:
        hint = "" if dashes else f"choose one of {', '.join(sorted(allowed))}; "
    place = f" of {of}" if dashes else ""
    return InputError(f"unknown {kind} {shown(dashes + name)}{place}; {hint}{of[:-1]} --help` lists them")


def commands_of(options: type) -> dict[str, type]:
    """Commands below a command, by their names; none of most."""
    commands: dict[str, type] = {}
    for hint in get_type_hints(options, include_extras=True).values():
        for part in get_args(hint):
            if get_origin(part) is Annotated and is_dataclass(get_args(part)[0]):
                kind, *marks = get_args(part)
                commands |= {mark.name: kind for mark in marks if getattr(mark, "name", None)}
    return commands


def options_of(options: Any) -> dict[str, bool]:
    """A command's options, as they are written after the two dashes: whether each may be repeated."""
    hints = get_type_hints(options, include_extras=True)
    names: dict[str, bool] = {}
    for field in fields(options):
        hint, name = hints[field.name], field.name.replace("_", "-")
        if is_dataclass(hint):
            names |= options_of(hint)
        elif tyro.conf.Positional not in get_args(hint):
            names[name] = APPENDS in get_args(hint)
            if hint is bool:
                names[f"no-{name}"] = False
    return names
