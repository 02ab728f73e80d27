"""`spikecam view`: entries of the timeline, and their frames; none of it needs a display, little of it rerun."""

from __future__ import annotations

import subprocess
import sys
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from denoiser import OnlineDnSS
from scenes.catalogue import make_scene
from spikecam_env.cli.live.streams import Block, Stream, of_recording, of_scene
from spikecam_env.cli.live.timeline import DENOISED, NOISY, TARGET, TimelineEntry, entries
from spikecam_env.cli.screen.screen import display
from spikecam_env.sensor import SpikeSensor
from spikecam_env.streams import save_npz
from tests.commands import spikecam

SHAPE = (12, 20)
SMALL = ("--size", 12, 20)


def spikes(frames: int) -> np.ndarray:
    scene = make_scene("disk", SHAPE, 0)
    return SpikeSensor("scsim", SHAPE, 0).step(scene.radiance(0, frames), frames)


def stream(block: np.ndarray, every: int, **figures: float) -> Stream:
    blocks = (Block(first, block[first : first + every], figures) for first in range(0, len(block), every))
    return Stream("made up", SHAPE, 40_000.0, len(block), blocks)


def by_path(found: list[TimelineEntry]) -> dict[str, list[TimelineEntry]]:
    ordered = sorted(found, key=lambda entry: entry.path)
    return {path: list(group) for path, group in groupby(ordered, key=lambda entry: entry.path)}


@pytest.mark.parametrize(("frames", "every"), [(160, 40), (101, 17), (5, 40)])
def test_both_pictures_and_the_rates_are_of_the_middle_of_a_block(frames: int, every: int) -> None:
    seen = spikes(frames)
    found = by_path(list(entries(stream(seen, every), [(3, 4)])))
    online = OnlineDnSS.pretrained("best", output="rate")
    planes = np.concatenate([online.push(seen), online.flush()])
    middles = [(first + min(first + every, frames)) // 2 for first in range(0, frames, every)]
    assert [entry.frame for entry in found[NOISY]] == [entry.frame for entry in found[DENOISED]] == middles
    white = float(np.percentile(seen[:every].mean(axis=0), 99.5))
    for first, noisy, denoised in zip(range(0, frames, every), found[NOISY], found[DENOISED], strict=True):
        np.testing.assert_array_equal(noisy.value, display(seen[first : first + every].mean(axis=0), white))
        np.testing.assert_array_equal(denoised.value, display(planes[denoised.frame], white))
    rates = found["rate [spikes a frame]/3,4 denoised"]
    assert [entry.value for entry in rates] == [planes[entry.frame, 3, 4] for entry in rates]
    assert found["rate [spikes a frame]/3,4 noisy"][0].value == pytest.approx(seen[:every, 3, 4].mean())


def test_statistics_and_figures_are_of_the_end_of_a_block() -> None:
    seen = spikes(80)
    found = by_path(list(entries(stream(seen, 40, **{"reward/reward": 2.0}), [], denoise=False)))
    assert DENOISED not in found
    assert [(entry.frame, entry.value) for entry in found["reward/reward"]] == [(40, 2.0), (80, 2.0)]
    mean = found["spikes a frame/mean of all pixels"][0].value
    assert mean == pytest.approx(seen[:40].mean())
    assert found["mean interval [frames]/mean interval"][0].value == pytest.approx(1 / mean)


def test_a_dark_stream_has_no_interval() -> None:
    found = by_path(list(entries(stream(np.zeros((40, *SHAPE), np.uint8), 40), [(0, 0)], denoise=False)))
    assert "mean interval [frames]/mean interval" not in found
    assert not np.any(found[NOISY][0].value)


def test_a_recording_and_a_scene_are_cut_into_blocks(tmp_path: Path) -> None:
    seen = spikes(90)
    save_npz(tmp_path / "a.npz", seen)
    of_file = of_recording(tmp_path / "a.npz", 70, 40)
    scene = make_scene("disk", SHAPE, 0)
    of_light = of_scene("disk", scene, SpikeSensor("scsim", SHAPE, 0), 70, 40)
    for made in (of_file, of_light):
        blocks = list(made.blocks)
        assert [(block.first, len(block.spikes)) for block in blocks] == [(0, 40), (40, 30)]
        np.testing.assert_array_equal(np.concatenate([block.spikes for block in blocks]), seen[:70])
        assert (made.shape, made.frames, made.frame_rate_hz) == (SHAPE, 70, 40_000.0)


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, float, list[TimelineEntry]]]:
    """Calls of rerun, which itself stays out."""
    given: list[tuple[str, float, list[TimelineEntry]]] = []

    def recorded(title: str, frame_rate_hz: float, found: Any) -> bytes:
        given.append((title, frame_rate_hz, list(found)))
        return b"a recording"

    monkeypatch.setattr("spikecam_env.cli.live.rerun_log.recorded", recorded)
    return given


def test_an_episode_has_reward_gaze_and_target(sent: list, tmp_path: Path, capsys) -> None:
    assert spikecam("view", "Catch-v1", "--save", tmp_path / "a.rrd", "--frames", 200, "--pixels", "1,2", "40,7") == 0
    assert (tmp_path / "a.rrd").read_bytes() == b"a recording"
    assert str(tmp_path / "a.rrd") in capsys.readouterr().out
    ((title, rate, found),) = sent
    assert (title, rate) == ("Catch-v1", 40_000.0)
    paths = by_path(found)
    steps = [entry.frame for entry in paths["reward/reward"]]
    assert steps == list(range(20, 201, 20)) == [entry.frame for entry in paths[TARGET]]
    returned = sum(entry.value for entry in paths["reward/reward"])
    assert paths["return/return"][-1].value == pytest.approx(returned)
    assert {"gaze/pan [px]", "gaze/tilt [px]", "distance/distance [px]", "performance/performance"} <= set(paths)
    assert {path for path in paths if path.startswith("rate")} == {
        f"rate [spikes a frame]/{pixel} {what}" for pixel in ("1,2", "40,7") for what in ("noisy", "denoised")
    }


def test_a_scene_is_viewed_as_its_recording_is(sent: list, tmp_path: Path) -> None:
    assert spikecam("record", "--out", tmp_path / "a.npz", *SMALL, "--frames", 50) == 0
    line = ("--save", tmp_path / "a.rrd", "--every", 25)
    assert spikecam("view", "disk", *SMALL, "--frames", 50, *line) == 0
    assert spikecam("view", tmp_path / "a.npz", *line) == 0
    scene, file = ([entry for entry in found if entry.path == NOISY] for *_, found in sent)
    for ours, theirs in zip(scene, file, strict=True):
        np.testing.assert_array_equal(ours.value, theirs.value)


def test_without_rerun_the_message_says_what_to_install(tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert spikecam("view", "disk", *SMALL, "--frames", 40, "--save", tmp_path / "a.rrd") == 2
    assert "pip install 'spikecam-env[view]'" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_rerun_takes_the_file(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="needs rerun-sdk")
    assert spikecam("view", "Catch-v1", "--save", tmp_path / "a.rrd", "--frames", 100) == 0
    command = [sys.executable, "-m", "rerun", "rrd"]
    subprocess.run([*command, "verify", tmp_path / "a.rrd"], check=True, timeout=120)
    said = subprocess.run([*command, "print", tmp_path / "a.rrd"], check=True, timeout=120, capture_output=True)
    for part in (b"/picture/noisy", b"/picture/denoised", b"gaze", b"target"):
        assert part in said.stdout + said.stderr
