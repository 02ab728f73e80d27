"""The page of benchmarks states the figures of every version's files, a point a version."""

from __future__ import annotations

import json
from pathlib import Path

from tools.site import benchmarks


def written(folder: Path, version: str, rate: float) -> None:
    (folder / version).mkdir()
    rows = [{"engine": "fast", "threads": 2, "Gpx-steps/s": rate, "from": 0.5, "x numpy": 10 * rate}]
    (folder / version / "sensor.json").write_text(json.dumps({"machine": f"made up {version}", "rows": rows}))


def test_a_version_is_a_column_and_a_point(tmp_path: Path) -> None:
    for version, rate in (("0.10.0", 4.0), ("0.9.0", 2.0)):
        written(tmp_path, version, rate)
    page = benchmarks.page(tmp_path)
    assert "| measured | figure | 0.9.0 | 0.10.0 | |" in page
    assert "| fast, 2 threads | Gpx-steps/s | 2 | 4 | <svg" in page and "| x numpy | 20 | 40 | <svg" in page
    assert "| from |" not in page and "- 0.9.0: made up 0.9.0" in page
    assert page.count("<circle") == 4


def test_figures_have_three_digits_and_no_exponent() -> None:
    assert [benchmarks.three_digits(v) for v in (12_260.0, 0.003891, 155.4)] == ["12 300", "0.00389", "155"]


def test_points_lie_as_their_values_do() -> None:
    drawn = benchmarks.drawing([1.0, None, 2.0])
    assert 'cx="5.0" cy="14.0"' in drawn and 'cx="115.0" cy="5.0"' in drawn
    assert benchmarks.drawing([1.0]) == ""


def test_without_a_file_the_page_says_so(tmp_path: Path) -> None:
    assert benchmarks.page(tmp_path) == "No version has been measured yet.\n"
