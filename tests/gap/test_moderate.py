"""Variances of few twins, joined with those of their like."""

import numpy as np
import pytest
from scipy.special import polygamma

from spikecam_env.gap.moderate import bias, moderated, worth
from spikecam_env.gap.statistics import Key

FREEDOM = 11
KEYS = [Key("spectrum", f"flat-{r}", f"band {n}") for n in range(8) for r in range(10)]


def drawn(true, seed):
    return true * np.random.default_rng(seed).chisquare(FREEDOM, len(true)) / FREEDOM


def test_what_is_alike_in_all_recordings_is_known_much_better():
    true = np.repeat(np.geomspace(1.0, 50.0, 8), 10)
    made = drawn(true, 0)
    found, freedom = moderated(KEYS, made, FREEDOM)
    assert np.std(np.log(found / true)) < 0.5 * np.std(np.log(made / true))
    assert freedom.min() > 100
    assert abs(np.mean(np.log(found / true))) < 0.1


def test_what_differs_keeps_its_own():
    rng = np.random.default_rng(1)
    true = np.exp(2.0 * rng.standard_normal(len(KEYS)))
    made = drawn(true, 2)
    found, freedom = moderated(KEYS, made, FREEDOM)
    assert freedom.max() < FREEDOM + 2
    assert np.std(np.log(found / true)) < 1.1 * np.std(np.log(made / true))


@pytest.mark.parametrize("apart", [0.2, 0.5, 1.0])
def test_what_is_said_of_a_variance_is_as_sure_as_it_says(apart):
    """The logarithm's error is that of a sample variance with the degrees of freedom stated."""
    keys = [Key("spectrum", f"flat-{r}", f"band {n}") for n in range(50) for r in range(40)]
    true = np.exp(apart * np.random.default_rng(3).standard_normal(len(keys)))
    found, freedom = moderated(keys, drawn(true, 4), FREEDOM)
    error = np.log(found / true)
    assert error.mean() == pytest.approx(bias(freedom[0]), abs=0.02)
    assert error.std() == pytest.approx(np.sqrt(polygamma(1, freedom[0] / 2)), rel=0.05)


def test_a_variance_far_below_its_like_is_chance():
    made = drawn(np.ones(len(KEYS)), 5)
    made[0] = 0.05
    found, _ = moderated(KEYS, made, FREEDOM)
    assert found[0] > 0.4


def test_what_stands_alone_or_never_varies_is_left():
    keys = [*KEYS, Key("step", "step", "undershoot"), Key("spectrum", "dark", "band 0")]
    made = np.append(drawn(np.ones(len(KEYS)), 6), [7.0, 0.0])
    found, freedom = moderated(keys, made, FREEDOM)
    assert list(found[-2:]) == [7.0, 0.0] and list(freedom[-2:]) == [FREEDOM, FREEDOM]


def test_degrees_of_freedom_of_a_variance():
    assert worth(0.0) == 2000.0
    assert worth(float(polygamma(1, 5.5))) == pytest.approx(11.0)
