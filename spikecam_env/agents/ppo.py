"""Proximal policy optimisation, in one file: from a task's id to a policy and its learning curve.

    r      = p(action) / p_old(action)
    loss   = -E[min(r A, clip(r, 1 - c, 1 + c) A)] + (value - target)^2 / 2 - entropy
    A      = sum (gamma lambda)^k (reward + gamma V' - V)             (GAE)

An episode that ends by its time is worth V beyond its end; a decided one is worth nothing.  Everything is drawn anew
from (seed, leg) at the beginning of a leg, so that a run that was resumed is the run that was not stopped.
Sources: Schulman et al., arXiv 1707.06347 and 1506.02438; the form of Huang et al., JMLR 23 (2022), "CleanRL".
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from gymnasium.vector import VectorEnv
from torch import Tensor
from torch.distributions import Normal
from tqdm import tqdm

from denoiser.run import Run
from spikecam_env.agents.history import History
from spikecam_env.agents.policy import Policy

UPDATES_A_LEG = 16
"""Between two checkpoints; at each the environments begin new episodes."""
LEAST_RATE = 0.02
"""Of learning, at the end of its fall."""


@dataclass(frozen=True)
class PPO:
    """Numbers of the learner; steps: of all environments together, rollout: of each between two updates."""

    steps: int = 300_000
    rollout: int = 64
    epochs: int = 3
    minibatch: int = 256
    lr: float = 1e-3
    gamma: float = 0.98
    decay: float = 0.95
    clip: float = 0.2
    entropy: float = 0.0
    place: float = 1.0
    most_gradient: float = 0.5


def train(envs: VectorEnv, run: Run, ppo: PPO, seed: int, save: Callable[[], None]) -> None:
    """Go on learning until `ppo.steps`.  run: of a `Policy`; `save` is called after every leg."""
    policy, a_leg = run.network, UPDATES_A_LEG * ppo.rollout * envs.num_envs
    assert isinstance(policy, Policy)
    for leg in tqdm(range(run.step // a_leg, -(-ppo.steps // a_leg)), desc="learning", unit="leg", disable=None):
        began, source = time.process_time(), np.random.SeedSequence([seed, leg])
        first, *seeds = (int(word) for word in source.generate_state(envs.num_envs + 1) >> 1)
        torch.manual_seed(first)
        player, ended = _Player(envs, policy, ppo, seeds), []
        for update in range(UPDATES_A_LEG):
            run.set_rate(ppo.lr * max(1 - (leg + update / UPDATES_A_LEG) * a_leg / ppo.steps, LEAST_RATE))
            batch, episodes = player.roll()
            ended += episodes
            _learn(policy, run.optimiser, batch, ppo)
        run.step, run.seconds = (leg + 1) * a_leg, run.seconds + time.process_time() - began
        means = dict(zip(("return", "performance", "success"), np.mean(ended or [[0.0] * 3], axis=0).tolist()))
        run.curve.append({"steps": run.step, "cpu_s": run.seconds, "episodes": len(ended), **means})
        save()


class _Player:
    """Plays the policy on and on from where it stands."""

    def __init__(self, envs: VectorEnv, policy: Policy, ppo: PPO, seeds: list[int]) -> None:
        self.envs, self.policy, self.ppo = envs, policy, ppo
        self.history, self.totals = History(policy.recipe.lags, policy.recipe.pool), np.zeros(envs.num_envs)
        observation, self.info = envs.reset(seed=seeds)
        self.over = np.zeros(envs.num_envs, bool)
        self.seen = self.history.push(observation, self.over)

    @torch.no_grad()
    def roll(self) -> tuple[dict[str, Tensor], list[tuple[float, float, float]]]:
        """A rollout's samples, and (return, performance, success) of the episodes that ended in it."""
        rows, ended = [], []
        for _ in range(self.ppo.rollout):
            pictures, state = map(torch.from_numpy, self.seen)
            self.policy.watch(state)
            mean, value, _ = self.policy(pictures, state)
            target = self.policy.scaled(torch.from_numpy(np.stack(self.info["target"]).astype(np.float32)))
            law = Normal(mean, self.policy.log_sigma.exp())
            action = law.sample()
            observation, reward, terminated, truncated, self.info = self.envs.step(action.clamp(-1, 1).numpy())
            played, self.over = ~self.over, terminated | truncated
            self.seen = self.history.push(observation, ~played)
            self.totals = np.where(played, self.totals + reward, 0.0)
            ended += [(self.totals[n], self.info["performance"][n], self.info["is_success"][n]) for n in np.flatnonzero(self.over)]
            flags = (torch.from_numpy(np.array(x, np.float32)) for x in (reward, terminated, self.over, played))
            rows.append((pictures, state, target, action, law.log_prob(action).sum(1), value, *flags))
        *samples, value, reward, terminated, over, played = (torch.stack(column) for column in zip(*rows, strict=True))
        after = torch.cat([value[1:], self.policy(*map(torch.from_numpy, self.seen))[1][None]])
        surprise = reward + self.ppo.gamma * after * (1 - terminated) - value
        gain = [torch.zeros(self.envs.num_envs)]
        for n in reversed(range(len(rows))):
            gain.append(surprise[n] + self.ppo.gamma * self.ppo.decay * (1 - over[n]) * gain[-1])
        gain = torch.stack(gain[:0:-1])
        names = ("pictures", "state", "place", "action", "log_p", "gain", "worth")
        return {k: x[played > 0] for k, x in zip(names, (*samples, gain, gain + value), strict=True)}, ended


def _learn(policy: Policy, optimiser: torch.optim.Optimizer, batch: dict[str, Tensor], ppo: PPO) -> None:
    for _ in range(ppo.epochs):
        for some in torch.randperm(len(batch["gain"])).split(ppo.minibatch):
            part = {name: column[some] for name, column in batch.items()}
            mean, value, place = policy(part["pictures"], part["state"])
            law = Normal(mean, policy.log_sigma.exp())
            ratio = (law.log_prob(part["action"]).sum(1) - part["log_p"]).exp()
            gain = (part["gain"] - part["gain"].mean()) / (part["gain"].std() + 1e-8)
            surrogate = torch.min(ratio * gain, ratio.clamp(1 - ppo.clip, 1 + ppo.clip) * gain).mean()
            loss = -surrogate + 0.5 * (value - part["worth"]).square().mean() - ppo.entropy * law.entropy().sum(1).mean()
            loss = loss + ppo.place * (place - part["place"]).square().mean()
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(policy.parameters(), ppo.most_gradient)
            optimiser.step()
