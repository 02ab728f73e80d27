"""`spikecam bench`: speed, as ratios to a baseline measured in the same run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import tyro


@dataclass
class Bench:
    """Measure speed on this machine: sensor engines, effects, the denoiser online and live, environments, scenes,
    datasets.

    example:  spikecam bench sensor
    """

    what: tyro.conf.Positional[
        Literal["sensor", "effects", "online", "live", "loop", "env", "scenes", "renderers", "dataset"]
    ]
    """sensor: pixel-steps a second of numpy, reference and fast.  effects: cost of each effect over the base model.
    online: denoised frames a second.  live: pictures a second of a live stream, frames lost, latency, and the error of
    skipping passes (some minutes).  loop: scene to denoised rates, each stage and the whole.  env: steps a second of
    1, 16 and 64 environments, by each way to step them, and how long an episode takes to begin (some minutes).
    scenes: frames of light a second and their error, renderers, scene to spikes, and the error of the flow (some
    minutes).  renderers: speed and error of each back-end of this machine.  dataset: frames a second into files."""
    out: Path | None = None
    """File for the figures, as JSON."""
    json: bool = False
    """Print the figures as JSON, and no table."""

    def run(self) -> None:
        from spikecam_env.bench.dataset import bench_dataset
        from spikecam_env.bench.effects import bench_effects
        from spikecam_env.bench.environments import bench_environments
        from spikecam_env.bench.live import bench_live
        from spikecam_env.bench.loop import bench_loop
        from spikecam_env.bench.machine import machine
        from spikecam_env.bench.online import bench_online
        from spikecam_env.bench.renderers import bench_renderers
        from spikecam_env.bench.scenes import bench_scenes
        from spikecam_env.bench.sensor import bench_sensor
        from spikecam_env.cli.files import json_text, write_json
        from spikecam_env.cli.table import table
        from spikecam_env.whole import check_file

        if self.out is not None:
            check_file(self.out)
        if not self.json:
            print(machine())
        benches: dict[str, Callable[[], list[dict[str, Any]] | dict[str, list[dict[str, Any]]]]] = {
            "sensor": bench_sensor,
            "effects": bench_effects,
            "online": bench_online,
            "live": bench_live,
            "loop": bench_loop,
            "env": bench_environments,
            "scenes": bench_scenes,
            "renderers": bench_renderers,
            "dataset": bench_dataset,
        }
        rows = benches[self.what]()
        figures = {"machine": machine(), "rows": rows}
        if self.json:
            print(json_text(figures))
        else:
            for title, part in rows.items() if isinstance(rows, dict) else [("", rows)]:
                if title:
                    print(f"\n{title}")
                print(table(part))
        if self.out is not None:
            write_json(self.out, figures)
            if not self.json:
                print(f"wrote {self.out}")
