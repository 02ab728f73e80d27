"""The engines against the hidden world, at a few of the settings of `benchmarks.within_frame`; and that program."""

from __future__ import annotations

import pytest

from benchmarks.settings.cases import Case, cases, steady, strobe
from benchmarks.settings.statistics import RATE, SERIAL, compared
from benchmarks.within_frame import chosen_cases, compare, main
from spikecam_env.errors import InputError
from spikecam_env.sensor.effects import CATALOGUE

pytestmark = pytest.mark.slow
MARKERS = "<!-- within_frame: begin -->\n{}<!-- within_frame: end -->\n"


def test_every_effect_has_a_setting() -> None:
    """shot_noise is in all of them, and `light` is shot noise alone."""
    assert set(CATALOGUE) - {case.effect for case in cases()} == {"shot_noise"}


def test_settings_have_names_of_their_own() -> None:
    names = [(case.effect, case.label) for case in cases()]
    assert len(names) == len(set(names))


@pytest.mark.parametrize("effect", ["light", "light_flicker", "photodiode_lag", "dead_time", "incomplete_reset"])
def test_engines_agree_with_the_hidden_world(effect: str) -> None:
    for case in chosen_cases([effect], quick=True, groups=16, frames=160):
        for row in compare(case, seed=3):
            print(row.setting, row.statistic, row.engine_name, row.comparison)
            assert row.comparison.agrees


def test_a_difference_is_seen() -> None:
    """The same statistics of dead times that differ by a tenth of a frame."""
    one, other = (
        Case("", steady(0.3), {"dead_time": {"tau_us": tau}}, (), groups=16, frames=120) for tau in (2.5, 5.0)
    )
    assert not compared(RATE, one.world(1), other.engine("fast", 1)).agrees
    assert compared(SERIAL, one.world(1), one.engine("fast", 1)).agrees


def test_what_the_sensor_refuses_is_listed_and_not_compared(monkeypatch, capsys, tmp_path) -> None:  # type: ignore[no-untyped-def]
    page = tmp_path / "page.md"
    page.write_text(MARKERS.format(""), encoding="utf-8")
    cases_of_two = [
        Case("weak", steady(0.3), {"dead_time": {"tau_us": 0.1}}, (RATE,), groups=8, frames=64),
        Case("strobe", strobe(0.4, 0.2, 0.3), {"dead_time": {"tau_us": 12.5}}, (RATE,), groups=8, frames=64),
    ]
    monkeypatch.setattr("benchmarks.within_frame.cases", lambda: cases_of_two)
    assert main(["--page", str(page)]) == 0
    assert "1 settings are refused" in capsys.readouterr().out
    written = page.read_text(encoding="utf-8")
    assert "2 comparisons" in written and "| dead_time | strobe | dead_time takes light to be linear" in written


def test_rows_are_written_between_the_markers(tmp_path, capsys) -> None:  # type: ignore[no-untyped-def]
    page, out = tmp_path / "page.md", tmp_path / "all.md"
    page.write_text("before\n" + MARKERS.format("old\n") + "after\n", encoding="utf-8")
    arguments = ["--only", "missed_spikes", "--groups", "8", "--frames", "64"]
    assert main([*arguments, "--page", str(page), "--out", str(out)]) == 0
    written = page.read_text(encoding="utf-8")
    assert written.startswith("before") and written.endswith("after\n") and "old" not in written
    assert "| missed_spikes |" in written and "12 comparisons" in capsys.readouterr().out
    assert out.read_text(encoding="utf-8").count("| missed_spikes |") == 12


@pytest.mark.parametrize("option", ["--only glare", "--groups 3", "--frames 10", "--electrons 0"])
def test_what_is_no_setting_is_refused_in_a_line(option: str, capsys) -> None:  # type: ignore[no-untyped-def]
    assert main(option.split()) == 2
    assert capsys.readouterr().err.startswith(f"spikecam: {option}: ")


def test_a_page_without_markers_is_refused_before_anything_is_compared(tmp_path, capsys) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "page.md").write_text("text\n", encoding="utf-8")
    assert main(["--page", str(tmp_path / "page.md")]) == 2
    assert "once, in this order" in capsys.readouterr().err


def test_what_is_no_setting_raises() -> None:
    with pytest.raises(InputError, match="--only glare: not an effect with settings"):
        list(chosen_cases(["glare"]))
