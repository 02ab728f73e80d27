"""The literal pixel against closed forms, and a few of its rows against the engines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.literal.cases import Case, cases, square, steady, strobe
from benchmarks.literal.statistics import RATE, SERIAL, VARIANCE, after, compared
from benchmarks.literal_pixel import BEGIN, END, chosen_cases, compare, main
from spikecam_env.errors import InputError
from spikecam_env.sensor.effects import CATALOGUE

pytestmark = pytest.mark.slow


def test_every_effect_has_a_setting() -> None:
    """shot_noise is in all of them, and `light` is shot noise alone."""
    assert set(CATALOGUE) - {case.effect for case in cases()} == {"shot_noise"}


def test_settings_have_names_of_their_own() -> None:
    names = [(case.effect, case.label) for case in cases()]
    assert len(names) == len(set(names))


def _mean(case: Case, statistic: object, seed: int = 5) -> tuple[float, float]:
    values = np.array([statistic.of(group) for group in case.literal(seed)])  # type: ignore[attr-defined]
    return float(values.mean()), float(values.std(ddof=1) / np.sqrt(values.size))


def test_a_literal_static_pixel_has_interval_variance_f_times_one_minus_f() -> None:
    """T = 2.5 frames, 2000 electrons: jitter T / sqrt(N) = 0.06 frames, so T^2 / N is added where phases meet it."""
    case = Case("", steady(0.4), {}, (VARIANCE,), electrons=2000.0, groups=16, frames=100)
    variance, error = _mean(case, VARIANCE)
    print(f"interval variance {variance:.4f} +- {error:.4f}, 0.25 expected")
    assert abs(variance - 0.25) < 5.0 * error + 2.5**2 / 2000.0


def test_a_literal_dead_time_lengthens_every_interval() -> None:
    """T = 1/x + tau = 1/0.3 + 0.9."""
    case = Case("", steady(0.3), {"dead_time": {"tau_us": 22.5}}, (RATE,), groups=32, frames=150)
    rate, error = _mean(case, RATE)
    print(f"rate {rate:.5f} +- {error:.5f}, {1.0 / (1.0 / 0.3 + 0.9):.5f} expected")
    assert abs(rate - 1.0 / (1.0 / 0.3 + 0.9)) < 5.0 * error


def test_a_literal_crosstalk_multiplies_the_rate() -> None:
    """rate = x / (1 - k * neighbours); a 12 x 12 array has 2 * 2 * 12 * 11 / 144 neighbours a pixel."""
    case = Case("", steady(0.22), {"crosstalk": {"kick": 0.02}}, (RATE,), shape=(12, 12), groups=16, separate=True)
    rate, error = _mean(replace(case, frames=100), RATE)
    expected = 0.22 / (1.0 - 0.02 * 4.0 * 11.0 / 12.0)
    print(f"rate {rate:.5f} +- {error:.5f}, {expected:.5f} expected")
    assert abs(rate - expected) < 5.0 * error + 1e-3 * expected  # the edge has fewer, and fires less


def test_a_literal_lag_delays_its_share() -> None:
    """The frame of an edge at .6 gets .4 of the rise less the late share: 1 - f + f (1 - tau/.4 (1 - exp(-.4/tau)))."""
    tau, share = 1.5, 0.3
    film = square(0.1, 0.7, 40, 5.6)
    case = Case("", film, {"photodiode_lag": {"fraction": share, "tau_us": 25.0 * tau}}, (), groups=32, frames=200)
    statistic = after(5, 40, (0,))[0]
    response, error = _mean(case, statistic)
    arrived = 1.0 - share * tau / 0.4 * (1.0 - np.exp(-0.4 / tau))
    expected = 0.1 + 0.6 * 0.4 * arrived
    print(f"response {response:.4f} +- {error:.4f}, {expected:.4f} expected")
    assert abs(response - expected) < 5.0 * error + 0.02  # charge is conserved within a frame but for the spikes


@pytest.mark.parametrize("effect", ["light", "light_flicker", "photodiode_lag", "dead_time", "incomplete_reset"])
def test_engines_agree_with_the_literal_pixel(effect: str) -> None:
    for case in chosen_cases([effect], quick=True, groups=16, frames=160):
        for row in compare(case, seed=3):
            print(row.setting, row.statistic, row.engine_name, row.comparison)
            assert row.comparison.agrees


def test_what_the_sensor_refuses_is_listed_and_not_compared(monkeypatch, capsys, tmp_path) -> None:  # type: ignore[no-untyped-def]
    page = tmp_path / "page.md"
    page.write_text(f"{BEGIN}\n{END}\n", encoding="utf-8")
    cases_of_two = [
        Case("weak", steady(0.3), {"dead_time": {"tau_us": 0.1}}, (RATE,), groups=8, frames=64),
        Case("strobe", strobe(0.4, 0.2, 0.3), {"dead_time": {"tau_us": 12.5}}, (RATE,), groups=8, frames=64),
    ]
    monkeypatch.setattr("benchmarks.literal_pixel.cases", lambda: cases_of_two)
    monkeypatch.setattr("sys.argv", ["literal_pixel", "--page", str(page)])
    main()
    assert "REFUSED" in capsys.readouterr().out
    written = page.read_text(encoding="utf-8")
    assert "2 comparisons" in written and "1 settings are refused" in written and "| dead_time | strobe |" in written


def test_a_difference_is_seen() -> None:
    """The same statistics of dead times that differ by a tenth of a frame."""
    one, other = (
        Case("", steady(0.3), {"dead_time": {"tau_us": tau}}, (), groups=16, frames=120) for tau in (2.5, 5.0)
    )
    assert not compared(RATE, one.literal(1), other.engine("fast", 1)).agrees
    assert compared(SERIAL, one.literal(1), one.engine("fast", 1)).agrees


def test_rows_are_written_between_the_markers(tmp_path, monkeypatch, capsys) -> None:  # type: ignore[no-untyped-def]
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n", encoding="utf-8")
    arguments = ["--only", "missed_spikes", "--groups", "8", "--frames", "64", "--page", str(page)]
    monkeypatch.setattr("sys.argv", ["literal_pixel", *arguments])
    main()
    written = page.read_text(encoding="utf-8")
    assert written.startswith("before") and written.endswith("after\n") and "old" not in written
    assert "| missed_spikes |" in written and "comparisons" in capsys.readouterr().out


@pytest.mark.parametrize("options", [{"only": ["glare"]}, {"groups": 3}, {"frames": 10}])
def test_what_is_no_setting_is_refused(options: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(InputError, match=next(iter(options))):
        list(chosen_cases(**options))
