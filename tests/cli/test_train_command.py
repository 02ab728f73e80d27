"""`spikecam train`: every mode reaches its training, with the options that were given."""

from __future__ import annotations

from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from denoiser.networks.reconstructor_recipe import LEARNED
from denoiser.passes.recipe import RECIPES
from denoiser.training.train_denoiser import TrainConfig
from denoiser.training.train_reconstructor import ReconstructorConfig
from spikecam_env.cli.main import run
from spikecam_env.cli.train import ONLY_OF, RECONSTRUCTORS, Train


@pytest.fixture
def trained(monkeypatch):
    """The configurations that training was begun with."""
    begun = []
    for module, name in (
        ("denoiser.training.train_denoiser", "train"),
        ("denoiser.training.train_reconstructor", "train_reconstructor"),
    ):
        monkeypatch.setattr(f"{module}.{name}", lambda config, **_: begun.append(config) or Path("weights.pt"))
    return begun


def test_every_mode_has_its_training():
    assert set(RECONSTRUCTORS) == set(LEARNED)
    assert set(get_args(get_type_hints(Train)["mode"])) == {*RECIPES, *LEARNED}
    assert {mode for modes in ONLY_OF.values() for mode in modes} <= {*RECIPES, *LEARNED}


@pytest.mark.parametrize("mode", RECIPES)
def test_a_denoiser_is_trained_with_what_was_given(mode, trained, tmp_path):
    assert run(["train", "--mode", mode, "--out", str(tmp_path), "--batch", "8", "--minutes", "7.6"]) == 0
    assert trained == [TrainConfig(mode=mode, out=tmp_path, batch=8, minutes=7.6, threads=2)]


@pytest.mark.parametrize("mode", LEARNED)
def test_a_reconstructor_is_trained_with_what_was_given(mode, trained, tmp_path):
    options = ["--width", "24", "--frames-a-step", "8", "--batch", "8", "--patch", "32"]
    assert run(["train", "--mode", mode, "--out", str(tmp_path), *options]) == 0
    expected = ReconstructorConfig(mode=mode, out=tmp_path, width=24, frames_a_step=8, batch=8, patch=32, threads=2)
    assert trained == [expected]


@pytest.mark.parametrize("mode", [*RECIPES, *LEARNED])
def test_what_is_not_given_is_the_modes_own(mode, trained, tmp_path):
    assert run(["train", "--mode", mode, "--out", str(tmp_path)]) == 0
    config = (ReconstructorConfig if mode in LEARNED else TrainConfig)(mode=mode, out=tmp_path, threads=2)
    assert trained == [config]


def test_the_ablation(trained, tmp_path):
    assert run(["train", "--mode", "paper", "--no-refine", "--out", str(tmp_path)]) == 0
    assert trained[0].refine is False
