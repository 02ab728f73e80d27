"""Distances in noise, and their chance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import special, stats

from spikecam_env.gap.compare.distance import (
    adjusted,
    deviates,
    is_significant,
    normal_deviates,
    residual,
)
from spikecam_env.gap.compare.prediction import (
    TOLERANCE,
    Draw,
    Null,
    Prediction,
    null_of,
    paired,
)
from spikecam_env.gap.compare.step import step_of
from spikecam_env.gap.settings import Judging
from spikecam_env.gap.statistics import StatisticKey, floor_of

GATE = Judging().gate


def made_up(mean=0.0, sd=1.0, floor=0.0, twins=12, count=1) -> Null:
    full = lambda v: np.full(count, float(v))  # noqa: E731
    return Null(
        tuple(StatisticKey("g", "r", str(i)) for i in range(count)), full(mean), full(sd), full(floor), twins, twins - 1
    )


def exactly(mean) -> Prediction:
    """A prediction of noise 1 a campaign whose mean is known."""
    return Prediction(mean, np.zeros(mean.shape), np.ones(mean.shape))


def test_holm_of_a_hand_example():
    """p = 0.01, 0.04, 0.03, 0.005: in order 4 x 0.005, 3 x 0.01, 2 x 0.03, and 0.04 may not be below 0.06."""
    p = np.array([0.01, 0.04, 0.03, 0.005])
    z = special.ndtri(p / 2) * np.array([1, -1, 1, -1])
    assert adjusted(z) == pytest.approx([0.03, 0.06, 0.06, 0.02])


@pytest.mark.parametrize("twins", [4, 8, 12])
def test_false_alarms_have_their_nominal_rate_however_few_the_twins(twins):
    """1500 campaigns of 20 statistics, alarm at 5 %: 5 -+ 4 sqrt(0.05 * 0.95 / 1500) % at most."""
    rng = np.random.default_rng(twins)
    alarms = 0
    for _ in range(1500):
        made = rng.standard_normal((twins, 20))
        null = Null(made_up(count=20).keys, made.mean(axis=0), made.std(axis=0, ddof=1), np.zeros(20), twins, twins - 1)
        alarms += adjusted(deviates(null, rng.standard_normal(20))).min() < 0.05
    share, allowed = alarms / 1500, 0.05 + 4 * np.sqrt(0.05 * 0.95 / 1500)
    print(f"{twins} twins: {share:.3f}, allowed {allowed:.3f}")
    assert 0.02 < share < allowed


@pytest.mark.slow
@pytest.mark.parametrize("twins, recordings", [(2, 1), (4, 10)])
def test_an_effect_that_scatters_is_not_held_against_its_own_few_twins(twins, recordings):
    """300 campaigns of 200 statistics of a model whose effect scatters three times the null: alarms as often as asked
    for.  By the null's degrees of freedom the spread of few twins passes for known."""
    rng = np.random.default_rng(twins)
    names = 200 // recordings
    keys = tuple(StatisticKey("drift", f"r{r}", str(i)) for i in range(names) for r in range(recordings))
    with_own, as_the_nulls = 0, 0
    for _ in range(300):
        made = rng.standard_normal((12, 200))
        null = null_of([dict(zip(keys, v, strict=True)) for v in made], keys, [None] * 12)
        added = 10.0 + np.sqrt(8.0) * rng.standard_normal((twins + 1, 200))
        predicted = paired(null, [Draw(n, made[n] + added[n], None) for n in range(twins)])
        rho = residual(null, rng.standard_normal(200) + added[twins], replace(predicted, own=np.zeros(200)))
        with_own += is_significant(null, rho, predicted)
        as_the_nulls += is_significant(null, rho)
    share, allowed = with_own / 300, GATE + 4 * np.sqrt(GATE * (1 - GATE) / 300)
    print(f"{twins} twins, {recordings} recordings: {share:.3f}, allowed {allowed:.3f}; {as_the_nulls / 300:.3f}")
    assert share < allowed < as_the_nulls / 300


@pytest.mark.parametrize("twins", [4, 12])
def test_deviates_of_few_twins_are_normal(twins):
    """Kolmogorov distance of 20 000: 1.95 / sqrt(n) once in a thousand times."""
    rng = np.random.default_rng(0)
    made = 3 + 2 * rng.standard_normal((twins, 20_000))
    null = Null(
        made_up(count=20_000).keys, made.mean(axis=0), made.std(axis=0, ddof=1), np.zeros(20_000), twins, twins - 1
    )
    z = deviates(null, 3 + 2 * rng.standard_normal(20_000))
    distance = float(stats.kstest(z, "norm").statistic)
    print(f"distance {distance:.4f}, sd {z.std():.3f}")
    assert distance < 1.95 / np.sqrt(20_000)


def test_a_distance_that_drawn_units_show_is_as_likely_as_their_share():
    """Four units in forty are ten widths off: t says that it never happens, these say that one in nine does.  Distances
    that none of them shows, and the other side, stay."""
    null = made_up(count=3)
    units = np.zeros((40, 3))
    units[:4] = 10.0
    there = Prediction(np.zeros(3), np.zeros(3), np.ones(3), units=units)
    t = np.array([8.0, -8.0, 12.0])
    z, before = normal_deviates(null, t, there), normal_deviates(null, t, replace(there, units=None))
    print(z, before)
    assert z[0] == pytest.approx(stats.norm.isf(5 / 41))
    assert z[1:] == pytest.approx(
        np.array([-1, 1]) * np.abs(normal_deviates(null, t, replace(there, units=0 * units)))[1:]
    )


def test_noise_that_is_known_makes_a_normal_deviate():
    """All floor: Student's t has no say.  All learnt: |z| of Student's t of 11 at 5 is 3.6 or so."""
    assert normal_deviates(made_up(sd=1e-9, floor=1.0), np.array([5.0]))[0] == pytest.approx(5.0, abs=0.01)
    learnt = float(normal_deviates(made_up(), np.array([5.0]))[0])
    assert learnt == pytest.approx(stats.norm.isf(stats.t.sf(5.0, 11)))
    assert learnt < 5.0


def test_an_unknown_statistic_is_no_deviation():
    assert deviates(made_up(count=2), np.array([np.nan, 0.0])).tolist() == [0.0, 0.0]
    assert residual(made_up(), np.array([np.nan]), exactly(np.zeros(1)))[0] == 0.0


def test_a_label_within_its_floor_is_no_deviation():
    """Rates are known to 2e-5, whatever the number of spikes."""
    key = StatisticKey("rates", "flat", "level")
    null = null_of([{key: 1e-9 * n} for n in range(12)], [key])
    assert null.floor[0] == floor_of(key) == 2e-5
    within_floor, beyond = deviates(null, np.array([2e-5]))[0], deviates(null, np.array([2e-4]))[0]
    print(f"{within_floor:.2f}, {beyond:.2f}")
    assert within_floor == pytest.approx(1.0, abs=0.01) and beyond == pytest.approx(10.0, abs=0.1)


def test_residual_forgives_a_share_of_the_effects_own_size():
    """An effect of 1000 noises that is simulated 5 % off leaves one noise of 50, not 50."""
    null = made_up(count=2)
    measured = np.array([1000.0, 0.0])
    rho = residual(null, measured, exactly(np.array([1000.0 / (1 + TOLERANCE), 0.0])))
    print(rho)
    assert rho[0] == pytest.approx(1.0, abs=0.06) and rho[1] == 0.0
    assert residual(null, measured, exactly(np.array([500.0, 0.0])))[0] > 15


def drawn(count=40, twins=12, seed=0) -> Null:
    """A null of Gaussian statistics with its draws."""
    values = np.random.default_rng(seed).standard_normal((twins, count))
    draws = tuple(Draw(n, v, None) for n, v in enumerate(values))
    full = made_up(count=count, twins=twins)
    return Null(full.keys, values.mean(axis=0), values.std(axis=0, ddof=1), full.floor, twins, twins - 1, draws=draws)


def test_step_finds_a_parameter_within_its_error_though_statistics_go_together():
    """200 campaigns; every statistic told twice over: 90 % intervals hold the truth in 80 to 97 %."""
    rng = np.random.default_rng(0)
    jacobian = np.repeat(rng.standard_normal((20, 1)), 2, axis=0)
    inside = 0
    for seed in range(200):
        made = np.repeat(rng.standard_normal((25, 20)), 2, axis=1)
        null = replace(drawn(seed=seed, twins=24), mean=made[:24].mean(axis=0), sd=made[:24].std(axis=0, ddof=1))
        null = replace(null, draws=tuple(Draw(n, v, None) for n, v in enumerate(made[:24])))
        step, covariance = step_of(null, made[24] + 0.4 * jacobian[:, 0], null.prediction, jacobian)
        inside += abs(step[0] - 0.4) < 1.645 * np.sqrt(covariance[0, 0])
    print(f"{inside} of 200")
    assert 0.8 < inside / 200 < 0.97


def test_parameters_that_do_the_same_are_open_between_each_other():
    """Their derivatives are the same: each is known as well as one was before (0.2), though both together are known
    to 0.4 %."""
    null = made_up(count=40)
    alike = np.full((40, 2), 20.0)
    _, covariance = step_of(null, np.zeros(40), exactly(np.zeros(40)), alike, before=np.array([1.0, 0.2]))
    together = float(np.sqrt(np.array([0.5, 0.5]) @ covariance @ np.array([0.5, 0.5])))
    print(np.sqrt(np.diag(covariance)), together)
    assert np.sqrt(np.diag(covariance)) == pytest.approx(np.full(2, 0.2), rel=0.15) and together < 0.005
    [one] = step_of(null, np.zeros(40), exactly(np.zeros(40)), alike[:, :1])[1].reshape(1)
    assert np.sqrt(one) == pytest.approx(1 / 20 / np.sqrt(40), rel=0.2), "alone it is told"


def test_noise_of_derivatives_does_not_tell_parameters_apart():
    """Two parameters make up for each other but for 5 %, and are half a logarithm off, one up and one down.  Their
    derivatives, noisy twins less the same one, differ by more: how often 90 % intervals hold the truth of 300."""
    rng = np.random.default_rng(3)
    null = made_up(count=30)
    true = 10.0 * np.stack([np.ones(30), np.ones(30) + 0.05 * np.linspace(-1, 1, 30)], axis=1)
    inside = {2.0: 0, 0.0: 0}
    for _ in range(300):
        seen = true + np.sqrt(2.0) * (rng.standard_normal((30, 2)) - rng.standard_normal((30, 1)))
        truth = 0.5 * rng.standard_normal() * np.array([1.0, -1.0])
        measured = true @ truth + rng.standard_normal(30)
        for doubt in inside:
            step, covariance = step_of(null, measured, exactly(np.zeros(30)), seen, doubt)
            inside[doubt] += bool(abs(step[1] - truth[1]) < 1.645 * np.sqrt(covariance[1, 1]))
    print(inside)
    assert inside[2.0] > 0.8 * 300 > 0.5 * 300 > inside[0.0]


def test_errors_know_that_an_effect_falls_on_other_pixels_each_time():
    """Twins whose statistics move by 20 % together: so unsure is the strength, however many statistics there are."""
    rng = np.random.default_rng(0)
    null = made_up(count=50)
    null = replace(null, draws=tuple(Draw(n, rng.standard_normal(50), None) for n in range(12)))
    luck = 1.0 + 0.2 * np.array([1.0, -1.0, 0.5, -0.5])
    draws = tuple(Draw(8 + i, null.draws[8 + i].values + 100.0 * f, None) for i, f in enumerate(luck))
    there = replace(exactly(np.full(50, 100.0)), draws=draws)
    errors = [
        float(np.sqrt(step_of(null, there.mean, p, np.full((50, 1), 100.0))[1][0, 0]))
        for p in (there, replace(there, draws=draws[:3]))
    ]
    print(errors)
    assert errors[0] == pytest.approx(0.2 * np.sqrt(2.5 / 3 * 1.25), abs=0.06) and errors[1] < 0.1


def test_errors_know_that_all_recordings_show_one_pattern():
    """Drawn units whose pattern differs by 9 %, alike in ten recordings: ten tell no more of it than one."""
    null = made_up(count=10)
    null = replace(null, draws=tuple(Draw(n, np.random.default_rng(n).standard_normal(10), None) for n in range(12)))
    luck = 1.0 + 0.09 * np.random.default_rng(0).standard_normal(400)
    there = replace(exactly(np.full(10, 100.0)), units=100.0 * np.repeat(luck[:, None], 10, axis=1))
    one = replace(there, units=np.where(np.arange(10) == 0, there.units, np.nan))
    errors = [float(np.sqrt(step_of(null, there.mean, p, np.full((10, 1), 100.0))[1][0, 0])) for p in (there, one)]
    print(errors)
    assert errors[0] == pytest.approx(np.hypot(0.09, TOLERANCE), abs=0.008) and errors[1] < 0.5 * errors[0]
