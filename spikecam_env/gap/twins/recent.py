"""The last simulated campaigns of a case: a search comes back to a model that it has simulated."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from threading import Lock
from typing import Any

import numpy as np

from spikecam_env.gap.unit.refit import BaseFit

MOST_KEPT = 16
"""Campaigns; a choice: those of a round's confirmed candidates, some 15 MB each of a whole camera."""


@dataclass(frozen=True, eq=False)
class Same:
    """A part of a key that is equal to itself alone, however large."""

    part: object

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and self.part is other.part

    def __hash__(self) -> int:
        return id(self.part)


@dataclass
class RecentTwins:
    """Results of the last simulations, by all that they follow from."""

    kept: OrderedDict[Hashable, Any] = field(default_factory=OrderedDict)
    known: set[Hashable] = field(default_factory=set)
    """Keys of all so far."""
    lock: Any = field(default_factory=Lock)

    def made(self, key: Hashable, make: Callable[[], Any], at_first: Callable[[], None]) -> Any:
        """The result under a key, made where it is not among the last.

        Args:
            key: all that it follows from.
            make: makes it.
            at_first: called for a key that is new, whatever is kept: threads do not change how often.
        """
        with self.lock:
            is_new = key not in self.known
            self.known.add(key)
        if is_new:
            at_first()
        with self.lock:
            if key in self.kept:
                self.kept.move_to_end(key)
                return self.kept[key]
        result = make()
        with self.lock:
            self.kept[key] = result
            while len(self.kept) > MOST_KEPT:
                self.kept.popitem(last=False)
        return result


def fingerprint(unit: BaseFit) -> bytes:
    """Of all numbers of a unit."""
    digest = hashlib.blake2b(digest_size=16)
    for part in vars(unit).values():
        digest.update(np.ascontiguousarray(part).tobytes())
    return digest.digest()
