"""`spikecam bench loop`: its rows add up, and the way before is the same denoiser."""

from __future__ import annotations

import numpy as np
import pytest

from denoiser.online import OnlineDnSS
from denoiser.weights import load_weights, pretrained_path
from scenes import RotatingDisk
from spikecam_env.bench.loop import FAST, FIRST_WAY, STAGES, WHOLE, CalledAsInTraining, bench_loop, loop_table
from spikecam_env.sensor import SpikeSensor

SHAPE = (20, 24)


def test_stages_make_up_the_whole():
    rows = {row["stage"]: row for row in loop_table(RotatingDisk(SHAPE), seconds=0.0)}
    assert set(rows) == {*STAGES, WHOLE, FAST, FIRST_WAY}
    assert sum(rows[stage]["of the whole, %"] for stage in STAGES) == pytest.approx(100)
    assert sum(1 / rows[stage]["frames/s"] for stage in STAGES) == pytest.approx(1 / rows[WHOLE]["frames/s"])
    assert all(row["x real time"] == pytest.approx(row["frames/s"] / 40_000) for row in rows.values())
    assert rows[FIRST_WAY]["x plain float32"] == 1 and rows["light"]["x plain float32"] is None


def test_the_first_way_gives_the_rates_of_today():
    recipe, network, _ = load_weights(pretrained_path("best"))
    spikes = SpikeSensor("scsim", SHAPE, 0).step(RotatingDisk(SHAPE).radiance(0, 64), 64)
    first, now = (
        OnlineDnSS(recipe, n, precision="float32", output="rate").push(spikes)
        for n in (CalledAsInTraining(network), network)
    )
    assert now.std() > 0.01 and np.array_equal(first, now)


def test_the_command_s_tables_are_the_disk_a_world_and_the_gpu():
    tables = bench_loop(SHAPE, seconds=0.0)
    assert [title.split(":")[0] for title in tables] == ["disk", "tumble", "on a GPU"]
    assert "GPU" in tables["on a GPU"][0]
