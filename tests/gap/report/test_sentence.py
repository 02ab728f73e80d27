"""The verdict in a sentence."""

from __future__ import annotations

import json
from dataclasses import replace

import made_up
import pytest

from spikecam_env.gap.report.sentence import gap_line, heading, sentence
from spikecam_env.gap.result import Diagnosis, Gap, Note


def sentence_of(d: Diagnosis) -> str:
    """The sentence of what a diagnosis holds."""
    return sentence(d, d.model_name)


@pytest.mark.parametrize(
    "verdict, said",
    [
        ("none", "No gap: these recordings and the model scsim agree to within the noise."),
        ("named", "Your camera has photodiode lag (fraction 6.12 %, tau 1.22 ms); adding it removes 97 % of the gap on "
         "recordings that were not used. It explains all of the difference: chance is left."),
        ("class", "Your camera has photo response nonlinearity or IR drop: these recordings do not show which; adding "
         "either removes 97 % of the gap on recordings that were not used."),
        ("unknown", "Your camera does something that no candidate explains; lamp drift comes nearest; adding an "
         "empirical patch removes 79 % of the gap on recordings that were not used."),
        ("parameter", "No effect is missing, but parameters of the model scsim are off: shot noise is 31000 electrons, "
         "not 50000 electrons."),
        ("data", "The recordings contradict their own labels: flat-300: rates are 2.1 % (31 sd) above the line through "
         "the other flats; its label fits 0.3063."),
    ],
)  # fmt: skip
def test_a_sentence_says_the_verdict(verdict: str, said: str) -> None:
    assert sentence_of(made_up.EVERY[verdict]()) == said


def test_a_gap_on_recordings_that_told_parameters_is_not_called_a_check() -> None:
    fitted = replace(made_up.named(), data=(Note.PARAMETERS_FROM_HELD_OUT,))
    assert "removes 97 % of the gap on the held-out recordings, which were fitted too." in sentence_of(fitted)


def test_what_a_note_is_decides_and_not_what_it_says() -> None:
    """The same words as plain text are no note of that kind; other kinds of notes change nothing."""
    prose = replace(made_up.named(), data=(Note.PARAMETERS_FROM_HELD_OUT.value, "The gain is 0.001 of nominal"))
    assert sentence_of(prose) == sentence_of(made_up.named())
    assert json.dumps([*Note]) == json.dumps([note.value for note in Note])


def test_parameters_that_are_off_beside_an_effect_are_said() -> None:
    off = {"reset_noise": {"measured": 19.9, "nominal": 0.976, "ratio": 20.4}}
    said = sentence_of(replace(made_up.named(), parameters=off))
    assert said.endswith(
        "chance is left. Parameters of the model scsim are off as well: reset noise is 19.9 mV, not 0.976 mV."
    )


def test_a_remainder_is_stated_with_its_size_its_place_and_its_look() -> None:
    said = sentence_of(made_up.with_remainder())
    assert said.endswith(
        "not used. It explains nearly all; its law differs in detail from the catalogue's. What is left, 0.4 % of the "
        "squares and 8.1 noises at most, is in the statistics step and moving of the step of light and moving light: "
        "pixel by pixel, with a memory of earlier light."
    )
    both = (*made_up.named().effects, *made_up.named("dead_time").effects)
    assert "They explain nearly all" in sentence_of(replace(made_up.with_remainder(), effects=both))


def test_the_largest_of_several_effects_is_called_so() -> None:
    left = (
        "something else is there. What is left, 16 % of the squares and 40.2 noises at most, is in the statistics "
        "rows and noise of the dim flats: common to many pixels, with a coupling of neighbours."
    )
    said = sentence_of(made_up.largest())
    assert said.endswith(f"not used. It is among several effects; {left}")
    assert "; adding it, with crosstalk in place of something unknown, removes 97 % of the gap" in said
    said = sentence_of(replace(made_up.largest(), stand_ins=()))
    assert said.endswith(f"not used. It is the largest of several effects; {left}") and "; adding it removes" in said
    assert heading(made_up.largest()) == "Effect named: largest of several"


def test_an_unknown_effect_is_stated_with_the_nearest_candidate_and_its_fault() -> None:
    about = {"best_candidate": "photodiode_lag", "not_named": "another candidate explains 78 % as much"}
    said = sentence_of(replace(made_up.unknown(), unknown=about))
    assert "no candidate explains; photodiode lag comes nearest, but another candidate explains 78 % as much;" in said


def test_two_effects_are_named_together() -> None:
    d = made_up.named()
    both = replace(d, effects=(*d.effects, *made_up.named("dead_time").effects))
    assert "1.22 ms) and dead time (tau 1.02 us); adding them removes" in sentence_of(both)


def test_a_patch_that_removes_nothing_is_not_said_to_remove_a_negative_share() -> None:
    said = gap_line(Gap(2.4, 3.0, 1.0, -0.43, {}))
    assert said.endswith("With the patched model it is 3: the gap is not smaller.")


@pytest.mark.parametrize("before, stated", [(1.1, False), (1.3, True)])
def test_a_removed_share_is_said_where_there_is_a_gap(before: float, stated: bool) -> None:
    assert ("is removed" in gap_line(Gap(before, 1.0, 1.0, 1.0, {}))) == stated


def test_chance_is_one_whatever_two_halves_of_the_measurement_differ_by() -> None:
    for floor in (1.0, 0.594):
        said = gap_line(Gap(9.0, 1.0, floor, 0.9, {}))
        assert "; 1 is chance" in said and ("0.594" in said) == (floor < 1.0)
