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

    what: tyro.conf.Positional[Literal["sensor", "effects", "online", "live", "env", "scenes", "renderers", "dataset"]]
    """sensor: pixel-steps a second of numpy, reference and fast.  effects: what each costs, over the base model.
    online: denoised frames a second.  live: pictures a second of a stream as it comes, frames lost, latency, and the
    error of leaving passes out (some minutes).  env: steps a second of 1, 16 and 64 environments, one way and another.
    scenes: frames of light a second, how far they are from the truth, renderers, scene to spikes, and whether the flow
    is right (some minutes).  renderers: how fast and how exact each back-end of this machine is.  dataset: frames a
    second into files."""
    out: Path | None = None
    """Where to write the figures as JSON."""

    def run(self) -> None:
        from spikecam_env.bench.dataset import bench_dataset
        from spikecam_env.bench.effects import bench_effects
        from spikecam_env.bench.environments import bench_environments
        from spikecam_env.bench.live import bench_live
        from spikecam_env.bench.machine import machine
        from spikecam_env.bench.online import bench_online
        from spikecam_env.bench.renderers import bench_renderers
        from spikecam_env.bench.scenes import bench_scenes
        from spikecam_env.bench.sensor import bench_sensor
        from spikecam_env.cli.files import write_json
        from spikecam_env.cli.table import table
        from spikecam_env.whole import check_file

        if self.out is not None:
            check_file(self.out)
        print(machine())
        benches: dict[str, Callable[[], list[dict[str, Any]] | dict[str, list[dict[str, Any]]]]] = {
            "sensor": bench_sensor,
            "effects": bench_effects,
            "online": bench_online,
            "live": bench_live,
            "env": bench_environments,
            "scenes": bench_scenes,
            "renderers": bench_renderers,
            "dataset": bench_dataset,
        }
        rows = benches[self.what]()
        for title, part in rows.items() if isinstance(rows, dict) else [("", rows)]:
            if title:
                print(f"\n{title}")
            print(table(part))
        if self.out is not None:
            write_json(self.out, {"machine": machine(), "rows": rows})
            print(f"wrote {self.out}")
