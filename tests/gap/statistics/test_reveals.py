"""Each effect shows in the statistics that are for it, and leaves others alone."""

from __future__ import annotations

import pytest
from small import CLEAR, effect, quiet, recorded, seen

from spikecam_env.gap.statistics import StatisticKey

CASES = [
    ("rates", effect("dead_time", tau_us=0.5), "flat-0.65", "level, scatter", "intervals"),
    ("rates", effect("comparator_delay", delay_us=0.3), "flat-0.65", "level", "intervals, spectrum"),
    ("rates", effect("photo_response_nonlinearity", beta=0.02), "flat-0.65", "level", "intervals"),
    ("rates", effect("incomplete_reset", fraction=0.05), "flat-0.65", "level", "intervals, rows"),
    ("rates", effect("ir_drop", droop=0.005), "flat-0.65", "level", "intervals, spectrum"),
    ("noise", effect("frame_threshold_noise", sigma_mV=10.0), "flat-0.03", "A_1, lag-1", "spectrum"),
    ("noise", effect("threshold_flicker_noise", sigma_mV=1.0), "flat-0.4", "A_64", "dark, spectrum, rows"),
    ("noise", effect("random_telegraph_noise", fraction=0.05), "flat-0.03", "A_1", "spectrum, step"),
    ("noise", effect("synchronous_reset", fraction=0.3), "flat-0.65", "lag-1", "intervals"),
    ("intervals", effect("missed_spikes", probability=0.002), "flat-0.2", "long", "timing"),
    ("intervals", effect("spurious_spikes", probability=0.0005), "flat-0.2", "short, length 1, length 2", "timing"),
    ("intervals", effect("afterpulsing", probability=0.002), "flat-0.2", "short, length 2", "timing, dark"),
    ("drift", effect("lamp_drift", sigma_per_root_s=0.02), "flat-0.65", "trend, bend", "dark, intervals, rows"),
    ("drift", effect("dark_current_drift", rise=0.3, tau_ms=50.0), "dark", "trend", "intervals, step"),
    (
        "drift",
        effect("random_telegraph_noise", amplitude_pA=1.0, fraction=0.1, dwell_ms=20.0),
        "flat-0.2",
        "pixel tail",
        "",
    ),
    ("drift", effect("threshold_flicker_noise", sigma_mV=2.0), "flat-0.4", "pixels", "dark"),
    (
        "spectrum",
        effect("light_flicker", modulation=0.02, frequency_hz=400.0),
        "flat-0.65",
        "line, band 2",
        "dark, rates",
    ),
    ("spectrum", effect("supply_ripple", ripple=0.002, frequency_hz=400.0), "flat-0.65", "line, band 2", "rates"),
    ("spectrum", effect("common_threshold_noise", sigma_mV=3.0), "dark", "band 7", "rates, intervals"),
    ("spectrum", effect("clock_jitter", sigma_ns=500.0), "flat-0.65", "band 7", "step"),
    ("rows", effect("row_temporal_noise", sigma_mV=6.0), "dark", "row 1", "spectrum"),
    ("neighbours", effect("crosstalk", kick=0.02), "flat-0.2", "down 1, across 1", "intervals"),
    ("timing", effect("common_threshold_noise", sigma_mV=3.0), "flat-0.03", "late", ""),
    ("timing", effect("clock_jitter", sigma_ns=2000.0), "flat-0.65", "late, next", ""),
    (
        "step",
        effect("photodiode_lag", fraction=0.06, tau_us=1000.0),
        "step",
        "up 16-32, down 16-32",
        "rates, noise, drift, spectrum",
    ),
    ("step", effect("readout_skew", span=1.0), "step", "row up, row down", "rates, noise, drift, spectrum"),
    ("moving", effect("photodiode_lag", fraction=0.06, tau_us=1000.0), "bars", "lag 16", "rates, noise"),
    ("moving", effect("readout_skew", span=1.0), "bars", "skew, delay", "rates, noise"),
    ("moving", effect("optical_blur", sigma_pixels=0.5), "bars", "level, left", "rates, noise, step, neighbours"),
    ("moving", effect("blooming", share=0.2), "bars", "bloom", "rates, noise, step, neighbours"),
]
"""Group of statistics, effect, recording, names of the statistics, recordings or other groups of which nothing is off.
Of 32 rows the array has 1 / sqrt(32) of a row's noise: at 8 mV that shows in the spectrum of bright flats."""


@pytest.mark.parametrize("group, shown_by, where, names, silent", CASES, ids=lambda v: getattr(v, "name", None))
def test_an_effect_shows_in_its_statistics_and_leaves_others_alone(group, shown_by, where, names, silent):
    """By more than CLEAR with the effect; by chance without it, and of all that it leaves alone."""
    with_it, without = seen(recorded(shown_by)), seen(recorded(seed=5))
    silent = [*filter(None, silent.split(", "))]
    for name in names.split(", "):
        key = StatisticKey(group, where, name)
        print(f"{shown_by.name}: {where} {name} {with_it[key]:.1f}, without {without[key]:.1f}")
        assert abs(with_it[key]) > CLEAR
        assert abs(without[key]) < quiet(1)
    alone = {k: abs(z) for k, z in with_it.items() if (k.group == group and k.recording in silent) or k.group in silent}
    if silent:
        worst = max(alone, key=lambda k: alone[k])
        print(f"left alone: at worst {worst} {alone[worst]:.1f} of {len(alone)}, at most {quiet(len(alone)):.1f}")
        assert alone[worst] < quiet(len(alone))
