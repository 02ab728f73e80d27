"""`benchmarks.gpu` on the processor: every part runs, one without time or that fails is said to be, others go on."""

from __future__ import annotations

import json

import pytest
import torch

from benchmarks import bench_cuda, gpu
from denoiser.ground.captured import WARM_UPS
from scenes.flat.disk import RotatingDisk
from spikecam_env.sensor import SpikeSensorBatch

CPU = torch.device("cpu")
RATES = ("frames/s", "env-steps/s", "Gpx-steps/s")


@pytest.fixture(autouse=True)
def set_back(monkeypatch):
    """The sizes of `--quick`."""
    for program in (gpu, bench_cuda):
        monkeypatch.setattr(program, "SECONDS", program.SECONDS)
    monkeypatch.setattr(gpu, "RUNS", gpu.RUNS)


@pytest.mark.slow
def test_the_dry_run_measures_every_part(tmp_path, capsys):
    gpu.main(["--cpu", "--quick", "--out", str(tmp_path / "gpu.json")])
    tables = json.loads((tmp_path / "gpu.json").read_text())["tables"]
    assert list(tables) == list(gpu.PARTS) and all(title in capsys.readouterr().out for title in list(tables)[:1])
    for title, rows in tables.items():
        rates = [next((row[name] for name in RATES if name in row), None) for row in rows]
        assert rows and all(rate is not None and rate > 0 for rate in rates), f"{title}: {rows}"


def test_a_part_that_fails_says_why_and_the_others_go_on(monkeypatch):
    def broken(sizes: gpu.Sizes, device: torch.device) -> gpu.Rows:
        raise RuntimeError("no such kernel")

    monkeypatch.setattr(gpu, "PARTS", {"broken": broken, "fine": lambda sizes, device: [{"frames/s": 1.0}]})
    found = gpu.measured(gpu.DRY, CPU)
    assert found == {"broken": [{"failed": "RuntimeError: no such kernel"}], "fine": [{"frames/s": 1.0}]}


def test_a_part_without_time_is_left_out():
    late = gpu.measured(gpu.DRY, CPU, minutes=gpu.TO_SPARE_S / 60 - 0.1)
    assert all(list(row) == ["left out"] for rows in late.values() for row in rows)


def test_the_recorded_camera_has_the_bits_of_the_batch(monkeypatch):
    def recorded(step, device):
        for _ in range(WARM_UPS):
            step()
        return step

    monkeypatch.setattr(gpu, "captured", recorded)
    scene = RotatingDisk((13, 17), motion_per_key=gpu.EVERY_FRAME)
    camera, batch = gpu.RecordedCamera(scene, CPU), SpikeSensorBatch("scsim", scene.shape, (0,), CPU)
    for block in range(3):
        first = block * gpu.BLOCK
        light = scene.radiance(first, first + gpu.BLOCK, device=CPU)
        assert torch.equal(camera.step(), batch.step(light, gpu.BLOCK)[0])
