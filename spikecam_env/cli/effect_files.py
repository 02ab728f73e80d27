"""The option `--effect-file`: effects of a user's own, in the catalogue for as long as a command runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

EffectFiles = Annotated[tyro.conf.UseAppendAction[tuple[Path, ...]], tyro.conf.arg(metavar="FILE")]
"""Of an option that must be named `effect_file`."""


@contextmanager
def effects_of(command: Any) -> Iterator[None]:
    """Within, the effects of a command's `effect_file` options and those of installed packages are in the catalogue.

    A command without that option takes none, and imports nothing for it.
    """
    files = list(_effect_files(command))
    if not files:
        yield
        return
    from spikecam_env.sensor import effects_from, load_installed_effects

    with effects_from():
        load_installed_effects()
        with effects_from(*(path for option in files for path in option)):
            yield


def _effect_files(command: Any) -> Iterator[tuple[Path, ...]]:
    """Its options of that name, and those of the options in it."""
    for field in fields(command):
        value = getattr(command, field.name)
        if field.name == "effect_file":
            yield value
        elif is_dataclass(value):
            yield from _effect_files(value)
