"""An effect of one's own to begin with: the two files of this folder, under another name.

They are an effect and a test like any other, checked with the rest of the package; nothing imports them.
"""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from spikecam_env.errors import InputError, shown
from spikecam_env.names import file_name
from spikecam_env.sensor.declaration import NAME
from spikecam_env.sensor.effects import CATALOGUE, base
from spikecam_env.whole import whole_folder, write_text_whole

TEMPLATE = "new_effect"
"""Name of the effect of this folder, in files, class and text."""


def check_new_name(name: str) -> None:
    """Raise InputError for a name that is no effect's, is in the catalogue, or would make a class of another name."""
    file_name(name, "effect name")
    if not NAME.fullmatch(name):
        raise InputError(f"effect name {shown(name)}: give lower-case words with underscores between, as threshold_sag")
    if name in CATALOGUE:
        raise InputError(f"there is an effect {name} already; `spikecam effects show {name}` explains it")
    named = base.effect_name(class_name(name))
    if named != name:
        raise InputError(f"effect name {shown(name)}: a class {class_name(name)} is called {named}; give that name")
    if hasattr(base, class_name(name)):
        raise InputError(f"effect name {shown(name)}: effects use {class_name(name)} for something else; give another")


def write_new_effect(name: str, folder: Path, *, force: bool = False) -> tuple[Path, Path]:
    """Write NAME.py and test_NAME.py into a folder, made if needed: both or neither.

    Args:
        name: of the effect.
        folder: for the files.
        force: replace files of these names.

    Returns:
        Paths of the effect and of its test.

    Raises:
        InputError: as `check_new_name` does, and for files that exist or cannot be written.
    """
    check_new_name(name)
    effect, test = folder / f"{name}.py", folder / f"test_{name}.py"
    with whole_folder(folder, replace=True) as beside:
        for path in (effect, test):
            if path.exists() and not force:
                raise InputError(f"{path} is there already; give another name, or --force to replace it")
        write_text_whole(beside / effect.name, _renamed(f"{TEMPLATE}.py", name))
        write_text_whole(beside / test.name, _renamed(f"test_{TEMPLATE}.py", name))
    return effect, test


def class_name(name: str) -> str:
    """Name of an effect's class: ThresholdSag for threshold_sag."""
    return "".join(word.capitalize() for word in name.split("_"))


def _renamed(file: str, name: str) -> str:
    text = (resources.files(__package__) / file).read_text(encoding="utf-8")
    return text.replace(class_name(TEMPLATE), class_name(name)).replace(TEMPLATE, name)
