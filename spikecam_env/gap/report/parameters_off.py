"""Parameters of the model that are off, for a reader: those that recordings show only together share a row.

At one V_D the spreads of conversion gain, capacitor and bias voltage only add up to the spread of the response; all of
them were scaled by one factor.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from spikecam_env.gap.report.words import bare, human, listed, meaning_of, parameter_unit
from spikecam_env.gap.twins.fresh_units import SPREAD_PARAMETERS
from spikecam_env.sensor import CATALOGUE
from spikecam_env.sensor.unit import Circuit

Parameters = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class ParameterOff:
    """One number that is off."""

    name: str
    """In a sentence."""
    parameter: str
    """Of the effect, in words."""
    unit: str
    """Of measured and nominal."""
    measured: float
    nominal: float
    ratio: float
    """Measured over nominal."""
    meaning: str


def parameters_off(parameters: Parameters, circuit: Circuit) -> list[ParameterOff]:
    """Parameters that are off, the spreads of the response joined where there are several.

    Args:
        parameters: as of `Conclusion`.
        circuit: of the model; it turns a spread into a share of the response.
    """
    joined = [name for name in parameters if name in SPREAD_PARAMETERS["gain"]]
    if len(joined) < 2:
        return [_alone(name, row) for name, row in parameters.items()]
    rest = [_alone(name, row) for name, row in parameters.items() if name not in joined]
    return [_response_spread({name: parameters[name] for name in joined}, circuit), *rest]


def response_spread(strengths: Mapping[str, float], circuit: Circuit) -> float:
    """Standard deviation over pixels of the response, over its mean.

    The response is gain / (C V): independent relative spreads add in squares, to first order.

    Args:
        strengths: of spreads, by the effect's name.
        circuit: C and V.
    """
    scale = {"bias_voltage_spread": circuit.swing_V, "capacitor_spread": circuit.capacitance_fF}
    return math.sqrt(sum((value / scale.get(name, 1.0)) ** 2 for name, value in strengths.items()))


def _alone(name: str, row: Mapping[str, float]) -> ParameterOff:
    key = CATALOGUE[name].strength
    return ParameterOff(
        human(name), bare(name, key), parameter_unit(name, key), row["measured"], row["nominal"], row["ratio"],
        meaning_of(name, key),
    )  # fmt: skip


def _response_spread(rows: Parameters, circuit: Circuit) -> ParameterOff:
    measured, nominal = (
        response_spread({name: row[side] for name, row in rows.items()}, circuit) for side in ("measured", "nominal")
    )
    parts = listed([human(name) for name in rows], "and")
    return ParameterOff(
        "response spread", "sigma", "relative", measured, nominal, measured / nominal,
        f"standard deviation over mean; {parts} together, which recordings at one V_D cannot separate",
    )  # fmt: skip
