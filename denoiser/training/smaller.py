"""A smaller network from a trained larger one, as a beginning for its training (`spikecam train --start`).

Each layer keeps the channels that explain most of all its channels, one after the other.  The convolutions after it are
corrected for those that it lost:

    kept      explains most of the covariance that is left      pivoted Cholesky
    a ~ B a[kept] + c                                            least squares
    W a + b ~ (W B) a[kept] + (b + W c)                          the convolution after

a: the layer's channels, over the pixels of some streams.  For the choice each channel has the weight that the next
convolutions give it.  Source of the idea: Luo et al., "ThiNet", ICCV 2017; choice and correction here are in closed
form.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor, nn

from denoiser.networks.dnss import DnSS
from denoiser.networks.stream_network import StreamDnSS

RIDGE = 1e-4
"""Share of the kept channels' mean variance that is added to each, so that channels which agree can both be kept."""

Weights = dict[str, Tensor]


@dataclass(frozen=True)
class _Seen:
    """Channels where some convolutions read them."""

    module: str
    """Gives them out."""
    readers: tuple[str, ...]
    """Convolutions."""
    first: int = 0
    """Of a reader's inputs, the first of these channels."""


@dataclass(frozen=True)
class _Layer:
    """Channels that must be kept together."""

    size: int
    """0, 1, 2 as in `channels`."""
    makers: tuple[str, ...]
    """Convolutions that make them."""
    seen: tuple[_Seen, ...]


@dataclass
class _Moments:
    """Of channels over pixels: how many pixels, their sums (C,) and the sums of their products (C, C), float64."""

    count: int = 0
    sums: Any = 0.0
    products: Any = field(default=0.0)

    def add(self, channels: Tensor) -> None:
        flat = channels.detach().movedim(1, 0).flatten(1).double()
        self.count += flat.shape[1]
        self.sums = self.sums + flat.sum(dim=1)
        self.products = self.products + flat @ flat.T

    @property
    def mean(self) -> Tensor:
        mean: Tensor = self.sums / self.count
        return mean

    @property
    def covariance(self) -> Tensor:
        covariance: Tensor = self.products / self.count - torch.outer(self.mean, self.mean)
        return covariance


def narrowed(network: StreamDnSS, channels: tuple[int, int, int], run: Callable[[nn.Module], object]) -> StreamDnSS:
    """The network with fewer channels; float32, on the processor.

    Args:
        network: trained.
        channels: at half and at quarter resolution, and of the head.
        run: has the network compute on typical frames.
    """
    layers = _layers(network)
    moments = _moments(network, (seen.module for layer in layers for seen in layer.seen), run)
    weights = {name: value.detach().double() for name, value in network.state_dict().items()}
    for layer in layers:
        _keep(weights, layer, channels[layer.size], moments)
    small = network.with_channels(channels)
    small.load_state_dict({name: value.float() for name, value in weights.items()})
    return small


def without_refine(network: DnSS) -> DnSS:
    """`paper` without its refine module: the layers after it read the other channels."""
    spikes = network.stem[0][0]  # type: ignore[index]
    small = DnSS(window=spikes.in_channels, refine=False)
    weights = {name: value for name, value in network.state_dict().items() if name in small.state_dict()}
    weights["infer.0.0.weight"] = weights["infer.0.0.weight"][:, : spikes.out_channels]
    small.load_state_dict(weights)
    return small


def _layers(network: StreamDnSS) -> list[_Layer]:
    """Of the network, every group of channels whose number depends on `channels`."""
    fine = network.join[1][0].in_channels  # type: ignore[index]
    blocks = range(1, len(network.coarse))
    coarse = (
        *(_Seen(f"coarse.{n - 1}", (f"coarse.{n}.change.0.0",)) for n in blocks),
        _Seen(f"coarse.{len(blocks)}", ("up",)),
    )
    return [
        _Layer(0, ("stem.0",), (_Seen("stem", ("mix.0",)),)),
        _Layer(0, ("mix.0",), (_Seen("mix", ("fine.0",)),)),
        _Layer(0, ("fine.0",), (_Seen("fine", ("coarse.0.0",)), _Seen("fine", ("join.0.0",), fine))),
        _Layer(1, ("coarse.0.0", *(f"coarse.{n}.change.1" for n in blocks)), coarse),
        *(
            _Layer(1, (f"coarse.{n}.change.0.0",), (_Seen(f"coarse.{n}.change.0", (f"coarse.{n}.change.1",)),))
            for n in blocks
        ),
        _Layer(0, ("up",), (_Seen("up", ("join.0.0",)),)),
        _Layer(0, ("join.0.0",), (_Seen("join.0", ("join.1.0",)),)),
        _Layer(0, ("join.1.0",), (_Seen("join.1", ("keep", "out")),)),
        _Layer(2, ("head.0.0",), (_Seen("head.0", ("head.1",)),)),
    ]


def _moments(network: nn.Module, modules: Iterable[str], run: Callable[[nn.Module], object]) -> dict[str, _Moments]:
    """Of the outputs of these modules while `run` has the network compute."""
    found = {name: _Moments() for name in modules}
    hooks = [
        network.get_submodule(name).register_forward_hook(lambda _m, _in, out, of=of: of.add(out))
        for name, of in found.items()
    ]
    try:
        with torch.no_grad():
            run(network)
    finally:
        for hook in hooks:
            hook.remove()
    return found


def _keep(weights: Weights, layer: _Layer, count: int, moments: dict[str, _Moments]) -> None:
    """Leave `count` channels of a layer, in its makers and in those that read it."""
    covariance = sum(_weighed(weights, seen, moments[seen.module].covariance) for seen in layer.seen)
    assert isinstance(covariance, Tensor)
    kept = most_telling(covariance, count)
    for seen in layer.seen:
        of, size = moments[seen.module], len(covariance)
        among = of.covariance[kept][:, kept]
        ridge = RIDGE * among.diagonal().mean() * torch.eye(count, dtype=among.dtype)
        others = torch.linalg.solve(among + ridge, of.covariance[kept]).T  # B, (C, kept)
        rest = of.mean - others @ of.mean[kept]  # c
        for reader in seen.readers:
            whole = _inputs_first(weights, reader)
            before, mine, after = whole.split([seen.first, size, len(whole) - seen.first - size])
            weights[f"{reader}.bias"] = weights[f"{reader}.bias"] + _bias(weights, reader, mine, rest)
            read = torch.einsum("ck,c...->k...", others, mine)
            _set_inputs_first(weights, reader, torch.cat([before, read, after]))
    for maker in layer.makers:
        outputs = 1 if maker == "up" else 0
        weights[f"{maker}.weight"] = weights[f"{maker}.weight"].index_select(outputs, kept)
        weights[f"{maker}.bias"] = weights[f"{maker}.bias"][kept]


def most_telling(covariance: Tensor, count: int) -> Tensor:
    """Numbers (count,) int64, rising, of the channels that explain most of a covariance (C, C), chosen greedily."""
    left = covariance.clone()
    kept: list[int] = []
    for _ in range(count):
        gains = left.square().sum(dim=1) / left.diagonal().clamp(min=1e-12 * float(covariance.diagonal().max()))
        gains[kept] = -1.0
        best = int(gains.argmax())
        kept.append(best)
        pivot = left[best, best].clamp(min=1e-12 * float(covariance.diagonal().max()))
        left = left - torch.outer(left[best], left[best]) / pivot
    return torch.tensor(sorted(kept))


def _weighed(weights: Weights, seen: _Seen, covariance: Tensor) -> Tensor:
    """The covariance with each channel times the norm of its weights in the readers."""
    size = len(covariance)
    squares = sum(
        _inputs_first(weights, reader)[seen.first : seen.first + size].flatten(1).square().sum(dim=1)
        for reader in seen.readers
    )
    assert isinstance(squares, Tensor)
    norm = squares.sqrt()
    return norm[:, None] * covariance * norm


def _inputs_first(weights: Weights, name: str) -> Tensor:
    """Weights (inputs, outputs, height, width) of a convolution."""
    weight = weights[f"{name}.weight"]
    return weight if name == "up" else weight.transpose(0, 1)


def _set_inputs_first(weights: Weights, name: str, value: Tensor) -> None:
    weights[f"{name}.weight"] = value if name == "up" else value.transpose(0, 1)


def _bias(weights: Weights, name: str, mine: Tensor, constant: Tensor) -> Tensor:
    """The effect of constant channels (C,) on the outputs; a mean of four for `up`, whose outputs see one input."""
    over = mine.mean(dim=(2, 3)) if name == "up" else mine.sum(dim=(2, 3))
    return constant @ over
