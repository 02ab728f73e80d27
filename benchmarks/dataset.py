"""Speed of making a dataset, and the share of each part.

python -m benchmarks.dataset
"""

from __future__ import annotations

import os
import tempfile
import time
from dataclasses import replace
from functools import partial
from typing import Any

import tyro

from spikecam_env.cli.bench import print_figures
from spikecam_env.datasets.build import Built, build
from spikecam_env.datasets.plan import Plan, phm_n
from spikecam_env.datasets.verify import verify

ALONE = 2
"""Scenes of the run in one process."""

PARTS = ("scene", "noisy", "clean", "file", "truth", "digest", "start")


def bench_dataset(plan: Plan | None = None, jobs: int | None = None) -> list[dict[str, Any]]:
    """Make a dataset and verify it.

    Args:
        plan: default: the PHM-like scenes, 1000 frames each at 250 x 400.
        jobs: processes; default: one a core.

    Returns:
        Rows of one process (first scenes only), all processes, and verify.  frames/s is by the wall clock, the start of
        the processes included.  Processor time a frame [ms] is without it, and other work on the machine changes it
        little.  Then the share of the workers' time on each part: scene (light), noisy and clean (camera and twin),
        file (packing and writing), truth, digest (SHA-256), start (scene, exposure, compiled code).
    """
    plan = phm_n() if plan is None else plan
    jobs = (os.cpu_count() or 1) if jobs is None else jobs
    few = replace(plan, entries=plan.entries[:ALONE])
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, part, workers in (("1 process", few, 1), (f"{jobs} processes", plan, jobs)):
            out = f"{folder}/{workers}-{len(part.entries)}"
            begin = time.perf_counter()
            built = build(part, out, jobs=workers, progress=True)
            rows.append(_row(name, part, time.perf_counter() - begin, built))
        begin = time.perf_counter()
        faults = verify(out, jobs=jobs)
        rows.append(_row(f"verify: {len(faults)} faults", plan, time.perf_counter() - begin, None))
    return rows


def _row(name: str, plan: Plan, wall_s: float, built: Built | None) -> dict[str, Any]:
    seconds = built.seconds if built else {}
    total = sum(seconds.values())
    frames = len(plan.entries) * plan.frames
    return {
        "run": name,
        "scenes": len(plan.entries),
        "frames/s": frames / wall_s,
        "processor ms/frame": 1e3 * built.processor_s / frames if built else None,
        **{part: f"{seconds[part] / total:.0%}" if part in seconds else None for part in PARTS},
    }


if __name__ == "__main__":
    tyro.cli(partial(print_figures, bench_dataset), description=__doc__)
