"""The passes of many streams on a torch device: windows, planes and network lie there, and nothing is copied back.

    frames -> windows (`denoiser.passes.window_torch`) -> network -> rates

The law is that of `on_host.py`, to the rounding of sums: rates differ by less than 1e-5 in float32.  The last passes
of a stream, over mirrored frames, are made by `HostPasses`, with the network where it is.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from denoiser.ground.captured import captured
from denoiser.ground.number_type import computing_in
from denoiser.ground.torch_threads import where_torch_can
from denoiser.passes import infer
from denoiser.passes.engine import Engine
from denoiser.passes.on_host import HostPasses
from denoiser.passes.window import WindowLayout
from denoiser.passes.window_torch import StreamWindows, learned, pushed
from spikecam_env.errors import InputError
from spikecam_env.streams.packing import as_spikes


class DevicePasses:
    """Passes over N streams of frames of one shape, by a network of many planes a pass.  Streams begin anew one by one.

    Args:
        engine: the network, on the device.
        device: of windows and network.
        shape: (rows, columns).
        streams: N.
        first: frame of every stream from which on there are passes.

    Raises:
        InputError: the network has one plane a pass, the layout is one that `StreamWindows` cannot begin, or the
            calibration map has another shape.
    """

    def __init__(
        self, engine: Engine, device: torch.device, shape: tuple[int, int], streams: int = 1, first: int = 0
    ) -> None:
        recipe = engine.recipe
        if not isinstance(recipe.layout, WindowLayout) or recipe.layout.planes == 1:
            raise InputError("a device takes networks of many planes a pass, as mode 'best' is; leave device out")
        self._engine, self.layout, self.shape, self.device = engine, recipe.layout, shape, device
        engine.check_map(shape)
        self._ending: HostPasses | None = None  # makes the last passes of the streams
        self._first, self._skipped = first, 0
        self._windows = StreamWindows.begin(self.layout, streams, shape, device)
        self._calibrate()
        self._carried = tuple(torch.zeros((streams, *size), device=device) for size in recipe.carries(shape))
        self._new = self._frames(streams, self.layout.planes)
        self._begins = torch.ones(streams, dtype=torch.bool, device=device)
        self._waiting = self._frames(streams, self.layout.planes - 1)
        self._waits = np.zeros(streams, np.int64)  # frames of `_waiting` that are some
        self.passes = np.zeros(streams, np.int64)
        """(N,) passes of each, with the one that covers the frames before the first."""
        self._together = self._recorded() if engine.kind == "captured" else self._all_on

    def __len__(self) -> int:
        return len(self._waits)

    def restart(self, which: NDArray[np.bool_]) -> None:
        """Forget these streams (N,): others begin in their place."""
        self._begins |= torch.from_numpy(which).to(self.device)
        self._waits[which], self.passes[which] = 0, 0

    @property
    def covered(self) -> int:
        """Frames of every stream up to which passes are done."""
        if self._ending is not None:
            return self._ending.covered
        return self._first + max(int(self.passes.min()) - 1, 0) * self.layout.planes

    def exchange(self, which: NDArray[np.bool_], others: Any) -> None:
        """InputError, where `HostPasses` exchange streams."""
        raise InputError("streams on a device lie in one memory and cannot be exchanged; leave device out")

    def push(self, new: Tensor) -> list[list[tuple[int, Tensor]]]:
        """(N, K, H, W) uint8 more frames, on the device -> of each stream the passes they complete: first frame, and
        rates (planes, H, W) float32, there."""
        skip = min(self._first - self._skipped, new.shape[1])
        self._skipped += skip
        return where_torch_can(lambda: self._pushed(new[:, skip:]))

    def end(self) -> list[list[tuple[int, Tensor]]]:
        """The streams are over -> the passes that are left."""
        ending = HostPasses(self._engine, self.shape, len(self), self._first)
        for stream in range(len(self)):
            ending.restore(self.state(stream), stream)
        self._ending = ending
        return [[(at, torch.from_numpy(rates).to(self.device)) for at, rates in its] for its in ending.end()]

    def state(self, stream: int = 0) -> dict[str, Any]:
        """Everything on which later passes of a stream depend, as `HostPasses.state` has it."""
        if self._ending is not None:
            return self._ending.state(stream)
        window, carried = self._window_state(stream)
        return {"window": window, "held": None, "carried": carried, "skipped": self._skipped}

    def restore(self, state: dict[str, Any]) -> None:
        """The one stream goes on from `state()`; InputError for arrays of another size or type."""
        ending, window = HostPasses(self._engine, self.shape, 1, self._first), state["window"]
        ending.restore(state)
        self._skipped = int(state["skipped"])
        is_over = 0 < window["start"] > window["seen"] - self.layout.future
        self._ending = ending if is_over else None
        if not is_over:
            self._go_on(window, tuple(state["carried"]))

    @torch.inference_mode()
    def _pushed(self, new: Tensor) -> list[list[tuple[int, Tensor]]]:
        done: list[list[tuple[int, Tensor]]] = [[] for _ in range(len(self))]
        planes, waits = self.layout.planes, self._waits.copy()
        for count in np.unique(waits).tolist():
            numbers = np.flatnonzero(waits == count)
            rows: Any = slice(None) if len(numbers) == len(self) else torch.from_numpy(numbers).to(self.device)
            frames = torch.cat([self._waiting[rows, :count], new[rows]], dim=1)
            for first in range(0, frames.shape[1] - planes + 1, planes):
                rates = self._passed(rows, numbers, frames[:, first : first + planes])
                for number, its in zip(numbers.tolist(), rates, strict=True):
                    if self.passes[number] > 1:
                        done[number].append((self._first + (int(self.passes[number]) - 2) * planes, its))
            left = frames.shape[1] % planes
            self._waiting[rows, :left] = frames[:, frames.shape[1] - left :]
            self._waits[numbers] = left
        return done

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
        spikes = windows.frames.to(self._engine.type).contiguous(memory_format=torch.channels_last)
        with computing_in(self._engine.type, self.device):
            found, left = self._engine.network(spikes, planes, carried)
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
    def _window_state(self, stream: int) -> tuple[dict[str, Any], infer.Carried]:
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
    def _go_on(self, state: dict[str, Any], carried: infer.Carried) -> None:
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
        if (unit := self._engine.unit) is not None:
            self._windows.gain[:] = torch.from_numpy(unit.gain).to(self.device)
            self._windows.dark[:] = torch.from_numpy(unit.dark).to(self.device)
            self._windows.mapped.fill_(1.0)

    def _frames(self, streams: int, count: int) -> Tensor:
        return torch.zeros((streams, count, *self.shape), dtype=torch.uint8, device=self.device)


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
