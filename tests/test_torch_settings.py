"""Threads and random numbers of torch are the caller's again after a library function has used its own."""

from __future__ import annotations

import pytest
import torch

from denoiser.training.train import TrainConfig, train
from spikecam_env.agents.ppo import PPO
from spikecam_env.agents.training import Study, train_agent
from spikecam_env.torch_settings import torch_settings


def test_settings_hold_within_and_not_after():
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    with torch_settings(threads=2, seed=7):
        assert torch.get_num_threads() == 2 and torch.initial_seed() == 7
        torch.rand(100)
        torch.backends.cudnn.benchmark = not torch.backends.cudnn.benchmark
        switched = torch.backends.cudnn.benchmark
    assert torch.get_num_threads() == 1 and torch.backends.cudnn.benchmark is not switched
    assert torch.equal(torch.rand(3), expected)


def test_they_do_not_hold_after_an_error_either():
    with pytest.raises(RuntimeError), torch_settings(threads=2):
        raise RuntimeError
    assert torch.get_num_threads() == 1


def test_training_takes_its_own_and_leaves_them_to_the_caller(tmp_path, monkeypatch):
    """The computation has a stand-in: two threads of torch spin for minutes where other work has the processors."""
    seen = []
    monkeypatch.setattr(
        "denoiser.training.train._trained", lambda *_: seen.append((torch.get_num_threads(), torch.rand(3)))
    )
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    train(TrainConfig(out=tmp_path, threads=2, seed=7))
    ((threads, drawn),) = seen
    assert threads == 2 and torch.equal(drawn, torch.rand(3, generator=torch.Generator().manual_seed(7)))
    assert torch.get_num_threads() == 1 and torch.equal(torch.rand(3), expected)


def test_an_agent_is_trained_so_too(tmp_path):
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    train_agent(Study("Catch-v1"), tmp_path, PPO(steps=64, rollout=32), environments=2)
    assert torch.get_num_threads() == 1 and torch.equal(torch.rand(3), expected)
