"""`spikecam dataset` as a user meets it."""

from __future__ import annotations

from pathlib import Path

import pytest

from spikecam_env.cli.main import run

SMALL = ("--size", "32", "48", "--frames", "128", "--renderer", "embree")


def dataset(*words: object) -> int:
    return run(["dataset", *map(str, words)])


def test_made_gone_on_with_and_verified(tmp_path: Path, capsys) -> None:
    made = ("phm-n", "--out", tmp_path, *SMALL, "--scenes", "disk", "collage")
    assert dataset(*made) == 0 and "2 scenes made, 0 were there" in capsys.readouterr().out
    assert dataset(*made) == 0 and "0 scenes made, 2 were there" in capsys.readouterr().out
    assert dataset("verify", tmp_path) == 0 and "every file is there" in capsys.readouterr().out
    (tmp_path / "test/disk.h5").unlink()
    with pytest.raises(SystemExit) as end:
        dataset("verify", tmp_path)
    assert end.value.code == 1
    assert capsys.readouterr().out == "test/disk.h5: missing; run the same dataset command again\n"


def test_random_scenes_are_drawn_rendered_and_differ(tmp_path: Path) -> None:
    assert dataset("spift-n", "--out", tmp_path, *SMALL, "--train", 2, "--test", 1) == 0
    files = sorted(p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*.h5"))
    assert files == ["test/000.h5", "train/000.h5", "train/001.h5"]
    assert len({(tmp_path / name).read_bytes() for name in files}) == 3


def test_nonsense_ends_in_one_line(tmp_path: Path, capsys) -> None:
    assert dataset("phm-n", "--out", tmp_path, "--scenes", "disco") == 2
    assert "spikecam: unknown scene 'disco'; choose one of ball" in capsys.readouterr().err
    assert dataset("spift-n", "--out", tmp_path, "--train", 0, "--test", 0) == 2
    assert dataset("phm-n", "--out", tmp_path, *SMALL, "--jobs", 0) == 2
    assert dataset("verify", tmp_path) == 2
    assert not list(tmp_path.iterdir())
