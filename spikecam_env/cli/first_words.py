"""The words of a command line, before its values are read: what to begin with, and what a wrong word may have meant."""

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
"""How the names of options begin that the parser adds, such as --tyro-print-completion."""
APPENDS = get_args(tyro.conf.UseAppendAction[str])[1]
"""Marks options that may be repeated."""


def check_words(args: Sequence[str], commands: Mapping[str, type]) -> None:
    """Raises InputError for the first word that is no command, and for the first option that the command does not have,
    or that is given more than once and may not be.

    args: the command line, without the program's name.  commands: the class of options of each command, which may hold
    commands of its own.
    """
    said, choices, options = "spikecam", dict(commands), set(ALWAYS)
    given: list[str] = []
    repeatable: set[str] = set()
    for word in args:
        if choices and not word.startswith("-"):
            if word not in choices:
                raise _unknown_command(said, word, choices)
            chosen = choices[word]
            said, choices, options = f"{said} {word}", commands_of(chosen), set(ALWAYS).union(options_of(chosen))
            repeatable = repeatable_of(chosen)
        elif word.startswith("--") and not choices:
            name = word[2:].partition("=")[0].replace("_", "-")
            if name and name not in options and not name.startswith(OF_THE_PARSER):
                raise _unknown_option(said, name, options)
            switch = name.removeprefix("no-") if f"no-{name.removeprefix('no-')}" in options else name
            if switch not in repeatable:
                given.append(f"--{switch}")
    each_once(given, f"`{said}`")


def _unknown_command(said: str, word: str, choices: Iterable[str]) -> InputError:
    names = sorted(choices)
    nearest = get_close_matches(word, names, n=1)
    meant = f"did you mean {nearest[0]}?" if nearest else f"choose one of {', '.join(names)};"
    return InputError(f"unknown command {shown(word)}; {meant} `{said} --help` lists them")


def _unknown_option(said: str, name: str, options: Iterable[str]) -> InputError:
    nearest = get_close_matches(name, sorted(options), n=1)
    meant = f"; did you mean --{nearest[0]}?" if nearest else ";"
    return InputError(f"unknown option {shown('--' + name)} of `{said}`{meant} `{said} --help` lists them")


def commands_of(options: type) -> dict[str, type]:
    """Commands below a command, by their names; none of most."""
    found: dict[str, type] = {}
    for hint in get_type_hints(options, include_extras=True).values():
        for part in get_args(hint):
            if get_origin(part) is Annotated and is_dataclass(get_args(part)[0]):
                kind, *marks = get_args(part)
                found |= {mark.name: kind for mark in marks if getattr(mark, "name", None)}
    return found


def repeatable_of(options: Any) -> set[str]:
    """Names of those options of a command that may be given more than once, each time another value."""
    hints = get_type_hints(options, include_extras=True)
    names: set[str] = set()
    for field in fields(options):
        hint = hints[field.name]
        if is_dataclass(hint):
            names |= repeatable_of(hint)
        elif APPENDS in get_args(hint):
            names.add(field.name.replace("_", "-"))
    return names


def options_of(options: Any) -> set[str]:
    """Names of a command's options, as they are written after the two dashes."""
    hints = get_type_hints(options, include_extras=True)
    names: set[str] = set()
    for field in fields(options):
        hint, name = hints[field.name], field.name.replace("_", "-")
        if is_dataclass(hint):
            names |= options_of(hint)
        elif tyro.conf.Positional not in get_args(hint):
            names |= {name, f"no-{name}"} if hint is bool else {name}
    return names
