"""`benchmarks.gpu` on the processor: every part runs, and a part without time is left out and said to be."""

from __future__ import annotations

import torch

from benchmarks import bench_cuda, gpu


def test_every_part_runs_and_has_rates(monkeypatch):
    for program in (gpu, bench_cuda):
        monkeypatch.setattr(program, "SECONDS", 0.0)
    tables = gpu.measured(gpu.DRY, torch.device("cpu"))
    assert list(tables) == list(gpu.PARTS)
    for rows in tables.values():
        rates = [row.get("frames/s", row.get("Gpx-steps/s")) for row in rows]
        assert rows and all(rate is not None and rate > 0 for rate in rates)


def test_a_part_without_time_is_left_out():
    late = gpu.measured(gpu.DRY, torch.device("cpu"), minutes=gpu.TO_SPARE_S / 60 - 0.1)
    assert all(list(row) == ["left out"] for rows in late.values() for row in rows)
