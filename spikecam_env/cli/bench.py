"""`spikecam bench`: speed, as ratios to a baseline measured in the same run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import tyro

Rows = list[dict[str, Any]]

BENCHES = {
    "sensor": "spikecam_env.bench.sensor:bench_sensor",
    "online": "spikecam_env.bench.online:bench_online",
    "live": "spikecam_env.bench.live:bench_live",
    "loop": "spikecam_env.bench.loop:bench_loop",
    "env": "spikecam_env.bench.environments:bench_environments",
}
"""Module and function of each bench: rows, or tables of rows by title."""

MOVED = ("effects", "scenes", "renderers", "dataset")
"""Benches of earlier versions that are programs of a checkout now."""


@dataclass
class Bench:
    """Measure speed on this machine: sensor engines, the denoiser online and live, environments.

    example:  spikecam bench sensor
    """

    what: tyro.conf.Positional[
        Literal["sensor", "online", "live", "loop", "env", "effects", "scenes", "renderers", "dataset"]
    ]
    """sensor: pixel-steps a second of numpy, reference and fast.  online: denoised frames a second.  live: pictures a
    second of a live stream, frames lost, latency, and the error of skipping passes (some minutes).  loop: scene to
    denoised rates, each stage and the whole.  env: steps a second of 1, 16 and 64 environments, by each way to step
    them, and how long an episode takes to begin (some minutes).  effects, scenes, renderers, dataset: programs of a
    checkout now, `python -m benchmarks.NAME`."""
    out: Path | None = None
    """File for the figures, as JSON."""
    json: bool = False
    """Print the figures as JSON, and no table."""

    def run(self) -> None:
        from spikecam_env.errors import InputError

        if self.what in MOVED:
            raise InputError(f"bench {self.what} is a program of a checkout now: python -m benchmarks.{self.what}")
        module, name = BENCHES[self.what].split(":")
        print_figures(getattr(import_module(module), name), self.out, self.json)


def print_figures(measure: Callable[[], Rows | dict[str, Rows]], out: Path | None = None, json: bool = False) -> None:
    """Measure, print the figures under the name of the machine, and write them.

    Args:
        measure: returns rows, or tables of rows by title.
        out: file for the figures, as JSON.
        json: print the figures as JSON, and no table.
    """
    from spikecam_env.bench.machine import machine
    from spikecam_env.cli.files import json_text, write_json
    from spikecam_env.cli.table import table
    from spikecam_env.whole import check_file

    if out is not None:
        check_file(out)
    if not json:
        print(machine())
    rows = measure()
    figures = {"machine": machine(), "rows": rows}
    if json:
        print(json_text(figures))
    else:
        for title, part in rows.items() if isinstance(rows, dict) else [("", rows)]:
            if title:
                print(f"\n{title}")
            print(table(part))
    if out is not None:
        write_json(out, figures)
        if not json:
            print(f"wrote {out}")
