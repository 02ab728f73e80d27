"""A place that cannot be written to is said in one line, with exit code 2, before any work is done."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.faults.writing import WRITINGS, EndsInALine, tree


def missing(folder: Path, name: str, is_file: bool) -> Path:
    """A place in a folder that is not there; folders are made, so for these it is in a file."""
    (folder / "file").touch()
    return folder / "no" / "such" / name if is_file else folder / "file" / name


def linked(folder: Path, name: str, to: Path | str) -> Path:
    (folder / name).symlink_to(to)
    return folder / name


def made(path: Path, is_file: bool) -> Path:
    """A folder where a file is to be, or a file where a folder is."""
    path.mkdir() if is_file else path.touch()
    return path


PLACES: dict[str, Callable[[Path, str, bool], Path]] = {
    "in the way": lambda folder, name, is_file: made(folder / name, is_file),
    "too long": lambda folder, name, _: folder / f"{'x' * 300}{name}",
    "too long a path": lambda folder, name, _: Path(*([str(folder)] + ["y" * 200] * 30)) / name,
    "inside a file": lambda folder, name, _: missing(folder, name, False),
    "missing folder": missing,
    "link to nowhere": lambda folder, name, is_file: linked(folder, name, missing(folder, name, is_file)),
    "links in a loop": lambda folder, name, _: linked(folder, name, linked(folder, "other", folder / name)),
    "a device": lambda folder, name, _: linked(folder, name, "/dev/full"),
}


@pytest.mark.parametrize("command", WRITINGS)
def test_every_command_refuses_every_impossible_place_in_a_line(
    command: str, tmp_path: Path, ends_in_a_line: EndsInALine
) -> None:
    writing = WRITINGS[command]
    for name, place in PLACES.items():
        folder = tmp_path / name
        folder.mkdir()
        out = place(folder, writing.out, writing.is_file)
        before = tree(folder)
        print(name)
        assert len(ends_in_a_line(writing.refused, out)) < 1000, name
        assert tree(folder) == before, name


@pytest.mark.parametrize("command", WRITINGS)
def test_every_command_refuses_a_read_only_folder_in_a_line(
    command: str, read_only: Path, ends_in_a_line: EndsInALine
) -> None:
    writing = WRITINGS[command]
    assert writing.out in ends_in_a_line(writing.refused, read_only / writing.out)
    assert not tree(read_only)
