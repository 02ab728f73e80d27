"""`spikecam train`: every mode reaches its training, with the options that were given."""

from __future__ import annotations

from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from denoiser.networks.reconstructor_recipe import LEARNED
from denoiser.passes.recipe import MODES, RECIPES
from denoiser.training.train import TrainConfig
from denoiser.training.train_config import SOURCES
from spikecam_env.cli.main import run
from spikecam_env.cli.train import Train


@pytest.fixture
def trained(monkeypatch):
    """The configurations that training was begun with."""
    begun = []
    monkeypatch.setattr("denoiser.training.train.train", lambda config: begun.append(config) or Path("weights.pt"))
    return begun


def test_every_mode_has_its_training():
    assert set(get_args(get_type_hints(Train)["mode"])) == {*MODES, *LEARNED} == set(SOURCES)


@pytest.mark.parametrize("mode", RECIPES)
def test_a_denoiser_is_trained_with_what_was_given(mode, trained, tmp_path):
    assert run(["train", "--mode", mode, "--out", str(tmp_path), "--batch", "8", "--minutes", "7.6"]) == 0
    assert trained == [TrainConfig(mode=mode, out=tmp_path, batch=8, minutes=7.6, threads=2)]


@pytest.mark.parametrize("mode", LEARNED)
def test_a_reconstructor_is_trained_with_what_was_given(mode, trained, tmp_path):
    options = ["--width", "24", "--frames-a-step", "8", "--batch", "8", "--patch", "32"]
    assert run(["train", "--mode", mode, "--out", str(tmp_path), *options]) == 0
    expected = TrainConfig(mode=mode, out=tmp_path, width=24, frames_a_step=8, batch=8, patch=32, threads=2)
    assert trained == [expected]


@pytest.mark.parametrize("mode", [*RECIPES, *LEARNED])
def test_what_is_not_given_is_the_modes_own(mode, trained, tmp_path):
    assert run(["train", "--mode", mode, "--out", str(tmp_path)]) == 0
    (config,) = trained
    assert config == TrainConfig(mode=mode, out=tmp_path, threads=2)
    assert (config.batch, config.validate_every) == ((64, 500) if mode in LEARNED else (16, 1000))


def test_the_ablation(trained, tmp_path):
    assert run(["train", "--mode", "paper", "--no-refine", "--out", str(tmp_path)]) == 0
    assert trained[0].refine is False


@pytest.mark.parametrize(
    "mode, option, modes",
    [
        ("best", "--no-refine", "refine is for paper"),
        ("paper", "--channels 4 8 3", "channels is for best, fast, picture"),
        ("ssml", "--start best", "start is for best, fast, paper, picture"),
        ("paper", "--teacher best", "teacher is for best, fast"),
        ("ssml", "--validate-passes 3", "validate-passes is for best, fast, paper"),
        ("fast", "--width 12", "width is for spk2img-clean, spk2img-noisy, ssml"),
        ("best", "--frames-a-step 3", "frames-a-step is for spk2img-clean, spk2img-noisy, ssml"),
    ],
)
def test_an_option_of_other_modes_is_refused(mode, option, modes, trained, tmp_path, capsys):
    assert run(["train", "--mode", mode, "--out", str(tmp_path), *option.split()]) == 2 and not trained
    assert capsys.readouterr().err == f"spikecam: --{modes}; leave it out for {mode}\n"
