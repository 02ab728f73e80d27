"""Results that a world keeps for its next call.

Everything in it follows from the world: an entry that is dropped is made again, bit for bit.  Each kind has a limit of
its own, in entries; the entry used least recently goes first.  A copied or unpickled world begins with nothing.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Generic, TypeVar

from scenes.renderers.protocol import PictureWindow, Pinhole, Sprite
from scenes.world.body_key import BodyKey
from scenes.world.extent import Probe, probe_of
from scenes.world.plan import BlockPlan, Pace
from scenes.world.spec import WorldSpec
from spikecam_env.types import Floats, Pictures

PLANS = 64
"""Blocks whose plans are kept: 0.4 s of the camera's time."""

KEYS_A_BODY = 4
"""Keys that a body gets in a piece of 64 frames at most (`paint.PIECE` / `plan.SHORTEST_KEY_STEP`): the last of them is
the first of the next piece, and the other bodies' keys come between."""

KEYS_MORE = 8
"""Keys beside those: room for calls that cut the stream elsewhere than at pieces."""

BACKDROPS_A_BODY = 2
"""Of each body, as if all were backdrops: the picture without gaze, and that under one gaze."""

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Sight:
    """A body before the camera at a frame."""

    pose: Floats
    camera: Pinhole
    view: Floats
    """(4, 4) from its coordinates to the camera's."""
    window: PictureWindow
    """The part of the picture that is rendered."""


class RecentResults(Generic[T]):
    """The results used most recently, by name: at most `most` of them, and at least one."""

    def __init__(self, most: int) -> None:
        self.most = max(most, 1)
        self._kept: OrderedDict[Hashable, T] = OrderedDict()

    def __len__(self) -> int:
        return len(self._kept)

    def update(self, other: RecentResults[T]) -> None:
        """Add the results of another one."""
        self._kept.update(other._kept)

    def get(self, name: Hashable, make: Callable[[], T]) -> T:
        """The result of this name; where there is none, that of `make`, which is kept from now on."""
        if name not in self._kept:
            self._kept[name] = make()
            while len(self._kept) > self.most:
                self._kept.popitem(last=False)
        self._kept.move_to_end(name)
        return self._kept[name]


@dataclass(frozen=True, eq=False)
class WorldCache:
    """One world's.  For B bodies at most:"""

    plans: RecentResults[BlockPlan]
    """64 plans of blocks."""
    paces: RecentResults[Pace]
    """64 B, of each body in each of these."""
    probes: RecentResults[Probe]
    """B, one a body."""
    sights: RecentResults[Sight]
    """4 B + 8, where bodies are at key times."""
    keys: RecentResults[BodyKey]
    """4 B + 8 bodies rendered at key times.  These take the memory: 72 bytes a pixel of each key's window, up to 37 MB
    at 250 x 400."""
    backdrops: RecentResults[Sprite]
    """2 B backdrops rendered at an instant, 12 bytes a pixel."""
    tile: RecentResults[Pictures]
    """1 background picture at one texel a pixel."""
    base: RecentResults[Pictures]
    """1 picture of all that stands still behind the bodies."""

    @classmethod
    def of(cls, bodies: int) -> WorldCache:
        """An empty one for a world of so many bodies."""
        return cls(
            plans=RecentResults(PLANS),
            paces=RecentResults(PLANS * bodies),
            probes=RecentResults(bodies),
            sights=RecentResults(KEYS_A_BODY * bodies + KEYS_MORE),
            keys=RecentResults(KEYS_A_BODY * bodies + KEYS_MORE),
            backdrops=RecentResults(BACKDROPS_A_BODY * bodies),
            tile=RecentResults(1),
            base=RecentResults(1),
        )

    def update_motion(self, other: WorldCache) -> None:
        """Add plans, paces and probes of a world that differs in its light alone."""
        self.plans.update(other.plans)
        self.paces.update(other.paces)
        self.probes.update(other.probes)

    def probe(self, spec: WorldSpec, body: int) -> Probe:
        """The points that stand for a body of the world."""
        return self.probes.get(body, lambda: probe_of(spec.bodies[body].surface.mesh))
