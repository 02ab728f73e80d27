"""`spikecam denoise` and `spikecam campaign import` read all formats of `read_recording`, with its options."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spikecam_env.cli.main import run
from spikecam_env.cli.reading import ReadingOptions
from spikecam_env.streams import save_vidar_dat


def regular(shape: tuple[int, int] = (24, 32), frames: int = 60) -> np.ndarray:
    rng = np.random.default_rng(0)
    charge = rng.random(shape) + np.arange(frames + 1)[:, None, None] * rng.uniform(0.1, 0.3, shape)
    return np.diff(np.floor(charge), axis=0).astype(np.uint8)


def test_only_what_was_given_is_passed_on() -> None:
    assert ReadingOptions().options() == {}
    assert ReadingOptions(height=24, flip=True, item=0).options() == {"height": 24, "flip": True, "item": 0}


def test_denoise_prints_the_geometry_it_took(tmp_path: Path, capsys) -> None:
    save_vidar_dat(tmp_path / "a.dat", regular(), flip=True, side_file=True)
    out = tmp_path / "out"
    assert run(["denoise", str(tmp_path / "a.dat"), "--out", str(out), "--window", "11", "--no-film"]) == 0
    printed = capsys.readouterr().out.splitlines()[0]
    assert printed.endswith(
        "a.dat: 60 frames of 24 rows x 32 columns, flipped upside down, little-endian bits, size a.dat.json"
    )


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("batch.npy", (), "item, 0 to 2"),
        ("batch.npy", ("--item", "3"), "item is 3"),
        ("batch.npy", ("--item", "-1"), "--item -1"),
        ("batch.npy", ("--height", "24"), "height does not apply"),
        ("a.raw", (), "give height and width"),
        ("a.raw", ("--height", "24", "--width", "32", "--layout", "bits"), "layout does not apply"),
        ("a.dat", ("--layout", "packets"), "64-byte packets"),
        ("a.dat", ("--height", "24", "--width", "33"), "remainder"),
    ],
)
def test_wrong_options_of_reading_end_in_one_line(
    name: str, options: tuple[str, ...], said: str, tmp_path: Path, capsys
) -> None:
    np.save(tmp_path / "batch.npy", np.stack([regular()] * 3))
    regular().tofile(tmp_path / "a.raw")
    save_vidar_dat(tmp_path / "a.dat", regular())
    before = {p.name for p in tmp_path.iterdir()}
    assert run(["denoise", str(tmp_path / name), "--out", str(tmp_path / "out"), *options]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("spikecam: ") and said in error
    assert {p.name for p in tmp_path.iterdir()} == before


def test_import_takes_every_format(tmp_path: Path, capsys) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    np.save(folder / "batch.npy", np.stack([regular()] * 3))
    regular().tofile(folder / "a.raw")
    save_vidar_dat(folder / "b.dat", regular(), side_file=True, frame_rate_hz=20_000.0)
    (folder / "labels.csv").write_text(
        "file,radiance,item,height,width\nbatch.npy,0.2,1,,\na.raw,0.2,,24,32\nb.dat,0.2,,,\n"
    )
    assert run(["campaign", "import", str(folder), str(tmp_path / "out"), "--table", str(folder / "labels.csv")]) == 0
    assert "wrote 3 recordings of 24 x 32 pixels" in capsys.readouterr().out
