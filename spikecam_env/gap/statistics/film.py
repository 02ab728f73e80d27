"""The film that moving light leaves, and its features: the change of it that each kind of effect makes.

Features are made orthogonal in this order, each to those before it: level, square, delay, skew,
lag 16 / 64 / 256 / 2000 frames, blur, row, column, bloom.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import BIN
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.sensor import Keyframes
from spikecam_env.sensor.between_keys import key_weights
from spikecam_env.types import Floats, Pictures

FEATURES = ("level", "square", "delay", "skew", "lag 16", "lag 64", "lag 256", "lag 2000", "blur", "row", "column",
            "bloom")  # fmt: skip


@dataclass(frozen=True)
class FilmFeatures:
    """The film of a moving light and its features."""

    light: Pictures
    """(bins, P) collected in each bin at gain 1."""
    basis: Pictures
    """(n, bins P) orthonormal features."""
    size: Floats
    """(n,) of each feature before it was scaled, 0 where those before it span it."""


def films(conditions: Sequence[Condition], shape: tuple[int, int]) -> dict[str, FilmFeatures]:
    """The film of every recording with moving light, computed once."""
    features = {}
    for c in conditions:
        if c.kind == "moving" and c.light is not None:
            light = light_film(c.light, c.frames)
            features[c.name] = FilmFeatures(light, *film_features(light, shape))
    return features


def light_film(light: Keyframes, frames: int) -> Pictures:
    """(F // BIN, P) light collected in each bin, linear between keys."""
    keys = light.radiance.reshape(len(light.frame), -1)
    out = np.zeros((frames // BIN, keys.shape[1]), np.float32)
    for b, collected in enumerate(out):
        first, of_mean, _ = key_weights(light.frame, b * BIN, (b + 1) * BIN)
        for key, weight in enumerate(of_mean, first):
            collected += np.float32(BIN * weight) * keys[key]
    return out


def refitted_film(condition: Condition, base: BaseFit) -> Floats:
    """(F // BIN, P) spikes that a refitted unit gives in moving light, at most one a frame."""
    assert condition.light is not None
    light = light_film(condition.light, condition.frames).astype(np.float64)
    return np.minimum(light * base.gain + BIN * base.dark, BIN)


def film_features(light: Pictures, shape: tuple[int, int]) -> tuple[Pictures, Floats]:
    """Orthonormal features (n, bins P) of the nominal camera's film, and how large each was before that."""
    bright = light / BIN
    x = np.minimum(bright, np.float32(1.0))
    bins = len(x)
    change = np.gradient(x, axis=0) / BIN
    row = np.linspace(-0.5, 0.5, shape[0], dtype=np.float32).repeat(shape[1])
    film = x.reshape(bins, *shape)
    kinds = [x, x * x, -change, -change * row]
    for tau in (16.0, 64.0, 256.0, 2000.0):
        kept = np.exp(-BIN / tau)
        late, _ = scipy.signal.lfilter([1.0 - kept], [1.0, -kept], x, axis=0, zi=kept * x[:1])
        kinds.append(late.astype(np.float32) - x)
    padded = np.pad(film, ((0, 0), (1, 1), (1, 1)), mode="edge")
    around = (padded[:, :-2, 1:-1] + padded[:, 2:, 1:-1] + padded[:, 1:-1, :-2] + padded[:, 1:-1, 2:]) / 4
    kinds.append((around - film).reshape(bins, -1))
    kinds.append((film * (film.mean(axis=2, keepdims=True) - film.mean())).reshape(bins, -1))
    kinds.append((film * (film.mean(axis=1, keepdims=True) - film.mean())).reshape(bins, -1))
    over = np.pad(np.maximum(bright.reshape(bins, *shape) - 1.0, 0.0), ((0, 0), (1, 1), (1, 1)))
    spill = (over[:, :-2, 1:-1] + over[:, 2:, 1:-1] + over[:, 1:-1, :-2] + over[:, 1:-1, 2:]) / 4
    kinds.append((spill - over[:, 1:-1, 1:-1]).reshape(bins, -1))
    basis = np.zeros((len(kinds), x.size))  # in single precision sums of 10^6 terms lose the fifth digit somewhere
    size = np.zeros(len(kinds))
    for n, kind in enumerate(kinds):
        v = kind.reshape(-1).astype(np.float64)
        whole = float(np.linalg.norm(v))
        for _ in range(2):
            v = v - (basis[:n] @ v) @ basis[:n]
        length = float(np.linalg.norm(v))
        if whole > 0 and length > 1e-3 * whole:
            basis[n] = v / length
            size[n] = length
    return basis.astype(np.float32), size
