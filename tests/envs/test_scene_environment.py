from __future__ import annotations

import warnings
from itertools import cycle
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence

from scenes.catalogue import SCENES
from scenes.flat.collage import Collage
from scenes.world import World
from spikecam_env.envs.observations import OBSERVATIONS
from spikecam_env.envs.registration import ENVIRONMENTS, register
from spikecam_env.envs.scene import SceneEnv
from spikecam_env.errors import InputError
from tests.envs.kinds import BY_SCENE, KINDS, RANDOM

register()
SMALL: dict[str, Any] = {"shape": (24, 32), "frames_per_step": 8}
NAMED = sorted(name for name, (_, options) in ENVIRONMENTS.items() if options)
OF_IDS = dict(zip((RANDOM, *NAMED), cycle(OBSERVATIONS), strict=False))
"""Every id with one of the observations, in turn; the disk has them all in `test_observations`."""
WITH_TRUTH = (BY_SCENE[Collage], BY_SCENE[World])


def make(name: str = RANDOM, **options: Any) -> SceneEnv:
    env = gymnasium.make(name, **{**SMALL, **options}).unwrapped
    assert isinstance(env, SceneEnv)
    return env


def test_every_scene_of_the_catalogue_has_an_id() -> None:
    assert {ENVIRONMENTS[name][1]["scene"] for name in NAMED} | {"random"} == set(SCENES)


@pytest.mark.slow
@pytest.mark.parametrize("name", OF_IDS)
def test_every_id_starts_with_its_target_in_view_and_steps_and_one_of_each_kind_passes_check_env(name: str) -> None:
    """The ids of a kind have the code of one class, which their last assertion here finds again: `check_env`, which
    begins several episodes, is for one of them.  Without the render check, which `test_rotating_disk` has.
    """
    env = make(name, obs=OF_IDS[name], ground_truth=name in WITH_TRUTH)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if name in KINDS:
            check_env(env, skip_render_check=True)
    observation, info = env.reset(seed=3)
    assert observation in env.observation_space and 0.01 < env.blocks.spikes.mean() < 0.6
    assert -1 <= info["target"][0] <= 33 and -1 <= info["target"][1] <= 25
    observation, reward, *_ = env.step(np.array([0.3, -0.2], np.float32))
    assert observation in env.observation_space and -1 < reward <= 1
    assert name == RANDOM or type(env._unexposed) in BY_SCENE
    env.close()


@pytest.mark.parametrize("name", ["spikecam_env/Collage-v0", "spikecam_env/Fan-v0"])
def test_same_seed_and_actions_give_the_same_bits(name: str) -> None:
    def rollout(env: SceneEnv, seed: int) -> list[Any]:
        actions = np.random.default_rng(0).uniform(-1, 1, (3, 2))
        return [env.reset(seed=seed), *(env.step(action) for action in actions)]

    env = make(name, ground_truth=True)
    first, other, again = rollout(env, 3), rollout(env, 4), rollout(env, 3)
    assert data_equivalence(first, again, exact=True)
    assert data_equivalence(first, rollout(make(name, ground_truth=True), 3), exact=True)
    assert not data_equivalence(first, other, exact=True)


def test_target_is_where_the_truth_sees_it() -> None:
    """The middle of the pixels of a shape that stands alone is where the shape's middle is said to be."""
    env = make("spikecam_env/Disk-v0", shape=(100, 100), frames_per_step=2, ground_truth=True)
    for frame in (0, 12_345):
        _, info = env.reset(seed=0, options={"start_frame": frame, "offset": (2.0, -1.0)})
        rows, columns = np.nonzero(info["object_id"])
        seen = np.array([columns.mean(), rows.mean()])
        print(f"target {info['target']}, seen {seen}")
        assert np.abs(seen - info["target"]).max() < 0.1


def test_bodies_in_space_are_seen_where_they_are_said_to_be() -> None:
    """Dice are convex: the middle of a die's pixels is within a quarter of its size of its projected middle."""
    env = make("spikecam_env/Dice-v0", shape=(60, 96), frames_per_step=1, ground_truth=True)
    _, info = env.reset(seed=1, options={"offset": (0.0, 0.0)})
    scene: Any = env.scene
    inside = 0
    for name, (x, y) in scene.places(0.5).items():
        if 8 < x < 87 and 8 < y < 51:
            around = info["object_id"][int(y) - 1 : int(y) + 3, int(x) - 1 : int(x) + 3]
            assert (around > 0).all(), name
            inside += 1
    assert inside >= 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scene": "dise"}, "unknown scene 'dise'"),
        ({"scene": "disk", "target": "fly"}, "unknown target .*'fly'"),
        ({"start_offset_px": -1.0}, "start_offset_px = -1"),
        ({"scene": "disk", "mean_interval": 0.5}, "mean_interval = 0.5"),
    ],
)
def test_bad_options_are_named(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        SceneEnv(**{**SMALL, **options})


def test_a_named_scene_takes_no_seed_in_its_options() -> None:
    with pytest.raises(InputError, match="unknown option of reset 'seed'"):
        make("spikecam_env/Disk-v0").reset(options={"seed": 2})
