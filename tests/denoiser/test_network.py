"""The two networks: sizes, parameter counts, starting point."""

from __future__ import annotations

import pytest
import torch
from torch.utils.flop_counter import FlopCounterMode

from denoiser.block_network import BlockDnSS
from denoiser.network import DnSS
from denoiser.recipe import RECIPES


def parameters(network: torch.nn.Module) -> int:
    return sum(p.numel() for p in network.parameters())


@pytest.mark.parametrize(("refine", "published"), [(True, 270_000), (False, 200_000)])
def test_paper_network_has_the_published_number_of_parameters(refine, published):
    count = parameters(DnSS(refine=refine))
    print(f"refine {refine}: {count} parameters, published {published}")
    assert abs(count / published - 1) < 0.05


@pytest.mark.parametrize("mode", ["paper", "best"])
@pytest.mark.parametrize("size", [(16, 16), (13, 18), (1, 1), (7, 30)])
def test_any_size_of_frame_comes_out_as_it_went_in(mode, size):
    recipe = RECIPES[mode]
    network = recipe.network().eval()
    with torch.inference_mode():
        rate = network(torch.zeros(1, recipe.layout.span, *size), torch.zeros(1, recipe.layout.layers, *size))
    assert rate.shape == (1, recipe.layout.planes, *size)
    assert rate.dtype == torch.float32


def test_blend_starts_at_the_inferred_interval():
    """Theta starts at sigmoid(2) = 0.88: a head that starts at the noisy plane stays there."""
    network = DnSS(refine=False).eval()
    spikes = torch.zeros(1, 41, 8, 8)
    with torch.inference_mode():
        noisy_share = float((network(spikes, torch.ones(1, 1, 8, 8)) - network(spikes, torch.zeros(1, 1, 8, 8))).mean())
    print(f"share of the noisy plane {noisy_share:.3f}")
    assert abs(noisy_share - (1 - 0.8808)) < 1e-3


def test_block_network_is_a_twentieth_of_the_work_a_frame():
    def work(network: torch.nn.Module, *inputs: torch.Tensor) -> float:
        with torch.inference_mode(), FlopCounterMode(display=False) as counter:
            network.eval()(*inputs)
        return counter.get_total_flops()

    paper = work(DnSS(), torch.zeros(1, 41, 64, 64), torch.zeros(1, 1, 64, 64))
    best = work(BlockDnSS(), torch.zeros(1, 48, 64, 64), torch.zeros(1, 14, 64, 64)) / 8
    scale = 250 * 400 / 64**2 / 1e9
    print(f"GFLOP a frame at 250 x 400: paper {paper * scale:.1f}, best {best * scale:.2f}")
    assert best < paper / 18
