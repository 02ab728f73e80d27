"""Checkpoints come back as they were; shipped ones are small and have a record (others: `test_plain_torch`)."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from denoiser.networks.reconstructor_recipe import LEARNED
from denoiser.online import OnlineDnSS
from denoiser.passes.recipe import MODES, RECIPES
from denoiser.weights import load_weights, pretrained_path, save_weights
from spikecam_env.errors import InputError

SPIKES = (np.random.default_rng(0).random((40, 8, 8)) < 0.3).astype(np.uint8)


@pytest.fixture
def checkpoint(tmp_path):
    torch.manual_seed(0)
    path = tmp_path / "best.pt"
    save_weights(path, "best", RECIPES["best"], RECIPES["best"].network(), {"steps": 0})
    return path


def test_a_checkpoint_comes_back_as_it_was(checkpoint):
    torch.manual_seed(0)
    original = OnlineDnSS(RECIPES["best"], RECIPES["best"].network(), output="rate")
    back = OnlineDnSS.from_file(checkpoint, output="rate")
    assert np.array_equal(original.push(SPIKES), back.push(SPIKES))
    assert load_weights(checkpoint)[0] == RECIPES["best"]
    assert not list(checkpoint.parent.glob("*.part"))


@pytest.mark.parametrize("mode", ["paper", "fast", "best"])
def test_shipped_weights_say_how_they_were_made(mode):
    path = pretrained_path(mode)
    recipe, _, training = load_weights(path)
    print(f"{mode}: {path.stat().st_size / 1e6:.2f} MB, {training}")
    assert recipe == RECIPES[mode]
    assert training["options"]["mode"] == mode and training["steps"] > 1000 and "seed" in training["options"]


def test_shipped_weights_are_small_together():
    """Reconstructors' too: all that the package carries."""
    sizes = {path.name: path.stat().st_size for path in pretrained_path("best").parent.iterdir()}
    print(
        {name: f"{size / 1e6:.2f} MB" for name, size in sizes.items()}, f"{sum(sizes.values()) / 1e6:.2f} MB together"
    )
    assert {f"{name}.pt" for name in (*MODES, "paper-no-refine", *LEARNED)} == set(sizes)
    assert sum(sizes.values()) < 12e6


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.pt"):
        load_weights(tmp_path / "nowhere.pt")


def test_an_unknown_mode_is_named():
    with pytest.raises(InputError, match="choose one of best, fast, paper"):
        OnlineDnSS.pretrained("worst")
