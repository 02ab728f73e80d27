"""Speed of the sensor's engines on this machine, as `spikecam bench sensor` prints it.

python benchmarks/bench_sensor.py
"""

from __future__ import annotations

from spikecam_env.cli.table import table
from spikecam_env.sensor.bench import bench_sensor, machine

if __name__ == "__main__":
    print(machine())
    print(table(bench_sensor()))
