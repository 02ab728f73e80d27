"""The cache of a world: limits that hold, and no key rendered twice while a stream is read in order."""

from __future__ import annotations

import dataclasses
from collections import Counter
from typing import Any

import numpy as np
import pytest

from scenes.meshes import assemble, sphere
from scenes.renderers.embree import Embree
from scenes.renderers.protocol import Sprite, Surface
from scenes.trajectories import Ballistic, Spinning
from scenes.world import Body, World
from scenes.world.cache import PLANS, RecentResults, WorldCache
from scenes.world.plan import BLOCK, SHORTEST_KEY_STEP, pace_of

BODIES = 6


class Counting:
    """A renderer that counts its pictures, by surface and pose."""

    name = "counting"

    def __init__(self) -> None:
        self.renderer, self.drawn = Embree(), Counter[Any]()

    def render(self, surface: Surface, pose: np.ndarray, *rest: Any) -> Sprite:
        self.drawn[surface, pose.tobytes()] += 1
        return self.renderer.render(surface, pose, *rest)

    def close(self) -> None:
        self.renderer.close()


def fast_balls(renderer: Counting) -> World:
    """Balls side by side that turn so fast that each is rendered as often as bodies are at most."""
    ball = assemble(sphere(0.15, 0.6, 16))
    places = np.linspace(-0.8, 0.8, BODIES)
    bodies = tuple(
        Body(f"ball {n}", ball, Ballistic((x, 0, 0), (0, 1, 0)) @ Spinning((1, 2, 0), 9000))
        for n, x in enumerate(places)
    )
    return World((20, 40), bodies, renderer=renderer)


def test_recent_keeps_the_entries_asked_for_last() -> None:
    recent: RecentResults[int] = RecentResults(2)
    made: list[str] = []

    def make(name: str) -> int:
        return recent.get(name, lambda: made.append(name) or len(made))

    first = [make(name) for name in ("a", "b", "a", "c", "a", "b")]
    print(f"made {made}, given {first}")
    assert made == ["a", "b", "c", "b"] and first == [1, 2, 1, 3, 1, 4]
    assert len(recent) == 2


def test_the_limits_are_those_that_the_docstring_states() -> None:
    cache = WorldCache.of(6)
    limits = {field.name: getattr(cache, field.name).most for field in dataclasses.fields(cache)}
    assert limits == {
        "plans": 64,
        "paces": 64 * 6,
        "probes": 6,
        "sights": 4 * 6 + 8,
        "keys": 4 * 6 + 8,
        "backdrops": 2 * 6,
        "tile": 1,
        "base": 1,
    }
    assert WorldCache.of(0).probes.most == 1


@pytest.mark.parametrize("call", [BLOCK, 64, 40])
def test_a_stream_read_in_order_renders_no_key_twice(call: int) -> None:
    renderer = Counting()
    world = fast_balls(renderer)
    assert {pace_of(world, n, world.cache.probe(world, n), 0).step for n in range(BODIES)} == {SHORTEST_KEY_STEP}
    for start in range(0, 2 * BLOCK, call):
        world.radiance(start, min(start + call, 2 * BLOCK))
    print(f"{len(renderer.drawn)} keys, rendered {max(renderer.drawn.values())} time(s)")
    assert len(renderer.drawn) == BODIES * (2 * BLOCK // SHORTEST_KEY_STEP + 1)
    assert max(renderer.drawn.values()) == 1
    assert len(world.cache.keys) == world.cache.keys.most == 4 * BODIES + 8


def test_a_dropped_entry_comes_back_bit_for_bit() -> None:
    world = fast_balls(Counting())
    light = world.radiance(0, 8).radiance
    for block in range(1, PLANS + 2):
        world.radiance(block * BLOCK, block * BLOCK + 1)
    assert len(world.cache.plans) == PLANS
    np.testing.assert_array_equal(world.radiance(0, 8).radiance, light)


def test_ground_truth_asks_for_no_pace_and_a_lit_world_for_no_plan() -> None:
    """Both take longer than the pictures of a small world; a scene is exposed before each episode."""
    world = fast_balls(Counting())
    world.truth(3.0)
    assert (len(world.cache.plans), len(world.cache.paces)) == (1, 0)
    world.radiance(0, 8)
    lit = world.lit(2.0)
    assert (len(lit.cache.plans), len(lit.cache.paces), len(lit.cache.probes)) == (1, BODIES, BODIES)
    assert len(lit.cache.keys) == len(lit.cache.sights) == 0
    alone = dataclasses.replace(world, light=2.0)
    np.testing.assert_array_equal(lit.radiance(0, 40).radiance, alone.radiance(0, 40).radiance)
