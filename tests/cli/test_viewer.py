"""When `spikecam demo` opens what it wrote."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from spikecam_env.cli import viewer


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[list[object]]:
    """Programs that were started; as on a Linux desktop, in a terminal."""
    programs: list[list[object]] = []
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr(viewer.shutil, "which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setattr(subprocess, "Popen", lambda words, **_: programs.append(words))
    for name, value in (("DISPLAY", ":0"), ("WAYLAND_DISPLAY", "")):
        monkeypatch.setenv(name, value)
    return programs


def test_a_file_is_opened_in_a_terminal_of_a_desktop(started: list[list[object]]) -> None:
    assert viewer.show_file(Path("demo.mp4"))
    assert started == [["/usr/bin/xdg-open", Path("demo.mp4")]]


def test_nothing_is_opened_where_nobody_would_see_it(
    started: list[list[object]], monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(sys.stdout, "isatty", lambda: False)
        assert not viewer.show_file(Path("demo.mp4"))
    with monkeypatch.context() as patch:
        patch.setenv("DISPLAY", "")
        assert not viewer.show_file(Path("demo.mp4"))
    monkeypatch.setattr(viewer.shutil, "which", lambda name: None)
    assert not viewer.show_file(Path("demo.mp4"))
    assert not started
