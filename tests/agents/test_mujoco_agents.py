"""Agents on MuJoCo tasks: what they observe, that they learn and are scored, and studies over levels."""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from denoiser.training.resumable_run import Run
from spikecam_env.agents import evaluate, learner_sb3
from spikecam_env.agents import study as studies
from spikecam_env.agents.agent import Agent
from spikecam_env.agents.controllers import classical
from spikecam_env.agents.controllers.read import ReadController
from spikecam_env.agents.controllers.timing import PictureTiming
from spikecam_env.agents.history import History
from spikecam_env.agents.playing import acting, judged
from spikecam_env.agents.ppo import PPO, train
from spikecam_env.agents.training import Study, learner, recipe_of, train_agent
from spikecam_env.cli.live.episodes import environment, episode
from spikecam_env.cli.live.players import player
from spikecam_env.cli.main import run as command
from spikecam_env.errors import InputError

FAST: dict[str, Any] = {"level": 5, "shape": (32, 32)}
"""An episode of level 5 in which nothing is done has 64 steps."""


def test_a_history_has_encoders_and_their_changes_in_place_of_the_gaze() -> None:
    history = History((0, 2))
    for step in range(4):
        picture, age = np.full((2, 1, 4, 4), step, np.uint8), np.full((2, 1), 7, np.float32)
        seen = history.push(
            {"picture": picture, "inner": np.full((2, 3), 10.0 * step, np.float32), "age": age},
            np.array([False, step == 3]),
        )
    assert seen.state.tolist() == [[30, 30, 30, 20, 20, 20, 7], [30, 30, 30, 0, 0, 0, 7]]


@pytest.mark.parametrize("imitate", [False, True], ids=["rewards", "oracle"])
def test_an_agent_learns_return_and_is_scored(imitate: bool, tmp_path: Path) -> None:
    how = learner(128, imitate=True) if imitate else PPO(steps=128)
    train_agent(Study("Return-v1", options=FAST), tmp_path, how, environments=2)
    agent = Agent.load(tmp_path / "agent.pt")
    result = evaluate(agent, "Return-v1", episodes=1, **FAST)
    assert result.oracle == 1.0 and result.camera_bits_s == 32 * 32 * 40_000
    env = agent.make(split="test", **FAST)
    observation, _ = env.reset(seed=0)
    assert agent.act(observation).shape == env.action_space.shape
    env.close()
    with pytest.raises(InputError, match=r"inner.*obs_inner=True"):
        agent.act({"picture": observation["picture"], "age": observation["age"]})


def test_a_model_with_predict_is_scored_on_a_mujoco_task() -> None:
    class Still:
        def predict(self, observation: Any, deterministic: bool) -> Any:
            return np.zeros(2, np.float32), None

    assert evaluate(Still(), "Return-v1", episodes=1, stack=2, **FAST).score == 0.0


def test_gymnasiums_own_vector_teaches_what_the_native_one_teaches() -> None:
    """Catch has both; episodes of 16 pixels end within the rollouts, and begin anew in the step after."""
    study, taught = Study("Catch-v1", options={"shape": (16, 16), "frames_per_step": 400}), []
    for mode in ("vector_entry_point", "sync"):
        envs = gymnasium.make_vec("spikecam_env/Catch-v1", num_envs=2, vectorization_mode=mode, **study.keywords)
        run = Run.begin(recipe_of(study, envs).network())
        run.network.load_state_dict(taught[0][0] if taught else run.network.state_dict())
        before = {name: tensor.clone() for name, tensor in run.network.state_dict().items()}
        train(envs, run, PPO(steps=128, rollout=32), 0, lambda: None)
        taught.append((before, run.curve[-1] | {"cpu_s": 0.0}))
        envs.close()
    assert taught[0][1] == taught[1][1] and taught[0][1]["episodes"] > 0


def test_an_agent_of_a_slow_camera_can_be_loaded(tmp_path: Path) -> None:
    """Ages of its pictures are up to 1333 frames, whose variance is beyond float16."""
    agent = Agent("Catch-v1", "frame30", recipe_of(study := Study("Catch-v1", "frame30"), study.make_vec(1)).network())
    agent.policy.variance.fill_(1333.0**2)
    agent.save(tmp_path / "agent.pt")
    assert np.isfinite(Agent.load(tmp_path / "agent.pt").policy.variance.numpy()).all()


@pytest.mark.parametrize(
    "given, said",
    [
        ({"tasks": ["Track-v1"], "levels": [1]}, "Track-v1 has no levels"),
        ({"tasks": ["Return-v1"], "levels": [6]}, "level"),
        ({"tasks": ["Return-v1"], "trained_levels": (5, 1)}, "lowest, then the highest"),
        ({"tasks": ["Return-v1"], "trained": (20.0, 50.0)}, "one mean interval"),
        ({"tasks": ["Return-v1"], "learners": ["sb4"]}, "sb3"),
        ({"tasks": ["ReadSpin-v1"], "sights": ["classical"]}, "classical controller"),
        ({"tasks": ["Read-v1"], "sights": ["classical-events"]}, "Read cannot read events"),
        ({"tasks": ["Return-v1"], "sights": ["classical-whole_spikes"]}, "Return cannot read spikes"),
        ({"tasks": ["Balance-v1"], "sights": ["classical-frame120"]}, "Balance cannot read frame120"),
    ],
)
def test_studies_that_cannot_be_are_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        studies.cases(**{"sights": ["tfp"], "intervals": [], "seeds": [0], **given})


def test_one_training_is_played_at_every_level_and_who_learns_nothing_once() -> None:
    wanted = studies.cases(
        ["Return-v1"], ["tfp", "oracle"], [50], [0, 1], [64], levels=[1, 5], trained_levels=(1, 5), learners=["ppo"]
    )
    learned = [case for case in wanted if case.sight == "tfp"]
    assert len(learned) == 4 and len({case.folder for case in learned}) == 2 and len(wanted) == 6
    assert {case.learned.options["level"] for case in learned} == {(1, 5)}
    assert [case.played.options["level"] for case in learned[:2]] == [(1, 1), (5, 5)]
    assert all(case.played.options["mean_interval"] == 50 for case in wanted)


def measured_again(*_: object, **__: object) -> None:
    raise AssertionError("it was measured again")


@pytest.mark.slow
@pytest.mark.slow
def test_a_study_over_levels_writes_its_table_and_picture_and_goes_on(tmp_path: Path, capsys, monkeypatch) -> None:
    line = ["evaluate", "agents", "--tasks", "Return-v1", "--observations", "tfp", "oracle", "--levels", "4", "5"]
    line += ["--trained-levels", "4", "5", "--seeds", "1", "--steps", "64", "--episodes", "1", "--points", "0"]
    line += ["--size", "36", "36", "--learners", "ppo", "sb3", "--out", str(tmp_path)]
    assert command(line) == 0
    first = capsys.readouterr().out
    monkeypatch.setattr(studies, "measure", measured_again)
    assert command(line) == 0 and capsys.readouterr().out == first
    rows = [
        [cell.strip() for cell in row.strip("|").split("|")] for row in (tmp_path / "levels.md").read_text().split("\n")
    ]
    assert rows[0][2:6] == ["level", "tfp", "tfp, sb3", "oracle"]
    assert [(row[2], row[5]) for row in rows[2:4]] == [("4", "1.000"), ("5", "1.000")]
    assert (tmp_path / "levels.png").stat().st_size > 1000


def test_a_model_of_stable_baselines3_is_trained_once(tmp_path: Path, monkeypatch) -> None:
    study = Study("Catch-v1", options={"shape": (36, 36)}, state=False)
    curve = learner_sb3.train_sb3(study, tmp_path, 64)
    assert learner_sb3.load_sb3(tmp_path).observation_space.shape == (4, 36, 36)
    monkeypatch.setattr(Study, "make", None)
    assert learner_sb3.train_sb3(study, tmp_path, 64) == curve
    monkeypatch.setattr(learner_sb3, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="stable-baselines3 is not installed"):
        learner_sb3.train_sb3(study, tmp_path, 64)


def test_the_classical_player_returns_most_slow_balls() -> None:
    """Of level 1, whose balls take 300 ms: it knows how the task is made, and sees pictures."""
    study = Study("Return-v1", options={"level": 1})
    env = study.make(split="test")
    result = evaluate(classical(env), "Return-v1", episodes=4, **study.keywords)
    print(result)
    assert result.success >= 0.5
    env.close()


@pytest.mark.parametrize(
    ("sight", "level"),
    [("classical", 3), ("classical-whole_spikes", 5), ("classical-frame1000", 1), ("classical-frame120", 1)],
)
def test_the_same_reader_reads_through_each_camera(sight: str, level: int, tmp_path: Path) -> None:
    """Plates at the speed that the camera is good for: 41 pixels of smear at frame120, 5 at frame1000."""
    (case,) = studies.cases(["Read-v1"], [sight], [], [0], episodes=4, levels=[level])
    (result,) = studies.study([case], tmp_path)
    print(f"{sight}, level {level}: {result.success} of 4 episodes")
    assert result.success is not None and result.success >= 0.75


def test_a_reader_that_takes_one_camera_for_another_reads_less() -> None:
    """The smear of an exposure of 8.3 ms is not that of 0.2 ms: what tells cameras apart is their timing."""
    env = Study("Read-v1", "frame120", {"level": 1}).make(split="test")
    bare: Any = env.unwrapped
    timings = PictureTiming.of(env), PictureTiming(8.0)
    right, wrong = (judged(acting(ReadController(bare, timing)), env, range(6)).success for timing in timings)
    assert right is not None and wrong is not None
    print(f"of 6 episodes with its own exposure {right}, with that of another camera {wrong}")
    env.close()
    assert right > wrong


def test_pictures_have_the_middle_of_their_exposure_as_time_and_one_that_stays_keeps_it() -> None:
    """A camera of 120 Hz: frame j is exposed from j / 120 s on; the episode's clock begins a step before step 0."""
    env = Study("Return-v1", "frame120", {"level": 1}).make(split="test")
    timing, middles = PictureTiming.of(env), []
    observation, _ = env.reset(seed=0)
    for step in range(40):
        middles.append(timing.middle_step(observation, step))
        observation, *_ = env.step(np.zeros(2, np.float32))
    env.close()
    assert np.isnan(middles[:8]).all()
    known = np.unique(np.round([middle for middle in middles if middle == middle], 3))
    np.testing.assert_allclose(known, (np.arange(len(known)) + 0.5) * 1000 / 120 - 1, atol=0.002)
    assert len(known) == 4


def test_the_classical_player_is_watched_through_a_frame_camera() -> None:
    watched = player("classical-frame120", "Return-v1")
    env = environment("Return-v1", watched, split="test")
    first, second = islice(episode(env, watched, 0), 2)
    env.close()
    assert dict(watched.sees)["obs"] == "frame120" and (first.step, second.step) == (0, 1)


def test_an_episode_of_a_mujoco_task_becomes_a_film(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    line = ["play", "Return-v1", "--size", "16", "16", "--film", "return.mp4", "--slow", "40"]
    assert command([*line, "--policy", "oracle"]) == 0 and (tmp_path / "return.mp4").stat().st_size > 1000
    assert "yes" in capsys.readouterr().out
    assert command([*line[:-2], "--policy", "keyboard"]) == 2 and "--policy oracle" in capsys.readouterr().err


def test_pictures_that_stable_baselines_cannot_take_are_refused_in_one_line(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3", reason="needs stable-baselines3")
    small = Study("Return-v1", options={"shape": (32, 32)}, state=False)
    with pytest.raises(InputError, match="36 x 36 or more"):
        learner_sb3.train_sb3(small, tmp_path / "sb3", steps=64)
