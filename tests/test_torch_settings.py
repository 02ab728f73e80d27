"""Threads and random numbers of torch are the caller's again after a library function has used its own."""

from __future__ import annotations

import pytest
import torch

from denoiser.reconstruct.train import ReconstructorConfig, train_reconstructor
from denoiser.simulated import Bank
from denoiser.train import TrainConfig, train
from spikecam_env.agents.ppo import PPO
from spikecam_env.agents.training import Study, train_agent
from spikecam_env.torch_settings import torch_settings

TINY = {"steps": 1, "batch": 1, "patch": 16, "validate_every": 1, "minutes": 1, "threads": 2}
TRAINED = {
    "a denoiser": lambda out: train(TrainConfig(mode="best", out=out, **TINY), progress=False),
    "a reconstructor": lambda out: train_reconstructor(
        ReconstructorConfig(mode="ssml", out=out, width=12, **TINY), progress=False
    ),
    "an agent": lambda out: train_agent(Study("Catch-v1"), out, PPO(steps=64, rollout=32), environments=2),
}


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


@pytest.mark.parametrize("what", TRAINED)
def test_training_leaves_them_to_the_caller(what, tmp_path, monkeypatch):
    bank = Bank.drawn(3, torch.device("cpu"), textures=1, units=1)
    monkeypatch.setattr(Bank, "drawn", lambda *_, **__: bank)
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    TRAINED[what](tmp_path)
    assert torch.get_num_threads() == 1
    assert torch.equal(torch.rand(3), expected)
