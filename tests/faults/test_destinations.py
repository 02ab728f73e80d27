"""A place that cannot be written to is said in one line, with exit code 2, before any work is done."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.writing import WRITINGS, said, tree


def in_the_way(folder: Path, name: str, is_file: bool) -> Path:
    out = folder / name
    out.mkdir() if is_file else out.touch()
    return out


def too_long(folder: Path, name: str, is_file: bool) -> Path:
    return folder / f"{'x' * 300}{name}"


def too_long_a_path(folder: Path, name: str, is_file: bool) -> Path:
    return Path(*([str(folder)] + ["y" * 200] * 30)) / name


def inside_a_file(folder: Path, name: str, is_file: bool) -> Path:
    (folder / "file").touch()
    return folder / "file" / name


def missing_folder(folder: Path, name: str, is_file: bool) -> Path:
    return folder / "no" / "such" / name if is_file else inside_a_file(folder, name, is_file)


def link_to_nowhere(folder: Path, name: str, is_file: bool) -> Path:
    out = folder / name
    out.symlink_to(folder / "no" / "such" / name if is_file else inside_a_file(folder, name, is_file))
    return out


def links_in_a_loop(folder: Path, name: str, is_file: bool) -> Path:
    out = folder / name
    out.symlink_to(folder / "other")
    (folder / "other").symlink_to(out)
    return out


def a_device(folder: Path, name: str, is_file: bool) -> Path:
    out = folder / name
    out.symlink_to("/dev/full")
    return out


PLACES = [
    in_the_way,
    too_long,
    too_long_a_path,
    inside_a_file,
    missing_folder,
    link_to_nowhere,
    links_in_a_loop,
    a_device,
]


@pytest.mark.parametrize("command", WRITINGS)
def test_every_command_refuses_every_impossible_place_in_a_line(
    command: str, tmp_path: Path, inputs: dict[str, Path], monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    writing = WRITINGS[command]
    capsys.readouterr()
    for place in PLACES:
        folder = tmp_path / place.__name__
        folder.mkdir()
        out = place(folder, writing.out, writing.is_file)
        before = tree(folder)
        code = writing.refused(out, inputs, monkeypatch)
        lines = said(capsys.readouterr().err)
        assert code == 2, (place.__name__, lines)
        assert len(lines) == 1 and lines[0].startswith("spikecam: ") and len(lines[0]) < 1000, (place.__name__, lines)
        assert tree(folder) == before, place.__name__


@pytest.mark.parametrize("command", WRITINGS)
def test_every_command_refuses_a_read_only_folder_in_a_line(
    command: str, read_only: Path, inputs: dict[str, Path], monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    writing = WRITINGS[command]
    capsys.readouterr()
    assert writing.refused(read_only / writing.out, inputs, monkeypatch) == 2
    lines = said(capsys.readouterr().err)
    assert len(lines) == 1 and lines[0].startswith("spikecam: ") and writing.out in lines[0], lines
    assert not tree(read_only)
