"""Templates by simulation: the parameters that they are taken at, and how strong."""

from __future__ import annotations

import numpy as np
import pytest

from spikecam_env.gap.candidates.table import NOISE_OF_A_RESET, candidate
from spikecam_env.gap.fit.simulated_templates import template_parameters
from spikecam_env.sensor import CATALOGUE


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_template_is_taken_at_every_combination_of_shapes(name):
    shapes = candidate(name).shapes
    found = template_parameters(name)
    assert len(found) == (0 if name in NOISE_OF_A_RESET else np.prod([len(v) for v in shapes.values()], dtype=int))
    for parameters in found:
        assert set(parameters) == {CATALOGUE[name].strength, *candidate(name).fitted, *shapes}
