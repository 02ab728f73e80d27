"""The passes of many streams on a torch device: windows, planes and network lie there, and nothing is copied back.

    frames -> windows (`denoiser.passes.window_torch`) -> network -> rates

The law is that of `chain.py`, to the rounding of sums: rates differ by less than 1e-5 in float32.  The last
passes of a stream, over mirrored frames, are made on the host by `PassChain`, with the network where it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor, nn

from denoiser.ground.captured import captured
from denoiser.ground.number_type import computing_in
from denoiser.ground.torch_threads import where_torch_can
from denoiser.passes import infer
from denoiser.passes.chain import PassChain, Rates
from denoiser.passes.pixel_map import PixelMap
from denoiser.passes.recipe import Recipe
from denoiser.passes.window_torch import StreamWindows, learned, pushed
from spikecam_env.errors import InputError
from spikecam_env.streams.packing import as_spikes


class DeviceStreams:
    """N streams of frames of one shape before one network of many planes a pass.  Streams begin anew one by one.

    Args:
        recipe: of the network.
        network: on the device, as `infer.prepared` makes it.
        number_type: in which it computes.
        shape: (rows, columns).
        streams: N.
        device: of windows and network.
        unit: calibration map.
        replays: on CUDA, a pass of all streams is recorded once and replayed.

    Raises:
        InputError: the network has one plane a pass, or the layout is one that `StreamWindows` cannot begin.
    """

    def __init__(
        self,
        recipe: Recipe,
        network: nn.Module,
        number_type: torch.dtype,
        shape: tuple[int, int],
        streams: int,
        device: torch.device,
        *,
        unit: PixelMap | None = None,
        replays: bool = False,
    ) -> None:
        if recipe.layout.planes == 1:
            raise InputError("a device takes networks of many planes a pass, as mode 'best' is; leave device out")
        self.layout, self.shape, self.device = recipe.layout, shape, device
        self._network, self._type, self._unit = network, number_type, unit
        self._windows = StreamWindows.begin(self.layout, streams, shape, device)
        self._calibrate()
        self._carried = tuple(torch.zeros((streams, *size), device=device) for size in recipe.carries(shape))
        self._new = self._frames(streams, self.layout.planes)
        self._begins = torch.ones(streams, dtype=torch.bool, device=device)
        self._waiting = self._frames(streams, self.layout.planes - 1)
        self._waits = np.zeros(streams, np.int64)  # frames of `_waiting` that are some
        self.passes = np.zeros(streams, np.int64)
        """(N,) passes of each, with the one that covers the frames before the first."""
        self._together = self._recorded() if replays else self._all_on

    def __len__(self) -> int:
        return len(self._waits)

    def restart(self, which: NDArray[np.bool_]) -> None:
        """Forget these streams (N,): others begin in their place."""
        self._begins |= torch.from_numpy(which).to(self.device)
        self._waits[which], self.passes[which] = 0, 0

    def push(self, new: Tensor) -> list[Tensor]:
        """(N, K, H, W) uint8 more frames, on the device -> N times the rates (F, H, W) float32 they complete, there."""
        return where_torch_can(lambda: self._pushed(new))

    @torch.inference_mode()
    def _pushed(self, new: Tensor) -> list[Tensor]:
        done: list[list[Tensor]] = [[torch.empty((0, *self.shape), device=self.device)] for _ in range(len(self))]
        planes, waits = self.layout.planes, self._waits.copy()
        for count in np.unique(waits).tolist():
            numbers = np.flatnonzero(waits == count)
            rows: Any = slice(None) if len(numbers) == len(self) else torch.from_numpy(numbers).to(self.device)
            frames = torch.cat([self._waiting[rows, :count], new[rows]], dim=1)
            for first in range(0, frames.shape[1] - planes + 1, planes):
                rates = self._passed(rows, numbers, frames[:, first : first + planes])
                for number, its in zip(numbers.tolist(), rates, strict=True):
                    if self.passes[number] > 1:
                        done[number].append(its)
            left = frames.shape[1] % planes
            self._waiting[rows, :left] = frames[:, frames.shape[1] - left :]
            self._waits[numbers] = left
        return [torch.cat(rates) for rates in done]

    def _passed(self, rows: Any, numbers: NDArray[np.int64], new: Tensor) -> Tensor:
        """Rates (n, planes, H, W) of the next pass of some streams; of a first pass they mean nothing."""
        self.passes[numbers] += 1
        if isinstance(rows, slice):
            self._new.copy_(new)
            return self._together()
        return self._on(rows, new)

    def _all_on(self) -> Tensor:
        return self._on(slice(None), self._new)

    def _on(self, rows: Any, new: Tensor) -> Tensor:
        """A pass; the streams' memory is changed in place."""
        windows, planes = pushed(self.layout, self._windows.rows(rows), new, self._begins[rows])
        goes_on = (windows.start > 0)[:, None, None, None]
        carried = tuple(torch.where(goes_on, before[rows], 0.0) for before in self._carried)
        spikes = windows.frames.to(self._type).contiguous(memory_format=torch.channels_last)
        with computing_in(self._type, self.device):
            found, left = self._network(spikes, planes, carried)
        rates: Tensor = found.float().clamp(0.0, 1.0)
        self._windows.put(rows, learned(self.layout, windows, rates))
        for before, now in zip(self._carried, left, strict=True):
            before[rows] = now.float()
        self._begins[rows] = False
        return rates

    @torch.inference_mode()
    def _recorded(self) -> Any:
        """`_all_on`, recorded; the passes that this takes are forgotten."""
        replay = captured(self._all_on, self.device)
        self._begins.fill_(True)
        return replay

    @torch.inference_mode()
    def window_state(self, stream: int) -> tuple[dict[str, Any], infer.Carried]:
        """The state of a stream's window, as of `RollingWindow.state`, and the arrays that its last pass left."""
        layout, passes, waits = self.layout, int(self.passes[stream]), int(self._waits[stream])
        start = max(passes - 1, 0) * layout.planes  # of the next pass
        waiting, windows = self._waiting[stream, :waits], self._windows.rows(torch.tensor([stream], device=self.device))
        known = windows.frames[0, layout.planes + max(layout.past - start, 0) :] if passes else waiting[:0]
        last = windows.last[0] + (start - layout.past)
        arrays = {"frames": torch.cat([known, waiting]), "means": windows.means[0], "sums": windows.sums[0]}
        if not passes:
            arrays |= {"means": torch.zeros_like(windows.means[0]), "sums": torch.zeros_like(windows.sums[0])}
        state: dict[str, Any] = {name: infer.on_host(array) for name, array in arrays.items()}
        state["last"] = infer.on_host(last if passes else torch.full_like(last, -1))
        seen = start + layout.future + waits if passes else waits
        carried = tuple(infer.on_host(c[stream]) for c in self._carried) if passes > 1 else ()
        return state | {"start": start, "seen": seen, "averaged": seen - waits}, carried

    @torch.inference_mode()
    def go_on(self, state: dict[str, Any], carried: infer.Carried) -> None:
        """The one stream goes on from a state of its window, that of a `RollingWindow` too."""
        layout, start = self.layout, int(state["start"])
        self.restart(np.ones(1, bool))
        frames = torch.from_numpy(state["frames"]).to(self.device)[None]
        if start == 0:  # no pass has covered a frame
            self._pushed(frames)
            return
        waits = int(state["seen"]) - start - layout.future
        known = frames[:, : frames.shape[1] - waits]
        windows = self._windows
        windows.frames[:, layout.span - known.shape[1] :] = known
        windows.start.fill_(start - layout.planes)
        windows.last.copy_(torch.from_numpy(state["last"] - np.int32(start - layout.past)))
        windows.means.copy_(torch.from_numpy(state["means"]))
        windows.averaged.fill_(start + layout.future)
        windows.sums.copy_(torch.from_numpy(state["sums"]))
        for ours, theirs in zip(self._carried, carried, strict=True):
            ours.copy_(torch.from_numpy(theirs))
        self._begins.fill_(False)
        self._waiting[:, :waits] = frames[:, frames.shape[1] - waits :]
        self._waits[:], self.passes[:] = waits, start // layout.planes + 1

    def _calibrate(self) -> None:
        if self._unit is not None:
            self._windows.gain[:] = torch.from_numpy(self._unit.gain).to(self.device)
            self._windows.dark[:] = torch.from_numpy(self._unit.dark).to(self.device)
            self._windows.mapped.fill_(1.0)

    def _frames(self, streams: int, count: int) -> Tensor:
        return torch.zeros((streams, count, *self.shape), dtype=torch.uint8, device=self.device)


class DeviceChain:
    """A `PassChain` on a device: rates are tensors there.

    Args:
        streams: one.
        host: a chain with the same network, for the state's form and a stream's last passes.
        first: frame of the stream from which on there are passes.
    """

    def __init__(self, streams: DeviceStreams, host: PassChain, first: int = 0) -> None:
        self._streams, self._host = streams, host
        self._first, self._skipped = first, 0
        self._over = False  # the host goes on
        self.shape = streams.shape

    @property
    def covered(self) -> int:
        """Frames of the stream up to which passes are done."""
        if self._over:
            return self._host.covered
        return self._first + max(int(self._streams.passes[0]) - 1, 0) * self._streams.layout.planes

    def push(self, chunk: Tensor) -> Iterator[tuple[int, Tensor]]:
        """(K, H, W) more frames, on the device -> first frame and rates (F, H, W) of the passes they complete."""
        skip = min(self._first - self._skipped, len(chunk))
        self._skipped += skip
        begin = self.covered
        rates = self._streams.push(chunk[None, skip:])[0]
        planes = self._streams.layout.planes
        yield from ((begin + at, rates[at : at + planes]) for at in range(0, len(rates), planes))

    def end(self) -> Iterator[tuple[int, Tensor]]:
        """The stream is over -> the passes that are left."""
        self._host.restore(self.state())
        self._over = True
        for start, rates in self._host.end():
            yield start, torch.from_numpy(rates).to(self._streams.device)

    def state(self) -> dict[str, Any]:
        """Everything on which later passes depend, as `PassChain.state` has it."""
        if self._over:
            return self._host.state()
        window, carried = self._streams.window_state(0)
        return {"window": window, "held": None, "carried": carried, "skipped": self._skipped}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from `state()`; InputError for arrays of another size or type."""
        self._host.restore(state)
        self._skipped, window = int(state["skipped"]), state["window"]
        self._over = 0 < window["start"] > window["seen"] - self._streams.layout.future
        if not self._over:
            self._streams.go_on(window, self._host.carried)


def spikes_on(spikes: ArrayLike | Tensor, device: torch.device) -> Tensor:
    """Spikes as uint8 on a device.

    Args:
        spikes: (..., K, H, W), an array or a tensor anywhere.
        device: for the result.

    Raises:
        InputError: as `as_spikes`.
    """
    if not isinstance(spikes, Tensor):
        return torch.from_numpy(np.ascontiguousarray(as_spikes(spikes))).to(device)
    if spikes.dtype not in (torch.uint8, torch.int8, torch.bool) or spikes.ndim != 3:
        raise InputError(
            f"spikes are {spikes.dtype} of shape {tuple(spikes.shape)}; a stream is uint8, int8 or bool of shape "
            "(frames, rows, columns)"
        )
    spikes = spikes.to(device)
    frames = spikes.view(torch.uint8)
    if spikes.dtype != torch.bool and bool((frames & 0xFE).any()):  # waits for the device, once
        raise InputError(f"spikes run from {int(spikes.min())} to {int(spikes.max())}; a stream holds 0 and 1 only")
    return frames


def unpacked_on(packed: NDArray[np.uint8] | Tensor, shape: tuple[int, int], device: torch.device) -> Tensor:
    """Packed frames as (K, H, W) uint8 on a device.

    Args:
        packed: (K, ceil(H W / 8)), an array or a tensor anywhere; the first pixel is in the lowest bit.
        shape: (H, W).
        device: for the result.

    Raises:
        InputError: the frames have another width or type.
    """
    rows = (packed if isinstance(packed, Tensor) else torch.from_numpy(np.ascontiguousarray(packed))).to(device)
    pixels = shape[0] * shape[1]
    if rows.dtype != torch.uint8 or rows.ndim != 2 or rows.shape[1] != -(-pixels // 8):
        raise InputError(
            f"packed frames are {rows.dtype} of shape {tuple(rows.shape)}; {shape[0]} x {shape[1]} pixels need uint8 "
            f"of shape (frames, {-(-pixels // 8)})"
        )
    bits = (rows[..., None] >> torch.arange(8, dtype=torch.uint8, device=device)) & 1
    return bits.reshape(len(rows), -1)[:, :pixels].reshape(-1, *shape)


def kept(rates: Iterator[tuple[int, Tensor]]) -> Iterator[tuple[int, Rates]]:
    """The same rates on the host."""
    return ((start, infer.on_host(rate)) for start, rate in rates)
