"""A trained policy that acts, before one environment or many: shipped, or from a file.

    agent = Agent.load("Catch-v1")
    env = agent.make(split="test")
    observation, info = env.reset(seed=0)
    agent.begin()
    observation, reward, *_ = env.step(agent.act(observation))

A file is `torch.save` of plain values: format, task, obs, recipe, float16 weights, and the record of its training.  A
foreign file cannot run code (`denoiser.ground.plain_torch`).
"""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray

from denoiser.ground.plain_torch import read_plain, tensors_like
from denoiser.weights import write_whole
from spikecam_env.agents.history import History
from spikecam_env.agents.policy import Policy, PolicyRecipe
from spikecam_env.envs.registration import ALL_TASKS, MUJOCO_ENVIRONMENTS, register
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.untrusted import declared

FORMAT = "spikecam-agent/2"
ENDING = ".pt"


class Agent:
    """A trained policy; its observations are those of environments with the keywords `sees`.

    Args:
        task: an id, e.g. "Catch-v1".
        obs: name of its observation.
        policy: its network.
        training: record of its training.

    Example:
        >>> agent = Agent.load("Catch-v1")
        >>> env = agent.make(split="test")
        >>> observation, info = env.reset(seed=0)
        >>> action = agent.act(observation)
        >>> agent.obs, action.shape
        ('tfp', (1,))
    """

    def __init__(self, task: str, obs: str, policy: Policy, training: dict[str, Any] | None = None) -> None:
        self.task, self.obs, self.policy, self.training = task, obs, policy.eval(), dict(training or {})
        self.begin()

    @classmethod
    def load(cls, source: str | os.PathLike[str]) -> Agent:
        """The shipped agent of a task's id, or the one in a file.

        Raises:
            InputError: for a task without a shipped agent, and for a file that is missing, damaged or of another kind.
        """
        path = _path(source)
        data = read_plain(path)
        if not isinstance(data, dict) or data.get("format") != FORMAT:
            raise InputError(f"{path} holds no agent ({FORMAT}); give a file of `spikecam train-agent`")
        recipe = declared(PolicyRecipe, data.get("recipe"), f"{path}: recipe")
        task, obs, training = (data.get(name) for name in ("task", "obs", "training"))
        if not (isinstance(task, str) and isinstance(obs, str) and isinstance(training, dict)):
            raise InputError(f"{path}: task, obs or training is missing; copy the file again")
        policy = recipe.network()
        expected = {name: tensor.half() for name, tensor in policy.state_dict().items()}
        policy.load_state_dict(tensors_like(expected, data.get("weights"), str(path)))
        return cls(task, obs, policy, training)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a file, which appears whole; weights are rounded to float16, one part in a thousand."""
        # beyond float16 is the variance of a slow camera's age, which only training uses
        most = torch.finfo(torch.float16).max
        state = self.policy.state_dict()
        weights = {name: tensor.detach().clamp(-most, most).half().contiguous() for name, tensor in state.items()}
        values = {"task": self.task, "obs": self.obs, "recipe": self.policy.recipe.model_dump(), "weights": weights}
        write_whole(path, {"format": FORMAT, **values, "training": self.training})

    def make(self, **options: Any) -> gymnasium.Env[Any, Any]:
        """An environment of its task, as it sees it; options: of the environment, e.g. split="test"."""
        register()
        return gymnasium.make(f"spikecam_env/{self.task}", **{**self.sees, **options})

    @property
    def sees(self) -> dict[str, Any]:
        """Keywords of its environment."""
        return {"obs": self.obs, **state_keywords(self.task)}

    def begin(self) -> None:
        """Forget all observations: the next one is the first of an episode, everywhere."""
        self._history = History(self.policy.recipe.lags, self.policy.recipe.pool)

    def act(self, observation: dict[str, NDArray[Any]], fresh: NDArray[np.bool_] | None = None) -> NDArray[np.float32]:
        """The action (A,), the policy's mean; with a leading axis N where the observation has one.

        Args:
            observation: picture, gaze and age; of MuJoCo tasks picture, inner and age.
            fresh: (N,) which of N are the first of an episode.

        Raises:
            InputError: for an observation of another kind.
        """
        many = self._checked(observation)
        together = observation if many else {name: np.asarray(array)[None] for name, array in observation.items()}
        count = len(together["picture"])
        seen = self._history.push(together, np.zeros(count, bool) if fresh is None else np.asarray(fresh, bool))
        with torch.inference_mode():
            mean, _, _ = self.policy(*map(torch.from_numpy, seen))
        actions = mean.clamp(-1, 1).numpy()
        return np.asarray(actions if many else actions[0])

    def _checked(self, observation: Any) -> bool:
        """Whether it is of many environments."""
        recipe = self.policy.recipe
        expected, place = (recipe.channels, *recipe.shape), "inner" if recipe.sensed else "gaze"
        if not isinstance(observation, dict) or set(observation) != {"picture", place, "age"}:
            keywords = "obs_state=True" + ", obs_inner=True" * bool(recipe.sensed)
            raise InputError(
                f"this agent acts on observations with picture, {place} and age; make the task with {keywords}"
            )
        shape = np.shape(observation["picture"])
        if shape[-3:] != expected or len(shape) not in (3, 4):
            raise InputError(f"a picture has shape {shape}; this agent sees {expected}, of obs={self.obs!r}")
        return len(shape) == 4


def state_keywords(task: str) -> dict[str, bool]:
    """Keywords of environments that give the picture's age, and the gaze or what encoders measure, beside the picture.

    Args:
        task: an id, without `spikecam_env/`.

    Example:
        >>> state_keywords("Catch-v1"), state_keywords("Return-v1")
        ({'obs_state': True}, {'obs_state': True, 'obs_inner': True})
    """
    return {"obs_state": True} | ({"obs_inner": True} if f"spikecam_env/{task}" in MUJOCO_ENVIRONMENTS else {})


def shipped() -> list[str]:
    """Tasks of which an agent comes with the package.

    Example:
        >>> shipped()
        ['Catch-v1', 'Exposure-v1', 'LowLight-v1', 'ReadSpin-v1', 'Return-v1', 'Saccade-v1', 'Track-v1']
    """
    return sorted(path.name[: -len(ENDING)] for path in _folder().glob(f"*{ENDING}"))


def is_file(name: str) -> bool:
    """Whether it can be a file's, and not that of a task.

    Example:
        >>> is_file("runs/catch/agent.pt"), is_file("Catch-v1")
        (True, False)
    """
    return ENDING in name or os.sep in name


def _folder() -> Path:
    return Path(str(resources.files("spikecam_env.agents") / "weights"))


def _path(source: str | os.PathLike[str]) -> Path:
    name = str(source).removeprefix("spikecam_env/")
    if name in shipped():
        return _folder() / f"{name}{ENDING}"
    if f"spikecam_env/{name}" in ALL_TASKS or not is_file(name):
        raise unknown_name("agent", name, shipped())
    return Path(source)
