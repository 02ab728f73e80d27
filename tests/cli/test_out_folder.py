"""Folders for results: of a command that writes them all at once, and of a run that goes on in one."""

from __future__ import annotations

from pathlib import Path

import pytest

from spikecam_env.cli.files import out_folder
from spikecam_env.errors import InputError
from spikecam_env.run_folder import run_folder


def test_a_folder_is_made_and_stays(tmp_path: Path) -> None:
    with out_folder(tmp_path / "a" / "b"):
        pass
    with run_folder(tmp_path / "a" / "c") as folder:
        assert folder.is_dir()
    assert (tmp_path / "a" / "b").is_dir() and folder.is_dir()


@pytest.mark.parametrize("kind", [out_folder, run_folder])
def test_a_folder_that_nothing_was_written_to_goes_with_the_error(kind, tmp_path: Path) -> None:
    with pytest.raises(InputError), kind(tmp_path / "new"):
        raise InputError("too short")
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("kind", [out_folder, run_folder])
def test_a_folder_that_was_there_stays(kind, tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    with pytest.raises(InputError), kind(tmp_path / "old"):
        raise InputError("too short")
    assert (tmp_path / "old").is_dir()


def test_finished_files_of_a_run_stay_and_those_of_a_result_that_is_not_whole_go(tmp_path: Path) -> None:
    for kind, name in ((out_folder, "result"), (run_folder, "run")):
        with pytest.raises(KeyboardInterrupt), kind(tmp_path / name) as folder:
            (folder / "part").touch()
            raise KeyboardInterrupt
    assert (tmp_path / "run" / "part").is_file() and not (tmp_path / "result").exists()


@pytest.mark.parametrize("kind", [out_folder, run_folder])
def test_a_file_in_the_way_is_said(kind, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot use"), kind(tmp_path / "file" / "results"):
        pass
    with pytest.raises(InputError, match="file"), kind(tmp_path / "file"):
        pass
