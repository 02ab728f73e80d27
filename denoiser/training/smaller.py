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
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from denoiser.networks.dnss import DnSS
from denoiser.networks.stream_network import StreamDnSS

RIDGE = 1e-4
"""Share of the kept channels' mean variance that is added to each, so that channels which agree can both be kept."""

Weights = dict[str, Tensor]
"""Of convolutions (inputs, outputs, height, width)."""
Moments = dict[str, tuple[Tensor, Tensor]]
"""By module the mean (C,) and the covariance (C, C) of its channels over pixels, float64."""


class _Seen(NamedTuple):
    """Channels where some convolutions read them."""

    module: str
    """Gives them out."""
    readers: tuple[str, ...]
    """Convolutions."""
    first: int = 0
    """Of a reader's inputs, the first of these channels."""


class _Layer(NamedTuple):
    """Channels that must be kept together."""

    size: int
    """0, 1, 2 as in `channels`."""
    makers: tuple[str, ...]
    """Convolutions that make them."""
    seen: tuple[_Seen, ...]


def narrowed(network: StreamDnSS, channels: tuple[int, int, int], run: Callable[[nn.Module], object]) -> StreamDnSS:
    """The network with fewer channels; float32, on the processor.

    Args:
        network: trained.
        channels: at half and at quarter resolution, and of the head.
        run: has the network compute on typical frames.
    """
    layers = _layers(network)
    moments = _moments(network, (seen.module for layer in layers for seen in layer.seen), run)
    weights = {name: _inputs_first(name, value.double()) for name, value in network.state_dict().items()}
    for layer in layers:
        _keep(weights, layer, channels[layer.size], moments)
    small = network.with_channels(channels)
    small.load_state_dict({name: _inputs_first(name, value).float() for name, value in weights.items()})
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


def _moments(network: nn.Module, modules: Iterable[str], run: Callable[[nn.Module], object]) -> Moments:
    """Of the outputs of these modules while `run` has the network compute."""
    sums: dict[str, list[Any]] = {name: [0, 0.0, 0.0] for name in modules}

    def add(name: str, channels: Tensor) -> None:
        flat, of = channels.movedim(1, 0).flatten(1).double(), sums[name]
        of[:] = of[0] + flat.shape[1], of[1] + flat.sum(dim=1), of[2] + flat @ flat.T

    hooks = [
        network.get_submodule(name).register_forward_hook(lambda _m, _in, out, name=name: add(name, out))
        for name in sums
    ]
    try:
        with torch.no_grad():
            run(network)
    finally:
        for hook in hooks:
            hook.remove()
    means = {name: total / count for name, (count, total, _) in sums.items()}
    return {
        n: (means[n], products / count - torch.outer(means[n], means[n])) for n, (count, _, products) in sums.items()
    }


def _keep(weights: Weights, layer: _Layer, count: int, moments: Moments) -> None:
    """Leave `count` channels of a layer, in its makers and in those that read it."""
    kept = most_telling(
        torch.stack([_weighed(weights, seen, moments[seen.module][1]) for seen in layer.seen]).sum(0), count
    )
    for seen in layer.seen:
        mean, covariance = moments[seen.module]
        among, size = covariance[kept][:, kept], len(covariance)
        ridge = RIDGE * among.diagonal().mean() * torch.eye(count, dtype=among.dtype)
        others = torch.linalg.solve(among + ridge, covariance[kept]).T  # B, (C, kept)
        rest = mean - others @ mean[kept]  # c
        for reader in seen.readers:
            whole = weights[f"{reader}.weight"]
            before, mine, after = whole.split([seen.first, size, len(whole) - seen.first - size])
            over = mine.mean(dim=(2, 3)) if reader == "up" else mine.sum(dim=(2, 3))  # outputs of `up` see one input
            weights[f"{reader}.bias"] = weights[f"{reader}.bias"] + rest @ over
            weights[f"{reader}.weight"] = torch.cat([before, torch.einsum("ck,c...->k...", others, mine), after])
    for maker in layer.makers:
        weights[f"{maker}.weight"] = weights[f"{maker}.weight"][:, kept]
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
    mine = slice(seen.first, seen.first + len(covariance))
    squares = [weights[f"{reader}.weight"][mine].flatten(1).square().sum(dim=1) for reader in seen.readers]
    norm = torch.stack(squares).sum(0).sqrt()
    return norm[:, None] * covariance * norm


def _inputs_first(name: str, value: Tensor) -> Tensor:
    """Between the weights of a convolution and (inputs, outputs, height, width); those of `up` are so."""
    return value.transpose(0, 1) if value.ndim == 4 and not name.startswith("up.") else value
