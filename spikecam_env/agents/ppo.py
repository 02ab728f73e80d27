"""Proximal policy optimisation, in one file: a policy learns from the steps of many environments.

    r      = p(action) / p_old(action)

    A      = sum_k (gamma decay)^k (reward + gamma V' - V)

    loss   = -E[min(r A, clip(r, 1 - c, 1 + c) A)] + (V - A - V_old)^2 / 2 + w (place - target)^2

The last term asks the policy where the target is, which is known in training alone (`info["target"]`); w = 0 is plain
PPO.  An agent that imitates plays its mean action, without noise, and has E[(mean - oracle's action)^2] in place of the
first two terms.  It learns the actions of `envs.oracle` in the states that it has come to itself, of all rollouts of
the leg.  Where the oracle acts on something unseen, the agent learns the expectation: of an answer, its probability.
Source: DAgger, Ross et al., AISTATS 2011.

An episode that ends by its time is worth V beyond its end; a decided one nothing.  Everything is drawn anew from
(seed, update) when a leg begins: a run that was resumed is the run that was not stopped.  Sources: Schulman et al.,
arXiv 1707.06347 and 1506.02438; the form of Huang et al., JMLR 23 (2022), "CleanRL".
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray
from torch import Tensor
from torch.distributions import Normal
from tqdm import tqdm

from denoiser.training.resumable_run import Run
from spikecam_env.agents.history import History
from spikecam_env.agents.policy import Policy

Cameras = VectorEnv[Any, Any, Any]
Ended = tuple[float, ...]  # (return, performance, success) of an episode
Samples = dict[str, Tensor]  # of a rollout, by name


@dataclass(frozen=True)
class PPO:
    """Numbers of the method."""

    steps: int = 49_152
    """Steps of all environments together."""
    rollout: int = 64
    """Steps of each environment between updates."""
    leg: int = 16
    """Updates between two saves."""
    epochs: int = 4
    minibatch: int = 256
    lr: float = 1e-3
    """Learning rate at the start; it falls linearly to 0."""
    gamma: float = 0.98
    decay: float = 0.95
    """Of the sum over later steps (generalised advantage estimation)."""
    clip: float = 0.2
    """c of the loss."""
    place: float = 1.0
    """w, weight of the loss of the target's place."""
    imitate: bool = False
    """Learn from the oracle's actions, and not from rewards."""
    most_gradient: float = 0.5
    """Norm to which gradients are cut."""


def train(
    envs: Cameras,
    run: Run,
    ppo: PPO,
    seed: int,
    save: Callable[[], None],
    watch: Callable[[int], None] = lambda _: None,
) -> None:
    """Go on learning until `ppo.steps`.

    Args:
        envs: the cameras that play.
        run: of a `Policy`.
        ppo: numbers of the method.
        seed: of all draws.
        save: called after every leg.
        watch: called after every update, with the steps so far; it must leave the policy as it is.
    """
    policy, steps_a_rollout = run.network, ppo.rollout * envs.num_envs
    assert isinstance(policy, Policy)
    for weights in policy.parameters():  # all have moments, also those that a loss leaves alone: a run is one of all
        weights.grad = torch.zeros_like(weights)
    updates = -(-ppo.steps // steps_a_rollout)
    for first in tqdm(range(run.step // steps_a_rollout, updates, ppo.leg), desc="learning", unit="leg", disable=None):
        began, last = time.process_time(), min(first + ppo.leg, updates)
        drawn, *seeds = np.random.SeedSequence([seed, first]).generate_state(envs.num_envs + 1).tolist()
        torch.manual_seed(drawn)
        player, ended, seen = _Player(envs, policy, ppo, seeds), list[Ended](), list[Samples]()
        for update in range(first, last):
            run.set_rate(ppo.lr * (1 - update / updates))
            batch, episodes = player.roll()
            ended += episodes
            seen = [*seen, batch] if ppo.imitate else [batch]
            _learn(policy, run.optimiser, seen, ppo)
            watch((update + 1) * steps_a_rollout)
        run.step, run.seconds = last * steps_a_rollout, run.seconds + time.process_time() - began
        means = np.mean(ended or [(0.0, 0.0, 0.0)], axis=0).tolist()
        row = dict(zip(("return", "performance", "success"), means, strict=True))
        run.curve.append({"steps": run.step, "cpu_s": run.seconds, "episodes": len(ended), **row})
        save()


class _Player:
    """Plays the policy on and on from where it stands."""

    def __init__(self, envs: Cameras, policy: Policy, ppo: PPO, seeds: Any) -> None:
        self.envs, self.policy, self.ppo = envs, policy, ppo
        self.history, self.totals = History(policy.recipe.lags, policy.recipe.pool), np.zeros(envs.num_envs)
        observation, self.info = envs.reset(seed=seeds)
        self.over = np.zeros(envs.num_envs, bool)
        self.seen = self.history.push(observation, self.over)

    @torch.no_grad()
    def roll(self) -> tuple[Samples, list[Ended]]:
        """A rollout's samples by name, and the episodes that ended in it."""
        steps, ended = [], list[Ended]()
        for _ in range(self.ppo.rollout):
            step, episodes = self._step()
            steps.append(step)
            ended += episodes
        columns = {name: torch.stack([step[name] for step in steps]) for name in steps[0]}
        value, over, played = (columns.pop(name) for name in ("value", "over", "played"))
        reward, decided = columns.pop("reward"), columns.pop("decided")
        _, last, _ = self.policy(*map(torch.from_numpy, self.seen))
        after = torch.cat([value[1:], last[None]])
        gain = _gain(reward + self.ppo.gamma * after * (1 - decided) - value, over, self.ppo)
        columns |= {"gain": gain, "worth": gain + value}
        return {name: column[played > 0] for name, column in columns.items()}, ended

    def _step(self) -> tuple[Samples, list[Ended]]:
        """A step everywhere: its numbers by name, and the episodes that ended with it."""
        pictures, state = map(torch.from_numpy, self.seen)
        self.policy.watch(state)
        mean, value, _ = self.policy(pictures, state)
        law = Normal(mean, self.policy.log_sigma.exp())
        action = mean if self.ppo.imitate else law.sample()
        step = {
            "pictures": pictures,
            "state": state,
            "place": self.policy.scaled(torch.from_numpy(np.stack(self.info["target"]).astype(np.float32))),
            "best": torch.from_numpy(self._oracles()) if self.ppo.imitate else mean,
            "action": action,
            "log_p": law.log_prob(action).sum(1),
            "value": value,
        }
        observation, reward, terminated, truncated, self.info = self.envs.step(action.clamp(-1, 1).numpy())
        played, self.over = ~self.over, terminated | truncated  # an episode's last picture is no step of it
        self.seen = self.history.push(observation, ~played)
        self.totals = np.where(played, self.totals + reward, 0.0)
        known = {"reward": reward, "decided": terminated, "over": self.over, "played": played}
        step |= {name: torch.from_numpy(np.array(values, np.float32)) for name, values in known.items()}
        figures = np.stack([self.totals, self.info["performance"], self.info["is_success"]], axis=1)
        return step, [tuple(row) for row in figures[self.over].tolist()]

    def _oracles(self) -> NDArray[np.float32]:
        """(N, A) actions of the oracle."""
        cameras: Any = self.envs.unwrapped
        return np.stack([env.unwrapped.best_action() for env in cameras.envs])


def _gain(surprise: Tensor, over: Tensor, ppo: PPO) -> Tensor:
    """(steps, N): A of the head of this file."""
    gain, later = torch.zeros_like(surprise), torch.zeros_like(surprise[0])
    for n in reversed(range(len(surprise))):
        gain[n] = later = surprise[n] + ppo.gamma * ppo.decay * (1 - over[n]) * later
    return gain


def _learn(policy: Policy, optimiser: torch.optim.Optimizer, seen: list[Samples], ppo: PPO) -> None:
    """As many samples as `epochs` times the last rollout's, from all rollouts."""
    batch = {name: torch.cat([samples[name] for samples in seen]) for name in seen[-1]}
    for _ in range(ppo.epochs):
        for some in torch.randperm(len(batch["gain"]))[: len(seen[-1]["gain"])].split(ppo.minibatch):
            part = {name: column[some] for name, column in batch.items()}
            mean, value, place = policy(part["pictures"], part["state"])
            wrong = ppo.place * (place - part["place"]).square().mean()
            if ppo.imitate:
                wrong = wrong + (mean - part["best"]).square().mean()
            else:
                wrong = wrong + 0.5 * (value - part["worth"]).square().mean() - _surrogate(policy, mean, part, ppo)
            optimiser.zero_grad(set_to_none=False)
            wrong.backward()
            torch.nn.utils.clip_grad_norm_(policy.parameters(), ppo.most_gradient)
            optimiser.step()


def _surrogate(policy: Policy, mean: Tensor, part: Samples, ppo: PPO) -> Tensor:
    ratio = (Normal(mean, policy.log_sigma.exp()).log_prob(part["action"]).sum(1) - part["log_p"]).exp()
    gain = (part["gain"] - part["gain"].mean()) / (part["gain"].std() + 1e-8)
    least: Tensor = torch.min(ratio * gain, ratio.clamp(1 - ppo.clip, 1 + ppo.clip) * gain)
    return least.mean()
