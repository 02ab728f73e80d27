"""Hashes of spikes over every preset, effect, engine, kind of light, size of step and number of threads.

    python -m tools.spike_hashes HASHES.json                    writes them
    python -m tools.spike_hashes HASHES.json --compare          fails where today's code gives other spikes

Whoever rewrites an engine writes the hashes by the code before and compares by the code after.  They are not committed:
exponentials and roots of another processor may differ in their last bits.
"""

from __future__ import annotations

import hashlib
import json
import math
from argparse import ArgumentParser
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from spikecam_env.sensor import CATALOGUE, Keyframes, SensorModel, SpikeSensor, step_together
from spikecam_env.sensor.effects.base import Effect
from spikecam_env.sensor.model import PRESETS
from spikecam_env.types import Pictures
from spikecam_env.whole import write_text_whole

FRAMES = 72
"""Of a case: more than one step of the fast engine (64)."""

SHAPES = ((9, 11), (40, 50), (3, 2100))
"""Rows and columns: less than a tile, many bands, and rows wider than a band of the block kernel."""

LONE = (4, 5)
"""For effects whose events within a frame the reference takes one by one, in Python."""

BY_EVENTS = ("clock_feedthrough", "crosstalk", "supply_ripple")

LARGE = (200, 300)
"""So large that two threads share it."""

LIGHTS = ("steady", "keys", "every frame", "dim", "irregular")
STEPS = ((FRAMES,), (1,) * 7 + (FRAMES - 7,), (5, 64, 3))
PAIRS = (
    ("dead_time", "photodiode_lag"),
    ("crosstalk", "supply_ripple"),
    ("incomplete_reset", "ir_drop"),
    ("blooming", "photodiode_lag"),
    ("dark_current_drift", "row_temporal_noise"),
    ("random_telegraph_noise", "incomplete_reset"),
)
"""Effects whose laws meet in one spike."""


@dataclass(frozen=True)
class HashCase:
    """A camera, its light, and how it is stepped."""

    name: str
    model: SensorModel
    engine: str
    shape: tuple[int, int]
    light: str
    steps: tuple[int, ...]
    threads: int

    def digest(self) -> str:
        """Of its spikes and of the pixels after them."""
        sensor = SpikeSensor(self.model, self.shape, 3, self.engine, threads=self.threads, bent_light="allow")
        light = radiance(self.light, self.shape)
        spikes = [sensor.step(light, frames).tobytes() for frames in self.steps]
        after = sensor.step(light, 9).tobytes()
        return hashlib.sha256(b"".join([*spikes, after])).hexdigest()[:16]


def radiance(kind: str, shape: tuple[int, int]) -> Keyframes | Pictures:
    """Light of a case (H, W), or keys of it, 1.0 = one spike a frame."""
    rng = np.random.default_rng(1)
    if kind in ("steady", "dim"):
        return rng.uniform(0.0, 1.3 if kind == "steady" else 0.12, shape).astype(np.float32)
    gaps = {"keys": [16.0] * 6, "every frame": [1.0] * 96, "irregular": [1.0] * 9 + [5.0, 0.5, 0.25, 30.25, 2.0, 49.0]}
    frame = np.cumsum([0.0, *gaps[kind]])
    return Keyframes(frame, rng.uniform(0.0, 1.2, (frame.size, *shape)).astype(np.float32))


def levels(effect: type[Effect]) -> Iterator[Effect]:
    """An effect at its default, and so strong that it shows in a few frames."""
    yield effect()
    bounds = next(f.metadata["bounds"] for f in fields(effect) if f.name == effect.strength)
    if math.isinf(effect.neutral):
        yield effect(**{effect.strength: 50.0})
    else:
        most = min(400 * abs(getattr(effect(), effect.strength)), bounds[1] / 2)
        yield effect(**{effect.strength: most})


def models() -> Iterator[tuple[str, SensorModel, bool]]:
    """Name and model of every camera, and whether the reference takes its events one by one."""
    for preset in PRESETS:
        model = SensorModel.preset(preset)
        yield preset, model, any(e.name in BY_EVENTS for e in model.effects)
    base = SensorModel.preset("scsim")
    own = {e.name for e in base.effects}
    for name, effect in CATALOGUE.items():
        for level, one in enumerate(levels(effect)):
            model = base.without(name) if name in own else base
            yield f"{name} {level}", model.with_effect(one), name in BY_EVENTS
    for pair in PAIRS:
        strong = [list(levels(CATALOGUE[name]))[1] for name in pair]
        model = base.with_effect(strong[0]).with_effect(strong[1])
        yield " + ".join(pair), model, bool(set(pair) & set(BY_EVENTS))


def cases() -> Iterator[HashCase]:
    """All cases: the fast engine in all its ways, the reference in one."""
    for name, model, by_events in models():
        yield HashCase(name, model, "reference", LONE if by_events else SHAPES[0], "keys", (1, FRAMES - 1), 1)
        for shape in SHAPES:
            for light in LIGHTS:
                for number, steps in enumerate(STEPS):
                    yield HashCase(name, model, "auto", shape, light, steps, 1 + number % 2)
        for light in ("keys", "every frame"):
            yield HashCase(name, model, "auto", LARGE, light, STEPS[0], 2)


def of_many() -> str:
    """Digest of cameras stepped together."""
    names = ("ideal", "scsim", "physical", "scsim", "measured")
    cameras = [SpikeSensor(name, SHAPES[1], seed) for seed, name in enumerate(names)]
    lights = [radiance(kind, SHAPES[1]) for kind in LIGHTS]
    spikes = [step_together(cameras, lights, frames, threads=2) for frames in STEPS[2]]
    return hashlib.sha256(b"".join(one.tobytes() for many in spikes for one in many)).hexdigest()[:16]


def hashes() -> dict[str, str]:
    """Digest of every case, by its name."""
    found: dict[str, Any] = {"step_together": of_many()}
    for case in tqdm(list(cases()), desc="spikes", unit="case"):
        steps = "+".join(map(str, case.steps))
        key = f"{case.name}, {case.engine}, {case.shape}, {case.light}, steps {steps}, {case.threads} threads"
        found[key] = case.digest()
    return found


def main() -> None:
    """Write or compare."""
    parser = ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--compare", action="store_true", help="with the hashes of FILE; fails where any differs")
    given = parser.parse_args()
    if given.compare and not given.file.is_file():
        parser.error(f"there is no file {given.file}; write it by the code before, without --compare")
    before = json.loads(given.file.read_text(encoding="utf-8")) if given.compare else {}
    now = hashes()
    if not given.compare:
        write_text_whole(given.file, json.dumps(now, indent=1) + "\n")
        return
    other = [name for name in before if now.get(name) != before[name]]
    print(f"{len(before)} cases, {len(other)} with other spikes")
    if other:
        raise SystemExit("\n".join(other[:40]))


if __name__ == "__main__":
    main()
