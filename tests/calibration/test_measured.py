"""The preset `measured` against the real recordings; skipped where they are not at hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spikecam_env.calibration.check_measured import flat_quantiles, simulated_wall
from spikecam_env.calibration.fit_measured import (
    PRESET,
    centred_bowl,
    hot_population,
    log_normal_through_quantiles,
    split_shading,
)
from spikecam_env.calibration.paper_figure import grey_patches
from spikecam_env.calibration.real import read_flat_maps, read_wall, wall_statistics
from spikecam_env.calibration.wall_noise import simulate_wall
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensor

REAL = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "real"
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
    for row in flat_quantiles("measured", *read_flat_maps(REAL)):
        print(f"{row['map']} {row['quantile']}: {row['off']:+.2%}")
        assert abs(row["off"]) < 0.05


@needs_real
def test_the_presets_constants_are_what_its_command_fits() -> None:
    light, dark = read_flat_maps(REAL)
    smooth, pixel_spread = split_shading(light)
    median, sigma = log_normal_through_quantiles(dark)
    parameters = {e.name: e.parameters() for e in SensorModel.from_toml(PRESET).effects}
    assert parameters["vignetting"]["falloff"] == pytest.approx(centred_bowl(smooth)[0], rel=0.01)
    assert parameters["conversion_gain_spread"]["sigma"] == pytest.approx(pixel_spread, rel=0.01)
    assert parameters["dark_current_tail"]["sigma"] == pytest.approx(sigma, rel=0.01)
    assert parameters["hot_pixels"]["fraction"] == pytest.approx(hot_population(dark, median, sigma)[0], rel=0.01)


@needs_real
def test_the_papers_figure_has_five_levels(wall) -> None:
    levels = [float(p.mean()) for p in grey_patches(wall)]
    assert len(levels) == 5
    assert np.all(np.diff(levels) > 0)
