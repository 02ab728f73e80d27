"""Parameters that are off: what recordings tell as one number is one row."""

from __future__ import annotations

from dataclasses import replace

import made_up
import numpy as np
import pytest

from spikecam_env.gap.report.page import report
from spikecam_env.gap.report.parameters_off import parameters_off, response_spread
from spikecam_env.gap.report.sentence import sentence
from spikecam_env.sensor import SensorModel

SCSIM = SensorModel.preset("scsim")
SPREADS = {"conversion_gain_spread": 0.05766, "capacitor_spread": 0.0128, "bias_voltage_spread": 0.0497}


def off(ratio: float, *others: str) -> dict[str, dict[str, float]]:
    rows = {name: {"measured": ratio * v, "nominal": v, "ratio": ratio} for name, v in SPREADS.items()}
    return rows | {name: {"measured": 2.0, "nominal": 1.0, "ratio": 2.0} for name in others}


def test_the_joined_spread_is_that_of_the_response_of_drawn_pixels() -> None:
    """To 1 %: 40 000 pixels know a standard deviation to 0.35 %, and squares add to first order only."""
    gain = SCSIM.draw_unit((200, 200), 1).gain
    said = response_spread(SPREADS, SCSIM.circuit)
    print(said, gain.std() / gain.mean())
    assert said == pytest.approx(float(gain.std() / gain.mean()), rel=0.01)


def test_three_spreads_of_the_response_are_one_row_and_others_stay() -> None:
    rows = parameters_off(off(0.3, "dark_current"), SCSIM.circuit)
    assert [r.name for r in rows] == ["response spread", "dark current"]
    assert rows[0].ratio == pytest.approx(0.3) and rows[0].unit == "relative"
    assert rows[0].measured == pytest.approx(0.3 * rows[0].nominal)


def test_one_spread_alone_keeps_its_name_and_unit() -> None:
    (row,) = parameters_off({"capacitor_spread": off(2.0)["capacitor_spread"]}, SCSIM.circuit)
    assert row.name == "capacitor spread" and row.unit == "fF"


def test_the_headline_and_the_page_name_one_spread() -> None:
    d = replace(made_up.named(), parameters=off(0.3), patched=SCSIM, evidence=None)
    said = sentence(d, "scsim")
    assert said.endswith("Parameters of the model scsim are off as well: response spread is 2.21 %, not 7.35 %.")
    page = report(d)
    assert page.count("response spread: sigma") == 1 and "capacitor spread: sigma" not in page


def test_the_spread_of_no_spread_is_none() -> None:
    assert response_spread({}, SCSIM.circuit) == 0.0 and np.isfinite(response_spread(SPREADS, SCSIM.circuit))
