"""From a task's name to a trained agent, as `spikecam train-agent`.

OUT/last.pt     to go on from (`denoiser.training.resumable_run`)
OUT/agent.pt    the agent so far (`agents.agent`)
OUT/curve.json  rows: steps, processor seconds, episodes, their mean return, performance and success
OUT/along/      agents on the way, by their steps, where they are asked for
"""

from __future__ import annotations

import json
from contextlib import closing
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import gymnasium
from gymnasium.spaces import Box, Dict, flatdim
from gymnasium.vector import VectorEnv

from denoiser.training.resumable_run import Run
from spikecam_env.agents.agent import ENDING, Agent, state_keywords
from spikecam_env.agents.policy import PolicyRecipe
from spikecam_env.agents.ppo import PPO, train
from spikecam_env.envs.mujoco_tasks import MUJOCO_TASKS, MujocoTask
from spikecam_env.envs.observations import OBSERVATIONS
from spikecam_env.envs.registration import ALL_TASKS, register
from spikecam_env.envs.tasks import TASKS, Task
from spikecam_env.envs.wrappers.any_env import USUAL_BLOCK
from spikecam_env.errors import unknown_name
from spikecam_env.run_folder import run_folder
from spikecam_env.torch_settings import torch_settings
from spikecam_env.whole import write_text_whole


@dataclass(frozen=True)
class Study:
    """The problem of a learner.

    Example:
        >>> Study("Catch-v1", sight="tfi", options={"split": "test"}).keywords
        {'obs_state': True, 'obs': 'tfi', 'split': 'test'}
    """

    task: str
    """An id, e.g. "Catch-v1"."""
    sight: str = "tfp"
    """A name of SIGHTS."""
    options: dict[str, Any] = field(default_factory=dict)
    """Further keywords of the environments."""
    state: bool = True
    """Whether more than the picture is observed (`agent.state_keywords`)."""

    def __post_init__(self) -> None:
        if f"spikecam_env/{self.task}" not in ALL_TASKS:
            raise unknown_name("task", self.task, (name.split("/")[1] for name in ALL_TASKS))
        if self.sight not in SIGHTS:
            raise unknown_name("observation", self.sight, SIGHTS)

    @property
    def name(self) -> str:
        """Name of the task, without size and version."""
        return self.task.split("-")[0]

    @property
    def kind(self) -> type[Task] | type[MujocoTask]:
        """Class of the task."""
        return TASKS[self.name] if self.name in TASKS else MUJOCO_TASKS[self.name]

    @property
    def keywords(self) -> dict[str, Any]:
        """Keywords of an environment."""
        return {**(state_keywords(self.task) if self.state else {}), **SIGHTS[self.sight], **self.options}

    def make(self, **options: Any) -> gymnasium.Env[Any, Any]:
        """One environment."""
        register()
        return gymnasium.make(f"spikecam_env/{self.task}", **{**self.keywords, **options})

    def make_vec(self, count: int) -> VectorEnv[Any, Any, Any]:
        """A vector of so many environments: the native one, or Gymnasium's where the task has none."""
        register()
        name = f"spikecam_env/{self.task}"
        mode = "sync" if gymnasium.spec(name).vector_entry_point is None else "vector_entry_point"
        return gymnasium.make_vec(name, num_envs=count, vectorization_mode=mode, **self.keywords)


SIGHTS: dict[str, dict[str, Any]] = {
    **{obs: {"obs": obs} for obs in OBSERVATIONS if obs not in ("multibinary", "packed", "isi")},
    "clean": {"obs": "tfp", "model": "ideal"},
    "root_clean": {"obs": "root_tfp", "model": "ideal"},
    "whole_spikes": {"obs": "spikes", "block_frames": USUAL_BLOCK},
}
"""Observations by name: every one that is a picture of bytes, of the noisy camera or another in its place; `clean`,
the rates of a camera without noise; or the spikes of the whole step, where a MuJoCo task shows a part."""

LAGS = {"Catch": (0, 2, 5), "Saccade": (0, 3), "ReadSpin": (0, 1, 2, 4), "LowLight": (0, 1, 2, 3, 4)}
LAGS |= dict.fromkeys(MUJOCO_TASKS, (0, 2, 5, 10)) | {"Read": (0, 1, 2, 3)}
"""Steps ago of the pictures that a task is learned from; others from (0, 4).  In the dark every spike counts."""
POOL = {"Saccade": 1, "ReadDigit": 1} | dict.fromkeys(MUJOCO_TASKS, 1)
"""Pixels squared that are averaged; others 2.  Spokes, strokes and far balls are finer than two pixels."""


def recipe_of(study: Study, envs: VectorEnv[Any, Any, Any]) -> PolicyRecipe:
    """The network for a task.

    Example:
        >>> study = Study("Catch-v1")
        >>> cameras = study.make_vec(1)
        >>> recipe_of(study, cameras).shape
        (64, 64)
        >>> cameras.close()
    """
    name = study.name
    spaces, action = envs.single_observation_space, envs.single_action_space
    assert isinstance(spaces, Dict) and isinstance(action, Box)
    picture = spaces["picture"]
    assert isinstance(picture, Box)
    channels, rows, columns = picture.shape
    return PolicyRecipe(
        channels=channels,
        shape=(rows, columns),
        high=int(picture.high.max()),
        lags=LAGS.get(name, (0, 4)),
        actions=action.shape[0],
        pool=POOL.get(name, 2),
        answers=study.kind.answers,
        sensed=flatdim(spaces["inner"]) if "inner" in spaces.spaces else 0,
    )


def learner(steps: int | None = None, *, imitate: bool = False, plain: bool = False) -> PPO:
    """PPO of so many steps, by default those of the shipped agents.

    Args:
        steps: of all environments together.
        imitate: learn from the oracle's actions, and not from rewards.  A policy must not go far from where its rewards
            were paid; an oracle's action stays right.  So each update learns from as many samples as a whole leg has.
        plain: without the loss that asks for the target's place.

    Example:
        >>> learner(2048, imitate=True).imitate
        True
    """
    given: dict[str, Any] = {} if steps is None else {"steps": steps}
    given |= {"imitate": True, "epochs": PPO.leg} if imitate else {}
    return PPO(**given, place=0.0 if plain else PPO.place)


def train_agent(
    study: Study, out: Path, ppo: PPO | None = None, seed: int = 0, environments: int = 16, points: int = 0
) -> Agent:
    """Train, or go on from `out/last.pt`.

    Args:
        study: task and observation of the learner.
        out: folder of the run, made if needed.
        ppo: the method; default `PPO()`.
        seed: of network, actions, episodes and cameras.
        environments: cameras that are stepped together.
        points: agents to keep along the training, evenly over its steps (`agents_along`).

    Returns:
        The agent.

    Raises:
        InputError: where another run is at work in `out`, or it holds the run of another network, or a damaged one.

    Example:
        >>> from pathlib import Path
        >>> from spikecam_env.agents.ppo import PPO
        >>> agent = train_agent(Study("Catch-v1"), Path(), PPO(steps=64, rollout=32), environments=2)
        >>> Path("agent.pt").is_file()
        True
    """
    ppo = ppo or PPO()
    with (
        run_folder(out, "a run of training"),
        closing(study.make_vec(environments)) as envs,
        torch_settings(threads=1, seed=seed),  # as many as pay for so small a network
    ):
        policy = recipe_of(study, envs).network()
        run = Run.begin(policy)
        if (out / "last.pt").exists():
            run.load(out / "last.pt")
        record = {"sight": study.sight, "seed": seed, "environments": environments, "ppo": asdict(ppo)}

        def trained() -> Agent:
            return Agent(study.task, str(SIGHTS[study.sight]["obs"]), policy, record | {"curve": run.curve})

        def save() -> None:
            run.save(out / "last.pt")
            trained().save(out / "agent.pt")
            write_text_whole(out / "curve.json", json.dumps(run.curve, indent=1) + "\n")

        def keep(steps: int) -> None:
            if steps * points // ppo.steps > (steps - ppo.rollout * environments) * points // ppo.steps:
                (out / ALONG).mkdir(exist_ok=True)
                trained().save(out / ALONG / f"{steps:09d}{ENDING}")

        train(envs, run, ppo, seed, save, keep)
        return trained()


ALONG = "along"


def agents_along(out: Path) -> dict[int, Path]:
    """Files of the agents that `train_agent` kept on the way in this folder, by their steps, in order.

    Example:
        >>> from pathlib import Path
        >>> from spikecam_env.agents.ppo import PPO
        >>> agent = train_agent(Study("Catch-v1"), Path("run"), PPO(steps=64, rollout=16), environments=2, points=2)
        >>> list(agents_along(Path("run")))
        [32, 64]
    """
    return {int(path.stem): path for path in sorted((out / ALONG).glob(f"*{ENDING}"))}
