"""Old names of public classes work for one version, and say the new name."""

from __future__ import annotations

import re
import sys
from importlib import import_module
from pathlib import Path

import pytest

CHANGES = (Path(__file__).parents[1] / "CHANGELOG.md").read_text(encoding="utf-8")
RENAMED = [
    ("scenes.film", "Reading", "FilmOptions"),
    ("scenes.renderers.protocol", "Window", "PictureWindow"),
    ("spikecam_env.campaign", "Take", "PlannedRecording"),
    ("spikecam_env.datasets", "Window", "SpikeWindow"),
    ("spikecam_env.envs.observations", "View", "CameraView"),
    ("spikecam_env.envs.tasks.base", "View", "CameraUnits"),
    ("spikecam_env.gap.statistics", "Key", "StatisticKey"),
    ("spikecam_env.gap.statistics.reading", "Reading", "CampaignReading"),
    ("spikecam_env.sensor.effects.base", "Exposure", "ExposureBlock"),
    ("spikecam_env.streams.side_file", "Geometry", "FrameLayout"),
    ("spikecam_env.streams.sources", "Stored", "StoredFrames"),
]


@pytest.mark.parametrize("module, old, new", RENAMED)
def test_an_old_name_is_the_new_class_with_a_warning(module: str, old: str, new: str) -> None:
    home = import_module(module)
    with pytest.warns(DeprecationWarning, match=rf"{re.escape(module)}\.{old} is now {new}"):
        assert getattr(home, old) is getattr(home, new)
    assert f"{module.removeprefix('spikecam_env.')}.{old}`" in CHANGES


def test_another_name_is_an_attribute_error_as_of_any_module() -> None:
    with pytest.raises(AttributeError, match=r"module 'spikecam_env\.campaign' has no attribute 'Taken'"):
        _ = import_module("spikecam_env.campaign").Taken


@pytest.mark.parametrize(
    "old, new", [("denoiser.run", "denoiser.training.resumable_run"), ("scenes.discs", "scenes.flat.discs")]
)
def test_a_module_that_moved_is_found_where_it_was(old: str, new: str) -> None:
    here = import_module(new)
    sys.modules.pop(old, None)
    with pytest.warns(DeprecationWarning, match=rf"{re.escape(old)} is now {re.escape(new)}"):
        assert import_module(old) is here
    assert here.__spec__ is not None and here.__spec__.name == new
