"""Diagnoses of parts of the real recordings (docs/real_data.md has the whole)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spikecam_env.gap import Label, import_campaign
from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.check.motion import find_motion
from spikecam_env.gap.compare.distance import adjusted, deviates
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.diagnose import diagnose, observed, read_case
from spikecam_env.sensor import SensorModel
from tools.real_recordings import REAL

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not REAL.is_dir(), reason=f"the real recordings are not at {REAL}"),
]


def test_on_the_wall_pixels_follow_the_clock_and_nothing_else_is_off(tmp_path: Path) -> None:
    wall = import_campaign(
        REAL, tmp_path / "wall", [Label("wall.npz", "unknown")], frame_rate_hz=20_000.0, rows=(110, 200),
        columns=(15, 355),
    )  # fmt: skip
    case = read_case(wall)
    null = model_null(case, SensorModel.preset("scsim"), 8)
    z = deviates(null, values_of(case.bank, null.keys))
    off = [k.group for k, p in zip(null.keys, adjusted(z), strict=True) if p < 0.001]
    print({f"{k.group} {k.name}": round(float(v), 1) for k, v in zip(null.keys, z, strict=True) if abs(v) > 3})
    assert set(off) == {"clock"}


@pytest.mark.parametrize(
    ("file", "part", "moves"),
    [
        ("wall.npz", {"rows": (110, 200), "columns": (15, 355)}, False),
        ("helicopter_low_light.npz", {}, True),
    ],
    ids=["wall", "helicopter"],
)
def test_the_helicopter_moves_and_the_wall_does_not(
    tmp_path: Path, file: str, part: dict[str, tuple[int, int]], moves: bool
) -> None:
    made = import_campaign(REAL, tmp_path / "made", [Label(file, "unknown")], frame_rate_hz=20_000.0, **part)
    seen = observed(made)
    found = find_motion(seen.conditions[0], seen.observations[0])
    print(found.text if found else f"{file} stands still")
    assert (found is not None) == moves


def test_the_maps_have_a_dark_tail_shading_and_a_narrower_spread_than_published(tmp_path: Path) -> None:
    maps = import_campaign(
        REAL, tmp_path / "maps", [Label("flat_335lux_maps.npz", "relative")], frame_rate_hz=20_000.0,
        rows=(50, 200), columns=(100, 350),
    )  # fmt: skip
    assert [r.use for r in maps.recordings] == ["fit", "fit", "holdout"]
    found = diagnose(
        maps, "scsim", jobs=2, progress=False, candidates=["vignetting", "dark_current_tail", "dead_pixels"]
    )
    print(found.sentence, found.parameters, found.gap)
    assert {"vignetting", "dark_current_tail"} <= {e.name for e in found.effects} or found.verdict == "unknown"
    assert found.parameters["conversion_gain_spread"]["ratio"] < 0.5
    assert found.gap is not None and found.gap.after < found.gap.before
    assert np.isfinite(found.gap.removed)
