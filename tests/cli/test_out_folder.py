"""The folder for results."""

from __future__ import annotations

from pathlib import Path

import pytest

from spikecam_env.cli.files import out_folder
from spikecam_env.errors import InputError


def test_a_folder_is_made_and_stays(tmp_path: Path) -> None:
    with out_folder(tmp_path / "a" / "b") as folder:
        pass
    assert folder.is_dir()


def test_a_folder_that_nothing_was_written_to_goes_with_the_error(tmp_path: Path) -> None:
    with pytest.raises(InputError), out_folder(tmp_path / "new"):
        raise InputError("too short")
    assert not (tmp_path / "new").exists()


def test_what_was_there_or_was_written_stays(tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    with pytest.raises(InputError), out_folder(tmp_path / "old"):
        raise InputError("too short")
    with pytest.raises(KeyboardInterrupt), out_folder(tmp_path / "half") as folder:
        (folder / "part").touch()
        raise KeyboardInterrupt
    assert (tmp_path / "old").is_dir() and (tmp_path / "half" / "part").is_file()


def test_a_file_in_the_way_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot use"), out_folder(tmp_path / "file" / "results"):
        pass
