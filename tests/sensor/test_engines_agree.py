"""The fast engine is the reference: bit for bit without noise, in distribution with it.

The acceptance grid, on 200 000 pixels, is benchmarks/validate_engines.py; here it runs on a few thousand.
"""

from __future__ import annotations

import numpy as np
import pytest
from laws import jittered
from numpy.typing import NDArray
from scipy import stats

from benchmarks.agreement import compare, independent, neighbours, observe, same_law
from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor

pytestmark = pytest.mark.slow

PIXELS = 12_000
SHAPE = (PIXELS // 400, 400)
ELECTRONS = (50, 500, 5000, 29_650)
INTERVALS = (1.3, 5.0, 20.0, 100.0)


def random_keys(lengths: list[int], shape: tuple[int, int], seed: int) -> Keyframes:
    """Light from one spike in 10 000 frames to over two thresholds a frame, some of it dark, keys of these lengths."""
    rng = np.random.default_rng(seed)
    frame = np.concatenate([[0], np.cumsum(lengths)])
    radiance = np.exp(rng.uniform(np.log(1e-4), np.log(3.0), (frame.size, *shape)))
    radiance[rng.random(radiance.shape) < 0.1] = 0.0
    return Keyframes(frame, radiance.astype(np.float32))


@pytest.mark.parametrize("shape", [(7, 13), (16, 16), (20, 33)])
@pytest.mark.parametrize("lengths", [[1] * 20, [7] * 20, [33] * 8, [64] * 6, [200, 3, 64, 1, 90, 50]])
def test_without_noise_engines_give_the_same_bits(shape: tuple[int, int], lengths: list[int]) -> None:
    light = random_keys(lengths, shape, seed=sum(lengths))
    frames = sum(lengths) + 30
    fast, reference = (SpikeSensor("ideal", shape, 5, engine) for engine in ("fast", "reference"))
    assert np.array_equal(fast.step(light, frames), reference.step(light, frames))


def test_without_noise_engines_give_the_same_bits_with_every_pixel_different() -> None:
    """Fixed pattern and dark current of scsim, its temporal noise taken away; fading to black and back."""
    model = SensorModel.preset("scsim").without("shot_noise").without("reset_noise")
    shape = (40, 50)
    level = np.random.default_rng(1).random(shape)
    pictures = np.array([level, 0 * level, level, level**4, 0 * level], dtype=np.float32)
    light = Keyframes(np.arange(5) * 64.0, pictures)
    fast, reference = (SpikeSensor(model, shape, 5, engine) for engine in ("fast", "reference"))
    assert np.array_equal(fast.step(light, 320), reference.step(light, 320))


@pytest.mark.parametrize("interval", [1000.0, 10_000.0])
def test_dim_light_gives_its_mean_rate(interval: float) -> None:
    """Phases uniform, so a pixel has fired by frame n with probability n / T: binomial, 4.5 standard errors."""
    pixels, frames = 250_000, int(interval / 2)
    sensor = SpikeSensor("ideal", (500, 500), 1, "fast")
    light = np.full((500, 500), 1 / interval, dtype=np.float32)
    spikes = sum(int(sensor.step(light, min(500, frames - n)).sum()) for n in range(0, frames, 500))
    phases = int((sensor.phase + frames / interval >= 1).sum())
    rate = spikes / (frames * pixels)
    print(f"T = {interval:g}: rate {rate:.6g}, from the phases {phases / (frames * pixels):.6g}")
    assert abs(spikes / phases - 1) < 1e-3
    assert abs(spikes / pixels - 0.5) < 4.5 * 0.5 / np.sqrt(pixels)


def light_of(interval: float, moving: bool, frames: int, shape: tuple[int, int] = SHAPE) -> Keyframes:
    frame = np.arange(0, frames + 65, 64)
    level = (1.0 + 0.6 * np.sin(1.7 * np.arange(frame.size)) * moving) / interval
    return Keyframes(frame, np.broadcast_to(level[:, None, None], (frame.size, *shape)).astype(np.float32))


def p_values(
    model: SensorModel, interval: float, moving: bool, seed: int, shape: tuple[int, int] = SHAPE
) -> NDArray[np.float64]:
    frames = int(8 * interval) + 64
    light = light_of(interval, moving, frames, shape)
    fast = observe(SpikeSensor(model, shape, 2 * seed, "fast"), light, frames)
    reference = observe(SpikeSensor(model, shape, 2 * seed + 1, "reference"), light, frames)
    return np.array(list((compare(fast, reference) | neighbours(fast)).values()))


def check(name: str, p: NDArray[np.float64]) -> None:
    limit = 0.001 / p.size
    print(f"{name}: {p.size} tests, smallest p {p.min():.2g} (limit {limit:.2g})")
    assert p.min() > limit


@pytest.mark.parametrize("electrons", ELECTRONS)
def test_with_noise_engines_agree_in_distribution(electrons: int) -> None:
    """Intervals, pairs of intervals, counts, 16-bit words, first spikes, neighbours; Bonferroni at 0.001.

    Every noise at every interval, and half of the pairs in moving light: of each noise and of each interval two.
    """
    model = jittered(electrons, kappa=np.sqrt(0.026 / electrons))
    moving = np.arange(len(INTERVALS)) % 2 == ELECTRONS.index(electrons) % 2
    cells = zip(INTERVALS, moving, strict=True)
    p = [p_values(model, interval, moves, electrons + i) for i, (interval, moves) in enumerate(cells)]
    check(f"N = {electrons}", np.concatenate(p))


def test_with_noise_engines_agree_in_dim_light() -> None:
    """Mean interval 1000: fewer pixels, longer streams."""
    cells = [(50, True), (29_650, False)]
    models = {n: jittered(n, kappa=np.sqrt(0.026 / n)) for n, _ in cells}
    p = [p_values(models[n], 1000.0, moving, n, shape=(4, 400)) for n, moving in cells]
    check("T = 1000", np.concatenate(p))


@pytest.mark.parametrize("electrons", [50, 29_650])
@pytest.mark.parametrize("interval", [1000, 10_000])
def test_dim_light_gives_its_mean_rate_with_noise(electrons: int, interval: int) -> None:
    """Over four intervals after the first: a pixel's count has variance 1/6 + 4/N at most; 4.5 standard errors."""
    shape = (100, 500)
    sensor = SpikeSensor(jittered(electrons, kappa=np.sqrt(0.026 / electrons)), shape, 11, "fast")
    light = np.full(shape, 1 / interval, dtype=np.float32)
    sensor.step(light, interval)
    spikes = sum(int(sensor.step(light, 500).sum()) for _ in range(0, 4 * interval, 500))
    count = spikes / (shape[0] * shape[1])
    error = np.sqrt((1 / 6 + 4 / electrons) / (shape[0] * shape[1]))
    print(f"N = {electrons}, T = {interval}: {count / 4 - 1:+.1e} of the rate, standard error {error / 4:.1e}")
    assert abs(count / 4 - 1) < 1e-3 + 4.5 * error / 4


@pytest.mark.parametrize(
    ("name", "model"), [("shot noise", jittered(quanta=200)), ("reset noise", jittered(kappa=0.05))]
)
def test_each_noise_alone_agrees_in_distribution(name: str, model: SensorModel) -> None:
    check(name, np.concatenate([p_values(model, 7.3, moving, 77 + moving) for moving in (False, True)]))


def test_scsim_agrees_in_distribution_on_one_unit() -> None:
    """Both engines are given the same fixed pattern: only the temporal noise differs."""
    model = SensorModel.preset("scsim")
    light = light_of(9.0, True, 256)
    fast, reference = (SpikeSensor(model, SHAPE, 4, engine) for engine in ("fast", "reference"))
    check("scsim", np.array(list(compare(observe(fast, light, 256), observe(reference, light, 256)).values())))


def test_the_tests_see_a_wrong_engine() -> None:
    """One per cent of rate, ten per cent of noise, and copied neighbours are all found."""
    light = light_of(20.0, False, 224)
    slower = Keyframes(light.frame, light.radiance * np.float32(0.99))
    right = observe(SpikeSensor(jittered(500), SHAPE, 1, "fast"), light, 224)
    wrong_rate = observe(SpikeSensor(jittered(500), SHAPE, 2, "fast"), slower, 224)
    wrong_noise = observe(SpikeSensor(jittered(500 / 1.2), SHAPE, 3, "fast"), light, 224)
    copied = right.interval[:, 1].repeat(2)
    assert min(compare(right, wrong_rate).values()) < 1e-6
    assert min(compare(right, wrong_noise).values()) < 1e-6
    assert independent(copied[::2], copied[1::2]) < 1e-6


def test_p_values_of_one_law_are_uniform() -> None:
    """The comparison itself, on 400 pairs of samples of one law: Kolmogorov-Smirnov against uniform, p > 0.001."""
    rng = np.random.default_rng(0)
    p = [same_law(*rng.poisson(9.0, (2, 5000))) for _ in range(400)]
    uniform = stats.kstest(p, "uniform").pvalue
    print(f"KS p = {uniform:.3f}")
    assert uniform > 0.001
