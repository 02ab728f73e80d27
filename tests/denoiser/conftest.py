"""Textures and units for the tests of training."""

from __future__ import annotations

import pytest
import torch

from denoiser.training.simulated import Bank


@pytest.fixture(scope="session")
def bank() -> Bank:
    """Few textures and units, for streams that are drawn fast."""
    return Bank.drawn(3, torch.device("cpu"), textures=4, units=3)
