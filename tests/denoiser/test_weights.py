"""Checkpoints: they come back as they were, and anything else is refused in one line."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from denoiser.online import OnlineDnSS
from denoiser.recipe import RECIPES
from denoiser.reconstruct.recipe import LEARNED
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
    there = OnlineDnSS(RECIPES["best"], RECIPES["best"].network(), output="rate")
    back = OnlineDnSS.from_file(checkpoint, output="rate")
    assert np.array_equal(there.push(SPIKES), back.push(SPIKES))
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
    assert {f"{name}.pt" for name in (*RECIPES, "paper-no-refine", *LEARNED)} == set(sizes)
    assert sum(sizes.values()) < 12e6


def test_a_truncated_file_is_refused(checkpoint):
    checkpoint.write_bytes(checkpoint.read_bytes()[:5000])
    with pytest.raises(InputError, match=r"best\.pt"):
        load_weights(checkpoint)


@pytest.mark.parametrize("content", [b"", b"not weights at all", b"\x80\x04N."])
def test_a_foreign_file_is_refused(tmp_path, content):
    path = tmp_path / "foreign.pt"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"foreign\.pt"):
        load_weights(path)


@pytest.mark.parametrize("data", [[1, 2], {"state_dict": {}}, {"format": "spikecam-denoiser/1", "recipe": {}}])
def test_a_torch_file_of_something_else_is_refused(tmp_path, data):
    path = tmp_path / "other.pt"
    torch.save(data, path)
    with pytest.raises(InputError):
        load_weights(path)


def test_weights_of_another_network_are_refused(checkpoint):
    data = torch.load(checkpoint, weights_only=True)
    data["state_dict"] = RECIPES["paper"].network().state_dict()
    torch.save(data, checkpoint)
    with pytest.raises(InputError, match="another network"):
        load_weights(checkpoint)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.pt"):
        load_weights(tmp_path / "nowhere.pt")


def test_an_unknown_mode_is_named():
    with pytest.raises(InputError, match="choose one of best, fast, paper"):
        OnlineDnSS.pretrained("worst")
