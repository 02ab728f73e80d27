"""Templates by simulation: the parameters that they are taken at, and how strong."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from spikecam_env.gap.candidates.table import NOISE_OF_A_RESET, candidate
from spikecam_env.gap.fit import simulated_templates
from spikecam_env.gap.fit.simulated_templates import simulated_template, template_parameters
from spikecam_env.sensor import CATALOGUE

TO_FIT = SimpleNamespace(to_fit=lambda keys: np.array([True, True, False]))
NULL = SimpleNamespace(keys=())


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_template_is_taken_at_every_combination_of_shapes(name):
    shapes = candidate(name).shapes
    found = template_parameters(name)
    assert len(found) == (0 if name in NOISE_OF_A_RESET else np.prod([len(v) for v in shapes.values()], dtype=int))
    for parameters in found:
        assert set(parameters) == {CATALOGUE[name].strength, *candidate(name).fitted, *shapes}


@pytest.mark.parametrize("noises", [4.0, 20.0, 400.0])
def test_a_template_shows_by_40_noises_in_recordings_to_fit(monkeypatch, noises):
    """A made-up effect in proportion to its strength; its largest statistic is held out, and does not count."""
    [start] = template_parameters("dead_time")
    key = CATALOGUE["dead_time"].strength

    def shift(case, model, null, name, parameters):
        return noises * parameters[key] / start[key] * np.array([0.3, -1.0, 10.0])

    monkeypatch.setattr(simulated_templates, "simulated_shift", shift)
    template = simulated_template(TO_FIT, None, NULL, "dead_time", start)
    peak = float(np.abs(template.shift[:2]).max())
    print(peak)
    assert 0.9 * 40.0 < peak < 1.25 * 40.0
    assert np.array_equal(template.shift, shift(None, None, None, "dead_time", template.parameters))
