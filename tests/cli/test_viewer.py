"""When `spikecam demo` opens its result."""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path

import pytest

from spikecam_env.cli.main import run


@pytest.mark.parametrize(
    ("terminal", "display", "option", "opens"),
    [(True, ":0", (), True), (False, ":0", (), False), (True, "", (), False), (True, ":0", ("--no-open",), False)],
)
def test_the_result_is_opened_in_a_terminal_of_a_desktop_alone(
    terminal: bool, display: str, option: tuple[str, ...], opens: bool, tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.setattr("spikecam_env.cli.demo.Demo._picture", lambda *_: ["wrote it"])
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: terminal)
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.setenv("WAYLAND_DISPLAY", "")
    shown: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda address: bool(shown.append(address)) or True)
    assert run(["demo", "--quick", "--out", str(tmp_path / "out"), *option]) == 0
    assert shown == [(tmp_path / "out" / "demo.png").as_uri()] * opens
    assert ("opened" in capsys.readouterr().out) == opens
