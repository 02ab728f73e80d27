"""`python -m tools.task_pictures docs/tasks.jpg`: the tasks as agents are shown them."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from spikecam_env.envs.registration import TASK_NAMES
from tools import task_pictures


def test_every_task_has_its_words_and_the_shipped_picture_is_small() -> None:
    shipped = Path(__file__).parents[2] / "docs" / "tasks.jpg"
    assert set(task_pictures.WORDS) == set(TASK_NAMES)
    assert shipped.stat().st_size <= 300_000
    with Image.open(shipped) as picture:
        rows = (picture.height - 2 * task_pictures.MARGIN - task_pictures.CAPTION) / len(TASK_NAMES)
    assert rows == 64 * task_pictures.ZOOM + task_pictures.MARGIN + task_pictures.CAPTION


def test_moments_run_from_the_first_picture_to_success() -> None:
    first, *_, last = shown = task_pictures.moments("Catch")
    assert len(shown) == task_pictures.MOMENTS
    assert first.line == "0.5 ms" and last.line.endswith("success")
    assert abs(last.target[0] - 31.5) <= last.near < abs(shown[1].target[0] - 31.5)


def test_without_a_file_it_says_how_to_call_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["task_pictures"])
    with pytest.raises(SystemExit, match=r"tools\.task_pictures docs/tasks\.jpg"):
        task_pictures.main()
