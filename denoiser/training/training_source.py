"""The sources of all training: streams from which networks learn, and by which one of them is judged.

A mode is added by a class of `TrainingSource` and its row in `train_config.SOURCES`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar, NamedTuple, TypeAlias

import torch
from torch import Tensor, nn

from denoiser.ground.number_type import number_type
from denoiser.training.recorded import RecordedStreams
from denoiser.training.simulated import TWINS, Bank, SimulatedStreams, in_turn
from spikecam_env.datasets import TwinRecording


class HeldOut(NamedTuple):
    """Streams of a validation."""

    streams: int
    patch: int | None = None
    """Their side [pixels]; None: that of the training."""
    passes: int | None = None
    """Passes along them; None: the option `validate_passes`."""


class TrainingSource(ABC):
    """Streams that networks of a recipe learn from, some of them a step."""

    options: ClassVar[dict[str, Any]] = {
        "batch": 16,
        "validate_every": 1000,
        "validate_passes": 24,
        "start": None,
        "recordings": (),
    }
    """Options of `TrainConfig` that not every mode has alike: those of this one, with their defaults."""
    sides: ClassVar[range] = range(16, 129, 16)
    """Of a patch [pixels]."""
    held_out: ClassVar[HeldOut] = HeldOut(streams=8, patch=64)
    whole_bank: ClassVar[bool] = False
    """A short training draws as many textures and units as a long one."""
    streams: Any
    """With the `device` of the step and the generator `rng` of its draws."""

    @abstractmethod
    def __init__(self, recipe: Any, **streams: Any) -> None:
        """With the arguments of `StreamSource`."""

    @staticmethod
    def networks(recipe: Any) -> nn.Module:
        """The untrained network, or an `nn.ModuleDict` of those that learn together; "student" is the one to keep."""
        network: nn.Module = recipe.network()
        return network

    @abstractmethod
    def loss(self, network: nn.Module) -> Tensor:
        """The loss of the next step, with gradients; `network` as `networks` gives it."""

    @abstractmethod
    def errors(self, network: nn.Module, passes: int) -> dict[str, float]:
        """Mean squared errors against the light in the next passes, by guess: the network's ("network") and simpler
        ones."""


Guesses: TypeAlias = tuple[Tensor, dict[str, tuple[Tensor, Tensor]]]
"""Light of N streams (N, planes, H, W); by name guesses of it, and the streams' weights (N,)."""


class StreamSource(TrainingSource):
    """Simulated streams, or streams of recordings, taken in turn.

    Args:
        recipe: of the network.
        taken: streams a step.
        patch: their side [pixels].
        device: of the streams.
        seed: everything follows from it.
        pool: streams for each one of a step; default: `pool` of the class.
        bank: as for `SimulatedStreams`.
        compiled: as for `SimulatedStreams`.
        recordings: from which streams are cut instead of being simulated.
        held_out: whether these are for validation (`recorded.py`).
        scenes: shares of simulated scenes that are panned, and of weak texture, as for `SimulatedStreams`.
    """

    pool: ClassVar[int] = 1
    twins: tuple[str, ...] = TWINS

    def __init__(
        self,
        recipe: Any,
        *,
        taken: int,
        patch: int,
        device: torch.device,
        seed: int,
        pool: int | None = None,
        bank: Bank | None = None,
        compiled: bool = False,
        recordings: Sequence[TwinRecording] = (),
        held_out: bool = False,
        **scenes: float,
    ) -> None:
        self.taken = taken
        count = taken * (self.pool if pool is None else pool)
        if recordings:
            self.streams = RecordedStreams(list(recordings), held_out, count, patch, device, seed, self.twins)
        else:
            drawn: dict[str, Any] = {"bank": bank, "compiled": compiled, "twins": self.twins, **scenes}
            self.streams = SimulatedStreams(count, patch, device, seed, **drawn)
        self._type = number_type("auto", device)
        self._next = torch.zeros((), dtype=torch.int64, device=device)

    @abstractmethod
    def guesses(self, network: nn.Module, passes: int) -> Iterator[Guesses]:
        """Guesses of the light in the next passes."""

    @torch.no_grad()
    def errors(self, network: nn.Module, passes: int) -> dict[str, float]:
        sums: dict[str, Any] = {}
        counts: dict[str, Any] = {}
        for light, guesses in self.guesses(network, passes):
            for name, (guess, weight) in guesses.items():
                error = (weight * (guess - light).square().mean(dim=(1, 2, 3))).sum()
                sums[name] = sums.get(name, 0.0) + error
                counts[name] = counts.get(name, 0.0) + weight.sum()
        return {name: float(total / counts[name].clamp(min=1)) for name, total in sums.items()}

    def _turn(self) -> Tensor:
        """Numbers (taken,) of the streams whose turn it is."""
        return in_turn(self._next, self.taken, self.streams.count)
