"""The preset `measured` against the real recordings; skipped where they are not at hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.check_measured import clock_locking, flat_quantiles, simulated_wall
from spikecam_env.campaign.flat_maps import FRAMES, FlatMaps, read_flat_maps
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensor
from tools.fit_measured import (
    PRESET,
    fit_bowl,
    hot_population,
    log_normal_through_quantiles,
)
from tools.real.recordings import MAPS, read_response_and_dark, read_wall, wall_statistics
from tools.real.two_levels import split_shading, two_levels
from tools.real.wall_noise import simulate_wall
from tools.real_recordings import REAL

needs_real = pytest.mark.skipif(
    not (REAL / "wall.npz").is_file(), reason="the real recordings (../shared/data/real) are not at hand"
)


@pytest.fixture(scope="module")
def wall():
    return read_wall(REAL)


def test_missing_recordings_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"wall\.npz"):
        read_wall(tmp_path)


def test_an_ideal_camera_has_no_excess_and_ranges_below_one() -> None:
    rate = np.random.default_rng(0).uniform(0.15, 0.25, 3000)
    ideal = wall_statistics(simulate_wall(rate, 1e-12, 0.0, 500, np.random.default_rng(1)))
    z = ideal.excess / ideal.excess_sd
    print(f"excess: rms z {np.sqrt(np.mean(z**2)):.2f}; ranges up to {ideal.minimum_range.max():.4f}")
    # An interval read off whole frames is a little wrong, and 3000 pixels see no more than that.
    assert np.sqrt(np.mean(z**2)) < 2.0
    assert ideal.minimum_range.max() < 1.0
    assert abs(ideal.variance_excess) < 0.002


def test_the_camera_has_the_noise_that_the_wall_was_fitted_with() -> None:
    """The fit's quick simulation, from spike to spike, and the camera's engine have one law."""
    model = SensorModel.preset("physical")
    shape, interval = (40, 50), 5.2
    sensor = SpikeSensor(model, shape, seed=1)
    spread = np.random.default_rng(2).uniform(0.95, 1.05, shape) / interval
    spikes = sensor.step(
        ((spread - sensor.unit.dark.reshape(shape)) / sensor.unit.gain.reshape(shape)).astype("f4"), 500
    )
    quick = simulate_wall(spread.ravel(), 3.46e-5, 0.0, 500, np.random.default_rng(3))
    a, b = wall_statistics(spikes), wall_statistics(quick)
    z = (a.excess - b.excess)[[0, 4, 9, 19, 39]] / np.hypot(a.excess_sd, b.excess_sd)[[0, 4, 9, 19, 39]]
    print(f"z of the difference: {z.round(2)}")
    assert np.all(np.abs(z) < 4.5)


def test_a_bowl_is_found_about_its_centre() -> None:
    y, x = np.mgrid[:50, :80]
    square = (x - 0.6 * 79) ** 2 + (y - 0.2 * 49) ** 2
    bowl = fit_bowl(0.2 * (1 - 0.18 * square / square.max()))
    assert (bowl.falloff, bowl.centre_x, bowl.centre_y) == pytest.approx((0.18, 0.6, 0.2))
    assert bowl.left < 1e-9


def write_maps(path: Path, lit: np.ndarray, dim: np.ndarray, dark: np.ndarray) -> None:
    """As the maps' authors do, from counts of FRAMES frames; float32."""
    at_335, at_153 = (FRAMES / n - 1 for n in (lit, dim))
    never = 1 / (dark / FRAMES + 1e-5) - 1
    np.savez(path, D_light=at_335.astype(np.float32), Nd=(153 * at_153 / (never - at_153)).astype(np.float32))


def made_up_counts(shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Counts at 335 and 153 lux and in the dark: gain spread 2 %, dark log-normal and no part of the gain."""
    rng = np.random.default_rng(0)
    dark = np.exp(np.log(18) + 0.45 * rng.standard_normal(shape))
    light = 654 * (1 + 0.02 * rng.standard_normal(shape))
    phase = rng.random((3, *shape))
    return tuple(np.floor(n + p) for n, p in zip((light + dark, light / 1.97 + dark, dark), phase, strict=True))


def test_flat_maps_give_back_the_counts_that_they_were_made_of(tmp_path: Path) -> None:
    counts = made_up_counts((60, 80))
    write_maps(tmp_path / "maps.npz", *counts)
    maps = read_flat_maps(tmp_path / "maps.npz")
    wrong = [
        float(np.mean(np.abs(FRAMES * m - n) > 1e-3))
        for m, n in zip((maps.lit, maps.dim, maps.dark), counts, strict=True)
    ]
    print(f"wrong counts at 335 lux, 153 lux, in the dark: {wrong}")
    assert maps.counted.all() and wrong[0] == 0.0
    # Some 14 pairs are tried, of which 1.4e-4 each come as near a whole number as float32 is fine.
    assert max(wrong) < 2 * 14 * 1.4e-4


def test_two_levels_tell_gain_from_offset() -> None:
    lit, dim, dark = (n / FRAMES for n in made_up_counts((100, 120)))
    everywhere = np.ones(lit.shape, dtype=np.bool_)
    plain = two_levels(FlatMaps(lit, dim, dark, everywhere))
    offset = 7 / FRAMES * np.random.default_rng(1).standard_normal(lit.shape)
    both = two_levels(FlatMaps(lit + offset, dim + offset, dark, everywhere))
    print(plain, both, sep="\n")
    # 12 000 pixels fix a spread to 0.65 %; counting adds 1 spike to the offset, 0.2 % to the gain.
    assert plain.gain == pytest.approx(0.02, rel=0.03) and plain.offset < 1.5
    assert both.gain == pytest.approx(0.02, rel=0.03) and both.offset == pytest.approx(7, rel=0.05)
    assert abs(plain.lit_dark) < 4 / np.sqrt(12_000)


@needs_real
def test_the_flat_maps_are_counts_of_4000_frames() -> None:
    """As `flat_maps` states: whole counts at 335 lux, at 153 lux and in the dark, in every pixel."""
    maps = read_flat_maps(REAL / MAPS)
    off = np.abs(FRAMES * maps.lit - np.round(FRAMES * maps.lit))
    print(f"335 lux: {off.max():.1e} from whole counts; pairs of dark and 153 lux found: {maps.counted.mean():.2%}")
    assert off.max() < 1e-4 and maps.counted.all()
    assert maps.lit.max() <= 1.0 and np.median(maps.dark) == 18 / FRAMES


@needs_real
def test_pixels_differ_by_gain_and_an_offset_and_not_by_a_factor_common_with_the_dark() -> None:
    spreads = two_levels(read_flat_maps(REAL / MAPS))
    print(spreads)
    assert abs(spreads.covariance_off) < 0.02
    assert spreads.common > 2 * spreads.lit
    assert spreads.gain_dark < 0.5 * spreads.lit_dark


def test_a_camera_without_a_clock_has_as_many_late_spikes_as_early_ones() -> None:
    rate = 1 / np.random.default_rng(0).uniform(4.98, 5.02, 2000)
    spikes = simulate_wall(rate, 4e-5, 0.0, 500, np.random.default_rng(1))
    seen = clock_locking(spikes, wall_statistics(spikes).rate)
    # 99 intervals a pixel; late and early ones are counts, taken as Poisson.
    error = np.sqrt((seen.late + seen.early) * 1e4 / (99 * seen.pixels))
    print(f"{seen}, error of the difference {error:.1f}")
    assert seen.late > 10 and abs(seen.late - seen.early) < 4 * error


@needs_real
def test_the_real_camera_follows_its_clock(wall) -> None:
    seen = clock_locking(wall, wall_statistics(wall).rate)
    print(seen)
    assert seen.late > 3 * seen.early


@needs_real
def test_measured_follows_the_wall(wall) -> None:
    real = wall_statistics(wall)
    simulated = simulated_wall("measured", real, wall.shape[1:], takes=1)
    percentiles = np.percentile(real.minimum_range, (10, 50, 90, 99))
    print(f"minimum range: real {percentiles.round(3)}, measured {simulated.minimum_range.round(3)}")
    print(f"variance over the floor: real {real.variance_excess:.4f}, measured {simulated.variance_excess:.4f}")
    z = (simulated.excess - real.excess) / np.hypot(real.excess_sd, simulated.excess_sd)
    print(f"A_k excess: chi2/40 {simulated.chi2 / 40:.2f}, largest |z| {np.abs(z).max():.1f}")
    assert np.all(np.abs(simulated.minimum_range - percentiles) < 0.006)
    assert abs(simulated.variance_excess - real.variance_excess) < 0.005
    assert np.abs(z).max() < 4.5


@needs_real
def test_measured_has_the_flat_maps_quantiles() -> None:
    for row in flat_quantiles("measured", *read_response_and_dark(REAL)):
        print(f"{row['map']} {row['quantile']}: {row['off']:+.2%}")
        assert abs(row["off"]) < 0.05


@needs_real
def test_the_presets_constants_are_what_its_command_fits() -> None:
    light, dark = read_response_and_dark(REAL)
    smooth, pixel_spread = split_shading(light)
    median, sigma = log_normal_through_quantiles(dark)
    parameters = {e.name: e.parameters() for e in SensorModel.from_toml(PRESET).effects}
    bowl = fit_bowl(smooth)
    for name in ("falloff", "centre_x", "centre_y"):
        assert parameters["vignetting"][name] == pytest.approx(getattr(bowl, name), rel=0.01)
    assert parameters["conversion_gain_spread"]["sigma"] == pytest.approx(pixel_spread, rel=0.01)
    assert parameters["dark_current_tail"]["sigma"] == pytest.approx(sigma, rel=0.01)
    assert parameters["hot_pixels"]["fraction"] == pytest.approx(hot_population(dark, median, sigma)[0], rel=0.01)
