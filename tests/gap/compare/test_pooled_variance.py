"""Variances of few twins, joined with those of their like."""

import numpy as np
import pytest
from scipy.special import polygamma

from spikecam_env.gap.compare.pooled_variance import bias, freedom_of_variance, moderated
from spikecam_env.gap.statistics import StatisticKey

FREEDOM = 11
KEYS = [StatisticKey("spectrum", f"flat-{r}", f"band {n}") for n in range(8) for r in range(10)]


def drawn(true, seed):
    return true * np.random.default_rng(seed).chisquare(FREEDOM, len(true)) / FREEDOM


def test_variances_alike_in_all_recordings_are_known_much_better():
    true = np.repeat(np.geomspace(1.0, 50.0, 8), 10)
    made = drawn(true, 0)
    found, freedom = moderated(KEYS, made, FREEDOM)
    assert np.std(np.log(found / true)) < 0.5 * np.std(np.log(made / true))
    assert freedom.min() > 100
    assert abs(np.mean(np.log(found / true))) < 0.1


def test_variances_that_differ_by_recording_alone_are_known_better():
    """Coincidences scatter as one over their number, which is a recording's."""
    of_band, of_flat = np.geomspace(1.0, 50.0, 8), np.geomspace(1.0, 1e-4, 10)
    true = np.outer(of_band, of_flat).ravel()
    made = drawn(true, 7)
    found, freedom = moderated(KEYS, made, FREEDOM)
    assert np.std(np.log(found / true)) < 0.7 * np.std(np.log(made / true))
    assert freedom.min() > 25
    assert abs(np.mean(np.log(found / true))) < 0.1


def test_variances_that_differ_stay():
    rng = np.random.default_rng(1)
    true = np.exp(2.0 * rng.standard_normal(len(KEYS)))
    made = drawn(true, 2)
    found, freedom = moderated(KEYS, made, FREEDOM)
    assert freedom.max() < FREEDOM + 2
    assert np.std(np.log(found / true)) < 1.1 * np.std(np.log(made / true))


@pytest.mark.parametrize("of_recording", [0.0, 2.0])
@pytest.mark.parametrize("apart", [0.2, 0.5, 1.0])
def test_the_stated_freedom_of_a_variance_is_that_of_its_error(apart, of_recording):
    """The logarithm's error is that of a sample variance with the degrees of freedom stated."""
    keys = [StatisticKey("spectrum", f"flat-{r}", f"band {n}") for n in range(50) for r in range(40)]
    rng = np.random.default_rng(3)
    true = np.exp(apart * rng.standard_normal(len(keys)) + np.tile(of_recording * rng.standard_normal(40), 50))
    found, freedom = moderated(keys, drawn(true, 4), FREEDOM)
    error = np.log(found / true)
    assert error.mean() == pytest.approx(bias(freedom[0]), abs=0.02)
    assert error.std() == pytest.approx(np.sqrt(polygamma(1, freedom[0] / 2)), rel=0.05)


def test_a_variance_far_below_its_like_is_chance():
    made = drawn(np.ones(len(KEYS)), 5)
    made[0] = 0.05
    found, _ = moderated(KEYS, made, FREEDOM)
    assert found[0] > 0.4


def test_a_variance_that_stands_alone_or_is_zero_stays():
    keys = [*KEYS, StatisticKey("step", "step", "undershoot"), StatisticKey("spectrum", "dark", "band 0")]
    made = np.append(drawn(np.ones(len(KEYS)), 6), [7.0, 0.0])
    found, freedom = moderated(keys, made, FREEDOM)
    assert list(found[-2:]) == [7.0, 0.0] and list(freedom[-2:]) == [FREEDOM, FREEDOM]


def test_degrees_of_freedom_of_a_variance():
    assert freedom_of_variance(0.0) == 2000.0
    assert freedom_of_variance(float(polygamma(1, 5.5))) == pytest.approx(11.0)
