"""Fit the preset `measured` to real recordings and write it with its provenance.

    python -m tools.fit_measured REAL

From the flat maps: smooth shading, pixel-to-pixel response, log-normal dark level, hot pixels.  From the wall: white
and slow temporal noise, told apart by A_k.  Prior: the published circuit, and with it N = C V_d / q and sqrt(kT/C).
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
import tyro
from scipy import optimize, special

from spikecam_env.campaign.flat_maps import LUX, counted, spread_counts
from spikecam_env.sensor import Circuit, SensorModel
from spikecam_env.types import Floats
from spikecam_env.whole import whole_file
from tools.real.recordings import (
    MAPS_FRAME_RATE_HZ,
    QUANTILES,
    read_response_and_dark,
    read_wall,
    wall_statistics,
)
from tools.real.two_levels import split_shading
from tools.real.wall_noise import OCTAVES, WallNoise, fit_wall_noise

PRESET = Path(str(resources.files("spikecam_env.sensor"))) / "presets" / "measured.toml"

_HOT_RATES = (0.03, 0.05, 0.1)
"""Dark rates above which the hot population is counted [spikes/frame]; the crowd's log-normal ends at the first."""


@dataclass(frozen=True)
class Bowl:
    """Shading 1 - falloff r^2 / r_corner^2 about a centre (shares of the array), as `vignetting` has it."""

    falloff: float
    centre_x: float
    centre_y: float
    left: float
    """Relative spread of the smooth part beside it."""


@dataclass(frozen=True)
class MeasuredConstants:
    """The preset's constants."""

    shading: float
    """Relative spread of the smooth part."""
    bowl: Bowl
    """The fit of the shading."""
    pixel_spread: float
    response_at_flat: float
    """Median rate at 335 lux [spikes/frame]."""
    dark_median: float
    """Median dark level [spikes/frame]."""
    dark_sigma: float
    """Standard deviation of the dark level's logarithm."""
    hot_fraction: float
    hot_mean: float
    noise: WallNoise
    reset_noise_mV: float


def fit_measured(folder: str | Path, circuit: Circuit | None = None, *, progress: bool = False) -> MeasuredConstants:
    """Fit all constants to the files in `folder`."""
    circuit = circuit or Circuit()
    light, dark = read_response_and_dark(folder)
    smooth, pixel_spread = split_shading(light)
    dark_median, dark_sigma = log_normal_through_quantiles(dark)
    hot_fraction, hot_mean = hot_population(dark, dark_median, dark_sigma)
    noise = fit_wall_noise(wall_statistics(read_wall(folder)), progress=progress)
    beyond_shot = max(noise.white - 1 / circuit.threshold_electrons, 0.0)
    return MeasuredConstants(
        float(smooth.std() / smooth.mean()),
        fit_bowl(smooth),
        pixel_spread,
        float(np.median(light)),
        dark_median,
        dark_sigma,
        hot_fraction,
        hot_mean,
        noise,
        1e3 * float(np.sqrt(beyond_shot)) * circuit.swing_V,
    )


def fit_bowl(smooth: Floats) -> Bowl:
    """Least squares over a map (H, W): a - b r^2 about a free centre is linear in 1, x, y and x^2 + y^2."""
    rows, columns = smooth.shape
    y, x = (axis.ravel().astype(np.float64) for axis in np.mgrid[:rows, :columns])
    terms = np.stack([np.ones(x.size), x, y, x**2 + y**2], axis=1)
    (start, along_x, along_y, curve), *_ = np.linalg.lstsq(terms, smooth.ravel(), rcond=None)
    centre_x, centre_y = -along_x / (2 * curve), -along_y / (2 * curve)
    top = start - curve * (centre_x**2 + centre_y**2)
    corner = max(centre_x, columns - 1 - centre_x) ** 2 + max(centre_y, rows - 1 - centre_y) ** 2
    left = smooth.ravel() / (terms @ np.array([start, along_x, along_y, curve]))
    return Bowl(
        float(-curve * corner / top),
        float(centre_x / (columns - 1)),
        float(centre_y / (rows - 1)),
        float(left.std() / left.mean()),
    )


def log_normal_through_quantiles(dark: Floats) -> tuple[float, float]:
    """Median and sigma of the log-normal whose counts come nearest to QUANTILES of `dark` (counts over FRAMES).

    Nearest: by the largest error of their logarithms.  Counts of ten or fewer are coarse: the log-normal is counted
    as the recording was, and both are spread evenly within a count.
    """
    target = np.log(np.quantile(spread_counts(dark), QUANTILES))
    z = special.ndtri((np.arange(dark.size) + 0.5) / dark.size)

    def worst(parameters: Floats) -> float:
        modelled = spread_counts(counted(np.exp(parameters[0] + parameters[1] * z)))
        return float(np.abs(np.log(np.quantile(modelled, QUANTILES)) - target).max())

    scale = special.ndtri(QUANTILES)
    start = np.array([target[2], (target[3] - target[1]) / (scale[3] - scale[1])])
    best = optimize.minimize(worst, start, method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-5})
    return float(np.exp(best.x[0])), float(best.x[1])


def hot_population(dark: Floats, median: float, sigma: float) -> tuple[float, float]:
    """Share of pixels in an exponential population on top of the log-normal crowd, and its mean [as dark]."""
    counts = np.array([(dark > level).mean() for level in _HOT_RATES])
    crowd = special.ndtr(-np.log(np.array(_HOT_RATES) / median) / sigma)
    extra = np.maximum(counts - crowd, 1e-9)
    # log of the survivors of an exponential is a line in the level
    slope, start = np.polyfit(np.array(_HOT_RATES) - median, np.log(extra), 1, w=np.sqrt(counts))
    return float(np.exp(start)), float(-1 / slope)


def preset_text(c: MeasuredConstants, circuit: Circuit | None = None) -> str:
    """The preset as TOML, every constant with where it is from."""
    circuit = circuit or Circuit()
    pA = circuit.capacitance_fF * circuit.swing_V * MAPS_FRAME_RATE_HZ * 1e-3
    n = c.noise
    octave_mV = 1e3 * float(np.sqrt(n.octave)) * circuit.swing_V
    return f"""\
# Fitted to real recordings by: python -m tools.fit_measured FOLDER
# wall.npz: 500 frames of a wall; flat_335lux_maps.npz: spikes of 100 000 pixels in light and in
# the dark, 4000 frames each, another unit perhaps.
# How well it does: python -m benchmarks.check_measured FOLDER, and docs/calibration.md.
#
# Prior, not fitted: the circuit (published SCSim constants), hence N = C V_d / q; 20 kHz for the maps, which do not say
# their frame rate (at it the dark level is the published 0.44 pA).  335 lux on the maps is radiance {c.response_at_flat:.4f}.
format = "spikecam-model/1"
name = "measured"
frame_rate_hz = 40000.0

[circuit]
reset_V = {circuit.reset_V}
reference_V = {circuit.reference_V}
bias_V = {circuit.bias_V}
capacitance_fF = {circuit.capacitance_fF}
temperature_K = {circuit.temperature_K}

# Flat maps at 335 lux: smooth shading, spread {100 * c.shading:.2f} %, of which this bowl leaves {100 * c.bowl.left:.2f} %.
# Lens and lamp are one here: at 153 lux the shading is another by up to 3.5 %.
[[effect]]
name = "vignetting"
falloff = {c.bowl.falloff:.4f}
centre_x = {c.bowl.centre_x:.4f}
centre_y = {c.bowl.centre_y:.4f}

# Flat maps: pixel-to-pixel response at 335 lux about the shading (half of the 16 .. 84 % range); any mix of alpha, C_S
# and V_S, and in part an offset that is there in light and not in the dark (docs/calibration.md).
[[effect]]
name = "conversion_gain_spread"
sigma = {c.pixel_spread:.4f}

# Flat maps: log-normal whose counts are nearest to the 1, 10, 50, 90, 99 % quantiles, median {c.dark_median:.5f} spikes/frame.
[[effect]]
name = "dark_current"
mean_pA = {c.dark_median * pA:.4f}

[[effect]]
name = "dark_current_tail"
sigma = {c.dark_sigma:.4f}

# Flat maps: exponential population beyond the log-normal, from counts above 0.03, 0.05 and 0.1 spikes/frame.
[[effect]]
name = "hot_pixels"
fraction = {c.hot_fraction:.2e}
mean_pA = {c.hot_mean * pA:.2f}

# Wall, A_k at k = 1 .. 40 less an ideal camera's, by simulation (chi2 {n.chi2:.0f} for 38; {n.white_alone_chi2:.0f} for 39 without slow noise):
# white s^2 = 1/N + kappa^2 = {n.white:.2e} +- {n.white_sd:.0e}, {100 * np.sqrt(n.white):.3f} % of the threshold a spike.
# N is prior; the reset noise is what remains, of which sqrt(kT/C) is {circuit.thermal_noise_mV:.3f} mV.  The wall fixes only the sum.
[[effect]]
name = "shot_noise"
quanta = {circuit.threshold_electrons:.1f}

[[effect]]
name = "reset_noise"
sigma_mV = {c.reset_noise_mV:.3f}

# Wall: slow noise, variance of an octave {n.octave:.2e} +- {n.octave_sd:.0e} thresholds^2; 1/f is the form assumed, and what is
# slower than the recording (500 frames) is extrapolated.
[[effect]]
name = "threshold_flicker_noise"
sigma_mV = {octave_mV:.3f}
octaves = {OCTAVES}
"""  # noqa: E501


def main(
    folder: tyro.conf.Positional[Path],
    out: Path = PRESET,
) -> None:
    """Fit the preset `measured` to the real recordings in `folder` and write it."""
    constants = fit_measured(folder, progress=True)
    text = preset_text(constants)
    with whole_file(out) as beside:
        beside.write_text(text, encoding="utf-8")
    SensorModel.from_toml(out)
    print(text)
    print(f"335 lux: median response {constants.response_at_flat:.4f} spikes/frame (of {LUX:g} lux); wrote {out}")


if __name__ == "__main__":
    tyro.cli(main)
