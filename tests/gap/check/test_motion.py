"""Motion in recordings that are said to be static: found where it is, and no effect of a camera taken for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spikecam_env.campaign import read_campaign
from spikecam_env.campaign.writing import finish_campaign, save_spikes
from spikecam_env.errors import InputError
from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.check.motion import find_motion
from spikecam_env.gap.check.static_part import without_motion
from spikecam_env.gap.compare.distance import adjusted, deviates
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.diagnose import case_of_observed, diagnose, observed, read_case
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import observe
from spikecam_env.gap.report.page import report
from spikecam_env.gap.settings import DiagnosisSettings
from spikecam_env.gap.twins.unknown_scene import correction
from spikecam_env.sensor import CATALOGUE, Keyframes, SensorModel, SpikeSensor
from spikecam_env.streams import pack_frames
from tests.gap.check.motion_scenes import CHANGES_IN_TIME, SHAPE, ball, drift, looked_at, picture, square

FRAMES = 500
SCSIM = SensorModel.preset("scsim")


@pytest.mark.parametrize("name", ["ideal", "scsim", "physical", "measured"])
def test_a_static_scene_does_not_move(name: str) -> None:
    """FALSE_ALARM over six recordings: one in 170 trials of this test."""
    model = SensorModel.preset(name)
    assert [looked_at(model, picture(), FRAMES, seed) for seed in range(6)] == [None] * 6


@pytest.mark.parametrize("name", CHANGES_IN_TIME)
def test_no_effect_that_changes_static_recordings_is_motion(name: str) -> None:
    model = SCSIM.with_effect(CATALOGUE[name](**CHANGES_IN_TIME[name]))
    assert [looked_at(model, picture(), FRAMES, seed) for seed in range(3)] == [None] * 3


SINGLE_EVENTS: list[tuple[str, dict[str, float], float]] = [
    ("spurious_spikes", {"probability": 0.01}, 0.005),
    ("spurious_spikes", {"probability": 0.01}, 0.125),
    ("hot_pixels", {"fraction": 0.05, "mean_pA": 100.0}, 0.03),
    ("random_telegraph_noise", {"fraction": 0.5, "amplitude_pA": 5.0, "dwell_ms": 5.0}, 0.005),
    ("random_telegraph_noise", {"fraction": 0.5, "amplitude_pA": 20.0, "dwell_ms": 1.0}, 0.125),
    ("afterpulsing", {"probability": 0.1}, 0.005),
    ("missed_spikes", {"probability": 0.1}, 0.125),
]
"""Effect, parameters, level: the counts of single pixels vary more than an integrator's."""


@pytest.mark.parametrize(("name", "parameters", "level"), SINGLE_EVENTS)
def test_events_of_single_pixels_are_no_motion(name: str, parameters: dict[str, float], level: float) -> None:
    model = SCSIM.with_effect(CATALOGUE[name](**parameters))
    flat = np.full(SHAPE, level, np.float32)
    assert [looked_at(model, flat, FRAMES, seed) for seed in range(4)] == [None] * 4


def glitched(spikes: np.ndarray, probability: float, length: int, seed: int) -> np.ndarray:
    """Spikes (T, H, W) with words of a row, side by side, that read all ones."""
    rng = np.random.default_rng(seed)
    frames, rows, columns = spikes.shape
    count = rng.poisson(probability * spikes.size / length)
    at = rng.integers(0, frames, count), rng.integers(0, rows, count)
    first = rng.integers(0, columns - length + 1, count)
    out = spikes.copy()
    for k in range(length):
        out[(*at, first + k)] = True
    return out


@pytest.mark.parametrize("length", [4, 8, 16, 64])
@pytest.mark.parametrize("level", [0.01, 0.125])
def test_events_that_pixels_of_a_row_share_are_no_motion(length: int, level: float) -> None:
    flat = np.full(SHAPE, level, np.float32)
    for seed in range(3):
        spikes = SpikeSensor(SCSIM, SHAPE, seed).step(flat, FRAMES)
        seen = observe(pack_frames(glitched(spikes, 2e-3, length, seed)), SHAPE)
        assert find_motion(Condition("scene", "unknown", np.nan, None, FRAMES, "fit"), seen) is None


@pytest.mark.parametrize("turned", [False, True])
def test_stripes_that_move_are_found_along_rows_and_along_columns(turned: bool) -> None:
    """Stripes along rows scatter these as glitches do, but by far more than `width` pixels that share them."""
    times = np.arange(0, FRAMES + 16, 16)
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    along = (column if turned else row) - 0.01 * times[:, None, None]
    light = (0.15 * (1 + 0.5 * np.sin(2 * np.pi * along / 12))).astype(np.float32)
    assert looked_at(SCSIM, Keyframes(times.astype(np.float64), light), FRAMES, 0) is not None


def test_a_square_is_found_where_and_when_it_is() -> None:
    """8 x 8 pixels of + 20 %: a block of 32 frames has 4.8 spikes and 0.8 more, as the mean has a quarter of them.  The
    variance is at most 0.35, so z is 8 x 0.8 / 0.6 = 10.  Windows of 16 pixels reach 16 beyond, blocks one block."""
    found = looked_at(SCSIM, square(8, 0.2, FRAMES), FRAMES, 0)
    assert found is not None
    print(found.text, found.contrast, found.z)
    assert found.moving[29:37, 29:37].all()
    assert found.rows[0] >= 29 - 16 and found.rows[1] <= 36 + 16
    assert found.frames[0] >= 125 - 32 and found.frames[1] <= 250 + 32
    assert 0.1 < found.contrast < 0.25 and found.z > 10


def test_a_ball_that_crosses_and_a_slow_drift_are_found() -> None:
    crossing, slow = (looked_at(SCSIM, light, FRAMES, 0) for light in (ball(FRAMES), drift(FRAMES)))
    assert crossing is not None and slow is not None
    print(crossing.text, slow.text, sep="\n")
    assert 32 in range(crossing.rows[0], crossing.rows[1] + 1)
    assert slow.share > 0.3


@pytest.mark.parametrize(
    ("spikes", "moves"),
    [
        (np.zeros((100, 32, 32), np.uint8), False),
        (np.ones((100, 32, 32), np.uint8), False),
        (np.random.default_rng(0).integers(0, 2, (100, 1, 1)).astype(np.uint8), False),
        (np.random.default_rng(0).integers(0, 2, (3, 32, 32)).astype(np.uint8), False),
        (np.kron(np.random.default_rng(0).integers(0, 2, (64, 8, 8)), np.ones((4, 8, 8))).astype(np.uint8)[:256], True),
    ],
    ids=["silent", "always", "one pixel", "three frames", "all moves"],
)
def test_awkward_recordings(spikes: np.ndarray, moves: bool) -> None:
    seen = observe(pack_frames(spikes), spikes.shape[1:])
    found = find_motion(Condition("odd", "unknown", np.nan, None, len(spikes), "fit"), seen)
    assert (found is not None) == moves
    assert found is None or found.share > 0.75


def scene(folder: Path, light: Keyframes) -> Path:
    """A campaign of one unknown scene."""
    folder.mkdir()
    spikes = SpikeSensor(SCSIM, SHAPE, 1).step(light, FRAMES)
    save_spikes(folder / "scene.dat", [spikes])
    entry = {"name": "scene", "spikes": "scene.dat", "frames": FRAMES, "radiance": None, "use": "fit"}
    finish_campaign(folder, SHAPE, 20_000.0, [entry])
    return folder


@pytest.mark.slow
def test_a_moving_scene_is_refused_before_anything_is_simulated(tmp_path: Path) -> None:
    folder = scene(tmp_path / "ball", ball(FRAMES))
    found = diagnose(folder, progress=False)
    assert (found.verdict, found.simulated) == ("data", 0)
    assert "rows" in found.sentence and any("--static-only" in line for line in found.data)
    said = found.to_json()
    assert said["motion"][0]["recording"] == "scene" and 0 < said["static_share"] < 1
    assert "Where it moves" in report(found)
    with pytest.raises(InputError, match="moves"):
        read_case(read_campaign(folder))


def test_where_too_little_is_static_even_static_only_is_refused(tmp_path: Path) -> None:
    found = diagnose(scene(tmp_path / "drift", drift(FRAMES, 0.1)), static_only=True, progress=False)
    assert (found.verdict, found.simulated) == ("data", 0)
    assert any("needs 30 %" in line for line in found.data)


def test_static_pixels_alone_agree_with_their_model(tmp_path: Path) -> None:
    """The ball's rows are left out of the recording and of its twins: nothing else is off at the alarm's level."""
    seen, motion = without_motion(observed(campaign := read_campaign(scene(tmp_path / "ball", ball(FRAMES)))),
                                  static_only=True, settings=DiagnosisSettings())  # fmt: skip
    assert motion
    case = case_of_observed(campaign, seen, 0, 1, DiagnosisSettings())
    assert not case.base.live.reshape(SHAPE)[32].any()
    null = model_null(case, SCSIM, 8)
    p = adjusted(deviates(null, values_of(case.bank, null.keys)))
    print(f"{100 * case.base.live.mean():.0f} % kept, {p.size} statistics, smallest p {p.min():.3g}")
    assert p.min() > 0.002


def test_silent_pixels_make_no_light_infinite() -> None:
    """A twin in which a level stays silent corrects its light by a factor of two at most, not by 1e9 at every turn."""
    wanted = np.repeat([0.01, 0.2], 50) * np.linspace(0.9, 1.1, 100)
    factor = correction(np.where(wanted < 0.1, 0.0, wanted), wanted)
    assert factor.max() == 2.0 and np.abs(factor[wanted > 0.15] - 1.0).max() < 0.01  # interpolated at the edge of a bin
