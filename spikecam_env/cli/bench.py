"""`spikecam bench`: speed, as ratios to a baseline measured in the same run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import tyro


@dataclass
class Bench:
    """Measure speed on this machine: the sensor's engines, its effects, the online denoiser, scenes or datasets.

    example:  spikecam bench sensor
    """

    what: tyro.conf.Positional[Literal["sensor", "effects", "online", "scenes", "dataset"]]
    """sensor: pixel-steps a second of numpy, reference and fast.  effects: what each costs, over the base model.
    online: denoised frames a second.  scenes: frames of light a second, how far they are from the truth, renderers,
    scene to spikes, and whether the flow is right (some minutes).  dataset: frames a second into files."""
    out: Path | None = None
    """Where to write the figures as JSON."""

    def run(self) -> None:
        from denoiser.bench import bench_online
        from scenes.bench import bench_scenes
        from spikecam_env.cli.files import write_json
        from spikecam_env.cli.table import table
        from spikecam_env.datasets.bench import bench_dataset
        from spikecam_env.sensor.bench import bench_sensor, machine
        from spikecam_env.sensor.effect_costs import bench_effects
        from spikecam_env.whole import check_file

        if self.out is not None:
            check_file(self.out)
        print(machine())
        benches: dict[str, Callable[[], list[dict[str, Any]] | dict[str, list[dict[str, Any]]]]] = {
            "sensor": bench_sensor,
            "effects": bench_effects,
            "online": bench_online,
            "scenes": bench_scenes,
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
