"""Each far law has a property that is computed by hand, and that its near law has not at a strength that cases draw.

A claim takes a bench with the law under trial.  It returns a measured value, the computed one, and the standard
deviation of the first.  The far law is within five of them; the near law, with the same parameters, beyond ten.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from tests.hidden_world.bench import filmed, plain_camera, step_up, walk_of_spikes
from tests.hidden_world.integrator import Physics
from tests.hidden_world.laws import PAGE, with_table
from tests.hidden_world.light import Light, plan
from tests.hidden_world.mechanism import Bits, Hidden, Law, Parameters, limits
from tests.hidden_world.unit import SWING_V, Camera
from tests.hidden_world.world import MECHANISMS, stream

CAMERA = plain_camera((32, 32), spread=0.0)
LARGE = plain_camera((64, 64), spread=0.0)
EDGE = 0.6 / 32
"""Standard deviation of the mean count of 1024 pixels that start anywhere in their first cycle."""
EXACT = 1e-9
FAR = [(m.name, law.name) for m in MECHANISMS.values() for law in m.far]

Claim = Callable[["Bench"], tuple[ArrayLike, ArrayLike, ArrayLike]]
CLAIMS: dict[tuple[str, str], Claim] = {}


@dataclass(frozen=True)
class Bench:
    """A mechanism by one of its laws, with parameters p."""

    name: str
    by: str
    p: Parameters

    @property
    def law(self) -> Law:
        return MECHANISMS[self.name].by(self.by)

    def film(self, light: Light | float, frames: int = 2000, camera: Camera = CAMERA) -> NDArray[np.uint8]:
        return filmed(camera, light, frames, [Hidden(self.name, self.p, 1.0, law=self.by)])

    def camera(self, camera: Camera = LARGE) -> Camera:
        return self.law.camera(camera, self.p, stream(1, "camera"))

    def physics(self, camera: Camera = CAMERA, frames: int = 4000, before: float = 0.0) -> Physics:
        arrays = [getattr(camera, name).reshape(-1) for name in ("gain", "dark", "quiet", "kappa", "per_mv")]
        made = Physics(camera.shape, frames, *arrays, np.zeros(1), np.zeros((1, 1), np.float32), before)
        self.law.physics(made, camera, frames, self.p, stream(1, "physics"))
        return made

    def bits(self, bits: Bits) -> Bits:
        return self.law.bits(bits.copy(), self.p, stream(1, "bits"))


def strongest(name: str) -> float:
    """A hundred limits, or as far as the mechanism goes; of events, those of a poor camera."""
    limit = limits()[name]
    return limit.poor or limit.strength(100.0)


def claim(name: str, law: str) -> Callable[[Claim], Claim]:
    def keep(made: Claim) -> Claim:
        CLAIMS[name, law] = made
        return made

    return keep


def test_every_far_law_has_a_claim():
    assert sorted(CLAIMS) == sorted(FAR)
    assert all(law.source for m in MECHANISMS.values() for law in m.far)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "law"), FAR, ids=[f"{name}/{law}" for name, law in FAR])
def test_far_law_is_as_computed_and_the_near_one_is_not(name, law):
    mechanism = MECHANISMS[name]
    p = {limits()[name].parameter: strongest(name)}
    p |= mechanism.drawn("", stream(1, name)) | mechanism.drawn(law, stream(1, name))
    away = []
    for by in (law, ""):
        value, expected, sd = (np.asarray(x, float) for x in CLAIMS[name, law](Bench(name, by, p)))
        away.append(float(np.max(np.abs(value - expected) / sd)))
        print(f"{by or 'near'}: {value}, expected {expected} +- {sd}")
    assert away[0] < 5.0 and away[1] > 10.0


def test_the_table_of_laws_in_the_docs_is_current():
    page = PAGE.read_text(encoding="utf-8")
    assert with_table(page) == page, "run python -m tests.hidden_world.laws"


def test_a_campaign_knows_the_order_of_its_recordings():
    shots = plan((8, 8), 100, stream(1, "light"))
    assert [shot.order for shot in shots] == list(range(len(shots)))


def line(value: NDArray[Any], cycles: float) -> complex:
    """Amplitude and phase of a line along the first axis."""
    return complex(2.0 * np.mean(value * np.exp(-2j * np.pi * cycles * np.arange(len(value)))))


def lag_one(series: NDArray[Any]) -> float:
    """Correlation of successive values along the first axis."""
    return float(np.mean(series[1:] * series[:-1]) / np.mean(series**2))


def besides(pattern: NDArray[Any]) -> float:
    """Correlation of neighbours along rows."""
    from_mean = pattern - pattern.mean()
    return float(np.mean(from_mean[:, 1:] * from_mean[:, :-1]) / from_mean.var())


def whole_squares(marked: NDArray[np.bool_]) -> tuple[float, float]:
    """Share of the marked pixels whose square of two by two is marked, and their number."""
    full = marked.reshape(marked.shape[0] // 2, 2, marked.shape[1] // 2, 2).all(axis=(1, 3))
    return 4.0 * full.sum() / marked.sum(), float(marked.sum())


# ---- optics


@claim("lamp_drift", "warms")
def _(bench):
    at = bench.physics().light_waves[0].value(np.array([2000.0, 4000.0])) - 1.0
    end = bench.p["sigma_per_root_s"] * np.sqrt(0.1)
    return np.abs(at), (end / 2, end), EXACT


@claim("lamp_drift", "hops")
def _(bench):
    """In a second 40 jumps, their squares add up to the variance of the walk."""
    jumps = np.diff(bench.physics(frames=40000).light_waves[0].value(np.arange(0.0, 40000.0)))
    squares = np.sum(jumps**2) / bench.p["sigma_per_root_s"] ** 2
    return (np.count_nonzero(jumps), squares), (40, 1.0), (np.sqrt(40), np.sqrt(3 / 40))


@claim("light_flicker", "switched")
def _(bench):
    value = bench.physics().light_waves[0].value(np.linspace(0.0, 4000.0, 100_000))
    return (value.max() - 1.0, value.std()), bench.p["modulation"] * np.ones(2), (EXACT, 1e-4)


@claim("light_flicker", "two lamps")
def _(bench):
    cycles = bench.p["frequency_hz"] * 25e-6
    value = np.prod([wave.value(np.arange(100_000.0)) for wave in bench.physics().light_waves], axis=0) - 1.0
    lines = [abs(line(value, cycles * times)) for times in (1.0, bench.p["ratio"])]
    return lines, bench.p["modulation"] / np.sqrt(2.0) * np.ones(2), 1e-3


@claim("vignetting", "off centre")
def _(bench):
    gain = bench.camera(plain_camera((65, 65), spread=0.0)).gain
    centre = 32.0 * (1.0 + np.array([bench.p["rows_off"], bench.p["columns_off"]]))
    return np.unravel_index(gain.argmax(), gain.shape), centre, 0.3


@claim("vignetting", "mechanical")
def _(bench):
    loss = 1.0 - bench.camera(plain_camera((65, 65), spread=0.0)).gain
    return loss[[0, 16], [0, 16]], bench.p["falloff"] * np.array([1.0, 1 / 16]), EXACT


def spot(bench: Bench) -> tuple[NDArray[Any], NDArray[Any]]:
    """A point of light after the lens, and its variance along columns and rows."""
    light = np.zeros((1, 41, 41), np.float32)
    light[0, 20, 20] = 1.0
    seen = bench.law.light(Light(np.zeros(1), light), (41, 41), bench.p).radiance[0]
    at = (np.arange(41) - 20.0) ** 2
    return seen, np.array([seen.sum(axis=1) @ at, seen.sum(axis=0) @ at])


@claim("optical_blur", "astigmatic")
def _(bench):
    return spot(bench)[1], (0.0, 2.0 * bench.p["sigma_pixels"] ** 2), 1e-4


@claim("optical_blur", "halo")
def _(bench):
    """A share s^2 / 4 leaves the middle, but for the 1 / 8 pi of it that a normal law of 2 pixels has there."""
    seen, variance = spot(bench)
    square = bench.p["sigma_pixels"] ** 2
    kept = 1.0 - square / 4.0 * (1.0 - 1 / (8 * np.pi))
    return (*variance, seen[20, 20]), (square, square, kept), (1e-3, 1e-3, 1e-3)


# ---- photodiode


@claim("photo_response_nonlinearity", "third order")
def _(bench):
    return bench.film(0.5).mean(), 0.5 * (1.0 - bench.p["beta"] * 0.25), EDGE / 2000


@claim("photo_response_nonlinearity", "gamma")
def _(bench):
    return bench.film(0.1).mean(), 0.1 ** (1.0 - bench.p["beta"]), EDGE / 2000


@claim("photodiode_lag", "after a fall")
def _(bench):
    """Nothing is missing after a rise; after a fall f tau of it comes late."""
    bench = replace(bench, p={**bench.p, "tau_us": 1500.0})
    rise = bench.film(step_up(0.1, 0.5, 500), 1000).sum(axis=0).mean() - (300.0 - 0.2)
    fall = bench.film(step_up(0.5, 0.1, 500), 1000).sum(axis=0).mean() - (300.0 + 0.2)
    late = 0.4 * bench.p["fraction"] * 60.0
    return (rise, fall), (0.0, late), 1.5 * EDGE


@claim("blooming", "along columns")
def _(bench):
    light = np.full((1, 9, 9), 0.1, np.float32)
    light[0, 4, 4] = 1.6
    rate = bench.film(Light(np.zeros(1), light), 4000, plain_camera((9, 9), spread=0.0)).mean(axis=0)
    given = 0.5 * bench.p["share"] * (1.6 - bench.p["full"])
    return (rate[3, 4], rate[5, 4], rate[4, 3]), (0.1 + given, 0.1 + given, 0.1), 2e-4


@claim("dark_current_drift", "linear")
def _(bench):
    value = bench.physics().dark_waves[0].value(np.array([0.0, 2000.0, 4000.0]))
    return value, 1.0 + bench.p["rise"] * np.array([0.0, 0.5, 1.0]), EXACT


@claim("dark_current_drift", "exponential")
def _(bench):
    value = bench.physics().dark_waves[0].value(np.array([0.0, 2000.0, 4000.0]))
    return value, np.exp(bench.p["rise"] * np.array([0.0, 0.5, 1.0])), EXACT


@claim("dark_current_drift", "running on")
def _(bench):
    value = bench.physics(before=12000.0).dark_waves[0].value(np.array([0.0, 4000.0]))
    return value, 1.0 + bench.p["rise"] * (1.0 - np.exp([-1.0, -4 / 3])), EXACT


@claim("hot_pixels", "clusters")
def _(bench):
    return whole_squares(bench.camera().dark > 0.0), (1.0, 4 * round(bench.p["fraction"] * 1024)), 0.02


@claim("hot_pixels", "power law")
def _(bench):
    """The least of n has xm (1 + 1 / (2.5 n)), xm = 0.6 of the mean."""
    current = bench.camera().dark / LARGE.charge_of(1.0)
    hot = current[current > 0.0]
    return hot.min() / bench.p["mean_pA"], 0.6 * (1.0 + 0.4 / hot.size), 0.24 / hot.size


@claim("dark_current_tail", "gamma")
def _(bench):
    factor = bench.camera(replace(LARGE, dark=np.ones((64, 64)))).dark
    return (factor.mean(), factor.std()), (1.0, bench.p["sigma"]), bench.p["sigma"] * np.array([1 / 64, 0.03])


@claim("dark_current_tail", "one side")
def _(bench):
    factor = np.log(bench.camera(replace(LARGE, dark=np.ones((64, 64)))).dark) / bench.p["sigma"]
    return (np.mean(factor < 0.0), np.mean(factor**2)), (0.0, 1.0), (EXACT, np.sqrt(2 / 4096))


@claim("random_telegraph_noise", "in proportion")
def _(bench):
    dark = 0.01 * stream(1, "dark").uniform(0.5, 1.5, (64, 64))
    _, pixel, size = bench.physics(replace(LARGE, dark=dark)).dark_steps
    steps = np.abs(size) / dark.flat[pixel]
    return (steps.min(), steps.max()), bench.p["amplitude_pA"] * LARGE.charge_of(1.0)[0, 0] / dark.mean(), EXACT


@claim("random_telegraph_noise", "unequal")
def _(bench):
    """Up for a fifth of the time.  Of some 2000 cycles, each of two exponential stretches."""
    frames = 40000
    time, pixel, size = bench.physics(LARGE, frames).dark_steps
    step = {p: np.abs(size[pixel == p][0]) for p in set(pixel)}
    up = sum(np.sum(np.sign(size[pixel == p]) * (frames - np.maximum(time[pixel == p], 0.0))) for p in step)
    count = round(bench.p["fraction"] * 4096)
    spread = np.std(list(step.values())) / np.mean(list(step.values()))
    return (up / frames / count, spread), (0.2, 1.0), (0.01, 0.1)


# ---- threshold


@claim("supply_ripple", "of the reset")
def _(bench):
    """delta(t) = delta(t - T) - T rho w cos(w t'), with t' = t - T for the reset and t for the threshold: the phase of
    the rate goes as -w T / 2 for the one and +w T / 2 for the other."""
    bench = replace(bench, p={**bench.p, "frequency_hz": 6000.0})
    light = np.full((1, 32, 32), 1 / 5.3, np.float32)
    light[0, 16:] = 1 / 3.2
    bits = bench.film(Light(np.zeros(1), light), 4000, plain_camera((32, 32), kappa=0.01, spread=0.0))
    dim, bright = (line(bits[:, rows].mean(axis=(1, 2)), 0.15) for rows in (slice(16), slice(16, 32)))
    return np.angle(dim * np.conj(bright)), -np.pi * 0.15 * (5.3 - 3.2), 0.06


@claim("supply_ripple", "rectified")
def _(bench):
    cycles = bench.p["frequency_hz"] * 25e-6
    value = np.prod([w.value(np.arange(100_000.0)) for w in bench.physics().threshold_waves], axis=0) - 1.0
    return [abs(line(value, k * cycles)) for k in (1, 2)], bench.p["ripple"] * np.array([0.8, 0.6]), 4e-4


@claim("clock_feedthrough", "slewing")
def _(bench):
    clock = bench.physics().clock
    assert clock is not None
    return clock.height(clock.tau * np.array([0.0, 1.0, 2.0])), -clock.amplitude * np.array([1.0, 0.5, 0.0]), EXACT


@claim("common_threshold_noise", "with memory")
def _(bench):
    noise = bench.physics().row_mv
    return (lag_one(noise[:, 0]), np.ptp(noise, axis=1).max()), (0.6, 0.0), (0.013, EXACT)


@claim("common_threshold_noise", "bursts")
def _(bench):
    noise = bench.physics(frames=20000).row_mv[:, 0]
    there, variance = np.mean(noise != 0.0), noise.var() / bench.p["sigma_mV"] ** 2
    return (there, variance), (0.05, 1.0), (np.sqrt(0.05 * 0.95 / 20000), np.sqrt(59 / 20000))


@claim("row_temporal_noise", "pairs of rows")
def _(bench):
    noise = bench.physics().row_mv
    together = [np.corrcoef(noise[:, 0], noise[:, 1])[0, 1], np.corrcoef(noise[:, 1], noise[:, 2])[0, 1]]
    return together, (1.0, 0.0), 1 / np.sqrt(4000)


@claim("row_temporal_noise", "with memory")
def _(bench):
    noise = bench.physics().row_mv
    return (lag_one(noise), noise.std() / bench.p["sigma_mV"]), (0.6, 1.0), (0.002, 0.01)


@claim("threshold_flicker_noise", "steeper")
def _(bench):
    """Power a band of two octaves, f S(f), goes as f^-0.4; in all, six bands about that of 1/f."""
    variance = bench.physics().slow_mv ** 2 / (2.0 * bench.p["sigma_mV"] ** 2)
    return variance, 4.0 ** (0.4 * (np.arange(6) - 2.5)), EXACT


@claim("threshold_flicker_noise", "one trap")
def _(bench):
    made = bench.physics()
    return (made.slow_mv.size, made.slow_tau[0]), (1, bench.p["tau_frames"]), EXACT


def pattern_of_gain(bench: Bench) -> tuple[ArrayLike, ArrayLike, ArrayLike]:
    made = bench.camera(replace(LARGE, dark=np.full((64, 64), 0.01)))
    lines = made.gain.std() * SWING_V * 1e3 / bench.p["sigma_mV"]
    return (lines, np.ptp(made.dark)), (1.0, 0.0), (1 / np.sqrt(128), EXACT)


def alternating(bench: Bench) -> tuple[ArrayLike, ArrayLike, ArrayLike]:
    """Every swing is sigma above or below its mean."""
    swing = (1.0 / bench.camera().gain - 1.0) * SWING_V * 1e3 / bench.p["sigma_mV"]
    return (np.abs(swing).min(), np.abs(swing).max(), np.abs(swing[:2, :2].sum())), (1.0, 1.0, 0.0), 1e-6


for _name in ("row_fixed_pattern", "column_fixed_pattern"):
    claim(_name, "of gain")(pattern_of_gain)
    claim(_name, "alternating")(alternating)


def each_its_own(variance: NDArray[Any]) -> tuple[ArrayLike, ArrayLike, ArrayLike]:
    """Variances of an exponential law over 4096 pixels: mean of squares twice the square of the mean."""
    return np.mean(variance**2) / np.mean(variance) ** 2, 2.0, np.sqrt(20 / 4096)


@claim("excess_threshold_noise", "each its own")
@claim("reset_noise", "each its own")
def _(bench):
    return each_its_own(bench.camera().kappa ** 2)


@claim("frame_threshold_noise", "each its own")
def _(bench):
    return each_its_own(bench.physics(LARGE).frame_noise_mv ** 2)


@claim("ir_drop", "from the pad")
def _(bench):
    """Nothing at the pad; T = (1 + 2 d a) / x at the other end, a = x."""
    rate = bench.film(0.4, 2000).mean(axis=(0, 1))
    return rate[[0, -1]], (0.4, 0.4 / (1.0 + 2.0 * bench.p["droop"] * 0.4)), (1e-4, 3e-4)


@claim("ir_drop", "by columns")
def _(bench):
    """Dim columns beside bright ones have the drop of the dim."""
    light = np.full((1, 32, 32), 0.5, np.float32)
    light[0, :, 16:] = 0.05
    rate = bench.film(Light(np.zeros(1), light), 4000)[:, :, 16:].mean()
    return rate, 0.05 / (1.0 + 0.05 * bench.p["droop"]), EDGE * np.sqrt(2) / 4000


# ---- reset


@claim("dead_time", "along the row")
def _(bench):
    rate = bench.film(0.5).mean(axis=(0, 1))[[0, -1]]
    return rate, 1.0 / (2.0 + bench.p["tau_us"] / 25.0 * np.array([0.0, 2.0])), EDGE * np.sqrt(32) / 2000


@claim("dead_time", "against the light")
def _(bench):
    return bench.film(0.5).mean(), 1.0 / (2.0 + bench.p["tau_us"] / 25.0 * 1.5), EDGE / 2000


@claim("comparator_delay", "two stages")
def _(bench):
    return bench.film(0.1).mean(), 1.0 / (10.0 + bench.p["delay_us"] / 25.0 * 0.1 ** (-1 / 3)), EDGE / 2000


@claim("synchronous_reset", "flag")
def _(bench):
    """A share f of the intervals is longer by the rest of a frame: variance f / 3 - f^2 / 4 each."""
    f = bench.p["fraction"]
    quiet = plain_camera((32, 32), electrons=0.0, spread=0.2)
    return walk_of_spikes(bench.film(0.3, 4000, quiet), 20), 0.5 + 40.0 * (f / 3.0 - f * f / 4.0), 0.015


@claim("incomplete_reset", "falling")
def _(bench):
    """T = (1 - f exp(-T / tau)) / x."""
    bench = replace(bench, p={**bench.p, "tau_us": 250.0})
    interval = 1 / 0.35
    for _ in range(50):
        interval = (1.0 - bench.p["fraction"] * np.exp(-interval / 10.0)) / 0.35
    return bench.film(0.35).mean(), 1.0 / interval, EDGE / 2000


@claim("crosstalk", "late")
def _(bench):
    """All of a kick counts: none of it makes a pixel fire, whose reset would take the charge beyond the threshold."""
    kicks = 4.0 * (1.0 - 1 / 32) * bench.p["kick"]
    return bench.film(0.3, 8000).mean(), 0.3 / (1.0 - kicks), EDGE / 8000


@claim("crosstalk", "along the row")
def _(bench):
    """A row in the light gives nothing to the dark ones beside it."""
    light = np.zeros((1, 32, 32), np.float32)
    light[0, 16] = 0.4
    rate = bench.film(Light(np.zeros(1), light), 2000).mean(axis=(0, 2))
    return (rate[15], rate[17]), (0.0, 0.0), 1e-4


# ---- read-out


@claim("clock_jitter", "wandering")
def _(bench):
    return lag_one(bench.physics(frames=8000).edge), 0.5, 0.01


@claim("clock_jitter", "spur")
def _(bench):
    edge = bench.physics().edge / (bench.p["sigma_ns"] / 25000.0)
    return abs(line(edge, 1.0 / bench.p["period_frames"])), np.sqrt(2.0), 5e-3


@claim("dead_pixels", "clusters")
def _(bench):
    return whole_squares(bench.camera().gain == 0.0), (1.0, 4 * round(bench.p["fraction"] * 1024)), 0.02


@claim("dead_pixels", "almost")
def _(bench):
    gain = bench.camera().gain
    return (gain.min(), np.sum(gain < 0.5)), (0.05, round(bench.p["fraction"] * 4096)), EXACT


@claim("readout_skew", "two banks")
def _(bench):
    return bench.physics().skew[[0, 15, 16, 31]], bench.p["span"] * np.array([1.0, 0.0, 1.0, 0.0]), EXACT


@claim("readout_skew", "groups")
def _(bench):
    skew = bench.physics().skew
    return (len(np.unique(skew)), skew[0] - skew[4]), (8, bench.p["span"] / 7.0), EXACT


def busy(densities: tuple[float, ...], frames: int = 4000) -> Bits:
    """Independent spikes, of these densities in equal parts of the rows of 32 x 32 pixels."""
    by_row = np.repeat(densities, 32 // len(densities))[None, :, None]
    return (stream(1, "busy").random((frames, 32, 32)) < by_row).astype(np.uint8)


@claim("missed_spikes", "busy rows")
def _(bench):
    """Of n spikes of a row of 32 at density d, a share 5 p (d + (1 - d) / 32), the spike itself being one of them."""
    there = busy((0.1, 0.4)).reshape(4000, 2, -1)
    left = bench.bits(busy((0.1, 0.4))).reshape(4000, 2, -1)
    count, density = there.sum(axis=(0, 2)), np.array([0.1, 0.4])
    share = 5.0 * bench.p["probability"] * (density + (1.0 - density) / 32)
    return 1.0 - left.sum(axis=(0, 2)) / count, share, np.sqrt(share / count)


@claim("missed_spikes", "words")
def _(bench):
    empty = np.mean(~bench.bits(busy((0.6,))).any(axis=2))
    return empty, bench.p["probability"], np.sqrt(bench.p["probability"] / 4000 / 32)


@claim("spurious_spikes", "some pixels")
def _(bench):
    """Counts of a Poisson law whose mean is exponential: variance over mean squared, less 1 / mean, is one."""
    count = bench.bits(np.zeros((4000, 64, 64), np.uint8)).sum(axis=0).astype(float)
    return count.var() / count.mean() ** 2 - 1.0 / count.mean(), 1.0, np.sqrt(10 / 4096)


@claim("spurious_spikes", "glitches")
def _(bench):
    """Seven of eight have one to their right; as many as stated."""
    bits = bench.bits(np.zeros((4000, 32, 32), np.uint8))
    beside = np.sum(bits[:, :, 1:] & bits[:, :, :-1]) / bits.sum()
    p = bench.p["probability"]
    return (beside, bits.mean()), (7 / 8, p), (0.005, np.sqrt(8 * p / bits.size))


@claim("afterpulsing", "exponential")
def _(bench):
    """A share 1 / d comes in the next frame."""
    bits = np.zeros((4000, 32, 32), np.uint8)
    bits[::100] = 1
    again = bench.bits(bits)
    extra = int(again.sum()) - int(bits.sum())
    d = bench.p["delay_frames"]
    return again[1::100].sum() / extra, 1.0 / d, np.sqrt((1.0 - 1.0 / d) / d / extra)


# ---- the base model's own


@claim("dark_current", "warmer on one side")
def _(bench):
    dark = bench.camera().dark[5] / LARGE.charge_of(1.0)[5]
    return dark[[0, -1]], bench.p["mean_pA"] * np.array([0.0, 2.0]), EXACT


@claim("dark_current_spread", "skewed")
def _(bench):
    extra = bench.camera(replace(LARGE, dark=np.full((64, 64), 0.05))).dark - 0.05
    third = np.mean((extra - extra.mean()) ** 3) / extra.std() ** 3
    return third, 1.0, 0.08


def smooth(bench: Bench) -> tuple[ArrayLike, ArrayLike, ArrayLike]:
    """White noise through a normal law of s = 4 pixels: neighbours correlate by exp(-1 / 4 s^2)."""
    return besides(1.0 / bench.camera().gain), np.exp(-1 / 64), 0.01


for _name in ("conversion_gain_spread", "capacitor_spread", "bias_voltage_spread"):
    claim(_name, "smooth over the chip")(smooth)
