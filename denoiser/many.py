"""The denoiser of many streams at once: every pass of the network is one call for all streams that have one due.

    windows of N streams -> one batch through the network -> rates of each

Each stream has its own window, memory and length: one can begin anew while the others go on.  The rates are those of N
`OnlineDnSS`, to the rounding of sums, which a batch may take in another order.  Where the denoiser has a device,
everything is there (`denoiser.passes.on_device`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from denoiser.online import OnlineDnSS
from denoiser.passes import infer
from denoiser.passes.chain import PassChain, Rates
from denoiser.passes.window import PassWindow
from spikecam_env.checked import checked_count, checked_shape
from spikecam_env.errors import InputError


class ManyDnSS:
    """Denoisers of many streams with frames of one shape; the output is the rate.

    Args:
        like: gives recipe, weights, stride, precision, unit and device; its own stream is not touched.
        streams: how many.
        shape: (rows, columns).

    Raises:
        InputError: the denoiser has `overlap`, or spikes of another size are pushed.
    """

    def __init__(self, like: OnlineDnSS, streams: int, shape: tuple[int, int]) -> None:
        if like.overlap:
            raise InputError("overlap is True; many streams are denoised by one chain of passes each, leave it False")
        self._like, self.shape = like, checked_shape(shape)
        self._count = checked_count(streams, "streams")
        self._on_device = None if like.device is None else like.streams_on_device(self._count, self.shape)
        self._chains = [self._chain() for _ in range(self._count if self._on_device is None else 0)]

    def __len__(self) -> int:
        return self._count

    @property
    def latency(self) -> int:
        """Frames between a frame's arrival and its output, at most."""
        return self._like.latency

    def restart(self, which: NDArray[np.bool_]) -> None:
        """Forget these streams (N,): others begin in their place."""
        if self._on_device is not None:
            self._on_device.restart(which)
            return
        for stream in np.flatnonzero(which):
            self._chains[stream] = self._chain()

    def exchange(self, which: NDArray[np.bool_], others: ManyDnSS) -> None:
        """Put the streams of others, mid-way, in the place of some of these.

        Args:
            which: (N,) those that go.
            others: as many streams of the same denoiser; nothing is to be pushed to them any more.

        Raises:
            InputError: where the denoiser is on a device.
        """
        if self._on_device is not None or others._on_device is not None:
            raise InputError("streams on a device lie in one memory and cannot be exchanged; leave device out")
        for stream, chain in zip(np.flatnonzero(which), others._chains, strict=True):
            self._chains[stream] = chain

    def push(self, spikes: Any) -> list[Any]:
        """(N, K, H, W) uint8 more frames of every stream -> N times the frames (F, H, W) they complete; F may be 0.

        Returns:
            Arrays; with a device, tensors there where `spikes` is a tensor.
        """
        given = tuple(spikes.shape)
        if len(given) != 4 or given[0] != len(self) or given[2:] != self.shape:
            raise InputError(f"spikes are {given}; they must be ({len(self)}, frames, *{self.shape})")
        if self._on_device is not None:
            if isinstance(spikes, torch.Tensor):
                return self._on_device.push(spikes.to(self._on_device.device))
            return [
                infer.on_host(rate)
                for rate in self._on_device.push(torch.from_numpy(spikes).to(self._on_device.device))
            ]
        due = [chain.windows(chunk) for chain, chunk in zip(self._chains, spikes, strict=True)]
        done: list[list[Rates]] = [[np.empty((0, *self.shape), np.float32)] for _ in self._chains]
        for windows in _rounds(due):
            for stream, rates in self._passed(windows):
                done[stream].append(rates)
        return [np.concatenate(rates) for rates in done]

    def _passed(self, windows: dict[int, PassWindow]) -> Iterator[tuple[int, Rates]]:
        """The rates of one window of each of these streams."""
        wanted = {n: window for n, window in windows.items() if self._chains[n].wants(window)}
        carried = [self._chains[n].carried for n in wanted]
        found = self._like.passes(list(wanted.values()), carried) if wanted else []
        results: dict[int, tuple[Rates, infer.Carried]] = dict(zip(wanted, found, strict=True))
        for stream, window in windows.items():
            yield stream, self._chains[stream].passed(window, results.get(stream))[1]

    def _chain(self) -> PassChain:
        return self._like.chain(self.shape)


def _rounds(due: list[Iterator[PassWindow]]) -> Iterator[dict[int, PassWindow]]:
    """The next window of every stream that has one, until none has."""
    while True:
        windows = {n: window for n, stream in enumerate(due) if (window := next(stream, None)) is not None}
        if not windows:
            return
        yield windows
