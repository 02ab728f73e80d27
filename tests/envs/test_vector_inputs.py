"""Arguments of the native vector environment: a wrong one is named, and changes nothing."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

import spikecam_env.envs  # noqa: F401 - registers
from spikecam_env.errors import InputError
from tests.envs.kinds import DISK

ENVS = 2
SMALL: dict[str, Any] = {"shape": (16, 24), "frames_per_step": 8, "obs": "tfp"}
TRACK = "spikecam_env/Track-v1"


def native(name: str = DISK, **options: Any) -> Any:
    return gymnasium.make_vec(name, ENVS, "vector_entry_point", **{**SMALL, **options})


WRONG_OPTIONS: list[tuple[dict[str, Any], str]] = [
    ({"max_episode_steps": 0}, "max_episode_steps = 0; it must be a whole number, 1 or more"),
    ({"max_episode_steps": -2}, "max_episode_steps = -2"),
    ({"max_episode_steps": 2.5}, "max_episode_steps = 2.5"),
    ({"max_episode_steps": "5"}, "max_episode_steps = '5'"),
    ({"max_episode_steps": True}, "max_episode_steps = True"),
    ({"workers": 0}, "workers = 0; it must be a whole number, 1 or more"),
    ({"workers": 1.5}, r"workers = 1\.5"),
    ({"workers": "two"}, "workers = 'two'"),
    ({"threads": 0}, "threads"),
    ({"threads": "two"}, "threads"),
    ({"render_mode": "human"}, "unknown render_mode 'human'"),
    ({"render_mode": 3}, "unknown render_mode 3"),
    ({"device": "quantum"}, "quantum"),
    ({"device": 1.5}, r"1\.5"),
    ({"models": "scsim"}, "models = 'scsim'; give a list of 2"),
    ({"models": 3}, "models = 3; give a list of 2"),
    ({"models": {"a": 1, "b": 2}}, "give a list of 2"),
    ({"models": ["scsim"]}, "models are 1; they must be one an environment, 2"),
    ({"models": ["scsim", "scsin"]}, "scsin"),
    ({"worker": 2}, r"unknown keyword of a vector environment 'worker'; choose one of .* \(workers\?\)"),
    ({"autoreset": "SameStep"}, r"unknown keyword .* \(autoreset_mode\?\)"),
    ({"max_episode_step": 5}, r"unknown keyword .* \(max_episode_steps\?\)"),
]


@pytest.mark.parametrize("options, message", WRONG_OPTIONS)
def test_a_wrong_argument_of_the_constructor_is_named(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        native(**options)


@pytest.mark.parametrize("count", [0, -1, 1.5, "2", None, True])
def test_a_wrong_number_of_environments_is_named(count: Any) -> None:
    with pytest.raises(InputError, match=r"num_envs = .* it must be a whole number, 1 or more"):
        gymnasium.make_vec(DISK, count, "vector_entry_point", **SMALL)


@pytest.mark.parametrize(("limit", "steps"), [(None, 500), (-1, None), (7, 7)])
def test_a_limit_is_that_of_the_id_or_none_or_as_given(limit: int | None, steps: int | None) -> None:
    assert native(max_episode_steps=limit).unwrapped.max_episode_steps == steps


WRONG_SEEDS: list[tuple[Any, str]] = [
    (-1, "seed = -1; it must be a whole number, 0"),
    (2**63 - 1, "seed = 9223372036854775807"),
    (1.0, r"seed = 1\.0"),
    (True, "seed = True"),
    ("ab", "seed = 'ab'"),
    ({1, 2}, "seed = "),
    (np.zeros((2, 1), int), "seed = "),
    ([1], "seed has 1 numbers; it must be one an environment, 2"),
    ([1, 2, 3], "seed has 3 numbers"),
    ([1, -2], r"seed\[1\] = -2"),
    ([1, 2.5], r"seed\[1\] = 2\.5"),
    ([1, "2"], r"seed\[1\] = '2'"),
    (np.array([1.0, 2.0]), r"seed\[0\] = "),
]


STILL = np.zeros((ENVS, 2), np.float32)


@pytest.fixture(scope="module")
def cameras() -> Any:
    env = native()
    yield env
    env.close()


@pytest.fixture(scope="module")
def first_step(cameras: Any) -> Any:
    """A step of cameras that had no wrong call."""
    cameras.reset(seed=3)
    return cameras.step(STILL)


@pytest.fixture
def unchanged(cameras: Any, first_step: Any) -> Any:
    """Cameras that begin with seed 3, and step after the test as if nothing had been called."""
    cameras.reset(seed=3)
    yield cameras
    assert data_equivalence(cameras.step(STILL), first_step, exact=True)


@pytest.mark.parametrize("seed, message", WRONG_SEEDS)
def test_a_wrong_seed_is_named_and_changes_nothing(unchanged: Any, seed: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        unchanged.reset(seed=seed)


@pytest.mark.parametrize("seed", [5, np.int64(5), [5, 6], (5, 6), np.array([5, 6]), range(5, 7), [np.int32(5), 6]])
def test_seeds_of_any_form_are_the_environments_own(cameras: Any, seed: Any) -> None:
    cameras.reset(seed=seed)
    assert cameras.np_random_seed == (5, 6)


WRONG_RESETS: list[tuple[Any, str]] = [
    (5, "options = 5; it must be a dictionary"),
    ("light", "options = 'light'; it must be a dictionary"),
    ({1: 2}, "it must be a dictionary of options by name"),
    ([{}], "options are 1; give one dictionary for all, or one an environment, 2"),
    ([{}, 5], r"options\[1\] = 5; it must be a dictionary"),
    ([{}, {2: 3}], r"options\[1\] = .* it must be a dictionary"),
]


@pytest.mark.parametrize("options, message", WRONG_RESETS)
def test_wrong_options_of_reset_are_named_and_change_nothing(unchanged: Any, options: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        unchanged.reset(options=options)


@pytest.mark.parametrize("options", [[{"episode": 1}, {"episode": 2}], ({"episode": 1}, {"episode": 2})])
def test_each_environment_has_options_of_its_own(options: Any) -> None:
    env = native(TRACK)
    _, infos = env.reset(seed=0, options=options)
    assert infos["episode_number"].tolist() == [1, 2]
    _, infos = env.reset(seed=0, options=[{"episode": 3}, None])
    assert infos["episode_number"][0] == 3
    env.close()


WRONG_ACTIONS: list[tuple[Any, str]] = [
    (None, "actions are object"),
    ("still", "actions are <U5"),
    ([["0", "0"], ["0", "0"]], "they must be numbers"),
    ([[None, 0.0], [0.0, 0.0]], "they must be numbers"),
    (STILL + 1j, "they must be numbers"),
    ([[0.0, 0.0], [0.0]], "actions = .* they must be numbers"),
    (STILL[:1], r"actions have shape \(1, 2\); they must be one an environment, \(2, 2\)"),
    (STILL[:, :1], r"actions have shape \(2, 1\)"),
    (0.0, r"actions have shape \(\)"),
    (np.array([[0.0, 0.0], [0.0, np.nan]]), r"actions\[1\] = \[0\.0, nan\]; it must be two finite numbers"),
    (np.array([[np.inf, 0.0], [0.0, 0.0]]), r"actions\[0\] = \[inf, 0\.0\]"),
]


@pytest.mark.parametrize("actions, message", WRONG_ACTIONS)
def test_wrong_actions_are_named_and_change_nothing(unchanged: Any, actions: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        unchanged.step(actions)


@pytest.mark.parametrize("actions", [[[0, 1], [1, 0]], np.array([[0, 1], [1, 0]]), ((0.0, 5.0), (7.0, 0.0))])
def test_numbers_of_any_form_are_actions_and_are_cut(cameras: Any, actions: Any) -> None:
    cameras.reset(seed=3)
    wanted = cameras.step(np.array([[0, 1], [1, 0]], np.float32))
    cameras.reset(seed=3)
    assert data_equivalence(cameras.step(actions), wanted, exact=True)
