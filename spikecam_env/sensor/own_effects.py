"""Effects of a user's own: out of one file, or of an installed package.

    load_effects("threshold_sag.py")                  its effects join the catalogue, and are returned
    with effects_from("threshold_sag.py"): ...        the same, within the block alone
    load_installed_effects()                          those that packages offer, entry point group `spikecam.effects`

Such a file is a program, and loading it runs it: load your own, or one that you would run.  A model file names effects
and never loads any.  In the catalogue they are like all others: options, parts of models, candidates of a diagnosis.
A model of them can be sent to other processes: it is pickled with the file's path, and refused where that file has
changed.
"""

from __future__ import annotations

import copyreg
import hashlib
import importlib
import inspect
import os
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Any

from spikecam_env.errors import InputError
from spikecam_env.own_code import in_a_line, line_in, own_code
from spikecam_env.sensor.declaration import check_declaration
from spikecam_env.sensor.effects import CATALOGUE, Effect
from spikecam_env.sensor.own_hooks import guard
from spikecam_env.untrusted import read_text

GROUP = "spikecam.effects"
"""Entry points of packages: each an effect's class, or a module of such."""

_MODULES = "spikecam_effect_file_"
"""Modules of effect files begin with it, followed by a digest of path and text: an edited file is another module."""


def load_effects(path: str | os.PathLike[str]) -> tuple[type[Effect], ...]:
    """Run an effect file and register its effects in CATALOGUE.

    Loading a file again changes nothing; loading it after it was edited replaces its effects.

    Raises:
        InputError: for a file that cannot be read, fails when it is run (with the line), or has no effect; and for an
            effect that is declared wrongly (`check_declaration`) or has the name of one of another file.

    Example:
        >>> from spikecam_env.sensor import beginning
        >>> path = beginning.__path__[0] + "/new_effect.py"
        >>> with effects_from():  # CATALOGUE is as before after the block
        ...     [effect.name for effect in load_effects(path)]
        ['new_effect']
    """
    source = Path(os.path.abspath(path))
    module = _module_of(source, read_text(Path(path)))
    found = tuple(_effects_in(module))
    if not found:
        raise InputError(
            f"{path} has no effect; it must define a class of Effect (spikecam effects new NAME writes one)"
        )
    for effect in found:
        try:
            register(effect)
        except InputError as error:
            raise InputError(f"{path}: {error}") from error
    return found


@contextmanager
def effects_from(*paths: str | os.PathLike[str]) -> Iterator[tuple[type[Effect], ...]]:
    """The effects of these files in CATALOGUE within the block, and not after it.

    Example:
        >>> from spikecam_env.sensor import beginning
        >>> path = beginning.__path__[0] + "/new_effect.py"
        >>> with effects_from(path):
        ...     "new_effect" in CATALOGUE
        True
        >>> "new_effect" in CATALOGUE
        False
    """
    before = dict(CATALOGUE)
    try:
        yield tuple(effect for path in paths for effect in load_effects(path))
    finally:
        _set_catalogue(before)


def load_installed_effects() -> tuple[type[Effect], ...]:
    """Register the effects that installed packages offer; one that fails is left out with a warning.

    Example:
        >>> load_installed_effects()  # no installed package offers effects
        ()
    """
    loaded: list[type[Effect]] = []
    for entry in metadata.entry_points(group=GROUP):
        try:
            found = entry.load()
            effects = tuple(_effects_in(found)) if isinstance(found, ModuleType) else (found,)
            for effect in effects:
                register(effect)
        except Exception as error:
            warnings.warn(f"effects of {entry.name} = {entry.value} are left out: {in_a_line(error)}", stacklevel=2)
        else:
            loaded += effects
    return tuple(loaded)


def register(effect: type[Effect]) -> None:
    """Add an effect to CATALOGUE, in its physical order.

    Raises:
        InputError: for a class of another kind, or one declared wrongly or with the name of an effect from elsewhere.
    """
    if not (isinstance(effect, type) and issubclass(effect, Effect) and effect is not Effect):
        raise InputError(f"{effect!r} is no class of Effect")
    known = CATALOGUE.get(effect.name, effect)
    if known is not effect and (file_of(known) is None or file_of(known) != file_of(effect)):
        raise InputError(f"there is an effect {effect.name} already ({_home(known)}); give the class another name")
    check_declaration(effect)
    guard(effect)  # again: a decorator may have given the class more hooks
    copyreg.pickle(effect, _reduced)
    _set_catalogue({**CATALOGUE, effect.name: effect})


def file_of(effect: type[Effect]) -> Path | None:
    """The effect file that a class was loaded from, absolute; None for the package's own and those of packages."""
    return Path(str(sys.modules[effect.__module__].__file__)) if effect.__module__.startswith(_MODULES) else None


def files_of(names: Iterable[str]) -> tuple[str, ...]:
    """Effect files that have to be given for effects of these names, each once: relative where they lie below here."""
    found = dict.fromkeys(filter(None, (file_of(CATALOGUE[name]) for name in names if name in CATALOGUE)))
    here = Path.cwd()
    return tuple(str(path.relative_to(here) if path.is_relative_to(here) else path) for path in found)


def source_of(effect: type[Effect]) -> str:
    """The text of the file that defines an effect, as it was when it was loaded."""
    module = sys.modules[effect.__module__]
    return str(getattr(module, "__source__", None) or inspect.getsource(module))


def _module_of(source: Path, text: str) -> ModuleType:
    """The file as a module, run once."""
    name = _MODULES + hashlib.sha256(f"{source}\0{text}".encode()).hexdigest()[:16]
    if name in sys.modules:
        return sys.modules[name]
    module = ModuleType(name)
    module.__file__, module.__dict__["__source__"] = str(source), text
    sys.modules[name] = module  # dataclasses look their module up while it is run
    try:
        with own_code(lambda: f"{source}{_line_in(source)}"):
            exec(compile(text, str(source), "exec"), module.__dict__)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _effects_in(module: ModuleType) -> Iterator[type[Effect]]:
    for value in vars(module).values():
        if isinstance(value, type) and issubclass(value, Effect) and value.__module__ == module.__name__:
            yield value


def _line_in(source: Path) -> str:
    """Where the exception that is being handled passed an effect file."""
    error = sys.exc_info()[1]
    line = None if error is None else line_in(str(source), error)
    return f", line {line}" if line else ""


def _home(effect: type[Effect]) -> str:
    return str(file_of(effect) or effect.__module__)


def _set_catalogue(effects: dict[str, type[Effect]]) -> None:
    """In place, since everything reads this very dictionary."""
    CATALOGUE.clear()
    CATALOGUE.update(sorted(effects.items(), key=lambda item: (item[1].stage, item[0])))


def _reduced(effect: Effect) -> tuple[Callable[..., Effect], tuple[Any, ...]]:
    """How an effect of a user's own is pickled: by the file or module of its class."""
    cls = type(effect)
    file = file_of(cls)
    return _revived, (file and str(file), cls.__module__, cls.name, effect.parameters())


def _revived(file: str | None, module: str, name: str, parameters: dict[str, Any]) -> Effect:
    if file is not None and module not in sys.modules:
        load_effects(file)
        if module not in sys.modules:
            raise InputError(f"{file} has changed since {name} was saved; load it again and make the model anew")
    [cls] = [effect for effect in _effects_in(importlib.import_module(module)) if effect.name == name]
    if name not in CATALOGUE:
        register(cls)
    return cls(**parameters)
