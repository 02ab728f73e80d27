"""Networks that users give: a wrapped one acts as it is, any other that cannot be this recipe's is refused by name."""

from __future__ import annotations

import copy

import numpy as np
import pytest
import torch
from torch import nn

from denoiser import DenoiseObservation, OnlineDnSS, denoise
from denoiser.live import LiveDnSS
from denoiser.passes.recipe import RECIPES
from denoiser.training.train import TrainConfig, started, train
from denoiser.weights import load_weights
from spikecam_env.envs.rotating_disk import RotatingDiskEnv
from spikecam_env.errors import InputError, OwnCodeError

RECIPE = RECIPES["best"]
SPIKES = (np.random.default_rng(0).random((48, 8, 12)) < 0.2).astype(np.uint8)


@pytest.fixture(scope="module")
def network() -> nn.Module:
    return load_weights("best")[1]


def rates(network: nn.Module, recipe=RECIPE, **options) -> np.ndarray:
    online = OnlineDnSS(recipe, network, output="rate", precision="float32", **options)
    return np.concatenate([online.push(SPIKES), online.flush()])


def test_a_compiled_network_runs_compiled(network: nn.Module) -> None:
    """By a compiler of the test's own, which counts the graphs that run and computes them as they are."""
    calls = []

    def counting(graph, example):
        return lambda *given: calls.append(len(given)) or graph.forward(*given)

    wrapped = rates(torch.compile(network, backend=counting))
    print(f"{len(calls)} graphs ran")
    assert calls
    # Of sums in another order, as those of `bench loop`: single precision over some thousand terms.
    np.testing.assert_allclose(wrapped, rates(network), atol=1e-4)


def test_a_network_compiled_in_place_is_refused(network: nn.Module) -> None:
    """torch leaves such compilation out of copies, and the denoiser computes by a copy."""
    given = copy.deepcopy(network)
    given.stem.compile(backend="eager")
    with pytest.raises(InputError, match=r"compiled in place.* give torch\.compile\(network\)"):
        rates(given)


def test_a_hook_of_a_network_acts(network: nn.Module) -> None:
    given = copy.deepcopy(network)
    given.register_forward_hook(lambda module, seen, found: (found[0] * 0.0, found[1]))
    assert not rates(given).any() and rates(network).any()


WRAPPED = {
    "DataParallel": nn.DataParallel,
    "train": lambda network: copy.deepcopy(network).train(),
    "double": lambda network: copy.deepcopy(network).double(),
}


@pytest.mark.parametrize("wrap", WRAPPED.values(), ids=WRAPPED)
def test_a_network_that_is_only_wrapped_or_in_another_state_gives_its_rates(wrap, network: nn.Module) -> None:
    given = wrap(network)
    was_training = given.training
    np.testing.assert_allclose(rates(given), rates(network), atol=1e-4)
    assert given.training == was_training


def test_a_network_in_bfloat16_is_taken(network: nn.Module) -> None:
    assert np.isfinite(rates(copy.deepcopy(network).bfloat16())).all()


def _with(network: nn.Module, value: float) -> nn.Module:
    other = copy.deepcopy(network)
    with torch.no_grad():
        other.out.bias[0] = value
    return other


REFUSED = {
    "of one plane": (lambda n: RECIPES["paper"].network(), "network is a DnSS, the recipe's is a StreamDnSS"),
    "smaller": (lambda n: RECIPES["fast"].network(), r"another recipe: stem.0.weight is \(32.*of this recipe \(64"),
    "compiled smaller": (lambda n: torch.compile(RECIPES["fast"].network()), "another recipe: stem.0.weight is"),
    "without values": (lambda n: copy.deepcopy(n).to("meta"), "stem.0.weight is on the device meta"),
    "NaN": (lambda n: _with(n, np.nan), "out.bias holds values that are not finite"),
    "infinite": (lambda n: _with(n, np.inf), "out.bias holds values that are not finite"),
    "scripted": (lambda n: torch.jit.trace(nn.Linear(2, 2), torch.zeros(1, 2)), "network is a ScriptModule"),
    "weights": (lambda n: n.state_dict(), "network is a OrderedDict; give a torch module"),
    "a class": (lambda n: type(n), "network is the class StreamDnSS"),
    "none": (lambda n: None, "network is a NoneType"),
    "a name": (lambda n: "best", "network is a str"),
}


@pytest.mark.filterwarnings("ignore:.*torch.jit:DeprecationWarning")
@pytest.mark.parametrize("name", REFUSED)
def test_a_network_that_cannot_be_this_recipes_is_refused_by_name(name: str, network: nn.Module) -> None:
    make, said = REFUSED[name]
    with pytest.raises(InputError, match=said):
        OnlineDnSS(RECIPE, make(network))


class Returns(nn.Module):
    """A module of a user's own that returns whatever it is made with."""

    def __init__(self, found) -> None:
        super().__init__()
        self.found = found

    def forward(self, spikes, planes, carried):
        return self.found(spikes, planes)


@pytest.mark.parametrize(
    "found, said",
    [
        (lambda s, p: None, "Returns: it returned a NoneType"),
        (lambda s, p: torch.zeros(1, 16, 8, 12), "it returned a Tensor"),
        (lambda s, p: (torch.zeros(1, 16, 4, 6), None), r"shape \(1, 16, 4, 6\); it must be \(1, 16, 8, 12\)"),
        (lambda s, p: (torch.zeros(1, 1, 8, 12), None), r"rates have shape \(1, 1, 8, 12\)"),
        (lambda s, p: (torch.full((1, 16, 8, 12), np.nan), None), "rates are not all finite"),
        (lambda s, p: 1 / 0, "network Returns: ZeroDivisionError"),
        (lambda s, p: s @ p, "network Returns: RuntimeError"),
    ],
)  # fmt: skip
def test_a_module_of_a_users_own_that_fails_is_named(found, said: str) -> None:
    with pytest.raises(OwnCodeError, match=said):
        OnlineDnSS(RECIPE, Returns(found)).push(SPIKES)


@pytest.mark.parametrize("recipe", [None, "best", {}])
def test_what_is_no_recipe_is_refused(recipe, network: nn.Module) -> None:
    with pytest.raises(InputError, match="give a Recipe"):
        OnlineDnSS(recipe, network)


def test_a_wrapped_network_has_no_device_and_removed_or_unknown_engines_are_named(network: nn.Module) -> None:
    with pytest.raises(InputError, match="and no DataParallel; leave device out"):
        OnlineDnSS(RECIPE, nn.DataParallel(network), device="cpu")
    for engine, why in (("openvino", "engine 'openvino' was removed"), ("onnx", "engine 'onnx'")):
        with pytest.raises(InputError, match=why):
            OnlineDnSS(RECIPE, network, engine=engine)


@pytest.mark.parametrize("given", [nn.Linear(2, 2), None, ["best"], 3])
def test_a_network_in_place_of_a_name_or_path_is_refused(given, tmp_path) -> None:
    for make in (
        lambda: LiveDnSS((8, 12), given),
        lambda: DenoiseObservation(RotatingDiskEnv(shape=(8, 12)), given),
        lambda: denoise(SPIKES, given),
        lambda: OnlineDnSS.from_file(given),
        lambda: started(RECIPE, given, seed=0),
    ):
        with pytest.raises(InputError, match="best"):
            make()
    if given is not None:
        with pytest.raises(InputError):
            train(TrainConfig(mode="best", out=tmp_path, steps=1, start=given))
