"""The denoiser as a stream: spikes in, in chunks of any length; denoised spikes out, a fixed latency later.

    window (`window.py`) -> network -> rate [spikes/frame] -> decoder (`mus.py`, `accumulate.py`)

Frame t comes out once frame t + latency has gone in: 20 frames in `paper` mode, 31 in `best`, whose frames come
sixteen at a time.  The output depends on the stream alone, bit for bit: not on how it is cut into chunks, nor on
whether it was saved and restored on the way.  (On one machine and thread count: another may sum in another order.)
"""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator
from itertools import chain as chain_of
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import nn
from tqdm import tqdm

from denoiser.decoders import accumulate, mus
from denoiser.decoders.brightness import brightened, checked_brightness, saturating
from denoiser.passes.crossfade import Crossfade
from denoiser.passes.eased import LEAST_PLANES, Eased
from denoiser.passes.engine import Engine
from denoiser.passes.infer import on_host
from denoiser.passes.on_device import spikes_on, unpacked_on
from denoiser.passes.passes import Passes, passes_of
from denoiser.passes.pixel_map import PixelMap
from denoiser.passes.recipe import AnyRecipe, PictureRecipe
from denoiser.passes.window import check_like
from denoiser.weights import digest, load_weights, pretrained_path
from spikecam_env.calibration import Calibration
from spikecam_env.checked import checked_count
from spikecam_env.errors import InputError, NotReadyError, unknown_name
from spikecam_env.streams.packing import as_spikes, unpack_frames
from spikecam_env.types import Pictures, Spikes

OUTPUTS = ("spikes", "rate", "both")
ENGINES = ("torch", "captured")
_DECODERS: dict[str, Any] = {"mus": mus, "accumulate": accumulate}

Denoised = NDArray[Any] | tuple[NDArray[np.uint8], NDArray[np.float32]]
"""(F, H, W) spikes uint8, or rates float32 [spikes/frame], or both as a pair; F may be 0.  With `device`, tensors there
where the frames that went in were tensors."""


class OnlineDnSS:
    """A denoiser of one stream; the first `push` sets the size of its frames.

    The network is copied: training it further changes nothing here.  For another stream take `another()`.

    Args:
        recipe: of the network.
        network: of the recipe.  A module of another class that takes and gives the same, as `torch.compile(network)`,
            is called as in training; `spikecam bench loop` prints by how much a pass is then slower.
        output: "spikes", "rate" (the network's plane, cut to [0, 1]) or "both"; default: "spikes", and "rate" of a
            network of one picture a step, which gives nothing else.
        stride: `paper` mode only: evaluate every stride-th plane and hold it in between (faster; worse when things
            move).
        precision: of the network; "auto" is bfloat16 where the processor (the GPU, with `device`) has it, else float32.
        engine: "torch", or "captured", with a `device`: on CUDA a pass is then recorded once and replayed.
        decoder: from rates to spikes, "accumulate" (`accumulate.py`) or "mus" (`mus.py`, the paper's);
            default: the recipe's.
        unit: `best` mode only: the calibrated unit: maps (gain, dark) of shape (H, W), a `Calibration` of SNEE, the
            path of its maps.h5, or a `PixelMap`.
        overlap: `best` mode only: two chains of passes, half a pass apart, and their mean (`crossfade.py`): less
            error, no seams, twice the work.
        ease: `best` mode only: the first planes of a pass lean on the last ones of the pass before (`eased.py`): half
            the flicker of the seams, for no more work.
        device: `best` mode only: windows, planes and network as tensors there, "cuda", "cuda:1" or "cpu"
            (`on_device.py`).  In float32 rates differ by less than 1e-5 from those without.  Spikes, and rates with
            `overlap` or `ease`, are made of them on the host.  Default: windows on the processor, in compiled code.
        step: `picture` mode only: frames from a picture to the next, 8 to 4000; default 40.
        look: `picture` mode only: age of a picture, 4 to 24 frames; default 12.
        brightness: spikes are made of rates times this, 0.01 to 100, and cut to one a frame (`saturated`); rates stay
            as they are (`decoders/brightness.py`).

    Raises:
        InputError: unknown options, a network of another recipe or without finite weights, and unusable spikes.
        NotReadyError: a push after `flush`.

    Example:
        >>> online = OnlineDnSS.pretrained("best", output="rate")
        >>> spikes = (np.random.default_rng(0).random((64, 16, 24)) < 0.2).astype(np.uint8)
        >>> [online.push(block).shape for block in (spikes[:32], spikes[32:])], online.flush().shape
        ([(16, 16, 24), (32, 16, 24)], (16, 16, 24))

        One picture a step, of the frame 12 before the newest:

        >>> OnlineDnSS.pretrained("picture", step=16).push(spikes).shape
        (4, 16, 24)
    """

    def __init__(
        self,
        recipe: AnyRecipe,
        network: nn.Module,
        *,
        output: str | None = None,
        stride: int = 1,
        precision: str = "auto",
        engine: str = "torch",
        decoder: str | None = None,
        unit: PixelMap | Calibration | tuple[ArrayLike, ArrayLike] | str | os.PathLike[str] | None = None,
        overlap: bool = False,
        ease: bool = False,
        device: str | torch.device | None = None,
        step: int | None = None,
        look: int | None = None,
        brightness: float = 1.0,
    ) -> None:
        self.engine = Engine.of(
            recipe, network, precision=precision, kind=engine, stride=stride, unit=unit, device=device, step=step,
            look=look,
        )  # fmt: skip
        self.output = self._checked_output(output)
        """The network, ready for passes."""
        if decoder is not None and (not isinstance(decoder, str) or decoder not in _DECODERS):
            raise unknown_name("decoder", decoder, _DECODERS)
        for name, value in (("overlap", overlap), ("ease", ease)):
            if not isinstance(value, bool):
                raise InputError(f"{name} is {value!r}; it must be True or False")
        if decoder is not None and recipe.decoder is None:
            raise InputError(f"decoder is {decoder!r}; a network of one picture a step has no spikes, leave it out")
        if overlap and recipe.layout.planes % 2:
            raise InputError("overlap is True; passes of this network cannot overlap by half, leave it False")
        if ease and recipe.layout.planes < LEAST_PLANES:
            raise InputError("ease is True; this network gives too few planes at once, leave it False")
        if ease and overlap:
            raise InputError("ease is True; passes that overlap have no seams, leave it False")
        self._overlap, self._ease = overlap, ease
        self._brightness = checked_brightness(brightness)
        if self._brightness != 1.0 and recipe.decoder is None:
            raise InputError(
                f"brightness = {brightness:g}; a network of one picture a step has no spikes, leave it out"
            )
        self._decoder = recipe.decoder if decoder is None else decoder
        self._digest = digest(recipe, network.state_dict())
        self.reset()

    @classmethod
    def pretrained(cls, mode: str = "best", **options: Any) -> OnlineDnSS:
        """With the shipped weights of a mode, "best", "fast", "paper" or "picture"."""
        return cls.from_file(pretrained_path(mode), **options)

    @classmethod
    def from_file(cls, path: str | os.PathLike[str], **options: Any) -> OnlineDnSS:
        """With the weights of a checkpoint."""
        recipe, network, _ = load_weights(path)
        return cls(recipe, network, **options)

    @classmethod
    def of_step(cls, weights: str | os.PathLike[str], step: int | None, **options: Any) -> OnlineDnSS:
        """With the weights of a mode or a checkpoint, and pictures of `step` frames where it gives one a step."""
        recipe, network, _ = load_weights(weights)
        return cls(recipe, network, step=step if isinstance(recipe, PictureRecipe) else None, **options)

    def another(self, output: str | None = None) -> OnlineDnSS:
        """A denoiser like this one for another stream, from its first frame, with the same weights; by default the same
        output."""
        other = copy.copy(self)
        other.output = self.output if output is None else self._checked_output(output)
        other.reset()
        return other

    @property
    def overlap(self) -> bool:
        """Whether two chains of passes overlap."""
        return self._overlap

    @property
    def ease(self) -> bool:
        """Whether passes are eased into one another."""
        return self._ease

    @property
    def brightness(self) -> float:
        """Factor between rates and the spikes that are made of them."""
        return self._brightness

    @property
    def saturated(self) -> float:
        """Share of the spikes' pixels and frames so far that are cut to one spike a frame; 0 before the first."""
        return self._cut / self._made if self._made else 0.0

    @property
    def latency(self) -> int:
        """Frames between a frame's arrival and its output, at most."""
        return self.engine.recipe.layout.latency

    @property
    def shape(self) -> tuple[int, int] | None:
        """(rows, columns) of the stream, once known."""
        return self._passes[0].shape if self._passes else None

    def reset(self) -> None:
        """Forget the stream; the next may have another size."""
        self._passes: list[Passes] = []  # of the one stream; two that overlap
        self._as_tensors = False
        self._mixing: Crossfade | None = None
        self._easing: Eased | None = None
        self._decoding: Any = None
        self._made = self._cut = 0  # pixels of the frames so far, and those that saturate
        self._ended = False

    @property
    def device(self) -> torch.device | None:
        """Where windows and network are; None: windows on the processor, in compiled code."""
        return self.engine.device

    def push(self, spikes: ArrayLike | torch.Tensor) -> Denoised:
        """(K, H, W) more spike frames, 0 or 1, K >= 0 -> the frames, or pictures, that they complete (perhaps none)."""
        return self._pushed(spikes, as_tensors=isinstance(spikes, torch.Tensor))

    def push_packed(self, packed: NDArray[np.uint8] | torch.Tensor, shape: tuple[int, int]) -> Denoised:
        """`push` of packed frames.  To a device they go as they are, and are unpacked there.

        Args:
            packed: (K, ceil(H W / 8)) as `pack_frames` packs.
            shape: (H, W).

        Returns:
            As `push`; arrays where `packed` is an array.
        """
        if self.device is None:
            return self.push(unpack_frames(np.asarray(packed), shape))
        return self._pushed(unpacked_on(packed, shape, self.device), as_tensors=isinstance(packed, torch.Tensor))

    def _pushed(self, spikes: ArrayLike | torch.Tensor, *, as_tensors: bool) -> Denoised:
        if self._ended:
            raise NotReadyError("the stream has ended (flush was called); call reset() to begin another")
        chunk = self._checked(spikes)
        self._as_tensors = self.device is not None and as_tensors
        if not self._passes:
            self._begin((chunk.shape[1], chunk.shape[2]))
        return self._denoise([passes.push(chunk[None])[0] for passes in self._passes])

    def flush(self) -> Denoised:
        """End the stream -> its last frames, so that output and input have as many."""
        if not self._passes:
            raise NotReadyError("nothing was pushed yet; push spike frames first")
        self._ended = True
        return self._denoise([passes.end()[0] for passes in self._passes])

    def state(self) -> dict[str, Any]:
        """A copy of everything on which later frames depend, but the weights: plain arrays and numbers, picklable."""
        state: dict[str, Any] = {"of": self._identity(), "shape": self.shape}
        if self._passes:
            state |= {
                "chains": [passes.state() for passes in self._passes],
                "mixing": None if self._mixing is None else self._mixing.state(),
                "easing": None if self._easing is None else self._easing.state(),
                "decoding": copy.deepcopy(self._decoding),
                "made": self._made,
                "cut": self._cut,
                "ended": self._ended,
            }
        return state

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a copy of `state()`; the output may be another one.

        Args:
            state: of a denoiser with the same weights and options.

        Raises:
            InputError: the state is of other weights, recipe, stride, precision or engine, which would go on
                differently, or is no state.  This denoiser is then as it was.
        """
        try:
            for name, ours in self._identity().items():
                if state["of"][name] != ours:
                    raise InputError(
                        f"the state is of a denoiser with {name} {state['of'][name]}, this one has {ours}; "
                        "restore it into one made with the same weights and options"
                    )
            other = self.another()
            if state["shape"] is not None:
                other._begin(state["shape"])
                other._go_on(state)
        except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
            raise InputError(
                f"the state is no whole state of a denoiser ({type(error).__name__}: {error}); "
                "give the result of `OnlineDnSS.state()`"
            ) from error
        self._passes, self._mixing, self._easing = other._passes, other._mixing, other._easing
        self._decoding, self._ended = other._decoding, other._ended
        self._made, self._cut = other._made, other._cut

    def _begin(self, shape: tuple[int, int]) -> None:
        planes = self.engine.recipe.layout.planes
        firsts = (0, planes // 2) if self._overlap else (0,)
        self._passes = [passes_of(self.engine, shape, first=first) for first in firsts]
        self._mixing = Crossfade(planes, shape) if self._overlap else None
        self._easing = Eased(shape) if self._ease else None
        self._decoding = None if self._decoder is None else _DECODERS[self._decoder].start(shape)

    def _go_on(self, state: dict[str, Any]) -> None:
        for passes, its in zip(self._passes, state["chains"], strict=True):
            passes.restore(its)
        if self._mixing is not None:
            self._mixing.restore(state["mixing"])
        if self._easing is not None:
            self._easing.restore(state["easing"])
        for found, ours in zip(state["decoding"] or (), self._decoding or (), strict=True):
            check_like(found, ours, "decoding")
        self._decoding = copy.deepcopy(state["decoding"])
        self._made, self._cut = int(state["made"]), int(state["cut"])
        self._ended = bool(state["ended"])

    def _identity(self) -> dict[str, Any]:
        """The options and weights on which frames depend besides the stream."""
        own = {"recipe and weights": self._digest, "decoder": self._decoder, "overlap": self._overlap}
        own |= {"ease": self._ease}
        return own | {"brightness": self._brightness} | self.engine.identity()

    def _denoise(self, done: list[list[tuple[int, Any]]]) -> Denoised:
        """The frames that these passes complete."""
        device, shape = self.device, self._passes[0].shape
        if device is None:
            return self._decoded(done, shape)
        if self._as_tensors and self.output == "rate" and not (self._overlap or self._ease):
            nothing = torch.empty((0, *shape), device=device)
            return torch.cat([nothing, *(rate for _, rate in done[0])])  # type: ignore[return-value]
        frames = self._decoded([[(at, on_host(rate)) for at, rate in passes] for passes in done], shape)
        if not self._as_tensors:
            return frames
        parts = [torch.from_numpy(part).to(device) for part in (frames if isinstance(frames, tuple) else (frames,))]
        return tuple(parts) if isinstance(frames, tuple) else parts[0]  # type: ignore[return-value]

    def _decoded(self, done: list[list[tuple[int, Pictures]]], shape: tuple[int, int]) -> Denoised:
        rates, spikes = [np.empty((0, *shape), np.float32)], [np.empty((0, *shape), np.uint8)]
        for rate in self._mixed(done):
            if self._decoder is None:
                rates.append(rate)
                continue
            rates.append(rate)
            spikes.append(self._fired(rate))
        if self.output == "spikes":
            return np.concatenate(spikes)
        return np.concatenate(rates) if self.output == "rate" else (np.concatenate(spikes), np.concatenate(rates))

    def _fired(self, rate: Pictures) -> Spikes:
        """Spikes of more rates."""
        bright = brightened(rate, self._brightness)
        self._made += rate.size
        self._cut += saturating(rate, self._brightness)
        fired, self._decoding = _DECODERS[str(self._decoder)].step(bright, self._decoding)
        return np.asarray(fired)

    def _mixed(self, done: list[list[tuple[int, Pictures]]]) -> list[Pictures]:
        if self._easing is not None:
            return [self._easing.add(rate) for _, rate in done[0]]
        if self._mixing is None:
            return [rate for _, rate in done[0]]
        for start, rate in chain_of(*done):
            self._mixing.add(start, rate)
        return [self._mixing.take(min(passes.covered for passes in self._passes))]

    def _checked_output(self, output: str | None) -> str:
        one_picture = self.engine.recipe.decoder is None
        if output is None:
            return "rate" if one_picture else "spikes"
        if not isinstance(output, str) or output not in OUTPUTS:
            raise unknown_name("output", output, OUTPUTS)
        if one_picture and output != "rate":
            raise InputError(f"output is {output!r}; a network of one picture a step gives 'rate' alone")
        return output

    def _checked(self, spikes: ArrayLike | torch.Tensor) -> Any:
        """The frames as an array, or as a tensor on the device."""
        chunk: Any = as_spikes(spikes) if self.device is None else spikes_on(spikes, self.device)
        if min(chunk.shape[1:]) < 1:
            raise InputError(
                f"spikes have shape {tuple(chunk.shape)}; frames must have at least one row and one column"
            )
        if self._passes and tuple(chunk.shape[1:]) != self.shape:
            raise InputError(
                f"spikes have frames of {tuple(chunk.shape[1:])}, the stream has {self.shape}; "
                "call reset() to begin a stream of another size"
            )
        return chunk


def denoise(spikes: ArrayLike, mode: str = "best", *, chunk: int = 256, **options: Any) -> Denoised:
    """Denoise a recording.  The bits are those of the stream pushed piece by piece.

    Args:
        spikes: (T, H, W) recorded.
        mode: "best", "fast", "paper" or "picture".
        chunk: frames that are pushed at a time, to save memory.
        options: as for `OnlineDnSS`.

    Returns:
        T denoised frames; of mode "picture" one for each step, and a last one for the frames that fill none.

    Raises:
        InputError: as `OnlineDnSS`; and for a chunk that is no whole number, 1 or more.

    Example:
        >>> spikes = (np.random.default_rng(0).random((48, 16, 24)) < 0.2).astype(np.uint8)
        >>> rate = denoise(spikes, "best", output="rate")
        >>> rate.shape, rate.dtype
        ((48, 16, 24), dtype('float32'))
    """
    frames, chunk = as_spikes(spikes), checked_count(chunk, "chunk")
    online = OnlineDnSS.pretrained(mode, **options)
    pieces = [online.push(frames[:0]), *(piece for _, piece in pieces_of(online, frames, chunk))]
    if online.output == "both":
        spikes_out, rates_out = zip(*pieces, strict=True)
        return np.concatenate(spikes_out), np.concatenate(rates_out)
    return np.concatenate(pieces)


def pieces_of(
    online: OnlineDnSS, spikes: NDArray[np.uint8], chunk: int = 16, title: str | None = None
) -> Iterator[tuple[int, Any]]:
    """Push a whole stream, and flush it.

    Args:
        online: before its first frame.
        spikes: (T, H, W).
        chunk: frames that are pushed at a time.
        title: of a bar of progress; None: no bar.

    Yields:
        (first, piece): the number of the first denoised frame, and the frames as `push` gives them.  The last piece is
        that of `flush`.
    """
    first = 0
    with tqdm(total=len(spikes), desc=title, unit="frame", leave=False, disable=title is None) as bar:
        for start in range(0, len(spikes) + chunk, chunk):
            piece: Any = online.push(spikes[start : start + chunk]) if start < len(spikes) else online.flush()
            yield first, piece
            count = len(piece[0] if isinstance(piece, tuple) else piece)
            first += count
            bar.update(count)
