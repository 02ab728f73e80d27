from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from scenes.catalogue import SCENES
from spikecam_env.cli.screen.film import write_film
from spikecam_env.cli.screen.screen import BACKGROUND, MARGIN, PicturePanel, compose
from spikecam_env.streams import read_recording
from tests.commands import film_in, picture_in, spikecam

SIZE = ("--size", "24", "40")


def test_every_scene_is_listed_with_a_line(capsys) -> None:
    assert spikecam("scenes") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(SCENES)
    assert all(len(line) > 30 for line in lines)


def test_sheet_has_a_picture_of_every_scene(tmp_path: Path, capsys, monkeypatch) -> None:
    few = {name: SCENES[name] for name in ("ball", "collage", "disk", "fan", "text")}
    monkeypatch.setattr("scenes.catalogue.SCENES", few)
    assert spikecam("scenes", "--out", tmp_path / "sheet.png", *SIZE) == 0
    page = picture_in(tmp_path / "sheet.png")
    one = tmp_path / "one.png"
    assert spikecam("scenes", "disk", "--out", one, *SIZE) == 0
    picture = picture_in(one)
    rows = -(-len(few) // 4)
    assert page.shape[0] == rows * picture.shape[0] and page.shape[1] > 3.9 * (picture.shape[1] - 20)
    assert f"{len(few)} scenes" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["a.mp4", "a.gif"])
def test_film_has_a_picture_every_so_many_frames(name: str, tmp_path: Path, capsys) -> None:
    assert spikecam("scenes", "disk", "--film", tmp_path / name, "--frames", 320, "--every", 32, *SIZE) == 0
    pictures = film_in(tmp_path / name)
    assert len(pictures) == 10 and pictures[0].shape[:2] == (24, 40)
    assert not np.array_equal(pictures[0], pictures[5])
    assert "8 ms of disk, 50 times slower than life" in capsys.readouterr().out


def test_record_takes_any_scene(tmp_path: Path, capsys) -> None:
    small = ("--frames", 40, "--size", 24, 40)
    for scene in ("collage", "dice"):
        assert spikecam("record", "--scene", scene, "--out", tmp_path / f"{scene}.h5", *small) == 0
        assert 0.05 < read_recording(tmp_path / f"{scene}.h5").spikes.mean() < 0.2
    assert spikecam("record", "--scene", "dise", "--out", tmp_path / "a.h5", *small) == 2
    assert "unknown scene 'dise'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("asked", "written"), [((101, 63), (102, 64)), ((24, 63), (24, 64)), ((9, 8), (10, 8)), ((24, 40), (24, 40))]
)
def test_a_film_of_odd_size_is_padded_never_cut(asked: tuple, written: tuple, tmp_path: Path, capsys) -> None:
    """The GIF holds the size asked for, so it has the light of the last row and column."""
    for name in ("a.mp4", "a.gif"):
        assert spikecam("scenes", "ball", "--film", tmp_path / name, "--frames", 64, "--size", *asked) == 0
    film, plain = (film_in(tmp_path / name)[0].astype(int) for name in ("a.mp4", "a.gif"))
    assert film.shape == (*written, 3) and plain.shape[:2] == asked
    for seen, light in ((film[asked[0] - 1, : asked[1]], plain[-1]), (film[: asked[0], asked[1] - 1], plain[:, -1])):
        print(worst := np.abs(seen - light).max())
        assert worst <= 8  # 64 greys of the GIF are 4 apart, and lossy coding adds as much
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("spikecam: warning:")]
    size = f"the film has {written[0]} x {written[1]} pixels, not {asked[0]} x {asked[1]}"
    assert len(said) == (asked != written) and all(size in line for line in said)


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (3, 5), (2, 2), (7, 300)])
def test_a_film_of_any_size_has_every_pixel(shape: tuple[int, int], tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    grey = np.repeat(rng.integers(0, 256, (*shape, 1)), 3, axis=2).astype(np.uint8)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        write_film(tmp_path / "a.mp4", [grey] * 3)
    film = film_in(tmp_path / "a.mp4")
    assert len(film) == 3 and film[0].shape[:2] == tuple(n + n % 2 for n in shape)
    assert np.abs(film[0][: shape[0], : shape[1]].astype(int) - grey).max() <= 12
    assert len(said) == any(n % 2 for n in shape)


@pytest.mark.parametrize("width", [1, 7, 31, 63])
def test_panels_have_even_sides_and_room_for_their_margin(width: int) -> None:
    white = compose([PicturePanel(np.ones((width, width)), "")], 1.0)
    assert white.shape[0] % 2 == white.shape[1] % 2 == 0
    assert (white[:, -MARGIN:] == BACKGROUND).all()
