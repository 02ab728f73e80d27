"""The two networks: sizes, parameter counts, starting point."""

from __future__ import annotations

import pytest
import torch
from torch.utils.flop_counter import FlopCounterMode

from denoiser.networks.dnss import DnSS
from denoiser.passes.recipe import RECIPES


def parameters(network: torch.nn.Module) -> int:
    return sum(p.numel() for p in network.parameters())


@pytest.mark.parametrize(("refine", "published"), [(True, 270_000), (False, 200_000)])
def test_paper_network_has_the_published_number_of_parameters(refine, published):
    count = parameters(DnSS(refine=refine))
    print(f"refine {refine}: {count} parameters, published {published}")
    assert abs(count / published - 1) < 0.05


def test_stream_network_has_a_million_parameters():
    count = parameters(RECIPES["best"].network())
    print(f"{count} parameters")
    assert 1.2e6 < count < 1.3e6


@pytest.mark.parametrize("mode", ["paper", "best"])
@pytest.mark.parametrize("size", [(16, 16), (13, 18), (1, 1), (7, 30), (2, 3)])
def test_any_size_of_frame_comes_out_as_it_went_in(mode, size):
    """And carried arrays have the shapes of the recipe, and go in again."""
    recipe, carried = RECIPES[mode], None
    network = recipe.network().eval()
    for _ in range(2):
        spikes, planes = (torch.rand(1, n, *size) for n in (recipe.layout.span, recipe.layout.layers))
        with torch.inference_mode():
            rate, carried = network(spikes, planes, carried)
        assert rate.shape == (1, recipe.layout.planes, *size) and rate.dtype == torch.float32
        assert tuple(tuple(part.shape[1:]) for part in carried or ()) == recipe.carries(size)
        assert all(part.dtype == torch.float32 for part in carried or ())


def test_nothing_carried_is_zeros_carried():
    recipe = RECIPES["best"]
    network = recipe.network().eval()
    spikes, planes = torch.rand(1, recipe.layout.span, 9, 6), torch.rand(1, recipe.layout.layers, 9, 6)
    zeros = tuple(torch.zeros(1, *shape) for shape in recipe.carries((9, 6)))
    with torch.inference_mode():
        first, (last, hidden) = network(spikes, planes, None)
        assert torch.equal(first, network(spikes, planes, zeros)[0])
        again = network(spikes, planes, (last, hidden))[0]
    assert torch.equal(last, first[:, -1:].clamp(0, 1)) and hidden.abs().max() <= 1
    assert not torch.equal(again, first), "carried arrays matter"


def test_an_uncalibrated_unit_ignores_the_shares_of_the_means():
    """A head that asks for one of the means alone gets it where the unit is calibrated, else the rate as it was."""
    recipe = RECIPES["best"]
    network, layout = recipe.network().eval(), recipe.layout
    spikes, planes = torch.rand(2, layout.span, 8, 8), torch.rand(2, layout.layers, 8, 8)
    planes[:, -1] = torch.tensor([0.0, 1.0]).reshape(2, 1, 1)
    with torch.inference_mode():
        before = network(spikes, planes)[0]
        network.head[-1].bias[layout.planes + 1] += 50.0  # of the second mean
        after = network(spikes, planes)[0]
    mean = planes[1, layout.means[0] + 1].expand(layout.planes, 8, 8)
    assert torch.equal(after[0], before[0]) and torch.allclose(after[1], mean, atol=1e-5)


def test_the_means_have_a_fifth_of_the_rate_at_first():
    """Of a calibrated unit, where the network says nothing: neither all nor next to nothing."""
    recipe = RECIPES["best"]
    network, layout = recipe.network().eval(), recipe.layout
    for part in (network.out, network.head[-1]):
        torch.nn.init.zeros_(part.weight)
        torch.nn.init.zeros_(part.bias)
    spikes, planes = torch.rand(1, layout.span, 8, 8), torch.rand(1, layout.layers, 8, 8)
    planes[:, slice(*layout.means)], planes[:, -1] = 1.0, 1.0
    with torch.inference_mode():
        share = float(network(spikes, planes)[0].mean())
    print(f"share of the means {share:.3f}")
    assert 0.1 < share < 0.4


def test_blend_starts_at_the_inferred_interval():
    """Theta starts at sigmoid(2) = 0.88: a head that starts at the noisy plane stays there."""
    network = DnSS(refine=False).eval()
    spikes = torch.zeros(1, 41, 8, 8)
    with torch.inference_mode():
        bright, dark = (network(spikes, torch.full((1, 1, 8, 8), value))[0] for value in (1.0, 0.0))
    noisy_share = float((bright - dark).mean())
    print(f"share of the noisy plane {noisy_share:.3f}")
    assert abs(noisy_share - (1 - 0.8808)) < 1e-3


def test_stream_network_is_a_sixteenth_of_the_work_a_frame():
    def work(mode: str) -> float:
        """GFLOP a frame of 250 x 400 pixels."""
        layout = RECIPES[mode].layout
        spikes, planes = torch.zeros(1, layout.span, 64, 64), torch.zeros(1, layout.layers, 64, 64)
        with torch.inference_mode(), FlopCounterMode(display=False) as counter:
            RECIPES[mode].network().eval()(spikes, planes)
        return counter.get_total_flops() / layout.planes * (250 * 400 / 64**2) / 1e9

    paper, best = work("paper"), work("best")
    print(f"GFLOP a frame at 250 x 400: paper {paper:.1f}, best {best:.2f}, {paper / best:.1f} times less")
    assert best < paper / 16
