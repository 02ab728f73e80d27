"""Agents: their memory, that learning can be repeated and resumed, files, the tracker, and the shipped ones."""

from __future__ import annotations

import runpy
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

from denoiser.training.resumable_run import Run
from spikecam_env.agents import ppo
from spikecam_env.agents import study as studies
from spikecam_env.agents.agent import Agent, shipped
from spikecam_env.agents.history import History
from spikecam_env.agents.playing import score_of
from spikecam_env.agents.policy import LOG_SIGMA, PolicyRecipe
from spikecam_env.agents.ppo import PPO, _gain
from spikecam_env.agents.tracker import Tracker
from spikecam_env.agents.training import Study, agents_along, learner, train_agent
from spikecam_env.cli.main import run as command
from spikecam_env.errors import InputError

SMALL = PPO(steps=17 * 2 * 8, rollout=8, epochs=1)
"""A leg of sixteen updates and one of one, of two cameras."""


def _observation(value: int, gaze: float) -> dict[str, np.ndarray]:
    picture = np.full((2, 1, 4, 4), value, np.uint8)
    return {"picture": picture, "gaze": np.full((2, 2), gaze, np.float32), "age": np.zeros((2, 1), np.float32)}


def test_a_history_has_pictures_and_motion_by_their_lags_and_starts_over_with_an_episode() -> None:
    history = History((0, 2))
    for step in range(4):
        seen = history.push(_observation(step, 10.0 * step), np.array([False, step == 3]))
    assert seen.pictures[:, :, 0, 0].tolist() == [[3, 1], [3, 3]]
    assert seen.state.tolist() == [[10, 10, 20, 20, 0], [0, 0, 0, 0, 0]]


def test_the_place_of_a_map_is_where_it_is_high() -> None:
    policy = PolicyRecipe(channels=1, shape=(32, 32), high=255, lags=(0,), actions=1, maps=1).network()
    maps = torch.zeros(1, 1, 9, 9)
    maps[0, 0, 6, 2] = 20.0
    x, y, _ = policy._places(maps)[0].tolist()
    assert (x, y) == pytest.approx((-0.5, 0.5), abs=1e-3)


def test_maps_of_any_scale_give_the_same_action_and_pass_the_gradient_on() -> None:
    torch.manual_seed(0)
    policy = PolicyRecipe(channels=1, shape=(32, 32), high=255, lags=(0,), actions=1).network()
    pictures, state = torch.randint(0, 256, (8, 1, 32, 32), dtype=torch.uint8), torch.zeros(8, 3)

    def taught() -> tuple[torch.Tensor, float]:
        policy.zero_grad()
        _, value, _ = policy(pictures, state)
        value.square().sum().backward()
        return value.detach(), float(policy.trunk[0].weight.grad.norm())

    value, gradient = taught()
    policy.eye[4].weight.data *= 1000
    policy.eye[4].bias.data *= 1000
    large_value, large_gradient = taught()
    print(f"gradient of the first layer that steers: {gradient:.3g}, with maps a thousandfold {large_gradient:.3g}")
    assert large_value.tolist() == pytest.approx(value.tolist(), rel=0.05)
    assert large_gradient == pytest.approx(gradient, rel=0.05)


def test_an_agent_that_is_to_read_rarely_says_something_before_it_learns() -> None:
    recipe = PolicyRecipe(channels=1, shape=(32, 32), high=255, lags=(0,), actions=7, answers=4)
    mean = recipe.network().mean.bias.detach()
    said = 1 - float(torch.distributions.Normal(mean[2], torch.tensor(LOG_SIGMA).exp()).cdf(torch.tensor(0.0)))
    print(f"an answer by chance in {100 * said:.1f} % of the steps")
    assert mean[:2].tolist() == [0, 0] and mean[3:].tolist() == [0, 0, 0, 0]
    assert 1 / 100 < said < 1 / 10


def test_gain_is_the_discounted_sum_of_surprises_to_the_end_of_an_episode() -> None:
    surprise, over = torch.tensor([[1.0], [2.0], [4.0]]), torch.tensor([[0.0], [1.0], [0.0]])
    weight = SMALL.gamma * SMALL.decay
    assert _gain(surprise, over, SMALL)[:, 0].tolist() == pytest.approx([1 + 2 * weight, 2, 4])


@pytest.mark.parametrize("how", [SMALL, replace(SMALL, imitate=True)], ids=["rewards", "oracle"])
def test_a_run_that_was_stopped_and_resumed_is_the_run_that_was_not(how: PPO, tmp_path: Path, monkeypatch) -> None:
    study, whole, parts = Study("Catch-v1", options={"shape": (16, 16)}), tmp_path / "whole", tmp_path / "parts"
    whole.mkdir()
    parts.mkdir()
    train_agent(study, whole, how, seed=3, environments=2, points=4)
    assert list(agents_along(whole)) == [80, 144, 208, 272]  # the updates in which a quarter is full
    save = Run.save

    def stop(run: Run, path: Path) -> None:
        save(run, path)
        raise KeyboardInterrupt

    monkeypatch.setattr(Run, "save", stop)
    with pytest.raises(KeyboardInterrupt):
        train_agent(study, parts, how, seed=3, environments=2)
    monkeypatch.setattr(Run, "save", save)
    train_agent(study, parts, how, seed=3, environments=2)
    one, two = (Agent.load(folder / "agent.pt") for folder in (whole, parts))
    assert len(one.training["curve"]) == 2
    for name, weights in one.policy.state_dict().items():
        assert torch.equal(weights, two.policy.state_dict()[name]), name


@pytest.mark.slow
def test_who_imitates_plays_without_noise_and_comes_to_act_like_the_oracle(tmp_path: Path, monkeypatch) -> None:
    misses: list[float] = []
    learn = ppo._learn

    def watch(policy: Any, optimiser: Any, seen: list[dict[str, torch.Tensor]], how: PPO) -> None:
        misses.append(float((seen[-1]["action"] - seen[-1]["best"]).square().mean()))
        learn(policy, optimiser, seen, how)

    monkeypatch.setattr(ppo, "_learn", watch)
    imitating = replace(learner(2048, imitate=True), rollout=32)
    train_agent(Study("Catch-v1", options={"shape": (16, 16)}), tmp_path, imitating, environments=4)
    first, last = np.mean(misses[:2]), np.mean(misses[-4:])
    print(f"mean square from the oracle's action: {first:.2f} at first, {last:.2f} at last")
    assert last < 0.7 * first  # of rollouts of 128 actions: the ratio is 0.5, and scatters by 0.06
    policy = Agent.load(tmp_path / "agent.pt").policy
    assert policy.log_sigma.tolist() == [LOG_SIGMA]  # noise is not played, and not learned


def test_an_agent_acts_for_many_as_for_each(tmp_path: Path) -> None:
    torch.manual_seed(0)
    policy = PolicyRecipe(channels=1, shape=(4, 4), high=255, lags=(0, 1), actions=1, pool=1).network()
    with torch.no_grad():
        policy.mean.weight.mul_(100)
    many, one = (Agent("Catch-v1", "tfp", policy) for _ in range(2))
    many.save(tmp_path / "agent.pt")
    one = Agent.load(tmp_path / "agent.pt")
    many = Agent.load(tmp_path / "agent.pt")
    for step in range(3):
        observation = _observation(40 * step, 3.0 * step)
        actions = many.act(observation)
        action = one.act({name: array[1] for name, array in observation.items()})
        assert actions.shape == (2, 1) and action == pytest.approx(
            actions[1], abs=1e-6
        )  # float32: sums of many in another order
    assert abs(action[0]) > 1e-3


@pytest.mark.parametrize("source", ["Cath-v1", "none.pt", "noise.pt", "denoiser/weights/best.pt"])
def test_a_file_that_is_no_agent_is_refused(source: str, tmp_path: Path, monkeypatch) -> None:
    if source == "noise.pt":
        (tmp_path / source).write_bytes(bytes(range(256)) * 9)
        monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError):
        Agent.load(source)


def test_an_agent_refuses_what_it_does_not_see() -> None:
    agent = Agent("Catch-v1", "tfp", PolicyRecipe(channels=1, shape=(8, 8), high=255, lags=(0,), actions=1).network())
    with pytest.raises(InputError, match="obs_state"):
        agent.act(np.zeros((1, 8, 8), np.uint8))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="tfp"):
        agent.act(_observation(0, 0.0))


@pytest.mark.parametrize("obs", ["tfp", "tfi"])
@pytest.mark.parametrize("task, episodes", [("Catch-v1", 10), ("Saccade-v1", 4), ("Track-v1", 1)])
def test_the_tracker_is_as_good_as_the_oracle(task: str, episodes: int, obs: str) -> None:
    env = gymnasium.make(f"spikecam_env/{task}", split="test", obs=obs, obs_state=True)
    assert score_of(Tracker(env.unwrapped), env, episodes) > 0.9
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    "task, least, episodes",
    [
        ("Catch-v1", 0.6, 20),
        ("Saccade-v1", 0.5, 10),
        ("Track-v1", 0.7, 1),
        ("LowLight-v1", 0.7, 1),
        ("Exposure-v1", 0.7, 1),
        ("ReadSpin-v1", 0.3, 10),
        ("Return-v1", 0.1, 10),
    ],
)
def test_a_shipped_agent_does_its_task(task: str, least: float, episodes: int) -> None:
    agent = Agent.load(task)
    env = agent.make(split="test")
    assert score_of(agent, env, episodes) > least
    env.close()


def test_shipped_agents_are_small() -> None:
    sizes = {
        task: Path(str(studies.__file__)).with_name("weights").joinpath(f"{task}.pt").stat().st_size
        for task in shipped()
    }
    assert sizes and max(sizes.values()) < 300_000


def test_the_example_learns(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["ppo.py", "512"])
    runpy.run_path(str(Path(__file__).parents[2] / "examples" / "ppo.py"), run_name="__main__")
    assert "95 % interval" in capsys.readouterr().out
    assert Agent.load(tmp_path / "catch.pt").task == "Catch-v1"


def _measured_again(*_: object, **__: object) -> None:
    raise AssertionError("it was measured again")


@pytest.mark.slow
def test_a_study_goes_on_from_its_record(tmp_path: Path, monkeypatch, capsys) -> None:
    line = ["evaluate", "agents", "--out", str(tmp_path), "--tasks", "Catch-v1", "--observations", "tracker", "frame30"]
    line += ["--seeds", "2", "--steps", "64", "--episodes", "2"]
    assert command(line) == 0
    first = capsys.readouterr().out
    monkeypatch.setattr(studies, "measure", _measured_again)
    assert command(line) == 0
    assert capsys.readouterr().out == first
    with pytest.raises(AssertionError, match="measured again"):  # by other episodes it is another score
        command([*line[:-1], "1"])
    assert (tmp_path / "curves.png").stat().st_size > 1000
    assert command([*line, "--films"]) == 0
    assert sorted(film.name for film in tmp_path.glob("*.mp4")) == [
        "Catch-v1-frame30-64steps-0.mp4",
        "Catch-v1-tracker-0.mp4",
    ]
    rows = [row.split() for row in first.splitlines() if row.startswith("Catch-v1")]
    assert [row[1] for row in rows] == ["tracker", "frame30"] and float(rows[0][3]) == 1.0


@pytest.mark.slow
def test_a_learning_curve_has_a_point_for_every_agent_on_the_way(tmp_path: Path) -> None:
    wanted = studies.cases(["Track-v1"], ["tfp", "tracker"], [], [0], [2 * 1024], 2, shape=(16, 16))
    learned, tracked = studies.study(wanted, tmp_path)
    print([(row["steps"], round(row["score"], 3)) for row in learned.along], f"at the end {learned.score:.3f}")
    assert [row["steps"] for row in learned.along] == [1024, 2048] and len(learned.curve) == 1
    first, last = (Agent.load(path).policy.state_dict() for path in agents_along(tmp_path / wanted[0].folder).values())
    whole = Agent.load(tmp_path / wanted[0].folder / "agent.pt").policy.state_dict()
    assert all(torch.equal(whole[name], last[name]) for name in whole)
    assert not all(torch.equal(first[name], last[name]) for name in whole)
    assert learned.along[-1]["score"] == learned.score and not tracked.along  # by the same two episodes
    assert studies.read_record(tmp_path / studies.RECORD)[0].along == learned.along


@pytest.mark.slow
def test_one_training_is_played_at_every_light(tmp_path: Path) -> None:
    wanted = studies.cases(
        ["LowLight-v1"], ["tfp", "tracker"], [50, 100], [3], [2], 1, trained=(20, 200), shape=(16, 16), imitate=True
    )
    results = studies.study(wanted, tmp_path)
    assert [(result.case.sight, result.case.interval) for result in results] == [
        ("tfp", 50),
        ("tfp", 100),
        ("tracker", 50),
        ("tracker", 100),
    ]
    (folder,) = tmp_path.glob("*/")
    assert folder.name == "LowLight-v1-16-16-20-200-tfp-imitating-2steps-3"
    assert Agent.load(folder / "agent.pt").training["ppo"]["imitate"] is True
    with pytest.raises(InputError, match="shortest"):
        studies.cases(["LowLight-v1"], ["tfp"], [], [0], [2], trained=(200, 20))


def test_a_study_plays_the_agent_that_comes_with_the_package(tmp_path: Path) -> None:
    (result,) = studies.measure([studies.StudyRun(task="Catch-v1", sight="shipped", episodes=5)], tmp_path)
    agent = Agent.load("Catch-v1")
    env = agent.make(split="test")
    assert result.score == score_of(agent, env, 5) > 0
    env.close()
    with pytest.raises(InputError, match=r"ReadDigit-v1.*Catch-v1"):
        studies.cases(["ReadDigit-v1"], ["shipped"], [], range(1))
