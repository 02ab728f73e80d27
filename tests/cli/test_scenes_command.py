from __future__ import annotations

from pathlib import Path

import imageio.v2 as imageio
import numpy as np
import pytest

from scenes.catalogue import SCENES
from spikecam_env.cli.main import run
from spikecam_env.streams import read_recording

SIZE = ("--size", "24", "40")


def spikecam(*args: object) -> int:
    return run([str(a) for a in args])


def test_every_scene_is_listed_with_a_line(capsys) -> None:
    assert spikecam("scenes") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(SCENES)
    assert all(len(line) > 30 for line in lines)


def test_sheet_has_a_picture_of_every_scene(tmp_path: Path, capsys, monkeypatch) -> None:
    few = {name: SCENES[name] for name in ("ball", "collage", "disk", "fan", "text")}
    monkeypatch.setattr("scenes.catalogue.SCENES", few)
    assert spikecam("scenes", "--out", tmp_path / "sheet.png", *SIZE) == 0
    page = np.asarray(imageio.imread(tmp_path / "sheet.png"))
    one = tmp_path / "one.png"
    assert spikecam("scenes", "disk", "--out", one, *SIZE) == 0
    picture = np.asarray(imageio.imread(one))
    rows = -(-len(few) // 4)
    assert page.shape[0] == rows * picture.shape[0] and page.shape[1] > 3.9 * (picture.shape[1] - 20)
    assert f"{len(few)} scenes" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["a.mp4", "a.gif"])
def test_film_has_a_picture_every_so_many_frames(name: str, tmp_path: Path, capsys) -> None:
    assert spikecam("scenes", "disk", "--film", tmp_path / name, "--frames", 320, "--every", 32, *SIZE) == 0
    pictures = [p.copy() for p in imageio.get_reader(tmp_path / name)]
    assert len(pictures) == 10 and pictures[0].shape[:2] == (24, 40)
    assert not np.array_equal(pictures[0], pictures[5])
    assert "8 ms of disk, 50 times slower than life" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (("nope",), "unknown scene 'nope'"),
        (("--film", "a.mp4"), "which scene?"),
        (("disk", "--film", "a.avi"), "unknown file type '.avi'"),
        (("disk", "--film", "a.mp4", "--every", "0"), "--every 0"),
        (("disk", "--film", "no/such/a.mp4"), "no folder"),
        (("--out", "a.jpg"), "use .png"),
        (("disk", "--size", "2", "9", "--out", "a.png"), "at least 8 rows"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(args: tuple[str, ...], message: str, capsys) -> None:
    assert spikecam("scenes", *args) == 2
    assert message in capsys.readouterr().err


def test_record_takes_any_scene(tmp_path: Path, capsys) -> None:
    small = ("--frames", 40, "--size", 24, 40)
    for scene in ("collage", "dice"):
        assert spikecam("record", "--scene", scene, "--out", tmp_path / f"{scene}.h5", *small) == 0
        assert 0.05 < read_recording(tmp_path / f"{scene}.h5").spikes.mean() < 0.2
    assert spikecam("record", "--scene", "dise", "--out", tmp_path / "a.h5", *small) == 2
    assert "unknown scene 'dise'" in capsys.readouterr().err
    assert spikecam("record", "--scene", "dice", "--rpm", 5, "--out", tmp_path / "a.h5", *small) == 2
    assert "--rpm 5 is the disk's speed" in capsys.readouterr().err
