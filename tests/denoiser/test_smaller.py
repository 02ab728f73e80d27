"""A smaller network from a larger one: its channels, and that nothing is lost where nothing has to be."""

from __future__ import annotations

import torch

from denoiser.networks.dnss import DnSS
from denoiser.networks.stream_network import StreamDnSS
from denoiser.passes.recipe import RECIPES
from denoiser.training import smaller
from denoiser.training.smaller import narrowed, without_refine

SMALL, WIDE = (4, 8, 3), (8, 16, 6)
LAYOUT = RECIPES["best"].layout


def network_of(channels) -> StreamDnSS:
    torch.manual_seed(3)
    return StreamDnSS(LAYOUT.span, LAYOUT.layers, LAYOUT.planes, LAYOUT.means, channels).eval()


def seen_by(network):
    """Rate and carried arrays, of two passes over frames that are always the same."""
    rng = torch.Generator().manual_seed(1)
    spikes = (torch.rand((2, LAYOUT.span, 16, 16), generator=rng) < 0.2).float()
    planes = torch.rand((2, LAYOUT.layers, 16, 16), generator=rng)
    with torch.no_grad():
        _, carried = network(spikes, planes)
        rate, (_, hidden) = network(spikes, planes, carried)
    return torch.cat([rate.flatten(), hidden.flatten()])


def doubled(network, share=0.3) -> StreamDnSS:
    """The same function by twice the channels: each there twice, read with `share` and the rest of its weights."""
    weights = {name: value.clone() for name, value in network.state_dict().items()}
    for layer in smaller._layers(network):
        for maker in layer.makers:
            across = 1 if maker == "up" else 0
            weights[f"{maker}.weight"] = torch.cat([weights[f"{maker}.weight"]] * 2, across)
            weights[f"{maker}.bias"] = torch.cat([weights[f"{maker}.bias"]] * 2)
        for seen in layer.seen:
            for reader in seen.readers:
                along = 0 if reader == "up" else 1
                whole, size = weights[f"{reader}.weight"], network.get_submodule(layer.makers[0]).bias.numel()
                first = (
                    seen.first and whole.shape[along] - size
                )  # the doubled channels before them may be there already
                before, mine, after = whole.split([first, size, whole.shape[along] - first - size], along)
                weights[f"{reader}.weight"] = torch.cat([before, share * mine, (1 - share) * mine, after], along)
    wide = network_of(WIDE)
    wide.load_state_dict(weights)
    return wide


def test_channels_that_are_there_twice_are_kept_once_and_nothing_is_lost():
    small = network_of(SMALL)
    wide = doubled(small)
    expected = seen_by(small)
    assert torch.allclose(seen_by(wide), expected, atol=1e-5)
    again = seen_by(narrowed(wide, SMALL, seen_by))
    error = float((again - expected).std() / expected.std())
    print(f"error {error:.1e} of the spread")
    assert error < 1e-2


def test_a_narrower_network_is_nearer_than_one_of_chosen_channels_without_correction(monkeypatch):
    """The lost channels are read off the kept ones."""
    wide = network_of(WIDE)
    expected = seen_by(wide)

    def error():
        return float((seen_by(narrowed(wide, SMALL, seen_by)) - expected).std())

    corrected = error()
    monkeypatch.setattr(smaller, "RIDGE", 1e9)  # the kept channels then say nothing of any
    print(f"{corrected:.4f} {error():.4f}")
    assert corrected < 0.8 * error()


def test_the_network_is_left_as_it_was():
    wide = network_of(WIDE)
    before = {name: value.clone() for name, value in wide.state_dict().items()}
    narrowed(wide, SMALL, seen_by)
    assert all(torch.equal(value, before[name]) for name, value in wide.state_dict().items())
    assert not any(module._forward_hooks for module in wide.modules())


def test_without_its_refine_module_the_rest_of_paper_is_the_same():
    torch.manual_seed(0)
    whole = DnSS().eval()
    rest = without_refine(whole)
    assert not rest.refine and sum(p.numel() for p in rest.parameters()) < 0.8 * sum(
        p.numel() for p in whole.parameters()
    )
    spikes = (torch.rand((1, 41, 16, 16)) < 0.2).float()
    with torch.no_grad():
        assert torch.equal(whole.denoise(whole.stem(spikes)), rest.denoise(rest.stem(spikes)))
        rates, _ = rest(spikes, torch.rand((1, 1, 16, 16)))
    assert bool(torch.isfinite(rates).all())
