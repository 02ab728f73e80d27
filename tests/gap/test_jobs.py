"""The answer does not depend on the number of jobs: of a scene here, of flats in test_diagnose.py, of maps in maps."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small import MODEL, effect

from spikecam_env.gap.diagnose import diagnose
from spikecam_env.gap.result import json_value
from spikecam_env.sensor import SpikeSensor
from spikecam_env.streams import pack_frames

pytestmark = pytest.mark.slow

SHAPE, FRAMES = (32, 32), 400


def scene_of_unknown_light(folder: Path) -> Path:
    """A still scene, recorded in flickering light: a search, with templates made for it."""
    model = MODEL.with_effect(effect("light_flicker", modulation=0.05, frequency_hz=100.0))
    light = np.linspace(0.1, 0.3, SHAPE[0] * SHAPE[1], dtype=np.float32).reshape(SHAPE)
    folder.mkdir()
    pack_frames(SpikeSensor(model, SHAPE, seed=2, engine="auto").step(light, FRAMES)).tofile(folder / "scene.dat")
    entry = {"name": "scene", "spikes": "scene.dat", "frames": FRAMES, "radiance": None, "use": "fit"}
    camera = {"height": SHAPE[0], "width": SHAPE[1], "frame_rate_hz": MODEL.frame_rate_hz}
    about = {"format": "spikecam-campaign/1", "camera": camera, "recordings": [entry]}
    (folder / "campaign.json").write_text(json.dumps(about))
    return folder


def answer(folder: Path, jobs: int) -> dict[str, Any]:
    """The diagnosis as written, without seconds."""
    found = diagnose(folder, MODEL, jobs=jobs, twin_count=4, candidates=("light_flicker", "lamp_drift"), progress=False)
    said: dict[str, Any] = json.loads(json.dumps(found.to_json() | {"stages_s": 0, "elapsed_s": 0}, default=json_value))
    return said


def test_two_jobs_say_what_one_says_of_an_unknown_scene(tmp_path: Path) -> None:
    folder = scene_of_unknown_light(tmp_path / "scene")
    one, two = answer(folder, 1), answer(folder, 2)
    print(one["sentence"], [(r["name"], r["misfit"]) for r in one["ranking"]])
    assert one["ranking"], "a search, in which jobs run side by side"
    assert json.dumps(one) == json.dumps(two)
