"""Scenes, judges and observations of users are checked where they return."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces

from scenes import RotatingDisk
from spikecam_env.envs.observations import Observation
from spikecam_env.envs.spike_camera import SpikeCameraEnv
from spikecam_env.errors import OwnCodeError

SHAPE = (8, 12)


def env(make_scene=lambda rng, options: RotatingDisk(SHAPE), judge=lambda *given: (0.0, False), **options: Any) -> Any:
    return SpikeCameraEnv(make_scene, judge, shape=SHAPE, frames_per_step=2, **options)


@pytest.mark.parametrize("found", [None, 1.0, (1.0,), (np.nan, False), (np.inf, False), (1j, False), ("1", False),
                                   (None, True), (1.0, None), (1.0, False, {}), [1.0, False]])  # fmt: skip
def test_a_judge_that_returns_no_reward_and_end_is_refused(found: Any) -> None:
    camera = env(judge=lambda *given: found)
    camera.reset(seed=0)
    with pytest.raises(OwnCodeError, match=r"judge returned .*it must return"):
        camera.step([0.0, 0.0])


@pytest.mark.parametrize("found", [(1, 0), (np.float32(0.5), np.True_), (0.25, True)])
def test_a_judge_may_return_numbers_of_numpy(found: Any) -> None:
    camera = env(judge=lambda *given: found)
    camera.reset(seed=0)
    _, reward, terminated, _, _ = camera.step([0.0, 0.0])
    assert reward == float(found[0]) and terminated is bool(found[1])


@pytest.mark.parametrize("found", [None, 3, np.ones(SHAPE), "disk"])
def test_a_make_scene_that_returns_no_scene_is_refused(found: Any) -> None:
    with pytest.raises(OwnCodeError, match=r"make_scene returned a .*it must return a scene"):
        env(lambda rng, options: found).reset(seed=0)


@dataclass(frozen=True)
class Own(Observation):
    """Whatever it is made with."""

    picture: Any

    def space(self, view: Any) -> spaces.Box:
        return spaces.Box(0, 255, (1, *view.shape), np.uint8)

    def step(self, blocks: Any, state: Any) -> Any:
        return self.picture, state


@pytest.mark.parametrize("picture", [None, 1.0, np.zeros(SHAPE, np.uint8), np.zeros((1, 1, *SHAPE)),
                                     np.zeros((2, 1, *SHAPE), np.uint8)])  # fmt: skip
def test_an_observation_that_is_not_of_its_space_is_refused(picture: Any) -> None:
    with pytest.raises(OwnCodeError, match="observation Own: step returned"):
        env(obs=Own(picture)).reset(seed=0)
    assert env(obs=Own(np.zeros((1, 1, *SHAPE), np.uint8))).reset(seed=0)[0].shape == (1, *SHAPE)
