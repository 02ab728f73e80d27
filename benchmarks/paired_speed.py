"""How fast the sensor is beside the same sensor of another checkout, in pairs of short runs.

    python -m benchmarks.paired_speed OLD_CHECKOUT [MODEL ...]      by default MODELS

A model is PRESET or PRESET+EFFECT, and @LIGHT where light is not steady: "moving" has a key each 16 frames, "new" one
at each frame; "call" is one frame a call, each in a light of its own.

Other programs on a machine slow a run by tens of per cent, and both of a pair by much the same.  One process a checkout
does the same steps in turn, both on one core.  The process's own CPU time is compared.  ratio: the median over pairs of
this checkout's time over the other's; error: that of the median, from its spread over pairs.
"""

from __future__ import annotations

import os
import subprocess
import sys
from argparse import ArgumentParser
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spikecam_env.bench.machine import machine
from spikecam_env.cli.table import table

MODELS = (
    *("ideal", "scsim", "physical", "scsim+dead_time", "scsim+ir_drop", "scsim+row_temporal_noise"),
    *("scsim+photodiode_lag", "scsim+incomplete_reset", "scsim+blooming", "scsim+clock_feedthrough", "scsim+crosstalk"),
    *("scsim@moving", "scsim@new", "scsim@call", "scsim+dead_time@moving", "scsim+dead_time@call"),
)
SHAPE, LEVEL = (250, 400), 0.2
"""Rows and columns, and spikes a frame of a nominal pixel in steady light."""

PAIRS = 60
FRAMES = 64
"""Frames of a run: the fast engine's longest step, some milliseconds."""

WORKER = """
import sys, time
import numpy as np
from spikecam_env.sensor import CATALOGUE, Keyframes, SensorModel, SpikeSensor

name, _, kind = sys.argv[1].partition("@")
preset, *effects = name.split("+")
rows, columns, level, frames = int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]), int(sys.argv[5])
model = SensorModel.preset(preset)
for name in effects:
    model = model.with_effect(CATALOGUE[name]())
sensor = SpikeSensor(model, (rows, columns), 0, engine="fast", threads=1)

every = {"moving": 16, "new": 1}.get(kind, frames)
keys = np.arange(0.0, frames + every, every)
pictures = np.random.default_rng(0).uniform(0.5, 1.5, (8, rows, columns)) * level
pictures = pictures.astype(np.float32)

light = pictures[0] if kind == "" else Keyframes(keys, pictures[np.arange(len(keys)) % 8])

start, out = sensor.state(), np.empty((frames, rows, columns), np.uint8)

def run():
    if kind == "call":
        for k in range(frames):
            sensor.step(pictures[k % 8], 1, out=out[:1])
    else:
        sensor.step(light, frames, out=out)

run()
print("ready", flush=True)
for _ in sys.stdin:
    sensor.restore(start)
    begin = time.process_time()
    run()
    print(time.process_time() - begin, flush=True)
"""


class Runner:
    """A process that steps a camera of one checkout when asked to."""

    def __init__(self, checkout: Path, model: str) -> None:
        numbers = [str(number) for number in (*SHAPE, LEVEL, FRAMES)]
        environment = {**os.environ, "PYTHONPATH": str(checkout), "NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [sys.executable, "-c", WORKER, model, *numbers],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=checkout,
            env=environment,
        )
        self._answer()

    def seconds(self) -> float:
        """CPU time of FRAMES frames [s]."""
        assert self._process.stdin is not None
        self._process.stdin.write("go\n")
        self._process.stdin.flush()
        return float(self._answer())

    def end(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()

    def _answer(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit(f"the run ended with code {self._process.wait()}; its own message is above")
        return line


def paired(one: Runner, other: Runner, pairs: int) -> NDArray[np.float64]:
    """Seconds (pairs, 2) of both, each first in every second pair."""
    rows = []
    for i in range(pairs):
        order = (one, other) if i % 2 == 0 else (other, one)
        times = [runner.seconds() for runner in order]
        rows.append(times if i % 2 == 0 else times[::-1])
    return np.array(rows)


def compare(old: Path, model: str, pairs: int) -> dict[str, object]:
    """A row of the table."""
    here = Path(__file__).resolve().parent.parent
    runners = Runner(old, model), Runner(here, model)
    times = paired(*runners, pairs)
    for runner in runners:
        runner.end()
    ratios = times[:, 1] / times[:, 0]
    before, after = 1e9 * np.median(times, axis=0) / (FRAMES * SHAPE[0] * SHAPE[1])
    return {
        "model": model,
        "old, ns/px-step": float(before),
        "new, ns/px-step": float(after),
        "ratio": float(np.median(ratios)),
        "error": median_error(ratios),
    }


def median_error(values: NDArray[np.float64]) -> float:
    """Standard error of the median of values that scatter as a normal law about it, with some far off."""
    spread = 1.4826 * np.median(np.abs(values - np.median(values)))
    return float(np.sqrt(np.pi / 2.0) * spread / np.sqrt(values.size))


def main() -> None:
    parser = ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("old", type=Path, help="the other checkout")
    parser.add_argument("models", nargs="*", default=MODELS)
    parser.add_argument("--pairs", type=int, default=PAIRS)
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    print(f"{machine()}; {SHAPE[0]} x {SHAPE[1]} pixels, {LEVEL:g} spikes a frame, {options.pairs} pairs")
    print(table([compare(options.old.resolve(), model, options.pairs) for model in options.models]))


if __name__ == "__main__":
    main()
