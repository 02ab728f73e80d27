"""Contradictions that hold beside a model: a label is at fault only where, relabelled, its recording agrees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.check.contradiction import Contradiction
from spikecam_env.gap.compare.distance import adjusted, deviates
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.twins.case import Case
from spikecam_env.sensor import SensorModel

TWINS_OF_RELABELLED = 6
"""Twins by whose scatter a relabelled recording is judged."""


def upheld(case: Case, model: SensorModel, faults: Sequence[Contradiction]) -> list[Contradiction]:
    """The contradictions that hold.

    The label of the brightest flat is at fault only where, relabelled, all else of its recording agrees: an effect that
    removes spikes in bright light alone looks like a wrong label of the brightest.

    Args:
        case: the measurement.
        model: to be tested.
        faults: contradictions.
    """
    levels = {c.name: c.level for c in case.conditions if c.kind == "flat"}
    brightest = max(levels, key=lambda name: levels[name], default="")
    return [
        c for c in faults if c.kind != "label" or c.recordings != (brightest,) or agrees_when_relabelled(case, model, c)
    ]


def agrees_when_relabelled(case: Case, model: SensorModel, label: Contradiction) -> bool:
    """Whether a recording agrees with the model under another label."""
    [name] = label.recordings
    conditions = [relabelled(c, label.factor) if c.name == name else c for c in case.conditions]
    again = case.of(conditions, case.observations)
    null = model_null(again, model, TWINS_OF_RELABELLED)
    of = np.array([k.recording == name and k.group != "rates" for k in null.keys])
    return not adjusted(deviates(null, values_of(again.bank, null.keys))[of]).min() < null.settings.judging.gate


def relabelled(condition: Condition, factor: float) -> Condition:
    """The same with its light multiplied."""
    assert condition.light is not None
    light = replace(condition.light, radiance=condition.light.radiance * np.float32(factor))
    return replace(condition, level=condition.level * factor, light=light)
