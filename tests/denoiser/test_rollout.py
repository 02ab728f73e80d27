"""Training along streams: passes that count, carried arrays, and weights of the loss."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from denoiser.networks.stream_network import CARRY
from denoiser.passes.recipe import RECIPES
from denoiser.training import training_source
from denoiser.training.rollout import Rollouts
from denoiser.training.simulated import StreamBlock

RECIPE = RECIPES["best"]
LAYOUT = RECIPE.layout
CPU = torch.device("cpu")
PATCH = 16


class Flats:
    """Streams of one light, whose spikes are regular; those in `renewed` begin anew at every call."""

    simulated = True

    light = 0.25

    def __init__(self, count, patch, device, seed, *, bank=None, compiled=False, twins=()):
        self.count, self.patch, self.device = count, patch, device
        self.rng = torch.Generator().manual_seed(seed)
        self.renewed, self.fresh, self.taken = [], True, []

    def advance(self, frames, rows):
        self.taken.append(rows.tolist())
        begins = torch.tensor([self.fresh or row in self.renewed for row in rows.tolist()])
        self.fresh = False
        spikes = torch.zeros((len(rows), frames, self.patch, self.patch), dtype=torch.uint8)
        spikes[:, :: round(1 / self.light)] = 1
        return StreamBlock({"noisy": spikes}, torch.full(spikes.shape, self.light), begins)

    def unit(self, rows):
        shape = (len(rows), self.patch, self.patch)
        return torch.full(shape, 1.1), torch.full(shape, 0.01)


class Answers(nn.Module):
    """Always the same rates; it carries on the number of the pass.  `carried`: input of each."""

    def __init__(self, rates):
        super().__init__()
        self.rates, self.carried = torch.as_tensor(rates), []

    def forward(self, spikes, planes, carried):
        self.carried.append(carried)
        count, _, height, width = planes.shape
        number = float(len(self.carried))
        rate = self.rates.reshape(1, -1, 1, 1).expand(count, LAYOUT.planes, height, width)
        last = torch.full((count, 1, height, width), number)
        return rate, (last, torch.full((count, CARRY, height // 2, width // 2), number))


@pytest.fixture
def flats(monkeypatch):
    """Two flats, both taken in every step."""
    monkeypatch.setattr(training_source, "SimulatedStreams", Flats)
    return Rollouts(RECIPE, taken=2, patch=PATCH, device=CPU, seed=0, pool=1)


@pytest.fixture
def simulated(bank):
    return Rollouts(RECIPE, taken=2, patch=32, device=CPU, seed=0, pool=2, bank=bank)


def test_a_few_steps_lower_the_loss(simulated):
    torch.manual_seed(0)
    network = RECIPES["best"].network()
    adam, losses = torch.optim.Adam(network.parameters(), 1e-3), []
    for _ in range(8):
        loss = simulated.loss(network, 2)
        adam.zero_grad()
        loss.backward()
        adam.step()
        losses.append(float(loss.detach()))
    print([round(loss, 4) for loss in losses])
    assert sum(losses[-2:]) < 0.5 * sum(losses[2:4])  # the first two steps have first passes, which do not count
    assert all(weight.grad is not None for weight in network.parameters())


def test_streams_are_taken_in_turn(monkeypatch):
    monkeypatch.setattr(training_source, "SimulatedStreams", Flats)
    flats = Rollouts(RECIPE, taken=2, patch=PATCH, device=CPU, seed=0, pool=2)
    for _ in range(3):
        flats.loss(Answers([0.25] * 16), 2)
    assert flats.streams.taken == [[0, 1], [0, 1], [2, 3], [2, 3], [0, 1], [0, 1]]


def test_a_first_pass_does_not_count(flats):
    wrong = Answers([1.0] * 16)
    first, later = (float(flats.loss(wrong, 1)) for _ in range(2))
    flats.streams.renewed = [1]
    half = float(flats.loss(wrong, 1))
    assert first == 0 and later > 0.5 and half == pytest.approx(later / 2)
    flats.streams.renewed = [0, 1]
    assert float(flats.loss(wrong, 3)) == 0 and set(flats.errors(wrong, 3).values()) == {0.0}


def test_what_is_carried_reaches_the_next_pass_and_not_the_next_stream(flats):
    """From pass to pass and from step to step; a stream's second pass is the first that covers frames of it."""
    network = Answers([0.25] * 16)
    flats.loss(network, 4)
    flats.streams.renewed = [1]
    flats.loss(network, 1)
    flats.streams.renewed = []
    flats.loss(network, 3)
    for part in (0, 1):
        found = [carried[part].amax(dim=(1, 2, 3)).tolist() for carried in network.carried]
        assert all(torch.equal(c[part].amax(dim=(1, 2, 3)), c[part].amin(dim=(1, 2, 3))) for c in network.carried)
        assert found == [[0, 0], [0, 0], [2, 2], [3, 3], [4, 0], [5, 0], [6, 6], [7, 7]]


def test_a_teacher_is_wanted_instead_of_the_light_and_carries_on_its_own(monkeypatch):
    """Rates that rise like the teacher's cost nothing, though the light is another; the light does then cost."""
    monkeypatch.setattr(training_source, "SimulatedStreams", Flats)
    rising = [0.3 + 0.02 * n for n in range(16)]
    losses = {}
    for name, rates in (("teacher's", rising), ("light", [Flats.light] * 16)):
        teacher = Answers(rising)
        flats = Rollouts(RECIPE, taken=2, patch=PATCH, device=CPU, seed=0, pool=1, teacher=teacher)
        network = Answers(rates)
        network.carried = [None] * 10  # so that it counts its passes from 11 on
        losses[name] = [float(flats.loss(network, 1)) for _ in range(5)]
        found = [carried[1].amax(dim=(1, 2, 3)).tolist() for carried in teacher.carried]
        assert found == [[0, 0], [0, 0], [2, 2], [3, 3], [4, 4]]
    print(losses)
    assert losses["teacher's"] == [0] * 5 and all(loss > 0.05 for loss in losses["light"][1:])


def test_gradients_reach_back_through_the_passes(flats):
    """The second pass that counts depends on the arrays that the first one carried on."""

    class Carrying(nn.Module):
        def __init__(self):
            super().__init__()
            self.weight = nn.Parameter(torch.tensor(0.5))

        def forward(self, spikes, planes, carried):
            rate = carried[0].expand(-1, LAYOUT.planes, -1, -1)
            last = self.weight * torch.ones_like(rate[:, :1])
            return rate, (last, torch.zeros_like(carried[1]))

    network = Carrying()
    flats.loss(network, 3).backward()
    assert network.weight.grad is not None and network.weight.grad != 0


def test_an_error_in_the_dark_weighs_eleven_times_as_much_as_at_a_fifth(flats, monkeypatch):
    """(0.2 + 0.02) / 0.02: the divisor."""
    losses = []
    for rate in (0.0, 0.2):
        monkeypatch.setattr(flats.streams, "light", rate + 0.01 if rate else 0.01)
        flats.streams.renewed = [0, 1]
        flats.loss(Answers([rate] * 16), 1)
        flats.streams.renewed = []
        losses.append(float(flats.loss(Answers([rate] * 16), 1)))
    print(losses)
    assert losses[0] / losses[1] == pytest.approx(11, rel=1e-3)


def test_an_error_that_flickers_weighs_three_times_as_much(flats):
    """Of errors +e and -e in turn the steps are 2 e, and half of their squares is added; those that stay have none."""
    flats.loss(Answers([0.25] * 16), 1)
    steady = float(flats.loss(Answers([0.26] * 16), 2))
    flats.streams.renewed = [0, 1]
    flats.loss(Answers([0.25] * 16), 1)
    flats.streams.renewed = []
    flickering = float(flats.loss(Answers([0.26, 0.24] * 8), 2))
    print(flickering / steady)
    assert flickering / steady == pytest.approx(3, rel=0.07)  # 15 steps of 16 in a first pass; the divisor wavers


def test_steps_across_passes_count(flats):
    """An error that is new in a pass: one step of it among sixteen."""
    flats.loss(Answers([0.25] * 16), 2)
    right = float(flats.loss(Answers([0.25] * 16), 1))
    new = float(flats.loss(Answers([0.26] * 16), 1))
    stays = float(flats.loss(Answers([0.26] * 16), 1))
    assert right == pytest.approx(0, abs=1e-9) and new / stays == pytest.approx(1 + 0.5 / 16, rel=1e-3)


def test_seams_weigh_as_they_are_told(monkeypatch):
    """With 1, a step from pass to pass counts as much as the error that it brings, and a half of a sixteenth."""
    monkeypatch.setattr(training_source, "SimulatedStreams", Flats)
    flats = Rollouts(RECIPE, taken=2, patch=PATCH, device=CPU, seed=0, pool=1, seams=1.0)
    flats.loss(Answers([0.25] * 16), 2)
    new, stays = (float(flats.loss(Answers([0.26] * 16), 1)) for _ in range(2))
    assert new / stays == pytest.approx(2 + 0.5 / 16, rel=1e-3)


def test_half_of_the_streams_has_a_map_with_errors_of_a_thousandth_to_a_hundredth(bank):
    streams = Rollouts(RECIPE, taken=300, patch=PATCH, device=CPU, seed=0, pool=1, bank=bank)
    rows, windows = torch.arange(300), streams._windows
    streams._calibrated(windows, torch.ones(300, dtype=torch.bool), rows)
    gain, dark = streams.streams.unit(rows)
    of_gain = (windows.gain / gain - 1).square().mean(dim=(1, 2)).sqrt()
    of_dark = (windows.dark - dark).square().mean(dim=(1, 2)).sqrt() / dark.mean(dim=(1, 2)).clamp(min=1e-9)
    lit = dark.amin(dim=(1, 2)) > 0.05 * dark.mean(dim=(1, 2))  # of these units no dark rate is cut at 0
    print(f"gain {of_gain.min():.5f} to {of_gain.max():.5f}, mapped {windows.mapped.mean():.2f}, lit {int(lit.sum())}")
    assert 0.0008 < of_gain.min() < 0.0012 and 0.008 < of_gain.max() < 0.012
    assert torch.allclose(of_dark[lit], of_gain[lit], rtol=0.25)
    assert abs(float(windows.mapped.mean()) - 0.5) < 5 * 0.5 / 300**0.5
    assert windows.dark.min() >= 0


def test_a_stream_keeps_its_map(bank):
    streams = Rollouts(RECIPE, taken=4, patch=PATCH, device=CPU, seed=0, pool=1, bank=bank)
    rows, windows = torch.arange(4), streams._windows
    streams._calibrated(windows, torch.ones(4, dtype=torch.bool), rows)
    before = {name: getattr(windows, name).clone() for name in ("gain", "dark", "mapped")}
    streams._calibrated(windows, torch.tensor([False, True, False, False]), rows)
    kept = [0, 2, 3]
    assert all(torch.equal(getattr(windows, name)[kept], value[kept]) for name, value in before.items())
    assert not torch.equal(windows.gain[1], before["gain"][1])


def test_errors_are_by_what_guessed(flats):
    """The network is off by 0.1 with or without a map; regular spikes are nearer, but for the gain that it taught."""
    flats.loss(Answers([0.35] * 16), 1)
    flats._windows.mapped = torch.tensor([0.0, 1.0])
    flats._windows.gain = torch.ones_like(flats._windows.gain)
    found = flats.errors(Answers([0.35] * 16), 2)
    print(found)
    assert found["network"] == found["mapped"] == pytest.approx(0.01)
    assert set(found) == {"network", "mapped", "interval", "mean"} and found["interval"] < 0.01 > found["mean"]
