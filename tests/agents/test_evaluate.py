"""`evaluate`: any policy on test episodes, its score and its interval."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from itertools import pairwise
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import FrameStackObservation

from spikecam_env.agents import Evaluation, evaluate
from spikecam_env.agents.agent import Agent
from spikecam_env.agents.playing import score_of
from spikecam_env.agents.tracker import Tracker
from spikecam_env.envs.score import BASELINES, ends, play
from spikecam_env.errors import InputError

SMALL: dict[str, Any] = {"shape": (16, 24)}
REST = np.zeros(1, np.float32)


def test_nothing_scores_zero_and_the_oracle_one() -> None:
    assert evaluate("nothing", "Catch-v1", episodes=5, **SMALL).score == 0.0
    assert evaluate("oracle", "Catch-v1", episodes=5, **SMALL).score == 1.0
    assert evaluate("oracle", "Disk-v0", episodes=1, max_episode_steps=60, **SMALL).score == 1.0


def test_nothing_and_the_oracle_are_played_on_the_episodes_of_the_policy_without_pictures() -> None:
    env = gymnasium.make("spikecam_env/Saccade-v1", split="test", **SMALL)
    found = ends(env, range(3, 7))
    played = [play(env, BASELINES[name], range(3, 7)).performances for name in ("nothing", "oracle")]
    assert [tuple(each) for each in found] == played


def test_an_agent_gets_its_own_observation_and_the_score_of_studies() -> None:
    agent = Agent.load("Catch-v1")
    result = evaluate(agent, "Catch-v1", episodes=5)
    assert result == evaluate("Catch-v1", "Catch-v1", episodes=5)
    assert result.score == score_of(agent, agent.make(split="test"), 5)


def test_a_tracker_is_given_its_observation_by_name() -> None:
    env: Any = gymnasium.make("spikecam_env/Catch-v1")
    assert evaluate(Tracker(env.unwrapped), "Catch-v1", episodes=3, obs="tfp", obs_state=True).score == 1.0


def test_a_stack_has_the_newest_picture_last_and_zeros_before_the_first() -> None:
    seen: list[Any] = []

    def policy(pictures: Any) -> Any:
        seen.append(pictures)
        return REST

    evaluate(policy, "Catch-v1", episodes=1, stack=3, **SMALL)
    assert seen[0].shape == (3, 16, 24) and not seen[0][:2].any() and seen[0][2].any()
    for before, after in pairwise(seen):
        np.testing.assert_array_equal(before[1:], after[:-1])


def test_wrappers_of_the_training_are_put_around_the_environment() -> None:
    shapes = set()

    def policy(pictures: Any) -> Any:
        shapes.add(pictures.shape)
        return REST

    evaluate(policy, "Catch-v1", episodes=1, wrap=lambda env: FrameStackObservation(env, 4), **SMALL)
    assert shapes == {(4, 1, 16, 24)}


def test_the_same_call_gives_the_same_result_and_other_seeds_other_episodes() -> None:
    one, again, other = (evaluate("random", "Catch-v1", episodes=4, seed=seed, **SMALL) for seed in (0, 0, 50))
    assert one == again and one.returns != other.returns


class Model:
    """With the `predict` of stable-baselines3 and a memory: its action is the number of the step."""

    observation_space = gymnasium.spaces.Box(0, 255, (1, 16, 24), np.uint8)

    def __init__(self) -> None:
        self.states: list[Any] = []

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> Any:
        assert deterministic and bool(episode_start[0]) == (state is None)
        self.states.append(state)
        return REST, 0 if state is None else state + 1


def test_a_model_with_predict_keeps_its_memory_within_an_episode() -> None:
    model = Model()
    evaluate(model, "Catch-v1", episodes=2, **SMALL)
    begins = [n for n, state in enumerate(model.states) if state is None]
    assert len(begins) == 2 and model.states[1 : begins[1]] == list(range(begins[1] - 1))
    with pytest.raises(
        InputError, match=r"made for observations \(1, 16, 24\), the task has \(3, 16, 24\); stack is 3"
    ):
        evaluate(Model(), "Catch-v1", episodes=1, stack=3, **SMALL)


@pytest.mark.parametrize(
    ("policy", "task", "options", "message"),
    [
        (None, "Catch-v1", {}, "policy is None"),
        ("Cacth-v1", "Catch-v1", {}, "Catch-v1"),
        ("nothing", "Cacth-v1", {}, r"unknown task .*\(Catch-v1\?\)"),
        ("nothing", 5, {}, "unknown task 5"),
        ("nothing", "Catch-v1", {"episodes": 0}, "episodes = 0"),
        ("nothing", "Catch-v1", {"stack": 0}, "stack = 0"),
        ("nothing", "Catch-v1", {"seed": -1}, "seed = -1"),
        ("nothing", "Catch-v1", {"split": "tests"}, "unknown split"),
        ("nothing", "Catch-v1", {"stack": 2, "obs_state": True}, "use wrap"),
        ("nothing", "Catch-v1", {"frame_per_step": 2}, "frames_per_step"),
        (lambda seen: "left", "Catch-v1", {"episodes": 1}, "action is 'left'"),
        (lambda seen: np.zeros(3), "Catch-v1", {"episodes": 1}, "action is"),
    ],
)
def test_what_cannot_be_evaluated_is_named(policy: Any, task: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        evaluate(policy, task, **{**SMALL, **options})


def test_the_interval_covers_the_truth_in_nineteen_of_twenty_evaluations() -> None:
    """400 evaluations of 20 episodes, of shares of time and of catches: within 3 standard errors of 95 %, from below
    within the 3 % by which a bootstrap of 20 falls short (Efron and Tibshirani, chapter 13)."""
    rng, runs, count = np.random.default_rng(0), 400, 20
    for name, draw, mean in (
        ("bootstrap", lambda: rng.beta(4, 2, count), 4 / 6),
        ("Wilson", lambda: (rng.random(count) < 0.9).astype(float), 0.9),
    ):
        results = [
            Evaluation.of("x", draw(), np.zeros(count), np.ones(count), success=0, returns=0) for _ in range(runs)
        ]
        covered = float(np.mean([result.low <= mean <= result.high for result in results]))
        error = 3 * (0.05 * 0.95 / runs) ** 0.5
        print(f"{name}: {covered:.3f}")
        assert 0.92 - error <= covered <= 0.95 + error + 0.02
        assert name in {result.method for result in results}


def test_one_hundred_catches_of_one_hundred_are_not_certainty() -> None:
    result = Evaluation.of("Catch-v1", [1.0] * 100, [0.0] * 100, [1.0] * 100, success=1.0, returns=1.0)
    assert result.score == result.high == 1.0 and 0.95 < result.low < 0.97
    assert np.isnan(Evaluation.of("Track-v1", [0.5], [0.0], [1.0], success=1.0, returns=1.0).low)


def test_it_prints_its_figures_and_cannot_be_changed() -> None:
    result = evaluate("nothing", "Catch-v1", episodes=5, **SMALL)
    text = str(result)
    for part in ("Catch-v1, 5 episodes", "score        0.000", "95 % interval 0.000 to", "oracle 1.000"):
        assert part in text
    with pytest.raises(FrozenInstanceError):
        result.score = 1.0  # type: ignore[misc]


def test_a_class_and_wrappers_that_give_no_environment_are_refused() -> None:
    with pytest.raises(InputError, match="policy is the class Model; give an instance"):
        evaluate(Model, "Catch-v1", **SMALL)
    for wrap in (3, lambda env: None):
        with pytest.raises(InputError, match=r"wrap is .* give a function"):
            evaluate("nothing", "Catch-v1", wrap=wrap, **SMALL)


def test_an_environment_of_others_is_refused() -> None:
    with pytest.raises(InputError, match="CartPole-v1 makes a CartPoleEnv, which has no oracle"):
        evaluate("nothing", "CartPole-v1", episodes=1)
