"""`spikecam dataset films`: cuts of films as recordings, and the whole way to figures."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scenes.catalogue import make_scene
from spikecam_env.cli.main import run
from spikecam_env.datasets import FilmFolder, build, film_cuts
from spikecam_env.datasets.spikezoo import write_clip
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.streams import read_recording, read_truth

SHAPE = (24, 40)
CUTS = ("--size", *SHAPE, "--frames", 61)


def dataset(*words: object) -> int:
    return run(["dataset", "films", *map(str, words)])


@pytest.fixture
def films(tmp_path: Path) -> Path:
    """A folder of pictures whose values say where a pixel is, and an array."""
    folder = tmp_path / "films"
    (folder / "street").mkdir(parents=True)
    y, x = np.mgrid[:32, :60]
    for i in range(5):
        Image.fromarray(np.uint8(4 * y + x + 10 * i)).save(folder / "street" / f"{i}.png")
    np.save(folder / "wave.npy", np.random.default_rng(0).random((6, 30, 50)).astype(np.float32))
    return folder


def test_light_is_white_times_the_value_of_a_part_of_the_picture(films: Path, tmp_path: Path) -> None:
    options = (*CUTS, "--model", "ideal", "--interpolation", "linear")
    assert dataset(films, "--out", tmp_path / "out", *options) == 0
    truth = read_truth(tmp_path / "out" / "test" / "street-0.h5")
    assert list(truth["frame"]) == [0.5, 20.5, 40.5, 60.5]
    for frame, light in zip(truth["frame"], truth["radiance"], strict=True):
        values = 255 * light / 0.6 - 10 * frame / 20
        place = values[0, 0]
        assert np.abs(values - place - (4 * np.mgrid[:24, :40][0] + np.mgrid[:24, :40][1])).max() < 0.01
    spikes = read_recording(tmp_path / "out" / "test" / "street-0.h5").spikes
    light = truth["radiance"].mean(axis=0)
    assert np.abs(spikes.sum(axis=0) - 61 * light).max() <= 1.5  # a spike at either end, of any starting phase


def test_cuts_follow_from_the_seed_and_differ(films: Path, tmp_path: Path) -> None:
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        assert dataset(films, "--out", tmp_path / name, *CUTS, "--cuts", 2, "--seed", seed, "--split", "train") == 0
    files = [{p.name: p.read_bytes() for p in (tmp_path / name / "train").iterdir()} for name in "abc"]
    assert files[0] == files[1] and len(files[0]) == 4
    assert all(files[0][name] != files[2][name] for name in files[0])
    places = {read_truth(tmp_path / "a" / "train" / f"street-{i}.h5")["radiance"][0, 0, 0] for i in range(2)}
    assert len(places) == 2


def test_a_stopped_run_goes_on_and_the_folder_may_have_moved(films: Path, tmp_path: Path) -> None:
    plan = film_cuts(FilmFolder(films), shape=SHAPE, frames=61)
    whole, out = tmp_path / "whole", tmp_path / "out"
    assert build(plan, whole).made == 2
    build(plan, out)
    (out / "test" / "street-0.h5").unlink()
    moved = films.rename(tmp_path / "moved")
    again = build(film_cuts(FilmFolder(moved), shape=SHAPE, frames=61), out)
    assert (again.made, again.kept) == (1, 1)
    for path in whole.rglob("*.*"):
        assert path.read_bytes() == (out / path.relative_to(whole)).read_bytes(), path
    with pytest.raises(InputError, match="films"):
        build(film_cuts(FilmFolder(moved, white=0.5), shape=SHAPE, frames=61), out)


def test_the_figures_are_those_of_the_scene_itself(tmp_path: Path) -> None:
    """A film of a scene, a picture every 2 frames, and the scene before the camera: TFP and TFI within 0.5 dB."""
    scene = make_scene("collage", shape=(64, 64), seed=3, mean_interval=5.0)
    (tmp_path / "films").mkdir()
    np.save(tmp_path / "films" / "c.npy", np.stack([scene.truth(float(t)).radiance / 0.6 for t in range(0, 244, 2)]))
    spikes = SpikeSensor(SensorModel.preset("ideal"), (64, 64), 1).step(scene.radiance(0, 240), 240)
    for t in range(20, 220, 20):
        write_clip(tmp_path / "scene", f"c-{t}", spikes[t - 20 : t + 21], scene.truth(t + 0.5).radiance)
    for step in (
        f"dataset films {tmp_path}/films --out {tmp_path}/cuts --film-rate 20000 --size 64 64 --model ideal",
        f"export {tmp_path}/cuts --frames 41 --clips 10 --out {tmp_path}/film",
        f"evaluate spikezoo {tmp_path}/film --modes --pictures tfp41 tfi --out {tmp_path}/film-db",
        f"evaluate spikezoo {tmp_path}/scene --modes --pictures tfp41 tfi --out {tmp_path}/scene-db",
    ):
        assert run(step.split()) == 0
    found = {name: means(tmp_path / f"{name}-db" / "spikezoo.csv") for name in ("film", "scene")}
    for row, db in found["scene"].items():
        print(f"{row}: scene {db:.2f} dB, its film {found['film'][row]:.2f} dB")
        assert found["film"][row] == pytest.approx(db, abs=0.5)


def means(table: Path) -> dict[str, float]:
    """Row -> mean PSNR [dB]."""
    with table.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 20
    names = {row["row"] for row in rows}
    return {name: float(np.mean([float(row["PSNR"]) for row in rows if row["row"] == name])) for name in names}


@pytest.mark.parametrize(
    "options, said",
    [
        (("--size", 33, 40), "32 x 60 pixels; 33 x 40 are asked"),
        (("--size", 24, 40, "--frames", 82), "lasts 80 spike frames; 82 are asked"),
        ((*CUTS, "--white", 20), "white"),
        ((*CUTS, "--film-rate", "None"), "which have no times"),
        ((*CUTS, "--transfer", "srg"), "srg"),
    ],
)
def test_what_cannot_be_cut_is_refused(options: tuple, said: str, films: Path, tmp_path: Path, capsys) -> None:
    assert dataset(films, "--out", tmp_path / "out", *options) == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("spikecam: ")]
    assert len(errors) == 1 and said in errors[0]


def test_a_folder_without_films_is_refused(tmp_path: Path) -> None:
    for folder, why in ((tmp_path / "none", "no folder"), (tmp_path, "holds no film")):
        with pytest.raises(InputError, match=why):
            film_cuts(FilmFolder(folder))
