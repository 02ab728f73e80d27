"""The denoiser of many streams at once: every pass of the network is one call for all streams that have one due.

    windows of N streams -> one batch through the network -> rates of each

Each stream has its own window, memory and length: one can begin anew while the others go on.  The rates are those of N
`OnlineDnSS`, to the rounding of sums, which a batch may take in another order.  Where the denoiser has a device,
everything is there (`denoiser.passes.on_device`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from denoiser.online import OnlineDnSS
from denoiser.passes.infer import on_host
from denoiser.passes.passes import passes_of
from spikecam_env.checked import checked_count, checked_shape
from spikecam_env.errors import InputError


class ManyDnSS:
    """Denoisers of many streams with frames of one shape; the output is the rate.

    Args:
        like: gives recipe, weights, stride, precision, unit and device; its own stream is not touched.
        streams: how many.
        shape: (rows, columns).

    Raises:
        InputError: the denoiser has `overlap` or `ease`, or spikes of another size are pushed.
    """

    def __init__(self, like: OnlineDnSS, streams: int, shape: tuple[int, int]) -> None:
        for name in ("overlap", "ease"):
            if getattr(like, name):
                raise InputError(f"{name} is True; passes of many streams are given as they are, leave it False")
        self._like, self.shape = like, checked_shape(shape)
        self._passes = passes_of(like.engine, self.shape, checked_count(streams, "streams"))
        self.finished = np.zeros(len(self), np.int64)
        """(N,) frame after the newest output of each stream; 0 before the first."""

    def __len__(self) -> int:
        return len(self._passes)

    @property
    def latency(self) -> int:
        """Frames between a frame's arrival and its output, at most."""
        return self._like.latency

    def restart(self, which: NDArray[np.bool_]) -> None:
        """Forget these streams (N,): others begin in their place."""
        self._passes.restart(which)
        self.finished[which] = 0

    def exchange(self, which: NDArray[np.bool_], others: ManyDnSS) -> None:
        """Put the streams of others, mid-way, in the place of some of these.

        Args:
            which: (N,) those that go.
            others: as many streams of the same denoiser; nothing is to be pushed to them any more.

        Raises:
            InputError: where the denoiser is on a device.
        """
        self._passes.exchange(which, others._passes)
        self.finished[which] = others.finished

    def push(self, spikes: Any) -> list[Any]:
        """(N, K, H, W) uint8 more frames of every stream -> N times the frames (F, H, W) they complete; F may be 0.

        Returns:
            Arrays; with a device, tensors there where `spikes` is a tensor.
        """
        given = tuple(spikes.shape)
        if len(given) != 4 or given[0] != len(self) or given[2:] != self.shape:
            raise InputError(f"spikes are {given}; they must be ({len(self)}, frames, *{self.shape})")
        device = self._like.device
        if device is None:
            nothing = np.empty((0, *self.shape), np.float32)
            return [np.concatenate([nothing, *(r for _, r in its)]) for its in self._finish(self._passes.push(spikes))]
        new = spikes if isinstance(spikes, torch.Tensor) else torch.from_numpy(spikes)
        none = torch.empty((0, *self.shape), device=device)
        rates = [torch.cat([none, *(r for _, r in its)]) for its in self._finish(self._passes.push(new.to(device)))]
        return rates if new is spikes else [on_host(its) for its in rates]

    def _finish(self, done: list[list[tuple[int, Any]]]) -> list[list[tuple[int, Any]]]:
        """These passes, once noted."""
        for n, passes in enumerate(done):
            if passes:
                start, rates = passes[-1]
                self.finished[n] = start + len(rates)
        return done
