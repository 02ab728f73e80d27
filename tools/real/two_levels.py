"""Differences of pixels by two lit recordings and a dark one: at 335 and 153 lux, spikes above those in the dark.

    (lit - dark) / its smooth part - 1 = g + o / smooth part        g: gain, o: an offset, the same at both levels

Two levels, two unknowns a pixel.  Gain alone would spread both alike, and does not: see docs/calibration.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from spikecam_env.campaign.flat_maps import DIM_LUX, FRAMES, LUX, FlatMaps
from spikecam_env.robust import scatter
from spikecam_env.types import Floats

_SMOOTH = 12.0
"""Standard deviation of the window that separates shading from pixels [pixels]."""

_ODD = 0.15
"""Pixels further than this from their neighbours, at either level, are left out; so are hot ones."""
_HOT = 0.015


@dataclass(frozen=True)
class TwoLevels:
    """Relative spreads beside the shading, and correlations over pixels."""

    lit: float
    """Spread at 335 lux."""
    dim: float
    """Spread at 153 lux."""
    gain: float
    """Spread of gain."""
    offset: float
    """Spread of the offset [spikes in FRAMES]."""
    covariance_off: float
    """Covariance of both levels, over that of uncorrelated gain and offset, less one."""
    gain_dark: float
    """Correlation of gain with ln(dark), shading removed."""
    offset_dark: float
    """Correlation of the offset with ln(dark), shading removed."""
    lit_dark: float
    """Correlation of the response at 335 lux with ln(dark), shading removed."""
    ratio: float
    """Median response at 335 lux over that at 153."""
    ratio_slope: float
    """1 .. 99 % range of the smoothed ratio over the array, relative."""
    common: float
    """Spread of a common factor of response and dark (e.g. of the threshold) that would give `lit_dark`."""

    def __str__(self) -> str:
        return (
            f"two levels: pixels spread {self.lit:.2%} at {LUX:g} lux, {self.dim:.2%} at {DIM_LUX:g};"
            f" response {self.ratio:.3f} times as high for {LUX / DIM_LUX:.3f}, differing by {self.ratio_slope:.1%}"
            f" over the array\n"
            f"  as gain {self.gain:.2%} and offset {self.offset:.1f} spikes in {FRAMES} (covariance"
            f" {self.covariance_off:+.1%} off); correlation with ln(dark): response {self.lit_dark:+.2f},"
            f" gain {self.gain_dark:+.2f}, offset {self.offset_dark:+.2f}\n"
            f"  a factor common to response and dark would have to spread by {self.common:.1%}"
        )


def two_levels(maps: FlatMaps) -> TwoLevels:
    """Gain and offset of the pixels of maps whose counts are known."""
    lit, dim = (FRAMES * (level - maps.dark) for level in (maps.lit, maps.dim))
    dim = np.where(maps.counted, dim, np.median(dim[maps.counted]))
    smooth_lit, smooth_dim = split_shading(lit)[0], split_shading(dim)[0]
    r, s = lit / smooth_lit - 1.0, dim / smooth_dim - 1.0
    logs = np.log(np.maximum(maps.dark, 0.5 / FRAMES))
    logs = logs - scipy.ndimage.gaussian_filter(logs, _SMOOTH)
    good = maps.counted & (maps.dark < _HOT) & (np.abs(r) < _ODD) & (np.abs(s) < _ODD)
    a, b = 1.0 / smooth_lit[good], 1.0 / smooth_dim[good]
    r, s, logs = r[good], s[good], logs[good]
    offset = (s - r) / (b - a)
    gain = r - a * offset
    # As if gain and offset had no correlation: the two variances give both, the covariance is then foretold.
    ab, aa, bb = np.mean(a) * np.mean(b), np.mean(a) ** 2, np.mean(b) ** 2
    of_offset = (s.var() - r.var()) / (bb - aa)
    foretold = r.var() + (ab - aa) * of_offset
    ratio = smooth_lit / smooth_dim
    return TwoLevels(
        float(r.std()),
        float(s.std()),
        float(gain.std()),
        float(offset.std()),
        float(np.mean((r - r.mean()) * (s - s.mean())) / foretold - 1),
        _correlation(gain, logs),
        _correlation(offset, logs),
        _correlation(r, logs),
        float(np.median(lit) / np.median(dim)),
        float(np.subtract(*np.quantile(ratio, [0.99, 0.01])) / np.median(ratio)),
        float(np.sqrt(max(np.mean((r - r.mean()) * (logs - logs.mean())), 0.0))),
    )


def response_and_dark(response: Floats, dark: Floats) -> float:
    """Correlation over pixels of response and ln(dark), shading included; a dark count of 0 is taken for half a one."""
    return _correlation(response.ravel(), np.log(np.maximum(dark, 0.5 / FRAMES)).ravel())


def _correlation(a: Floats, b: Floats) -> float:
    return float(np.corrcoef(a, b)[0, 1])


def split_shading(light: Floats) -> tuple[Floats, float]:
    """The smooth part (H, W) of a response map, and the pixels' relative spread around it (robust: dust, edges)."""
    smooth = scipy.ndimage.gaussian_filter(scipy.ndimage.median_filter(light, 5), _SMOOTH, mode="nearest")
    rest = light / smooth - 1.0
    return smooth, scatter(rest)
