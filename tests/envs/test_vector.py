"""Vector environments as users make them (`tests.envs.vectors`), and the resources that `close` gives back."""

from __future__ import annotations

import copy
import os
import pickle
import signal
import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest

import spikecam_env.envs  # noqa: F401
from benchmarks.renderers import objects
from scenes.renderers import contexts, shared
from scenes.renderers.choose import make as make_renderer
from scenes.renderers.embree import Embree
from scenes.renderers.own_process import ProcessRenderer
from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole
from spikecam_env.errors import InputError, NotReadyError
from tests.envs.vectors import MANY

LONGEST_S = 600.0
"""Ten times what the slowest takes on two cores: a program that takes longer hangs."""

SMALL: dict[str, Any] = {"shape": (16, 16), "frames_per_step": 8}

POOLS = {"OMP_NUM_THREADS": "2", "GOMP_SPINCOUNT": "10000"}
"""Torch has threads that a fork does not copy, as it has for users; where they wait, they spin briefly."""


def alone(program: str) -> str:
    """The output of a program of `tests.envs.vectors`, in a process group of its own that is killed where it hangs."""
    command = [sys.executable, "-m", "tests.envs.vectors", program]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env={**os.environ, **POOLS},
    )
    try:
        printed, _ = process.communicate(timeout=LONGEST_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        pytest.fail(f"{program} hangs: {process.communicate()[0]}")
    print(printed)
    assert process.returncode == 0, printed
    return printed


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_every_kind_of_id_forks_with_and_without_the_denoiser_and_gives_the_bits_of_a_synchronous_run() -> None:
    """Scenes of a kind have the same renderer, kernels and pools, which a fork may break."""
    assert "ids" in alone("every_kind")


@pytest.mark.slow
def test_spawned_environments_give_the_bits_of_a_synchronous_run() -> None:
    assert "spawn" in alone("contexts")


@pytest.mark.slow
@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="no /proc on this system")
def test_many_environments_leave_no_memory_files_or_threads() -> None:
    assert f"after {MANY}" in alone("many")


@pytest.mark.parametrize("name", ["spikecam_env/RotatingDisk-v0", "spikecam_env/Fan-v0"])
def test_nothing_but_closing_again_works_after_close(name: str) -> None:
    env = gymnasium.make(name, render_mode="rgb_array", **SMALL)
    env.reset(seed=0)
    env.close()
    env.close()
    for use in (lambda: env.step(np.zeros(2, np.float32)), env.reset, env.render, lambda: env.unwrapped.scene):  # type: ignore[attr-defined]
        with pytest.raises(NotReadyError, match="closed; make a new one"):
            use()


@pytest.mark.slow
def test_the_renderer_goes_with_the_last_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[str] = []

    class Counted(Embree):
        def close(self) -> None:
            closed.append("renderer")

    monkeypatch.setattr(shared, "_here", shared._OfThread())
    monkeypatch.setattr(shared, "_users", type(shared._users)())
    monkeypatch.setattr("scenes.renderers.choose.choose_renderer", Counted)
    first, second = (gymnasium.make("spikecam_env/Fan-v0", **SMALL) for _ in range(2))
    first.reset(seed=0)
    second.reset(seed=0)
    first.close()
    assert not closed
    second.step(np.zeros(2, np.float32))
    second.close()
    assert closed == ["renderer"]


def test_construction_renders_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared, "_here", shared._OfThread())
    gymnasium.make("spikecam_env/Fan-v0", **SMALL)
    gymnasium.make("spikecam_env/Scene-v0", **SMALL)
    assert shared._here.renderer is None


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_as_the_original_does(copied: Any) -> None:
    env = gymnasium.make("spikecam_env/Fan-v0", **SMALL).unwrapped
    env.reset(seed=0)
    other = copied(env)
    for _ in range(2):
        action = np.array([0.2, -0.1], np.float32)
        np.testing.assert_array_equal(env.step(action)[0], other.step(action)[0])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["embree", "egl-software"])
def test_a_renderer_in_another_process_draws_the_same_bits(kind: str) -> None:
    try:
        here, there = make_renderer(kind), ProcessRenderer(kind)
    except InputError as error:
        pytest.skip(str(error))
    pose = np.eye(4)
    pose[2, 3] = 3.2
    camera = Pinhole(70.0, (39.5, 29.5), pose)
    for surface, at in objects()[:3] * 2:
        a, b = (r.render(surface, at, camera, Lighting(), PictureWindow(0, 0, 60, 80)) for r in (here, there))
        for name in ("radiance", "coverage", "depth"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    with pytest.raises(InputError, match="the window has 0 rows"):
        there.render(*objects()[0], camera, Lighting(), PictureWindow(0, 0, 0, 80))
    there.close()
    there.close()
    with pytest.raises(NotReadyError, match="closed"):
        there.render(*objects()[0], camera, Lighting(), PictureWindow(0, 0, 60, 80))
    here.close()


def test_a_renderer_in_another_process_says_why_it_cannot_be_had() -> None:
    with pytest.raises(RuntimeError, match="unknown renderer 'vulkan'"):
        ProcessRenderer("vulkan")


def test_opengl_does_not_begin_in_a_fork_of_a_process_that_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(contexts, "_started_in", os.getpid())
    assert contexts.can_start()
    monkeypatch.setattr(contexts, "_started_in", os.getpid() + 1)
    assert not contexts.can_start()
