"""How many threads compiled code takes, and that asking changes nobody else's."""

from __future__ import annotations

import subprocess
import sys

import pytest

from spikecam_env.threads import as_many, limit_threads, use_one_thread

PAINTED = """
import torch
from scenes.meshes import assemble, sphere
from scenes.renderers.embree import Embree
from scenes.trajectories import Spinning
from scenes.world import Body, World

torch.set_num_threads(1)
torch.get_num_threads()  # torch sets its memory of it at its first use
ball = Body("ball", assemble(sphere(0.5)), Spinning((0, 1, 0), rpm=900))
World((24, 40), (ball,), renderer=Embree()).radiance(0, 8)
print(torch.get_num_threads())
"""


@pytest.fixture(autouse=True)
def unlimited():
    yield
    limit_threads(None)


def test_a_worker_takes_one_thread_where_none_are_asked_for():
    use_one_thread()
    assert as_many(None, 8) == 1 and as_many(3, 8) == 3


def test_a_limit_ends():
    limit_threads(5)
    assert as_many(None, 8) == 5 and as_many(None, 2) == 2
    limit_threads(None)
    assert as_many(None, 8) == as_many(None, 8) >= 1


def test_painting_a_world_leaves_torch_its_threads():
    """numba sets OpenMP's threads, torch's too, when it is asked for its own."""
    done = subprocess.run([sys.executable, "-c", PAINTED], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["1"]
