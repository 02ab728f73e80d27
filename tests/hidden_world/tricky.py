"""Campaigns that are awkward: labels that lie, frames that are lost, recordings that are missing.

`changed_plan` acts before anything is filmed, `changed_labels` on the labels that are handed over.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from tests.hidden_world.campaign import Recorded
from tests.hidden_world.light import Light, Shot


@dataclass(frozen=True)
class Trick:
    """A trick: its name, and a description."""

    name: str
    what: str


TRICKS = {
    t.name: t
    for t in (
        Trick("wrong_label", "one flat's radiance is given 2 % wrong"),
        Trick("swapped", "the spikes of two flats are exchanged"),
        Trick("dropped_frames", "frames are missing at a few places of a moving recording"),
        Trick("reversed_rows", "one recording with texture has its rows upside down"),
        Trick("no_motion", "no recording with light that changes"),
    )
}


def changed_plan(trick: str, shots: list[Shot]) -> list[Shot]:
    """The recordings that are made."""
    if trick == "no_motion":
        return [shot for shot in shots if len(shot.light.key_frame) == 1]
    return shots


def changed_labels(trick: str, made: Iterable[Recorded], rng: np.random.Generator) -> Iterator[Recorded]:
    """The recordings as they are handed over."""
    if trick == "swapped":
        yield from _swapped(made, rng)
        return
    lying = int(rng.integers(2, 6))
    for i, recorded in enumerate(made):
        if trick == "wrong_label" and i == lying:
            factor = np.float32(1.02 if rng.random() < 0.5 else 0.98)
            light = Light(recorded.light.key_frame, recorded.light.radiance * factor)
            yield replace(recorded, light=light)
        elif trick == "dropped_frames" and recorded.name == "bars":
            yield replace(recorded, bits=_without_frames(recorded.bits, rng))
        elif trick == "reversed_rows" and recorded.name == "bars":
            yield replace(recorded, bits=recorded.bits[:, ::-1])
        else:
            yield recorded


def _swapped(made: Iterable[Recorded], rng: np.random.Generator) -> Iterator[Recorded]:
    """Two neighbouring flats among the six to fit; only these are held in memory."""
    first = int(rng.integers(2, 5))
    held: list[Recorded] = []
    for i, recorded in enumerate(made):
        if i == first:
            held = [recorded]
        elif i == first + 1:
            yield replace(held[0], bits=recorded.bits)
            yield replace(recorded, bits=held[0].bits)
        else:
            yield recorded


def _without_frames(bits: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The recording with gaps of 40 to 120 frames at three places, as long as before less the gaps."""
    keep = np.ones(len(bits), bool)
    for at in np.sort(rng.uniform(0.2, 0.8, 3)) * len(bits):
        keep[int(at) : int(at) + int(rng.integers(40, 120))] = False
    return bits[keep]
