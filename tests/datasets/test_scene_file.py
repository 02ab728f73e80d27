"""Contents of a scene's file: both streams, the truth, and all that is needed to make it again."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from small_dataset import SHAPE, small_plan

from scenes.catalogue import make_scene
from spikecam_env.datasets import build
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.streams import read_recording, read_truth

PLAN = small_plan()


@pytest.fixture(scope="module")
def folder():
    with tempfile.TemporaryDirectory() as made:
        build(PLAN, made)
        yield Path(made)


@pytest.mark.parametrize("entry", PLAN.entries, ids=lambda entry: entry.path)
def test_streams_are_those_of_the_camera_and_its_twin_in_one_go(folder: Path, entry) -> None:
    scene = make_scene(entry.scene, SHAPE, entry.scene_seed)
    light = scene.radiance(0, PLAN.frames)
    camera = SpikeSensor("scsim", SHAPE, entry.unit_seed)
    noisy = read_recording(folder / entry.path)
    clean = read_recording(folder / entry.path, stream="clean")
    np.testing.assert_array_equal(noisy.spikes, camera.step(light, PLAN.frames))
    np.testing.assert_array_equal(clean.spikes, camera.clean_twin().step(light, PLAN.frames))
    assert noisy.frame_rate_hz == 40_000.0


def test_truth_is_the_scenes_at_the_middle_of_the_chosen_frames(folder: Path) -> None:
    for entry in PLAN.entries:
        scene, kept = make_scene(entry.scene, SHAPE, entry.scene_seed), read_truth(folder / entry.path)
        assert kept["frame"].tolist() == [0.5, 50.5, 100.5, 150.5]
        for i, instant in enumerate(kept["frame"]):
            truth = scene.truth(instant)
            for name in ("radiance", "flow", "object_id"):
                np.testing.assert_array_equal(kept[name][i], getattr(truth, name))
            assert all(np.array_equal(kept[f"pose_{name}"][i], pose) for name, pose in truth.poses.items())
            assert ("depth" in kept) == (truth.depth is not None)


def test_attributes_say_how_to_make_it_again(folder: Path, tmp_path: Path) -> None:
    said = read_recording(folder / "train/000.h5").attributes
    expected = {"dataset": "small", "scene": "collage", "scene_seed": 11, "unit_seed": 12, "seed": 3, "truth_every": 50}
    assert (expected | {"mean_interval": 10.0, "engine": "fast"}).items() <= said.items()
    (tmp_path / "model.toml").write_text(said["model"])
    assert SensorModel.from_toml(tmp_path / "model.toml") == SensorModel.preset("scsim")
    assert "package_version" in said


def test_a_scene_does_not_depend_on_how_many_there_are() -> None:
    from spikecam_env.datasets import spift_n

    few, many = spift_n(train=2, test=1), spift_n(train=5, test=3)
    assert set(few.entries) < set(many.entries)
    seeds = [e.scene_seed for e in spift_n().entries]
    assert len(seeds) == 110 == len(set(seeds))
