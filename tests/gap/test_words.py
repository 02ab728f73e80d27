"""Words of a diagnosis: quantities keep the digits that their errors leave, and units an engineer reads."""

from __future__ import annotations

import made_up
import pytest

from spikecam_env.gap.words import bare, quantity, sentence, unit_of
from spikecam_env.sensor import CATALOGUE


@pytest.mark.parametrize(
    "value, unit, sd, said",
    [
        (0.0612, "relative", 0.0012, "6.12 ± 0.12 %"),
        (1224.0, "us", 24.0, "1.224 ± 0.024 ms"),
        (2.4, "us", 0.1, "2.40 ± 0.10 us"),
        (31000.0, "electrons", 800.0, "31000 ± 800 electrons"),
        (0.0, "pA", 0.0, "0 pA"),
        (5.0, "", None, "5"),
        (1e-12, "V", 1e-13, "1e-12 ± 1e-13 V"),
    ],
)
def test_a_quantity_has_the_digits_that_its_error_leaves(value, unit, sd, said) -> None:
    assert quantity(value, unit, sd) == said


def test_every_parameter_of_the_catalogue_has_a_plain_name_and_a_unit_in_words() -> None:
    for effect, kind in CATALOGUE.items():
        for parameter in kind().parameters():
            assert "_" not in bare(effect, parameter)
            assert isinstance(unit_of(effect, parameter), str)
    assert bare("light_flicker", "frequency_hz") == "frequency"


def test_the_sentence_names_the_effect_its_size_and_what_it_removes() -> None:
    d = made_up.named()
    said = sentence(d.effects, d.gap)
    print(said)
    assert said == (
        "Your camera has photodiode lag (fraction 6.12 %, tau 1.22 ms); adding it removes 97 % of the gap on "
        "recordings that were not used."
    )
