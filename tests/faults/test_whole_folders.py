"""A result of several files is whole or not there, and whatever was there before stays until it is whole."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from spikecam_env.cli.main import run
from spikecam_env.errors import InputError, WriteError
from spikecam_env.streams import save_vidar_dat
from spikecam_env.whole import PARTIAL, whole_folder, write_text_whole
from tests.faults.writing import WRITINGS, EndsInALine, files_up_to, tree

RESULTS = [name for name, writing in WRITINGS.items() if not writing.is_file and not writing.resumes]
NEW = ("export", "campaign import")
"""Commands that want a new folder."""


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow
@pytest.mark.parametrize("command", RESULTS)
def test_a_result_of_which_the_largest_file_cannot_be_written_leaves_the_folder_as_it_was(
    command: str,
    tmp_path: Path,
    inputs: dict[str, Path],
    monkeypatch: pytest.MonkeyPatch,
    ends_in_a_line: EndsInALine,
) -> None:
    writing = WRITINGS[command]
    assert writing.run(tmp_path / "good" / writing.out, inputs, monkeypatch) == 0
    good = contents(tmp_path / "good" / writing.out)
    largest = max(map(len, good.values()))
    print(f"{command}: {', '.join(f'{name} {len(data)} B' for name, data in good.items())}")
    places = [tmp_path / "new" / writing.out]
    if command not in NEW:
        places.append(tmp_path / "old" / writing.out)
        places[1].mkdir(parents=True)
        for name in (*good, "mine"):
            (places[1] / name).write_text("old")
    for out in places if command != "effects new" else places[:1]:  # which replaces nothing
        before = contents(out)
        with files_up_to(largest - 1):
            line = ends_in_a_line(writing.run, out)
        assert "ulimit" in line and str(out) in line and "partial" not in line
        assert contents(out) == before and tree(out) == set(before), out
    assert not tree(tmp_path / "new")


@pytest.mark.parametrize("command", ["denoise", "ladder", "calibrate"])
def test_a_result_replaces_the_one_before_and_leaves_other_files(
    command: str, tmp_path: Path, inputs: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    writing = WRITINGS[command]
    out = tmp_path / writing.out
    out.mkdir()
    (out / "mine").write_text("old")
    assert writing.run(out, inputs, monkeypatch) == 0
    made = tree(out)
    for name in made:
        (out / name).write_text("old")
    assert writing.run(out, inputs, monkeypatch) == 0
    assert tree(out) == made and {name for name in made if (out / name).read_bytes() == b"old"} == {"mine"}


def test_if_one_file_cannot_be_moved_those_before_are_put_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a", "b", "c"):
        (tmp_path / name).write_text("old")
    move = os.replace
    moved = []

    def third_fails(source: str | Path, target: str | Path) -> None:
        if Path(target).parent == tmp_path and "partial" in str(source):
            moved.append(target)
            if len(moved) == 3:
                raise OSError(5, "Input/output error")
        move(source, target)

    with pytest.raises(WriteError, match="Input/output error"), whole_folder(tmp_path, replace=True) as beside:
        for name in ("a", "b", "d", "e"):
            (beside / name).write_text("new")
        monkeypatch.setattr(os, "replace", third_fails)
    assert len(moved) > 2
    assert contents(tmp_path) == {"a": b"old", "b": b"old", "c": b"old"}
    assert tree(tmp_path) == {"a", "b", "c"}


def test_a_folder_that_is_stopped_or_fails_leaves_nothing_and_no_folders_above_it(tmp_path: Path) -> None:
    for error in (KeyboardInterrupt, InputError("too short"), RuntimeError):
        with pytest.raises(BaseException), whole_folder(tmp_path / "a" / "b") as beside:  # noqa: B017
            write_text_whole(beside / "part", "x")
            raise error
        assert not tree(tmp_path)
    with whole_folder(tmp_path / "a" / "b") as beside:
        write_text_whole(beside / "part", "x")
        assert tree(tmp_path) > {"a"} and not (tmp_path / "a" / "b").exists()
    assert tree(tmp_path) == {"a", "a/b", "a/b/part"}


def test_errors_name_the_folder_that_was_given_and_not_the_hidden_one(tmp_path: Path) -> None:
    with pytest.raises(WriteError) as seen, whole_folder(tmp_path / "result") as beside:
        write_text_whole(beside / "no such" / "file", "x")
    assert str(tmp_path / "result" / "no such") in str(seen.value) and "partial" not in str(seen.value)
    with pytest.raises(WriteError) as seen, whole_folder(tmp_path / "result") as beside:
        (beside / "no such" / "file").write_text("x")
    assert str(tmp_path / "result" / "no such" / "file") in str(seen.value) and "partial" not in str(seen.value)


def test_a_folder_in_the_way_of_a_file_changes_nothing(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    with pytest.raises(WriteError, match="b: it is there already"), whole_folder(tmp_path, replace=True) as beside:
        (beside / "a").write_text("new")
        (beside / "b").write_text("new")
    assert tree(tmp_path) == {"b"}


def test_of_two_that_fill_a_new_folder_at_once_the_second_adds_to_the_first(tmp_path: Path) -> None:
    with whole_folder(tmp_path / "x", replace=True) as one, whole_folder(tmp_path / "x", replace=True) as two:
        (one / "a").write_text("1")
        for name in ("a", "b"):
            (two / name).write_text("2")
    assert contents(tmp_path / "x") == {"a": b"1", "b": b"2"}


def test_hidden_files_of_a_killed_run_do_not_make_a_folder_full(tmp_path: Path) -> None:
    left = tmp_path / "out" / ".a.12.00000000-01234567.partial.h5"
    left.parent.mkdir()
    left.touch()
    assert PARTIAL.fullmatch(left.name)
    with whole_folder(tmp_path / "out") as beside:
        (beside / "a").write_text("x")
    assert tree(tmp_path / "out") == {"a", left.name}  # of another machine: it stays for a day


def test_a_file_that_a_link_leads_to_is_replaced_and_the_link_stays(tmp_path: Path) -> None:
    (tmp_path / "far").write_text("old")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a").symlink_to(tmp_path / "far")
    with whole_folder(tmp_path / "out", replace=True) as beside:
        (beside / "a").write_text("new")
    assert (tmp_path / "out" / "a").is_symlink() and (tmp_path / "far").read_text() == "new"


def test_bits_and_the_file_that_says_their_size_are_both_there_or_neither(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "x.dat"
    with files_up_to(20):
        with pytest.raises(WriteError, match=r"x\.dat"):
            save_vidar_dat(path, np.zeros((1, 2, 8), np.uint8), side_file=True)
        assert not tree(tmp_path)
        assert run(["record", "--out", str(path), "--frames", "1", "--size", "8", "16"]) == 2
    assert not tree(tmp_path)
    path.with_name("x.dat.json").mkdir()
    capsys.readouterr()
    assert run(["record", "--out", str(path), "--frames", "100000000", "--size", "8", "16"]) == 2
    assert "x.dat.json" in capsys.readouterr().err and tree(tmp_path) == {"x.dat.json"}


def test_a_film_is_not_begun_where_the_picture_beside_it_cannot_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "in the way.png").mkdir()
    for picture in ("picture.txt", "in the way.png"):
        words = ["scenes", "disk", "--film", str(tmp_path / "film.gif"), "--out", str(tmp_path / picture)]
        assert run([*words, "--size", "24", "40", "--frames", "64"]) == 2
        assert picture in capsys.readouterr().err and tree(tmp_path) == {"in the way.png"}
