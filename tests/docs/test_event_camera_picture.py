"""`python -m tools.event_camera docs/events.png`: cameras on the same light, and the effect of a parameter."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tools import event_camera

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_has_a_row_a_change_and_its_picture_is_small() -> None:
    page = (DOCS / "event_camera.md").read_text(encoding="utf-8")
    shown = re.findall(r"^\| ((?:`|default).*?) \| (\d+) \| (\d+) \|$", page, re.MULTILINE)
    names = [", ".join(f"`{name}` {value:g}" for name, value in change.items()) for change in event_camera.CHANGES]
    assert [name for name, *_ in shown] == [name or "default" for name in names]
    assert (DOCS / "events.png").stat().st_size < 100_000


def test_a_table_of_the_first_row_has_the_page_s_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """The page's first row, from its own command; times of the processor are of the machine."""
    monkeypatch.setattr(event_camera, "CHANGES", event_camera.CHANGES[:1])
    light, pictures, bits = event_camera.lights()
    (row,) = event_camera.rows(light)
    print(row)
    page = (DOCS / "event_camera.md").read_text(encoding="utf-8")
    assert f"| default | {row['ON/pixel/s']} | {row['OFF/pixel/s']} |" in page
    assert bits["tfp"] == 40_000 * 96 * 96 > bits["events"] > bits["frame30"]
    assert event_camera.page(light, pictures, bits).size == (1500, 342)


def test_without_a_file_it_says_how_to_call_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["event_camera"])
    with pytest.raises(SystemExit, match=r"tools\.event_camera docs/events\.png"):
        event_camera.main()
