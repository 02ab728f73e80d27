"""The catalogue in plain words."""

from __future__ import annotations

from spikecam_env.gap.report.words import bare, listed, parameter_unit
from spikecam_env.sensor import CATALOGUE


def test_every_parameter_of_the_catalogue_has_a_plain_name_and_a_unit_in_words() -> None:
    for effect, kind in CATALOGUE.items():
        for parameter in kind().parameters():
            assert "_" not in bare(effect, parameter)
            assert isinstance(parameter_unit(effect, parameter), str)
    assert bare("light_flicker", "frequency_hz") == "frequency"


def test_names_are_listed_with_a_word_before_the_last() -> None:
    assert listed(["a", "b", "c"], "or") == "a, b or c" and listed(["a"], "and") == "a" and listed([], "and") == ""
