"""Pictures from spikes: texture from playback (TFP) and texture from interval (TFI).

    TFP(t) = spikes in a window about t / frames in the window          [spikes/frame]
    TFI(t) = 1 / ISI(t)                                                 [spikes/frame]

Both estimate the pixel's rate, which is its radiance times its gain.  TFP is smooth and blurs motion;
TFI follows motion and is coarse.  The names are those of the public spike-camera code.
Source: Zhu et al., "A retina-inspired sampling method for visual texture reconstruction", ICME 2019.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.errors import InputError
from spikecam_env.streams.isi import isi_plane
from spikecam_env.streams.packing import as_spikes, as_stream, check_values


def middleTFP(spikes: ArrayLike, t: int | None = None, window: int = 41) -> NDArray[np.float32]:
    """Texture from playback: (H, W) rate [spikes/frame] in a window about a frame.

    Args:
        spikes: (T, H, W).
        t: frame; default the middle one.
        window: frames of the window, from t - window // 2 on; it is cut to the stream.

    Example:
        >>> middleTFP(np.tile(np.uint8([1, 0, 0, 0]), 10).reshape(40, 1, 1), window=20).tolist()
        [[0.25]]
    """
    frames = as_stream(spikes)
    t = _middle(frames, t)
    first, stop = _window(t, window, len(frames))
    return np.asarray(check_values(frames[first:stop], spikes).mean(axis=0, dtype=np.float32))


def middleTFI(spikes: ArrayLike, t: int | None = None) -> NDArray[np.float32]:
    """Texture from interval: (H, W) rate 1 / ISI [spikes/frame] at frame t, by default the middle one.

    Example:
        >>> middleTFI(np.uint8([1, 0, 0, 0, 1, 0]).reshape(6, 1, 1), t=2).tolist()
        [[0.25]]
    """
    return isi_plane(spikes, _middle(as_stream(spikes), t), normalised=True)


def tfp_film(spikes: ArrayLike, window: int = 41, *, every: int = 1) -> NDArray[np.float32]:
    """(T, H, W) spikes -> (ceil(T / every), H, W): `middleTFP` at frames 0, every, 2 every, ...

    Example:
        >>> tfp_film(np.tile(np.uint8([1, 0, 0, 0]), 10).reshape(40, 1, 1), window=8, every=20).ravel().tolist()
        [0.25, 0.25]
    """
    frames = as_spikes(spikes)
    if every < 1:
        raise InputError(f"every is {every}; it is a step in frames, at least 1")
    times = range(0, len(frames), every)
    film = np.empty((len(times), *frames.shape[1:]), np.float32)
    total = np.zeros(frames.shape[1:], np.int32)
    seen_first = seen_stop = 0
    for picture, t in zip(film, times, strict=True):
        first, stop = _window(t, window, len(frames))
        if first >= seen_stop:
            total[:] = 0
            seen_first = seen_stop = first
        for entering in frames[seen_stop:stop]:
            total += entering
        for leaving in frames[seen_first:first]:
            total -= leaving
        seen_first, seen_stop = first, stop
        np.divide(total, stop - first, out=picture, casting="same_kind")
    return film


def _middle(frames: NDArray[np.uint8], t: int | None) -> int:
    count = len(frames)
    t = count // 2 if t is None else t
    if not 0 <= t < count:
        raise InputError(f"frame {t} asked of a stream of {count} frames; need 0 <= t < {count}")
    return t


def _window(t: int, window: int, count: int) -> tuple[int, int]:
    if window < 1:
        raise InputError(f"window is {window}; it is a number of frames, at least 1")
    first = t - window // 2
    return max(first, 0), min(first + window, count)
