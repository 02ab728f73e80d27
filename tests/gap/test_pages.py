"""Committed diagnoses: the figures in the docs are theirs, and they are by today's code.

python -m tools.pages makes them anew.
"""

from __future__ import annotations

import re
from dataclasses import replace

import made_up
import pytest

from spikecam_env.errors import InputError
from spikecam_env.gap.report.quantities import number, quantity
from spikecam_env.gap.report.sentence import gap_line, heading
from spikecam_env.gap.report.words import human, parameter_unit
from spikecam_env.gap.result import VERDICTS
from tools import pages
from tools.figure_blocks import diagnosis_block, filled, short_block
from tools.real_recordings import REAL
from tools.stated_diagnosis import StatedDiagnosis

PLACES = {
    "docs/real_data.md": {"wall", "maps"},
    "docs/gap.md": {"ladder"},
    "docs/results/diagnosis.md": {"wall, short", "maps, short", "ladder, short"},
}
ANEW = "run: make pages"


def test_figures_in_the_docs_are_those_of_the_pages() -> None:
    blocks = pages.all_blocks()
    for path in pages.documents():
        text = path.read_text(encoding="utf-8")
        assert filled(text, blocks) == text, f"{path.name}: {ANEW}"


def test_every_block_of_figures_has_its_place() -> None:
    texts = {p.relative_to(pages.REPOSITORY).as_posix(): p.read_text(encoding="utf-8") for p in pages.documents()}
    found = {page: set(re.findall("<!-- figures: (.*?) -->", text)) for page, text in texts.items()}
    assert found == PLACES and set().union(*PLACES.values()) == set(pages.all_blocks())


@pytest.mark.parametrize("page", pages.PAGES, ids=lambda page: page.name)
def test_every_block_says_the_version_of_its_page(page) -> None:
    version = page.stated()["version"] if page.name == "ladder" else StatedDiagnosis.read(page.page).version
    assert re.fullmatch(r"spikecam-env \S+, code [0-9a-f]{12}", version), ANEW
    assert page.name == "ladder" or version in page.page.read_text(encoding="utf-8")
    assert all(version in block for block in page.blocks().values())


@pytest.mark.skipif(not REAL.is_dir(), reason="without the real recordings pages cannot be made anew")
@pytest.mark.parametrize("page", pages.PAGES, ids=lambda page: page.name)
def test_the_pages_are_by_today_s_code(page) -> None:
    assert page.is_fresh(), f"the code that makes the page {page.name} has changed since; {ANEW}"


def test_a_block_is_written_between_its_markers_and_nothing_else_changes() -> None:
    text = "before\n<!-- figures: one -->\nold\n<!-- end of figures -->\nafter"
    once = filled(text, {"one": "new"})
    assert once == "before\n<!-- figures: one -->\n\nnew\n\n<!-- end of figures -->\nafter"
    assert filled(once, {"one": "new"}) == once


def test_a_block_that_nobody_writes_and_one_without_an_end_are_errors() -> None:
    with pytest.raises(InputError, match=r"'won'.*one"):
        filled("<!-- figures: won -->\n<!-- end of figures -->", {"one": ""})
    with pytest.raises(InputError, match="does not end"):
        filled("<!-- figures: one -->\n", {"one": ""})


@pytest.mark.parametrize("verdict", VERDICTS)
def test_a_diagnosis_of_every_verdict_gives_its_figures(verdict: str, tmp_path) -> None:
    """Read from the files beside its page."""
    made = StatedDiagnosis.of(made_up.EVERY[verdict](), "spikecam campaign import")
    made.write(tmp_path / "page.html")
    stated = StatedDiagnosis.read(tmp_path / "page.html")
    d = stated.diagnosis
    assert d == replace(made.diagnosis, evidence=None, motion=(), stages={})
    whole, short = diagnosis_block(stated), short_block(stated)
    for block in (whole, short):
        assert d.sentence in block and heading(d) in block and stated.version in block and stated.about in block
        assert d.gap is None or gap_line(d.gap) in block
    for r in d.ranking:
        assert f"| {human(r.name)} | {number(r.misfit)} |" in whole and r.reason in whole
    for e in d.effects:
        for name, estimate in e.parameters.items():
            assert quantity(estimate.value, parameter_unit(e.name, name), estimate.sd) in whole
    assert "spikecam campaign import" in whole and all(note in whole for note in d.data)
    assert (d.class_ or {}).get("experiment", "") in whole


def test_a_page_whose_recording_is_missing_is_kept_and_the_command_says_why(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(pages.RealPage, "is_fresh", lambda _: False)
    monkeypatch.setattr(pages, "write_blocks", lambda: None)
    before = pages.WALL.page.stat().st_mtime_ns
    pages.main(data=tmp_path, only=("wall",))
    assert f"there is no {tmp_path / 'wall.npz'}" in capsys.readouterr().out
    assert pages.WALL.page.stat().st_mtime_ns == before


def test_a_page_that_does_not_exist_is_not_looked_for() -> None:
    with pytest.raises(InputError, match=r"'wal'.*wall"):
        pages.main(only=("wal",))
