"""What a person sees while a diagnosis runs."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import pytest
from small import MODEL, effect

from spikecam_env.gap import Dark, Flat, diagnose, write_campaign

HIDDEN = MODEL.with_effect(effect("dead_time", tau_us=4.0))


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("progress") / "camera"
    flats = [Dark(), *(Flat(radiance=level) for level in (0.1, 0.3, 0.6, 0.8))]
    write_campaign(folder, HIDDEN, shape=(16, 16), frames=1000, recordings=flats)
    return folder


def diagnosed(folder: Path, **options: Any) -> None:
    diagnose(folder, "scsim", candidates=["dead_time"], twin_count=4, effort=40, **options)


def test_on_a_terminal_a_bar_has_stage_effect_share_of_the_budget_and_time_left(
    campaign: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for stream in (sys.stdout, sys.stderr):
        monkeypatch.setattr(stream, "isatty", lambda: True)
    diagnosed(campaign)
    printed = capsys.readouterr()
    seen = printed.err.split("\r")
    print(*seen, sep="\n")
    assert printed.out == ""
    of_effect = [line for line in seen if "candidates: fitting dead_time" in line]
    [(percent, campaigns)] = re.findall(r"(\d+) % of the budget, (\d+) of 40 campaigns", of_effect[-1])
    assert int(percent) == pytest.approx(100 * int(campaigns) / 40, abs=2)
    assert all("to its end at most" in line for line in of_effect)
    shares = [int(share) for line in seen for share in re.findall(r"(\d+) % of the budget", line)]
    assert shares == sorted(shares) and shares[0] == 0 < shares[-1]


def test_elsewhere_each_stage_is_a_line(campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    diagnosed(campaign)
    printed = capsys.readouterr()
    assert [line for line in printed.out.splitlines() if line in ("read ...", "twins ...", "verdict ...")] == [
        "read ...", "twins ...", "verdict ...",
    ]  # fmt: skip
    assert "budget" not in printed.out + printed.err


def test_without_progress_nothing_is_printed(
    campaign: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for stream in (sys.stdout, sys.stderr):
        monkeypatch.setattr(stream, "isatty", lambda: True)
    diagnosed(campaign, progress=False)
    assert capsys.readouterr() == ("", "")
