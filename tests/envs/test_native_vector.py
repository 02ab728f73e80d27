"""The native vector environment against as many single ones, bit for bit."""

from __future__ import annotations

import sys
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode

from spikecam_env.bench.environments import bench_episodes, bench_vectors
from spikecam_env.envs.observations import OBSERVATIONS
from spikecam_env.envs.registration import ENVIRONMENTS, TASK_ENVIRONMENTS, register
from spikecam_env.envs.rotating_disk import RotatingDiskEnv
from spikecam_env.envs.vector import SpikeCameraVectorEnv, batched
from spikecam_env.errors import InputError, NotReadyError
from tests.envs.kinds import DISK, KINDS

register()
SMALL: dict[str, Any] = {"shape": (16, 24), "frames_per_step": 20}
STEPS = 14
FAST = 20_000.0
"""Pixels a second at which the disk leaves the picture within a few steps, so that episodes end at various times."""


def vector(mode: str, name: str = DISK, num_envs: int = 3, **options: Any) -> Any:
    return gymnasium.make_vec(name, num_envs=num_envs, vectorization_mode=mode, **{**SMALL, **options})


def rollout(env: Any, steps: int = STEPS) -> list[Any]:
    """Everything that the vector returns; closes it."""
    rng = np.random.default_rng(0)
    found = [env.reset(seed=3)]
    found += [env.step(rng.uniform(-1, 1, (env.num_envs, 2)).astype(np.float32)) for _ in range(steps)]
    env.close()
    return found


def same(a: list[Any], b: list[Any]) -> None:
    for number, (ours, theirs) in enumerate(zip(a, b, strict=True)):
        assert data_equivalence(ours[0], theirs[0], exact=True), f"observation {number}"
        for x, y in zip(ours[1:-1], theirs[1:-1], strict=True):
            np.testing.assert_array_equal(x, y)
        assert ours[-1].keys() == theirs[-1].keys()
        for name, values in ours[-1].items():
            np.testing.assert_array_equal(values, theirs[-1][name], err_msg=name)


@pytest.mark.parametrize("obs", OBSERVATIONS)
def test_bits_are_those_of_single_environments_also_over_the_ends_of_episodes(obs: str) -> None:
    options = {"obs": obs, "obs_state": True, "max_gaze_rate_px_s": FAST, "max_episode_steps": 5}
    ours = rollout(vector("vector_entry_point", **options))
    ends = np.array([step[2] for step in ours[1:]]), np.array([step[3] for step in ours[1:]])
    assert ends[0].any() and ends[1].any(), "no episode ended"
    theirs = rollout(vector("sync", **options))
    if obs == "rate":
        theirs = [(rounded_as(b[0], a[0]), *b[1:]) for a, b in zip(ours, theirs, strict=True)]
    same(ours, theirs)


def rounded_as(seen: Any, other: Any) -> Any:
    """The same, with the other's picture where it is a grey level off in few pixels: a batch through the network may
    take its float32 sums in another order."""
    off = np.abs(seen["picture"].astype(int) - other["picture"])
    assert off.max() <= 1 and (off > 0).mean() < 0.01
    return seen | {"picture": other["picture"]}


def test_the_number_of_workers_changes_no_bit() -> None:
    few, many = (rollout(vector("vector_entry_point", num_envs=5, obs="tfi", workers=n)) for n in (1, 4))
    same(few, many)


@pytest.mark.parametrize("name", KINDS)
def test_a_vector_of_every_kind_of_scene_has_the_bits_of_single_environments(name: str) -> None:
    ours, theirs = (rollout(vector(mode, name, 2), 2) for mode in ("vector_entry_point", "sync"))
    same(ours, theirs)


def test_every_id_has_a_vector() -> None:
    """Of the class of its single environment; the kinds of scenes stand for all ids of that class."""
    for name in (*ENVIRONMENTS, *TASK_ENVIRONMENTS):
        spec = gymnasium.spec(name)
        assert spec.vector_entry_point == f"spikecam_env.envs.vector:{str(spec.entry_point).replace(':', '.')}"
    classes = {gymnasium.spec(name).entry_point for name in ENVIRONMENTS}
    assert classes == {gymnasium.spec(name).entry_point for name in KINDS}


def test_models_are_each_environment_s_own() -> None:
    models = ["ideal", "scsim", "physical"]
    ours = SpikeCameraVectorEnv(RotatingDiskEnv, 3, models=models, **SMALL)
    seen, _ = ours.reset(seed=[7, 8, 7])
    for n, model in enumerate(models):
        np.testing.assert_array_equal(seen[n], RotatingDiskEnv(model=model, **SMALL).reset(seed=7 + n % 2)[0])
    ours.close()


def test_options_reach_every_environment_for_one_episode() -> None:
    env = vector("vector_entry_point", obs="tfp")
    usual, _ = env.reset(seed=0)
    bright, _ = env.reset(seed=0, options={"light": 1.5})
    assert (bright.mean(axis=(1, 2, 3)) > 1.2 * usual.mean(axis=(1, 2, 3))).all()
    env.close()


def test_spaces_mode_and_limit_are_declared() -> None:
    env = vector("vector_entry_point", obs="tfp", obs_state=True)
    single = gymnasium.make(DISK, **SMALL, obs="tfp", obs_state=True)
    assert env.single_observation_space == single.observation_space
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert env.unwrapped.max_episode_steps == gymnasium.spec(DISK).max_episode_steps
    assert gymnasium.spec(DISK).to_json()
    seen, _ = env.reset(seed=0)
    assert seen in env.observation_space
    assert env.step(env.action_space.sample())[0] in env.observation_space
    env.close()


def test_observations_are_fresh() -> None:
    env = vector("vector_entry_point", obs="spikes")
    seen, _ = env.reset(seed=0)
    kept = seen.copy()
    env.step(np.zeros((3, 2), np.float32))
    np.testing.assert_array_equal(seen, kept)
    env.close()


def test_render_gives_a_picture_of_each() -> None:
    env = vector("vector_entry_point", render_mode="rgb_array")
    env.reset(seed=0)
    assert [picture.shape for picture in env.render()] == [(16, 24, 3)] * 3
    env.close()


def test_nothing_works_before_the_first_reset_and_after_close() -> None:
    env = vector("vector_entry_point")
    with pytest.raises(NotReadyError, match="call reset first"):
        env.step(np.zeros((3, 2), np.float32))
    env.close()
    env.close()
    with pytest.raises(NotReadyError, match="closed"):
        env.reset(seed=0)


@pytest.mark.slow
def test_the_bench_has_a_row_for_each_way() -> None:
    rows = bench_vectors(counts=(1, 2), cases=(("Track-v1", "tfp"),), seconds=0.01, rounds=1)
    assert [(row["how"], row["environments"]) for row in rows] == [
        ("single", 1),
        *((how, count) for count in (1, 2) for how in ("sync", "async", "native")),
    ]
    assert all(row["steps/s"] > 0 for row in rows)
    assert rows[0]["x single"] == 1.0 and all(row["x async"] == 1.0 for row in rows if row["how"] == "async")
    asked = [row for row in rows if row["how"] != "async" or sys.platform == "linux"]
    assert all(row["processor ms"] > 0 for row in asked)
    assert all(row["x async, processor"] == 1.0 for row in asked if row["how"] == "async")
    parts = ("light, %", "camera, %", "beside both, %")
    for row in rows:
        if row["how"] in ("single", "native"):
            assert row[parts[0]] > 0 and row[parts[1]] > 0 and sum(row[part] for part in parts) == pytest.approx(100)
        else:
            assert [row[part] for part in parts] == ["", "", ""]


def test_the_bench_times_episodes() -> None:
    (row,) = bench_episodes(kinds=("Track-v1",), episodes=2, steps=3)
    assert row["id"] == "Track-v1" and row["begin ms"] > 0
    assert row["frames/s"] == pytest.approx(40_000 / row["step ms"])


def test_an_environment_with_a_step_of_its_own_is_refused() -> None:
    class Own(RotatingDiskEnv):
        def step(self, action: Any) -> Any:
            return super().step(action)

    with pytest.raises(InputError, match=r"Own has a step of its own, .* override turn, outcome instead"):
        SpikeCameraVectorEnv(Own, 2, **SMALL)


def test_infos_that_only_some_have_are_marked() -> None:
    """As gymnasium's own vectors collect them, one environment after another."""
    infos = [{"a": 1.5, "b": np.array([1, 2])}, {"a": 2.5, "c": {"d": True}}, {"e": "text", "b": np.array([3, 4])}]
    collected: dict[str, Any] = {}
    own = gymnasium.vector.VectorEnv()
    own.num_envs = 3
    for n, info in enumerate(infos):
        collected = own._add_info(collected, info, n)
    assert data_equivalence(batched(infos), collected, exact=True)
