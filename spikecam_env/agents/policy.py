"""The network of an agent: it finds places in the pictures, and steers by them.

    maps      = norm(conv(conv(conv(pictures))))                      (M, h, w), of a picture together: mean 0, spread 1

    place     = sum softmax(maps) * (column, row)                     in [-1, 1], an expected place a map

    level     = log mean exp(maps)                                    strength of the thing at that place

    known     = mlp(places, levels, state)                            features

The action's mean, the value and the target's place are linear in the features.

A softmax over places gives positions finer than the maps' pixels with few weights.  Source: Levine et al., JMLR 17
(2016).  Without the norm the maps can grow in the first updates until softmax and tanh are saturated and no gradient
comes back.  Source of the norm: Wu and He, ECCV 2018, with one group.
"""

from __future__ import annotations

from math import log
from typing import Annotated

import torch
from pydantic import Field
from torch import Tensor, nn
from torch.nn.functional import group_norm

from spikecam_env.untrusted import Declared, Side


class PolicyRecipe(Declared):
    """Sizes of a network."""

    channels: Annotated[int, Field(ge=1, le=256)]
    """Channels of an observation's picture."""
    shape: Annotated[tuple[Side, Side], Field(strict=False)]
    """(rows, columns) of the picture."""
    high: Annotated[int, Field(ge=1, le=255)]
    """Largest value of a picture."""
    lags: Annotated[tuple[Annotated[int, Field(ge=0, le=1000)], ...], Field(min_length=1, max_length=16, strict=False)]
    """Steps ago of the pictures that it sees, as of `History`."""
    actions: Annotated[int, Field(ge=1, le=16)]
    """Numbers of an action."""
    pool: Annotated[int, Field(ge=1, le=8)] = 2
    """Side of the squares of pixels that are averaged before anything else."""
    maps: Annotated[int, Field(ge=1, le=64)] = 12
    """Maps whose places are found."""
    width: Annotated[int, Field(ge=1, le=64)] = 16
    """Channels of the convolutions; a quarter of the units of the layers after them."""
    answers: Annotated[int, Field(ge=0, le=16)] = 0
    """Answers that an action can give: its last numbers, after the number that says one.  0 where the task asks
    nothing."""
    sensed: Annotated[int, Field(ge=0, le=64)] = 0
    """Numbers that encoders measure, of an environment with `obs_inner`; 0 where the gaze is observed."""

    @property
    def states(self) -> int:
        """Numbers of the state, as of `History`.

        Example:
            >>> recipe = PolicyRecipe(channels=1, shape=(64, 64), high=255, lags=(0, 2), actions=2)
            >>> recipe.states, recipe.model_copy(update={"sensed": 4}).states
            (5, 9)
        """
        return (self.sensed or 2) * len(self.lags) + 1

    def network(self) -> Policy:
        """A network with random weights."""
        return Policy(self)


class Policy(nn.Module):
    """pictures (N, L C, H, W) uint8 and state (N, S) float32 -> mean of the action (N, A), value (N,)."""

    middle: Tensor
    variance: Tensor
    spread: Tensor
    count: Tensor

    def __init__(self, recipe: PolicyRecipe) -> None:
        super().__init__()
        self.recipe, width, maps = recipe, recipe.width, recipe.maps
        states = recipe.states
        self.eye = nn.Sequential(
            nn.Conv2d(len(recipe.lags) * recipe.channels, width, 5, stride=2, padding=2),
            nn.ReLU(),
            nn.Conv2d(width, width, 3, stride=1 if recipe.pool > 1 else 2, padding=1),
            nn.ReLU(),
            nn.Conv2d(width, maps, 3, padding=1),
        )
        self.sharpness = nn.Parameter(torch.full((maps, 1), SHARPNESS))
        self.register_buffer("middle", torch.zeros(states))
        self.register_buffer("variance", torch.zeros(states))
        self.register_buffer("spread", torch.ones(states))
        self.register_buffer("count", torch.zeros(()))
        self.trunk = nn.Sequential(*_layer(3 * maps + states, 4 * width), *_layer(4 * width, 4 * width))
        self.mean, self.value, self.place = (nn.Linear(4 * width, numbers) for numbers in (recipe.actions, 1, 2))
        nn.init.orthogonal_(self.mean.weight, 0.01)
        nn.init.zeros_(self.mean.bias)
        if recipe.answers:
            self.mean.bias.data[recipe.actions - recipe.answers - 1] = SILENCE
        self.log_sigma = nn.Parameter(torch.full((recipe.actions,), LOG_SIGMA))

    def forward(self, pictures: Tensor, state: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """See the class."""
        maps = group_norm(self.eye(pictures.float() * (GAIN / self.recipe.high)), 1)
        features = torch.cat([self._places(maps), ((state - self.middle) / self.spread).clamp(-5, 5)], dim=1)
        known = self.trunk(features)
        return self.mean(known), self.value(known)[:, 0], self.place(known)

    def scaled(self, place: Tensor) -> Tensor:
        """(N, 2) places (x, y) [pixels] as the network has them: 0 in the middle, 1 at an edge, SEEN at most."""
        half = torch.tensor([(size - 1) / 2 for size in self.recipe.shape[::-1]])
        return (place / half - 1).clamp(-SEEN, SEEN)

    @torch.no_grad()
    def watch(self, state: Tensor) -> None:
        """Learn the scale of the state (N, S): mean and spread of the first SCALED, which then stay."""
        if self.count >= SCALED:
            return
        self.count += len(state)
        share, off = len(state) / self.count, state - self.middle
        self.middle += share * off.mean(dim=0)
        self.variance += share * (off.square().mean(dim=0) - self.variance)
        self.spread.copy_(self.variance.sqrt().clamp(min=LEAST_SPREAD))

    def _places(self, maps: Tensor) -> Tensor:
        count, channels, rows, columns = maps.shape
        flat = maps.reshape(count, channels, -1)
        share = (flat * self.sharpness).softmax(dim=2).reshape(count, channels, rows, columns)
        x = (share.sum(dim=2) * torch.linspace(-1, 1, columns)).sum(dim=2)
        y = (share.sum(dim=3) * torch.linspace(-1, 1, rows)).sum(dim=2)
        level = flat.logsumexp(dim=2) - log(rows * columns)
        return torch.cat([x, y, level], dim=1)


SCALED = 20_000
"""States of which the scale is made: of the first episodes, those of actions at random."""
LEAST_SPREAD = 0.01
"""Of a number of the state that hardly changes."""
SEEN = 1.5
"""Farthest place that the network is asked for, where the target is out of the picture [half sides]."""
GAIN = 2.0
"""Of pictures, so that the first layer sees values of the order of one where the light is 0.05 to 0.6."""
SHARPNESS = 4.0
"""Of the softmax at the start."""
SILENCE = -1.0
"""Mean, at the start, of the number that says an answer: with sigma 0.6 one step in twenty answers by chance."""
LOG_SIGMA = -0.5
"""Of the actions at the start, sigma 0.6: the whole range is tried."""


def _layer(inputs: int, outputs: int) -> tuple[nn.Module, nn.Module]:
    layer = nn.Linear(inputs, outputs)
    nn.init.orthogonal_(layer.weight, 2**0.5)
    nn.init.zeros_(layer.bias)
    return layer, nn.Tanh()
