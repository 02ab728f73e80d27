"""Training: seeded, resumable, and it writes what it says."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch

from denoiser import train as training
from denoiser.pairs import draw_clip
from denoiser.recipe import RECIPES
from denoiser.train import TrainConfig, train
from denoiser.weights import load_weights
from spikecam_env.errors import InputError


class InlineFeed:
    """ClipFeed without a process of its own, over small clips."""

    def __init__(self, recipe, seed, first=0, weights=None, *, workers=1):
        self.recipe, self.seed, self.next, self.weights = recipe, seed, first, weights

    def __next__(self):
        self.next += 1
        return draw_clip(self.recipe, self.seed, self.next - 1, shape=(24, 24))

    def close(self):
        pass


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(training, "ClipFeed", InlineFeed)
    monkeypatch.setattr(training, "FIRST_CLIPS", 2)
    monkeypatch.setattr(training, "VALIDATION_CLIPS", 1)


def weights_after(out, steps, mode="best", **options):
    config = TrainConfig(mode=mode, out=out, steps=steps, batch=2, patch=16, refresh_every=4, **options)
    return load_weights(train(config, progress=False))[1].state_dict()


def same(a, b):
    return all(torch.equal(a[name], b[name]) for name in a)


def test_same_seed_same_weights(small, tmp_path):
    first, again = (weights_after(tmp_path / name, 3) for name in ("a", "b"))
    other = weights_after(tmp_path / "c", 3, seed=1)
    assert same(first, again) and not same(first, other)


def test_a_resumed_run_goes_on(small, tmp_path, monkeypatch):
    """Two steps, then the rest of four, are four steps: weights, moments, clips and draws come back."""
    whole = weights_after(tmp_path / "whole", 4)
    done = training._done
    monkeypatch.setattr(training, "_done", lambda config, run: 1.0 if run.step == 2 else done(config, run))
    weights_after(tmp_path / "halves", 4)
    monkeypatch.setattr(training, "_done", done)
    assert same(weights_after(tmp_path / "halves", 4), whole)


@pytest.mark.parametrize("mode", ["paper", "best"])
def test_a_run_leaves_weights_and_a_curve(small, tmp_path, mode):
    weights_after(tmp_path, 5, mode)
    curve = json.loads((tmp_path / "curve.json").read_text())
    assert [point["step"] for point in curve] == [4] and np.isfinite(curve[0]["network_vs_light_db"])
    assert (tmp_path / "curve.png").stat().st_size > 0 and (tmp_path / "last.pt").exists()
    assert (tmp_path / "rollout-4.pt").exists() == (RECIPES[mode].layout.gain_memory > 0)
    assert not list(tmp_path.glob("*.part"))


def test_the_run_of_another_mode_is_refused(small, tmp_path):
    weights_after(tmp_path, 1, "paper")
    with pytest.raises(InputError, match=r"last\.pt"):
        weights_after(tmp_path, 2, "best")


@pytest.mark.parametrize(
    "bad",
    [{"steps": 0}, {"patch": 97}, {"lr": 0.0}, {"batch": 0}, {"workers": 0}, {"device": "tpu"}, {"device": "cuda:x"}],
)
def test_unusable_options_are_named(bad):
    with pytest.raises(InputError, match=next(iter(bad))):
        TrainConfig(**bad)


@pytest.mark.skipif(torch.cuda.is_available(), reason="this machine has a CUDA device")
def test_a_gpu_that_is_not_there_is_refused():
    with pytest.raises(InputError, match="sees 0 CUDA devices; train with --device cpu"):
        TrainConfig(device="cuda")


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device on this machine")
def test_a_network_learns_on_a_gpu(small, tmp_path):
    """To weights that load on a processor, past a validation and into clips with a gain."""
    weights = weights_after(tmp_path, 6, device="cuda")
    assert all(w.device.type == "cpu" and bool(torch.isfinite(w).all()) for w in weights.values())
