"""Detection limits of the catalogue's effects, from the diagnosis' own templates.

    python -m benchmarks.detection_limits                          prints the table and writes it into limits.toml
    python -m benchmarks.detection_limits clock_feedthrough        of these effects alone

The file is tests/hidden_world/limits.toml.

Limit: the strength at which the statistic that shows the effect best stands CLEAR noises off, in 64 x 64 pixels and
8000 frames of the standard design: recordings to fit, and held-out ones in motion, which may ring the alarm as well
(`baseline.alarm`); over some 450 statistics it rings from about 4.2.  Effects in time are scaled from their template;
those of the pattern, whose statistics are not in proportion, are searched for by drawing units; noise of a reset shows
where it is more than units differ by.  The base model's own effects are not among them: they are hidden from `ideal`.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spikecam_env.campaign.design import standard_design
from spikecam_env.gap.baseline.off_nominal import USUAL_NOISE
from spikecam_env.gap.candidates.strength import bounded, with_effect
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.fit.predict import with_drawn_pattern
from spikecam_env.gap.fit.standard_case import FRAMES, SHAPE, standard_case
from spikecam_env.gap.observe.conditions import planned_conditions
from spikecam_env.gap.screen.templates import shipped_templates
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.sensor import CATALOGUE, SensorModel
from tests.hidden_world.catalogue import CATALOGUE as HIDDEN

CLEAR = 6.0
TABLE = Path(__file__).parents[1] / "tests/hidden_world/limits.toml"


def measured(only: Sequence[str] = ()) -> dict[str, float]:
    """Strength by name, of these effects, or of all; of an effect with several shapes the middle one."""
    wanted = set(only or [*HIDDEN, "excess_threshold_noise"])
    by_name: dict[str, list[float]] = {}
    templates = shipped_templates()
    used = heard(templates.keys)
    for entry in templates.weakest:
        power = 1.0 / candidate(entry.name).power
        peak = float(np.abs(entry.shift[used]).max())
        strength = abs(entry.parameters[CATALOGUE[entry.name].strength])
        by_name.setdefault(entry.name, []).append(strength * (CLEAR / peak) ** power)
    limits = {name: float(np.median(values)) for name, values in by_name.items() if name in wanted & set(HIDDEN)}
    limits |= of_pattern([name for name in limits if candidate(name).is_pattern], limits)
    return limits | ({"excess_threshold_noise": of_a_reset()} if "excess_threshold_noise" in wanted else {})


def of_a_reset() -> float:
    """Noise [mV] beside that of first principles."""
    model = SensorModel.preset("physical")
    unit = model.draw_unit(SHAPE, 0)
    s2 = float(np.mean(1.0 / unit.electrons + unit.kappa**2))
    return 1e3 * model.circuit.swing_V * float(np.sqrt((USUAL_NOISE - 1.0) * s2))


def heard(keys: Sequence[StatisticKey]) -> NDArray[np.bool_]:
    """(S,) which statistics are of recordings that the alarm hears and a fit may take."""
    names = {c.name for c in planned_conditions(standard_design(), SHAPE, FRAMES) if c.use == "fit" or c.moves}
    return np.array([k.recording in names for k in keys])


def of_pattern(names: list[str], near: dict[str, float]) -> dict[str, float]:
    """Strength by name from which units drawn with the effect stand CLEAR noises off, to 10 %."""
    if not names:
        return {}
    case, model, null = standard_case()
    used = heard(null.keys)
    limits = {}
    for name in names:
        key = CATALOGUE[name].strength
        for strength in near[name] * np.geomspace(0.02, 5.0, 60):
            tried = with_effect(model, name, bounded(name, {key: strength}))
            shift = ((with_drawn_pattern(case, tried, null, null.prediction).mean - null.mean) / null.noise)[used]
            limits[name] = float(strength)
            if np.abs(shift).max() > CLEAR:
                break
    return limits


def written(text: str, limits: dict[str, float]) -> str:
    """limits.toml with these values in it."""
    for name, value in limits.items():
        entry = re.compile(rf"(\[{name}\]\nparameter = \"\w+\"\nlimit = )\S+")
        text = entry.sub(lambda m, v=value: f"{m[1]}{v:.2g}", text)  # type: ignore[misc]
    return text


if __name__ == "__main__":
    values = measured(sys.argv[1:])
    for name, value in values.items():
        print(f"{name:28s} {value:.2g}")
    TABLE.write_text(written(TABLE.read_text(encoding="utf-8"), values), encoding="utf-8")
