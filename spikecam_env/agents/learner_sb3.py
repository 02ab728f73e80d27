"""PPO of stable-baselines3 with its defaults for pictures, as a learner of studies.

`CnnPolicy` (the network of Mnih et al., Nature 518 (2015)) sees the last STACK pictures and nothing else.  Numbers are
the defaults of `stable_baselines3.PPO`: rate 3e-4, ten epochs of minibatches of 64, 2048 samples an update.

OUT/sb3.zip     the model, written once when the training is done
OUT/curve.json  a row: steps and processor seconds

stable-baselines3 is an optional package (`pip install 'spikecam-env[sb3]'`).
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import gymnasium

from spikecam_env.agents.evaluation import stacked
from spikecam_env.agents.training import Study
from spikecam_env.errors import InputError
from spikecam_env.run_folder import run_folder
from spikecam_env.torch_settings import torch_settings
from spikecam_env.whole import whole_file, write_text_whole

LEAST_SIDE = 36
"""[pixels] Of the pictures that its usual network takes."""
STACK = 4
"""Pictures that it sees together, as is usual with this network."""
ENVIRONMENTS = 8
"""Environments that are stepped together, as for Atari in rl-baselines3-zoo."""
SAMPLES = 2048
"""Steps of all environments between updates: the default of one environment."""
LEAST = 8
"""Steps of each environment between updates at least: a minibatch."""


def check_sb3() -> None:
    """Raise InputError where stable-baselines3 is not installed.

    Example:
        >>> check_sb3()
    """
    if find_spec("stable_baselines3") is None:
        raise InputError("stable-baselines3 is not installed; pip install 'spikecam-env[sb3]', or leave sb3 out")


def train_sb3(study: Study, out: Path, steps: int, seed: int = 0) -> tuple[dict[str, float], ...]:
    """Train, unless the model is in `out` already.

    Args:
        study: task and observation, of pictures alone.
        out: folder of the run, made if needed.
        steps: of all environments together; rounded up to whole updates.
        seed: of network, actions, episodes and cameras.

    Returns:
        The curve: a row with steps and cpu_s.

    Raises:
        InputError: where stable-baselines3 is missing, pictures are too small for its network, or another run is at
            work in `out`.

    Example:
        >>> study = Study("Catch-v1", state=False)
        >>> train_sb3(study, Path("sb3"), steps=64)[0]["steps"]
        64
        >>> load_sb3(Path("sb3")).observation_space.shape
        (4, 64, 64)
    """
    check_sb3()
    from stable_baselines3 import PPO
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import DummyVecEnv

    with run_folder(out, "a run of training"):
        if (out / MODEL).exists():
            return tuple(json.loads((out / CURVE).read_text()))
        makers: list[Callable[[], gymnasium.Env[Any, Any]]] = [lambda: Monitor(stacked(study.make(), STACK))]
        with closing(DummyVecEnv(makers * ENVIRONMENTS)) as envs, torch_settings(threads=1, seed=seed):
            shape = (envs.observation_space.shape or (0, 0, 0))[1:]
            if min(shape) < LEAST_SIDE:
                raise InputError(
                    f"pictures are {shape[0]} x {shape[1]}; the usual network of stable-baselines3 takes "
                    f"{LEAST_SIDE} x {LEAST_SIDE} or more: give a larger --size"
                )
            each = min(SAMPLES, max(LEAST * ENVIRONMENTS, steps)) // ENVIRONMENTS
            model = PPO("CnnPolicy", envs, n_steps=each, seed=seed, device="cpu")
            began = time.process_time()
            model.learn(steps)
            curve = [{"steps": model.num_timesteps, "cpu_s": time.process_time() - began}]
        write_text_whole(out / CURVE, json.dumps(curve) + "\n")
        with whole_file(out / MODEL) as beside, beside.open("wb") as file:
            model.save(file)
    return tuple(curve)


def load_sb3(out: Path) -> Any:
    """The model that `train_sb3` wrote into this folder; files of others can run code, so load your own alone.

    Example:
        >>> curve = train_sb3(Study("Catch-v1", state=False), Path("run"), steps=64)
        >>> load_sb3(Path("run")).action_space.shape
        (1,)
    """
    from stable_baselines3 import PPO

    return PPO.load(out / MODEL, device="cpu")


MODEL, CURVE = "sb3.zip", "curve.json"
