"""Gymnasium's own wrappers that need an extra, `spikecam-env[video]`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import spikecam_env.envs  # noqa: F401

ROOT = Path(__file__).resolve().parents[2]


def test_the_extra_names_what_record_video_and_human_rendering_want() -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    (line,) = (line for line in text.splitlines() if line.startswith("video = "))
    assert "pygame" in line and "moviepy" in line


def test_record_video_writes_a_film_of_an_episode(tmp_path: Path) -> None:
    pytest.importorskip("moviepy", reason="needs the extra video")
    made: Any = gymnasium.make("spikecam_env/Catch-v1", shape=(32, 32), render_mode="rgb_array")
    env = gymnasium.wrappers.RecordVideo(made, str(tmp_path))
    env.reset(seed=0)
    over = False
    while not over:
        *_, terminated, truncated, _ = env.step(np.zeros(1, np.float32))
        over = terminated or truncated
    env.close()
    (film,) = tmp_path.glob("*.mp4")
    assert film.stat().st_size > 1000


def test_a_window_opens_where_a_driver_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """SDL's dummy driver stands for a display."""
    pytest.importorskip("pygame", reason="needs the extra video")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with pytest.warns(UserWarning, match="HumanRendering"):
        env = gymnasium.make("spikecam_env/Catch-v1", shape=(32, 32), render_mode="human")
    env.reset(seed=0)
    env.step(np.zeros(1, np.float32))
    env.close()
