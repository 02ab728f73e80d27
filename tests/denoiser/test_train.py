"""Training: seeded, resumable, with a record in the file."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from denoiser.online import OnlineDnSS
from denoiser.passes.recipe import RECIPES, PictureRecipe
from denoiser.training import train as training
from denoiser.training.resumable_run import Run
from denoiser.training.rollout import Rollouts
from denoiser.training.simulated import Bank
from denoiser.training.train import TrainConfig, train, validation
from denoiser.training.train_config import command
from denoiser.training.training_source import HeldOut, TrainingSource
from denoiser.weights import load_weights, pretrained_path
from spikecam_env.errors import InputError


@pytest.fixture
def small(monkeypatch, bank):
    """Few textures and units; four streams to validate on."""
    monkeypatch.setattr(Bank, "drawn", lambda *_, **__: bank)
    monkeypatch.setattr(TrainingSource, "held_out", HeldOut(streams=4, patch=64))
    monkeypatch.setattr(training, "NARROWING_STREAMS", 4)


def weights_after(out, steps, mode="best", validate_passes=3, **options):
    """After a training with validations of as few passes as count."""
    config = TrainConfig(mode=mode, out=out, steps=steps, batch=2, patch=16, validate_passes=validate_passes, **options)
    return load_weights(train(config, progress=False))[1].state_dict()


def same(a, b):
    return all(torch.equal(a[name], b[name]) for name in a)


def test_same_seed_same_weights(small, tmp_path):
    first, again = (weights_after(tmp_path / name, 3) for name in ("a", "b"))
    other = weights_after(tmp_path / "c", 3, seed=1)
    assert same(first, again) and not same(first, other)


def test_a_resumed_run_goes_on(small, tmp_path, monkeypatch):
    """Two steps, then the rest of four: weights and moments come back, the streams are others."""
    done, seeds, drawn = training.share_done, [], Rollouts.__init__
    monkeypatch.setattr(Rollouts, "__init__", lambda *a, seed, **o: seeds.append(seed) or drawn(*a, seed=seed, **o))
    monkeypatch.setattr(training, "share_done", lambda config, run: 1.0 if run.step == 2 else done(config, run))
    half = weights_after(tmp_path, 4)
    resumed = Run.begin(RECIPES["best"].network())
    resumed.load(tmp_path / "last.pt")
    assert same(resumed.network.state_dict(), half)
    monkeypatch.setattr(training, "share_done", done)
    whole = weights_after(tmp_path, 4)
    record = load_weights(tmp_path / "best.pt")[2]
    moments = torch.load(tmp_path / "last.pt", weights_only=True)["optimiser"]["moments"]
    assert record["resumed_at"] == [2] and record["steps"] == 4 and float(moments[0]["step"]) == 4
    assert seeds == [0, 2] and not same(half, whole)


@pytest.mark.slow
@pytest.mark.parametrize("mode, passes", [("paper", 13), ("best", 3)])
def test_a_run_leaves_weights_and_a_curve(small, tmp_path, mode, passes):
    weights_after(tmp_path, 3, mode, validate_every=2, validate_passes=passes)
    curve = json.loads((tmp_path / "curve.json").read_text())
    assert [point["step"] for point in curve] == [2]
    assert 0 < curve[0]["network_db"] < 60 and 5 < curve[0]["interval_db"] < 60 and np.isfinite(curve[0]["loss"])
    assert (tmp_path / "curve.png").stat().st_size > 0
    assert {path.name for path in tmp_path.iterdir()} == {f"{mode}.pt", "last.pt", "curve.json", "curve.png"}
    record = load_weights(tmp_path / f"{mode}.pt")[2]
    assert record["steps"] == 3 and record["command"].startswith(f"spikecam train --mode {mode} --out OUT")


def test_a_validation_changes_nothing_in_the_weights(small, tmp_path):
    never, often = (weights_after(tmp_path / str(every), 2, validate_every=every) for every in (1000, 1))
    assert same(never, often)


def test_the_judge_is_the_same_at_every_validation(small):
    torch.manual_seed(0)
    network, scores = RECIPES["best"].network().train(), validation(TrainConfig(validate_passes=3))
    first, again = scores(network), scores(network)
    print(first)
    assert first == again and network.training and set(first) == {"network_db", "mapped_db", "interval_db", "mean_db"}


def test_the_ablation_has_no_refine_module(small, tmp_path):
    weights = weights_after(tmp_path, 1, "paper", refine=False)
    recipe, _, record = load_weights(tmp_path / "paper.pt")
    assert recipe == replace(RECIPES["paper"], refine=False) and not any("texture" in name for name in weights)
    assert "--no-refine" in record["command"].split()


def test_a_narrow_network_is_trained_and_denoises(small, tmp_path):
    """Its file says its channels; those of the shipped one do not, so that older files keep their digests."""
    weights_after(tmp_path, 1, channels=(4, 8, 3))
    recipe, network, record = load_weights(tmp_path / "best.pt")
    assert recipe == replace(RECIPES["best"], channels=(4, 8, 3)) and "--channels 4 8 3" in record["command"]
    counts = [sum(p.numel() for p in n.parameters()) for n in (network, RECIPES["best"].network())]
    print(f"{counts[0]} weights of {counts[1]}")
    assert counts[0] < counts[1] / 20
    assert "channels" in recipe.to_dict() and "channels" not in RECIPES["best"].to_dict()
    rates = OnlineDnSS.from_file(tmp_path / "best.pt", output="rate").push(np.zeros((64, 8, 12), np.uint8))
    assert rates.shape[1:] == (8, 12) and np.isfinite(rates).all()


def test_a_narrow_picture_network_is_trained_and_denoises(small, tmp_path):
    weights_after(tmp_path, 1, mode="picture", channels=(4, 8), validate_passes=None)
    recipe, _, record = load_weights(tmp_path / "picture.pt")
    assert recipe == PictureRecipe(channels=(4, 8)) and "--channels 4 8" in record["command"]
    pictures = OnlineDnSS.from_file(tmp_path / "picture.pt", output="rate").push(np.zeros((80, 8, 12), np.uint8))
    assert pictures.shape == (2, 8, 12) and np.isfinite(pictures).all()


def test_a_run_begins_from_the_weights_that_are_given(small, tmp_path):
    """Its first step hardly moves them; without them it begins elsewhere."""
    given = weights_after(tmp_path / "given", 2)
    options = {"seed": 7, "lr": 1e-9}
    started = weights_after(tmp_path / "started", 1, start=str(tmp_path / "given" / "best.pt"), **options)
    elsewhere = weights_after(tmp_path / "elsewhere", 1, **options)
    shipped = weights_after(tmp_path / "shipped", 1, start="best", **options)
    near = {name: torch.allclose(started[name], given[name], atol=1e-6) for name in given}
    assert all(near.values())
    assert not any(torch.allclose(other["stem.0.weight"], given["stem.0.weight"]) for other in (elsewhere, shipped))


@pytest.mark.parametrize(
    "options",
    [{"start": "paper"}, {"start": "best", "channels": (65, 128, 24)}, {"mode": "paper", "start": "bare"}],
)
def test_weights_of_another_network_are_no_start(small, tmp_path, options):
    """Of another kind, or of a smaller one."""
    bare = tmp_path / "bare"
    if options["start"] == "bare":
        weights_after(bare, 1, "paper", refine=False)
        options = options | {"start": str(bare / "paper.pt")}
    with pytest.raises(InputError, match=r"weights of another network.*as large or larger"):
        train(TrainConfig(**options, out=tmp_path / "run"), progress=False)


@pytest.mark.slow
def test_a_smaller_network_begins_from_what_a_larger_one_has_learnt(small, tmp_path, monkeypatch):
    """Half the channels of `best` begin 5 dB better than untrained ones; without its refine module `paper` goes on."""
    monkeypatch.setattr(training, "NARROWING_PASSES", 6)
    options = {"lr": 1e-9, "validate_every": 1, "validate_passes": 4, "channels": (32, 64, 12)}
    for name, start in (("from_best", "best"), ("untrained", None)):
        weights_after(tmp_path / name, 1, start=start, **options)
    from_best, untrained = (
        json.loads((tmp_path / name / "curve.json").read_text())[0]["network_db"] for name in ("from_best", "untrained")
    )
    print(f"{from_best} dB, untrained {untrained} dB")
    assert from_best > untrained + 5
    weights = weights_after(tmp_path / "bare", 1, "paper", refine=False, start="paper", lr=1e-9)
    shipped = load_weights(pretrained_path("paper"))[1].state_dict()
    assert torch.allclose(weights["stem.0.0.weight"], shipped["stem.0.0.weight"], atol=1e-6)


@pytest.mark.slow
def test_a_network_learns_the_rates_of_a_teacher(small, tmp_path):
    """From its own weights there is nothing to learn; the record names the teacher."""
    options = {"start": "best", "validate_every": 2}
    weights_after(tmp_path, 2, teacher="best", **options)
    weights_after(tmp_path / "light", 2, **options)
    taught, light = (json.loads((tmp_path / out / "curve.json").read_text())[0]["loss"] for out in (".", "light"))
    print(taught, light)
    assert taught < 1e-6 < light
    assert "--teacher best" in load_weights(tmp_path / "best.pt")[2]["command"]


def test_the_last_layers_learn_alone(small, tmp_path):
    options = {"start": "best", "layers": "last", "seams": 1.0, "panned": 0.5, "weak": 0.5}
    learnt = weights_after(tmp_path / "last", 3, **options)
    shipped = load_weights(pretrained_path("best"))[1].state_dict()
    changed = {name.partition(".")[0] for name in shipped if not torch.equal(learnt[name], shipped[name])}
    assert changed == {"join", "out", "head"}
    resumed = weights_after(tmp_path / "last", 4, **options)
    assert not same(resumed, learnt) and torch.equal(resumed["mix.0.weight"], shipped["mix.0.weight"])
    with pytest.raises(InputError, match="layers is 'last'; say from which weights"):
        TrainConfig(mode="best", layers="last")
    with pytest.raises(InputError, match="unknown layers 'some'"):
        TrainConfig(mode="best", start="best", layers="some")


def test_a_teacher_of_another_mode_is_refused(small, tmp_path):
    with pytest.raises(InputError, match="weights of another mode; give a file of this mode"):
        train(TrainConfig(teacher="paper", out=tmp_path), progress=False)
    with pytest.raises(InputError, match="teacher is for best, fast; leave it out for paper"):
        TrainConfig(mode="paper", teacher="best")
    with pytest.raises(InputError, match="teacher is 3; it must be the path of weights"):
        TrainConfig(teacher=3)


def test_minutes_end_a_run(small, tmp_path):
    """A second, of a thousand million steps."""
    weights_after(tmp_path, 10**9, minutes=1 / 60)
    record = load_weights(tmp_path / "best.pt")[2]
    print(record["steps"], "steps")
    assert 1 <= record["steps"] < 1000


def test_the_rate_of_learning_warms_up_and_falls_to_nothing():
    run, rates = Run.begin(torch.nn.Linear(1, 1)), []
    for step, done in ((0, 0.0), (99, 0.0), (1000, 0.5), (2000, 1.0)):
        run.set_rate(training.rate_at(2.0, step, done))
        rates.append(run.optimiser.param_groups[0]["lr"])
    assert rates == pytest.approx([0.02, 2.0, 1.0, 0.0])


@pytest.mark.parametrize(
    "options, expected",
    [
        ({}, "spikecam train --mode best --out OUT"),
        (
            {"mode": "paper", "refine": False, "batch": 48, "minutes": 7.5, "resume": False},
            "spikecam train --mode paper --out OUT --batch 48 --minutes 7.5 --no-refine",
        ),
        (
            {"channels": (32, 64, 12), "compiled": True},
            "spikecam train --mode best --out OUT --compiled --channels 32 64 12",
        ),
    ],
)
def test_a_record_says_what_to_type(options, expected, monkeypatch):
    """And the command takes it for the same options."""
    from spikecam_env.cli.main import run

    taken = []
    monkeypatch.setattr(training, "train", taken.append)
    config = TrainConfig(**options)
    assert command(config) == expected
    assert run(expected.split()[1:]) == 0
    assert taken == [replace(config, out="OUT", resume=True, threads=2)]


def test_the_run_of_another_mode_is_refused(small, tmp_path):
    weights_after(tmp_path, 1, "paper")
    with pytest.raises(InputError, match=r"last\.pt"):
        weights_after(tmp_path, 2, "best")


def test_compiling_without_a_compiler_is_refused(monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CXX", raising=False)
    with pytest.raises(InputError, match="compiler on a processor"):
        TrainConfig(compiled=True)
    assert not TrainConfig().compiled


@pytest.mark.skipif(torch.cuda.is_available(), reason="this machine has a CUDA device")
def test_a_gpu_that_is_not_there_is_refused():
    with pytest.raises(InputError, match="sees 0 CUDA devices; train with --device cpu"):
        TrainConfig(device="cuda")


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device on this machine")
def test_a_network_learns_on_a_gpu(small, tmp_path):
    """To weights that load on a processor, past a validation."""
    weights = weights_after(tmp_path, 6, device="cuda", validate_every=4)
    assert all(w.device.type == "cpu" and bool(torch.isfinite(w).all()) for w in weights.values())


def test_a_gradient_of_unusual_length_is_shortened_to_three_usual_ones():
    network = torch.nn.Linear(3, 2)
    run = Run.begin(network)
    lengths = []
    for size in [*[0.1] * 20, 10.0, 0.1]:
        for weight in network.parameters():
            weight.grad = torch.full_like(weight, size)
        run.shorten_gradients(3.0)
        lengths.append(float(network.bias.grad[0]))
        run.optimiser.step()
    print(f"first {lengths[0]:.3f}, usual {lengths[19]:.3f}, long {lengths[20]:.3f}, after it {lengths[21]:.3f}")
    assert lengths[0] == lengths[19] == lengths[21] == pytest.approx(0.1)
    assert lengths[20] == pytest.approx(0.3, rel=0.02)


COUNTS = ("steps", "batch", "seed", "threads", "patch", "validate_every")
OWN_COUNTS = {
    "best": "validate_passes",
    "picture": "validate_every",
    "paper": "validate_passes",
    "ssml": "frames_a_step",
}
BAD = [
    *({"steps": None}, {"seed": None}, {"steps": 0}, {"batch": 0}, {"mode": None}, {"mode": "worst"}, {"out": 3}),
    *({"out": None}, {"resume": "no"}, {"resume": None}, {"device": 0}, {"device": "tpu"}, {"device": "cuda:x"}),
]
OWN = {
    "best": [{"patch": 97}, {"channels": (8, 8)}, {"channels": (8, 8, 0)}, {"channels": "8 8 8"}, {"start": 3}],
    "picture": [{"channels": (8, 8, 8)}, {"channels": (8, 0)}, {"channels": 8}, {"refine": False}, {"teacher": "best"}],
    "paper": [{"patch": 144}, {"refine": "no"}, {"teacher": "best"}, {"width": 12}],
    "ssml": [{"patch": 193}, {"width": 13}, {"width": 0}, {"refine": False}, {"start": "best"}],
}


@pytest.mark.parametrize("mode", OWN)
def test_unusable_options_are_named_in_one_line(mode):
    counts = [{name: n} for name in (*COUNTS, OWN_COUNTS[mode]) for n in (-1, 10**30, 1.5, float("nan"), True, "8")]
    amounts = [
        {name: amount}
        for name in ("lr", "minutes", "save_every_s")
        for amount in (0.0, -1.0, float("nan"), float("inf"), 1e308, True, "0.1")
    ]
    for bad in (*counts, *amounts, *BAD, *OWN[mode]):
        with pytest.raises(InputError, match=next(iter(bad))) as caught:
            TrainConfig(**({"mode": mode} | bad))
        assert "\n" not in str(caught.value), bad


ODD_RUNS = {
    "a list": lambda run: [run],
    "no step": lambda run: run.pop("step") and None,
    "a step of text": lambda run: run.update(step="4"),
    "a negative step": lambda run: run.update(step=-1),
    "NaN seconds": lambda run: run.update(seconds=float("nan")),
    "a curve of text": lambda run: run.update(curve=[{"step": "1"}]),
    "resumed at a list": lambda run: run.update(resumed_at=[[1]]),
    "an unknown entry": lambda run: run.update(more=1),
    "weights NaN": lambda run: next(iter(run["network"].values())).fill_(float("nan")),
    "weights a list": lambda run: run.update(network=[1]),
    "no network": lambda run: run.pop("network") and None,
    "no settings": lambda run: run["optimiser"].pop("settings") and None,
    "settings a number": lambda run: run["optimiser"].update(settings=3),
    "settings of text": lambda run: run["optimiser"].update(settings="Adam"),
    "other settings": lambda run: run["optimiser"]["settings"][0].update(betas=(2.0, 3.0)),
    "rate NaN": lambda run: run["optimiser"]["settings"][0].update(lr=float("nan")),
    "no moments": lambda run: run["optimiser"].pop("moments") and None,
    "moments of others": lambda run: run["optimiser"]["moments"].pop(0) and None,
    "moments of another shape": lambda run: run["optimiser"]["moments"][0].update(exp_avg=torch.zeros(3)),
    "moments infinite": lambda run: run["optimiser"]["moments"][0]["exp_avg"].fill_(float("inf")),
}


@pytest.fixture(scope="module")
def run_of_one_step(tmp_path_factory, bank):
    """A run of one step."""
    out = tmp_path_factory.mktemp("run")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Bank, "drawn", lambda *_, **__: bank)
        weights_after(out, 1)
    return out / "last.pt"


@pytest.mark.parametrize("name", ODD_RUNS)
def test_an_odd_run_to_resume_is_refused_in_one_line(run_of_one_step, tmp_path, name):
    run = torch.load(run_of_one_step, weights_only=True)
    changed = ODD_RUNS[name](run)
    torch.save(changed if isinstance(changed, list) else run, tmp_path / "last.pt")
    with pytest.raises(InputError, match=r"last\.pt") as caught:
        Run.begin(RECIPES["best"].network()).load(tmp_path / "last.pt")
    assert "\n" not in str(caught.value)
