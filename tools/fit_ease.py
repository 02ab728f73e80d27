"""Fit the shares by which passes are eased into one another (`denoiser.passes.eased`), on training streams of `best`.

    minimise  mean w [ sum_k e_k^2  +  STEADY sum_k (e_k - e_k-1)^2  +  SEAMS (e_0 - e_before)^2 ]

over the shares a_k.  e_k is the error of plane k and a_k times the jump (`jump_between`); e_before is that of the last
plane of the pass before; w = 1 / (rate + OFFSET) as in training.  The sum is a square in the shares: one linear system.

    python -m tools.fit_ease
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import torch
import tyro
from numpy.typing import NDArray
from torch import Tensor

from denoiser.passes.eased import EASE, OFFSET, jump_between
from denoiser.passes.recipe import recipe_of
from denoiser.training.rollout import Rollouts
from denoiser.weights import load_weights
from spikecam_env.cli.table import table
from spikecam_env.numbers import Count, Seed

STEADY, SEAMS = 1.0, 2.0
"""Weights of the steps within a pass, and of the step between two; chosen so that the flicker of training streams falls
by half, and the error of no kind of them rises by more than a hundredth."""
PLANES = 16
FIRST_PASSES = 2
"""Passes of a stream that are left out: the network has no past yet."""
Numbers = NDArray[np.float64]


@dataclass
class Products:
    """Mean products over pixels and seams, by which error and flicker follow from the shares."""

    jump: float = 0.0
    """Of the jump with itself."""
    with_jump: Numbers = field(default_factory=lambda: np.zeros(PLANES + 1))
    """Of each plane's error with the jump; the first is that of the plane before the pass."""
    errors: Numbers = field(default_factory=lambda: np.zeros(PLANES))
    """Squares of each plane's error."""
    steps: Numbers = field(default_factory=lambda: np.zeros(PLANES))
    """Squares of the steps of the error; the first is that between passes."""

    def add(self, rate: Tensor, light: Tensor, before: Tensor, light_before: Tensor) -> None:
        """Take in passes (N, planes, H, W), and the last two planes of the passes before."""
        weight = 1 / (rate[:, :1] + OFFSET)
        jump = jump_between(before.movedim(1, 0), rate.movedim(1, 0))[:, None]
        error = torch.cat([before[:, -1:] - light_before[:, -1:], rate - light], dim=1)
        count = len(rate)
        self.jump += count * float((weight * jump.square()).mean())
        self.with_jump += count * _planes(weight * error * jump)
        self.errors += count * _planes(weight * error[:, 1:].square())
        self.steps += count * _planes(weight * torch.diff(error, dim=1).square())

    def fitted(self, count: int) -> Numbers:
        """Shares of the first `count` planes."""
        own = self.with_jump[1 : count + 1]
        step = np.diff(self.with_jump)[: count + 1]
        weights = np.array([SEAMS, *[STEADY] * count])
        normal = np.eye(count) + np.diag(weights[:-1]) + np.diag(weights[1:])
        normal -= STEADY * (np.eye(count, k=1) + np.eye(count, k=-1))
        right = own + weights[:-1] * step[:-1] - weights[1:] * step[1:]
        return np.asarray(np.linalg.solve(normal * self.jump, -right))

    def figures(self, shares: Numbers) -> dict[str, float]:
        """Error [dB] and flicker with these shares."""
        all_shares = np.concatenate([[0.0], shares, np.zeros(PLANES - len(shares))])
        errors = self.errors + 2 * all_shares[1:] * self.with_jump[1:] + all_shares[1:] ** 2 * self.jump
        leans = np.diff(all_shares)
        steps = self.steps + 2 * leans * np.diff(self.with_jump) + leans**2 * self.jump
        return {
            "error, first plane": float(errors[0] / self.errors[0]),
            "error, all planes": float(errors.mean() / self.errors.mean()),
            "flicker": float(np.sqrt(steps[0] / steps[1:].mean())),
        }


def products(streams: int, passes: int, seed: int) -> dict[str, Products]:
    """Of streams without a map of the camera ("network") and with one ("mapped")."""
    _, network, _ = load_weights("best")
    source = Rollouts(recipe_of("best"), taken=streams, pool=1, patch=64, device=torch.device("cpu"), seed=seed)
    found = {"network": Products(), "mapped": Products()}
    for (_, light_before, kinds_before), (_, light, kinds) in _pairs(source, network, passes):
        for name, (rate, weight) in kinds.items():
            before, weight_before = kinds_before[name]
            seen = (weight > 0) & (weight_before > 0)
            if seen.any():
                found[name].add(rate[seen], light[seen], before[seen, -2:], light_before[seen, -2:])
    return found


Seen = tuple[int, Tensor, dict[str, tuple[Tensor, Tensor]]]
"""Number of a pass, light, and by kind rates and which streams are of it."""


@torch.no_grad()
def _pairs(source: Rollouts, network: torch.nn.Module, passes: int) -> Iterator[tuple[Seen, Seen]]:
    before: Seen | None = None
    for number, (light, guesses) in enumerate(source.guesses(network, passes)):
        now = number, light, {name: guesses[name] for name in ("network", "mapped")}
        if before is not None and number > FIRST_PASSES:
            yield before, now
        before = now


def _planes(values: Tensor) -> Numbers:
    return values.mean(dim=(0, 2, 3)).double().numpy()


@dataclass
class FitEase:
    """Print the shares, and error over that without them and flicker, of training streams."""

    streams: Count = 80
    """Training streams of 64 x 64 pixels."""
    passes: Count = 18
    """Of each stream."""
    seed: Seed = 21
    """Of the streams."""

    def run(self) -> None:
        torch.set_num_threads(1)
        found = products(self.streams, self.passes, self.seed)
        both = Products()
        for one in found.values():
            for name, value in vars(one).items():
                setattr(both, name, getattr(both, name) + value)
        print("EASE =", tuple(round(float(share), 2) for share in both.fitted(len(EASE))))
        for title, shares in (("as the network gives them", np.zeros(1)), ("eased by EASE", np.array(EASE))):
            print(f"\n{title}")
            names = {"network": "no map", "mapped": "a map"}
            print(table([{"streams with": names[kind], **one.figures(shares)} for kind, one in found.items()]))


if __name__ == "__main__":
    tyro.cli(FitEase).run()
