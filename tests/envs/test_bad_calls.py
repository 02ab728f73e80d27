"""Nonsense as options of reset, actions and keywords, at an id of every kind: an InputError that says it in a line."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

from spikecam_env.envs.registration import SMALL_TASKS, register
from spikecam_env.errors import InputError
from tests.envs.kinds import DISK, KINDS, RANDOM

register()
SMALL: dict[str, Any] = {"shape": (16, 24), "frames_per_step": 8}
IDS = (*KINDS, *SMALL_TASKS)
OPTIONS = {
    DISK: ("centre", "drift_px_s", "angle"),
    RANDOM: ("start_frame", "offset", "drift_px_s", "seed"),
    "spikecam_env/Disk-v0": ("start_frame", "offset", "drift_px_s"),
    "spikecam_env/Track-v1": ("split", "episode"),
}
OF_EVERY = ("model", "light")
NONSENSE = (None, "a", b"a", (1, 2, 3), [[1, 2]], {"x": 1}, {1}, float("nan"), (float("inf"), 0.0), object(), -1e300)


def made(name: str, **options: Any) -> Any:
    return gymnasium.make(name, **{**SMALL, **options}).unwrapped


def refused(call: Any, *arguments: Any, **keywords: Any) -> str:
    """The one line of the InputError."""
    with pytest.raises(InputError) as caught:
        call(*arguments, **keywords)
    text = str(caught.value)
    assert "\n" not in text
    return text


@pytest.mark.parametrize("name", OPTIONS)
def test_nonsense_as_an_option_of_reset_is_refused_by_name(name: str) -> None:
    env = made(name)
    for option in (*OPTIONS[name], *OF_EVERY):
        for value in NONSENSE:
            text = refused(env.reset, seed=0, options={option: value})
            assert option in text or "preset" in text, text


@pytest.mark.parametrize("name", IDS)
def test_unknown_options_and_options_that_are_no_dictionary_are_refused(name: str) -> None:
    env = made(name)
    assert "unknown option of reset 'center'" in refused(env.reset, options={"center": (1, 2)})
    for options in ([1], "split", 5, ("split", "test"), {3: 1}):
        assert "dictionary" in refused(env.reset, options=options)


def test_a_pair_with_a_number_too_many_is_not_cut() -> None:
    assert "centre = (1, 2, 3); it must be 2 numbers" in refused(made(DISK).reset, options={"centre": (1, 2, 3)})
    assert "centre = 1; it must be 2 numbers" in refused(made(DISK).reset, options={"centre": 1})


def test_pairs_may_be_lists_arrays_and_tuples() -> None:
    env = made(DISK)
    for centre in ((7.0, 8), [7, 8.0], np.array([7, 8])):
        env.reset(seed=0, options={"centre": centre, "drift_px_s": (0, 0)})
        assert env.standing.place == pytest.approx((7, 8))


@pytest.mark.parametrize("name", IDS)
def test_nonsense_as_an_action_is_refused_and_changes_nothing(name: str) -> None:
    env = made(name)
    env.reset(seed=0)
    before, (count,) = env.standing, env.action_space.shape
    wrong_count = np.zeros(count + 1)
    for action in (
        "a",
        None,
        ["0.5"] * count,
        [1, [2]],
        1j,
        {"x": 1},
        object(),
        [np.nan] * count,
        wrong_count,
        [[0.0] * count],
    ):
        assert "action is" in refused(env.step, action)
    assert env.standing == before
    env.step([0] * count)


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("mode", ["single", "sync", "vector_entry_point"])
def test_a_wrong_keyword_gets_a_suggestion(name: str, mode: str) -> None:
    def make(**options: Any) -> Any:
        if mode == "single":
            return gymnasium.make(name, **SMALL, **options)
        return gymnasium.make_vec(name, num_envs=2, vectorization_mode=mode, **SMALL, **options)

    assert "(frames_per_step?)" in refused(gymnasium.make, name, frame_per_step=4)
    assert "(obs_state?)" in refused(make, obs_stat=True)
    assert "sets it itself" in refused(make, draw=None)
    if mode != "vector_entry_point":
        assert "vector environments: gymnasium.make_vec" in refused(make, device="cuda")


def test_a_number_of_a_task_is_not_its_environment_s() -> None:
    text = refused(gymnasium.make, "spikecam_env/LowLight-v1", mean_interval=(50, 50))
    assert "TaskEnv(Track(mean_interval=...))" in text
    assert "sets it itself" in refused(gymnasium.make, "spikecam_env/Track-v1", axes=1)


def test_a_class_of_a_user_s_own_keeps_its_keywords() -> None:
    from spikecam_env.envs.rotating_disk import RotatingDiskEnv

    class Own(RotatingDiskEnv):
        def __init__(self, *, lamp: float = 1.0, **options: Any) -> None:
            self.lamp = options.pop("bulb", lamp)
            super().__init__(**options)

    assert Own(shape=(16, 24), bulb=2.0).lamp == 2.0
    assert "(lamp?)" in refused(Own, lmp=1.0)


@pytest.mark.parametrize("seed", [-1, 1.0, "3", [1], True, 2**64])
def test_nonsense_as_a_seed_is_refused_and_changes_nothing(seed: Any) -> None:
    env = made("spikecam_env/Track-v1")
    env.reset(seed=0)
    before = env.standing
    assert "seed = " in refused(env.reset, seed=seed)
    assert env.standing == before
    env.reset(seed=np.int64(0))
    assert env.np_random_seed == 0


def test_a_tensor_with_a_gradient_is_an_action() -> None:
    env = made("spikecam_env/Track-v1")
    found = []
    for action in ([0.5, 0.0], torch.tensor([0.5, 0.0], requires_grad=True)):
        env.reset(seed=0)
        found.append(env.step(action)[1])
    assert found[0] == found[1]


def test_an_action_of_another_shape_is_answered_with_the_shape() -> None:
    env = made("spikecam_env/Catch-v1")
    env.reset(seed=0)
    assert "of shape (1,)" in refused(env.step, 0.3)
    assert "of shape (1,)" in refused(env.step, np.zeros((2, 1)))
    assert "shape" not in refused(env.step, [np.nan])


@pytest.mark.parametrize("name", ["packed", "obs_state", "ground_truth"])
@pytest.mark.parametrize("value", ["no", "False", 0, 2, None, [False]])
def test_a_switch_is_true_or_false(name: str, value: Any) -> None:
    assert f"{name} = {value!r}; it must be True or False" in refused(gymnasium.make, DISK, **SMALL, **{name: value})
    made(DISK, **{name: np.True_})


def test_a_step_that_would_fill_memory_is_refused() -> None:
    assert "a step of 1000000000 frames would take" in refused(made, DISK, shape=(1000, 1000), frames_per_step=10**9)
