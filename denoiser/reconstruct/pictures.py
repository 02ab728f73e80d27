"""Pictures from spikes by the name of a method: (T, H, W) spikes and a frame -> (H, W) light [spikes/frame].

    tfp21, tfp41     spikes in the window about the frame / its frames       `spikecam_env.streams.middleTFP`
    tfi              1 / the interval over the frame                         `spikecam_env.streams.middleTFI`
    spk2img-clean    Spk2ImgNet, trained on noise-free spikes                `spk2imgnet.py`
    spk2img-noisy    Spk2ImgNet, trained on noisy spikes                     `spk2imgnet.py`
    ssml             learned from noisy spikes alone                         `ssml.py`

The learned ones see the 41 frames about the frame; before the first and after the last the stream is mirrored (frame
-1 - i is frame i), as the denoiser's windows are.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import nn

from denoiser.ground.number_type import PRECISIONS, computing_in, number_type
from denoiser.ground.torch_threads import where_torch_can
from denoiser.networks.reconstructor_recipe import LEARNED
from denoiser.networks.spk2imgnet import WINDOW
from denoiser.weights import load_reconstructor, reconstructor_path
from spikecam_env.checked import checked_whole
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.streams import middleTFI, middleTFP
from spikecam_env.streams.packing import as_stream, check_values
from spikecam_env.untrusted import existing_file

PLAIN: dict[str, Callable[[NDArray[np.uint8], int], NDArray[np.float32]]] = {
    "tfp21": partial(middleTFP, window=21),
    "tfp41": partial(middleTFP, window=41),
    "tfi": middleTFI,
}
"""Methods without weights."""
RECONSTRUCTORS = (*PLAIN, *LEARNED)
"""Every method by name."""


def reconstruct(
    name: str,
    spikes: ArrayLike,
    t: int,
    *,
    weights: str | os.PathLike[str] | None = None,
    precision: str = "float32",
) -> NDArray[np.float32]:
    """(T, H, W) spikes -> (H, W) float32 light at frame t [spikes/frame], in [0, 1]: `reconstruct_many` of one frame.

    Example:
        reconstruct("spk2img-noisy", spikes, 100)
    """
    light: NDArray[np.float32] = reconstruct_many(name, spikes, [t], weights=weights, precision=precision)[0]
    return light


def reconstruct_many(
    name: str,
    spikes: ArrayLike,
    frames: Iterable[int],
    *,
    weights: str | os.PathLike[str] | None = None,
    precision: str = "float32",
) -> NDArray[np.float32]:
    """(T, H, W) spikes -> (n, H, W) float32 light at n frames [spikes/frame], in [0, 1].

    Args:
        name: of RECONSTRUCTORS.
        spikes: uint8, int8 or bool of 0 and 1.
        frames: numbers from 0 to T - 1, in any order.
        weights: a checkpoint of `spikecam train`, for a learned one, instead of the shipped weights.
        precision: of PRECISIONS; float32 gives nearly the same on every machine, bfloat16 is faster on some.

    Raises:
        InputError: another name or precision, an unusable stream, a frame outside of it, an unusable checkpoint.
    """
    if not isinstance(name, str) or name not in RECONSTRUCTORS:
        raise unknown_name("reconstructor", name, RECONSTRUCTORS)
    if precision not in PRECISIONS:
        raise unknown_name("precision", precision, PRECISIONS)
    stream = as_stream(spikes)
    if not stream.size:
        raise InputError(f"spikes have the shape {stream.shape}; a picture needs a frame and a pixel")
    times = [checked_whole(t, "frame", 0, len(stream) - 1) for t in frames]
    pictures = np.empty((len(times), *stream.shape[1:]), np.float32)
    if name in PLAIN:
        for picture, t in zip(pictures, times, strict=True):
            picture[:] = PLAIN[name](stream, t)
        return pictures
    network = _network(name, weights)
    for picture, t in zip(pictures, times, strict=True):
        picture[:] = light(network, check_values(window_about(stream, t), spikes), precision)
    return pictures


def window_about(stream: NDArray[np.uint8], t: int) -> NDArray[np.uint8]:
    """(T, H, W) -> (41, H, W) the frames about frame t, the stream mirrored at its ends."""
    first, stop = t - WINDOW // 2, t + WINDOW // 2 + 1
    if first >= 0 and stop <= len(stream):
        return stream[first:stop]
    mirrored = np.pad(np.arange(len(stream)), WINDOW // 2, mode="symmetric")
    return stream[mirrored[t : t + WINDOW]]


def light(network: nn.Module, window: NDArray[np.uint8], precision: str = "float32") -> NDArray[np.float32]:
    """(41, H, W) spikes -> (H, W) float32 light at the middle frame by a learned network, cut to [0, 1]."""
    return where_torch_can(lambda: _light(network, window, number_type(precision)))


def _light(network: nn.Module, window: NDArray[np.uint8], kind: torch.dtype) -> NDArray[np.float32]:
    device = next(network.parameters()).device
    spikes = torch.from_numpy(np.ascontiguousarray(window))[None].to(device, kind)
    with torch.inference_mode(), computing_in(kind, device):
        found = network(spikes.contiguous(memory_format=torch.channels_last))
    return np.ascontiguousarray(found[0, 0].float().clamp(0.0, 1.0).cpu().numpy())


def _network(name: str, weights: str | os.PathLike[str] | None) -> nn.Module:
    path = existing_file(reconstructor_path(name) if weights is None else Path(weights))
    found, network = _loaded(path, path.stat().st_mtime_ns)
    if found != LEARNED[name].architecture:
        raise InputError(
            f"{path} holds the network {found}; {name} is a {LEARNED[name].architecture}: give another file"
        )
    return network


@lru_cache(maxsize=4)
def _loaded(path: Path, changed_ns: int) -> tuple[str, nn.Module]:
    """Architecture and network; changed_ns: when the file was written, so that a new one is read."""
    recipe, network, _ = load_reconstructor(path)
    return recipe.architecture, network.to(memory_format=torch.channels_last).requires_grad_(False)  # type: ignore[call-overload]
