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


@pytest.mark.parametrize(
    "name", ["steps", "batch", "seed", "threads", "patch", "steps_per_clip", "refresh_every", "workers"]
)
@pytest.mark.parametrize("value", [-1, 10**30, 1.5, float("nan"), None, True, "8"])
def test_a_count_out_of_range_is_named(name, value):
    with pytest.raises(InputError, match=name):
        TrainConfig(**{name: value})


@pytest.mark.parametrize("name", ["lr", "minutes", "save_every_s"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf"), 1e308, True, "0.1"])
def test_an_amount_out_of_range_is_named(name, value):
    with pytest.raises(InputError, match=name):
        TrainConfig(**{name: value})


@pytest.mark.parametrize("bad", [{"mode": None}, {"mode": "worst"}, {"out": 3}, {"resume": "no"}, {"device": 0}])
def test_other_options_are_checked(bad):
    with pytest.raises(InputError, match=next(iter(bad))):
        TrainConfig(**bad)


ODD_RUNS = {
    "a list": lambda run: [run],
    "no step": lambda run: run.pop("step") and None,
    "a step of text": lambda run: run.update(step="4"),
    "a negative step": lambda run: run.update(step=-1),
    "NaN seconds": lambda run: run.update(seconds=float("nan")),
    "a curve of text": lambda run: run.update(curve=[{"step": "1"}]),
    "resumed at a list": lambda run: run.update(resumed_at=[[1]]),
    "an unknown entry": lambda run: run.update(more=1),
    "rng no JSON": lambda run: run.update(rng="{"),
    "rng nested": lambda run: run.update(rng="[" * 100_000),
    "rng of another kind": lambda run: run.update(rng=run["rng"].replace("PCG64", "MT19937")),
    "rng out of range": lambda run: run.update(rng=run["rng"].replace('"state": ', '"state": -').replace("-{", "{")),
    "rng a number": lambda run: run.update(rng=3),
    "weights NaN": lambda run: next(iter(run["network"].values())).fill_(float("nan")),
    "weights a list": lambda run: run.update(network=[1]),
    "no groups": lambda run: run["optimiser"].pop("param_groups") and None,
    "groups a number": lambda run: run["optimiser"].update(param_groups=3),
    "other settings": lambda run: run["optimiser"]["param_groups"][0].update(betas=(2.0, 3.0)),
    "rate NaN": lambda run: run["optimiser"]["param_groups"][0].update(lr=float("nan")),
    "moments of others": lambda run: run["optimiser"]["state"].pop(0) and None,
    "moments of another shape": lambda run: run["optimiser"]["state"][0].update(exp_avg=torch.zeros(3)),
    "moments infinite": lambda run: run["optimiser"]["state"][0]["exp_avg"].fill_(float("inf")),
}


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    """A run of one step."""
    patch = pytest.MonkeyPatch()
    patch.setattr(training, "ClipFeed", InlineFeed)
    patch.setattr(training, "FIRST_CLIPS", 2)
    out = tmp_path_factory.mktemp("run")
    weights_after(out, 1)
    patch.undo()
    return out / "last.pt"


@pytest.mark.parametrize("name", ODD_RUNS)
def test_an_odd_run_to_resume_is_refused_in_one_line(begun, tmp_path, name):
    run = torch.load(begun, weights_only=True)
    changed = ODD_RUNS[name](run)
    torch.save(changed if isinstance(changed, list) else run, tmp_path / "last.pt")
    config = TrainConfig(out=tmp_path)
    with pytest.raises(InputError, match=r"last\.pt") as caught:
        training._Run.begin(config, RECIPES["best"]).load(tmp_path / "last.pt")
    assert "\n" not in str(caught.value)
