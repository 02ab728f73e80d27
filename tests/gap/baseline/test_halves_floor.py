"""The floor of the gap: the rest of a model without fault."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from small import MODEL, SHAPE, TWINS, case_from, conditions, unit

from spikecam_env.gap.baseline.halves_floor import floor_of_halves
from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.result import Gap
from spikecam_env.gap.twins.simulate import expose
from spikecam_env.gap.unit.conversion import unit_from_refit
from spikecam_env.gap.verdict.comparison import usable_floor
from spikecam_env.streams import unpack_frames


@pytest.mark.slow
def test_where_nothing_is_wrong_the_gap_is_its_floor_pattern_and_all():
    """Three units of the model against it: gap and floor on the flat held out, of which a fifth is of the pattern."""
    gaps, floors = [], []
    for seed in (20, 21, 22):
        law = unit_from_refit(MODEL, unit(MODEL, seed), SHAPE)
        packed = {c.name: expose(MODEL, law, c, SHAPE, seed, take) for take, c in enumerate(conditions())}
        case = case_from({name: unpack_frames(bits, SHAPE) for name, bits in packed.items()}, seed)
        null = model_null(case, MODEL, TWINS)
        off = (values_of(case.bank, null.keys) - null.mean) / null.noise
        gaps.append(np.nanmean(off[[k.recording == "flat-0.5" for k in null.keys]] ** 2))
        files = [SimpleNamespace(name=name, packed=lambda bits=bits: bits) for name, bits in packed.items()]
        floors.append(floor_of_halves(case, files, null))
    print(gaps, floors)
    assert np.mean(floors) == pytest.approx(np.mean(gaps), rel=0.35)


@pytest.mark.parametrize("halves, floor", [(0.4, 0.4), (np.nan, 1.0), (190.0, 1.0)])
def test_halves_that_differ_by_more_than_chance_are_no_floor(halves, floor):
    """A dark level that climbs makes them differ by the fault of the model."""
    gap = Gap.of(87.0, 0.5, {"dark": (87.0, 0.5)}, usable_floor(halves))
    assert gap.floor == gap.by_recording["dark"]["floor"] == floor
    assert gap.removed == pytest.approx(86.5 / (87.0 - floor))
