"""The report of a diagnosis: whole, self-contained, true to the diagnosis, readable on narrow screens."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import lru_cache
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import made_up
import numpy as np
import pytest
from in_browser import BROWSER, laid_out
from matplotlib.backends.backend_agg import FigureCanvasAgg

from spikecam_env.code_version import code_version
from spikecam_env.gap.report import plots
from spikecam_env.gap.report.exhibits import Exhibit, by_z, exhibits
from spikecam_env.gap.report.exhibits.spectrum import averaged, panels
from spikecam_env.gap.report.page import report, write_report
from spikecam_env.gap.report.panels import PlotPanel
from spikecam_env.gap.report.plots import strip
from spikecam_env.gap.report.quantities import at_most
from spikecam_env.gap.report.reproduce import MADE_BY, command_of
from spikecam_env.gap.report.words import group_meaning
from spikecam_env.gap.result import LABELLED_LIGHT, NOMINAL_LIGHT, VERDICTS, Evidence
from spikecam_env.sensor import SensorModel
from spikecam_env.version import __version__

VOID = {"meta", "img", "br", "link"}
ALWAYS = {"meaning", "evidence", "statistics", "not-testable", "model", "reproduce"}
SECTIONS = {
    "none": ALWAYS | {"gap"},
    "named": ALWAYS | {"gap", "candidates"},
    "class": ALWAYS | {"gap", "candidates"},
    "unknown": ALWAYS | {"gap", "candidates"},
    "parameter": ALWAYS | {"gap"},
    "data": ALWAYS,
}
OPENINGS = {
    "none": "no statistic differs",
    "named": "Confidence in the name: 97 %",
    "class": "The experiment that separates them",
    "unknown": "it claims no physics",
    "parameter": "has another strength in this camera",
    "data": "Correct the following and diagnose again",
}


class Page(HTMLParser):
    """Structure of a page; fails on tags that do not nest."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag) -> None:
        assert self.open and self.open[-1] == tag, (tag, self.open)
        self.open.pop()

    def handle_data(self, data) -> None:
        if self.open and self.open[-1] != "style":
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())

    def of(self, tag: str) -> list[dict[str, str | None]]:
        return [attrs for name, attrs in self.tags if name == tag]


@lru_cache
def written(verdict: str) -> str:
    return report(made_up.EVERY[verdict]())


def test_there_is_a_made_up_diagnosis_of_every_verdict() -> None:
    assert set(made_up.EVERY) == set(VERDICTS) == set(SECTIONS)


@pytest.mark.slow
@pytest.mark.parametrize("verdict", VERDICTS)
def test_a_page_nests_opens_by_its_verdict_and_has_its_sections(verdict: str) -> None:
    page = Page(written(verdict))
    sections = {attrs["id"] for attrs in page.of("section")}
    assert sections == SECTIONS[verdict]
    assert {attrs["href"] for attrs in page.of("a")} == {f"#{s}" for s in sections}
    assert len(page.of("h1")) == 1 and made_up.EVERY[verdict]().sentence in page.text
    assert OPENINGS[verdict] in page.text
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    assert len(ids) == len(set(ids))


@pytest.mark.parametrize("verdict", VERDICTS)
def test_a_page_fetches_nothing_runs_nothing_and_is_small(verdict: str) -> None:
    text = written(verdict)
    page = Page(text)
    print(f"{verdict}: {len(text) / 1e6:.2f} MB, {len(page.of('img'))} pictures")
    assert len(text) < 3e6
    assert all(attrs["src"].startswith("data:image/") and attrs["alt"] for attrs in page.of("img"))
    assert not page.of("script") and not page.of("link")
    assert not re.search(r"https?://|url\(|@import", text)


def test_a_page_says_what_a_name_leaves() -> None:
    page = Page(report(replace(made_up.with_remainder(), evidence=None))).text
    assert "Effect named: explains nearly all" in page and "Largest deviation, in noise" in page
    assert "8.1 (step: up 16-32)" in page and "step 86 %; moving 14 %" in page and "step, bars" in page
    assert "Largest deviation, in noise" not in Page(written("named")).text


def test_the_page_says_what_the_diagnosis_says() -> None:
    d = made_up.named()
    text = Page(written("named")).text
    for said in ("6.12 ± 0.12 %", "1.224 ± 0.024 ms", "5.93 … 6.32 %", "97 % of the gap is removed", "bars-fast",
                 command_of(d), "Seed 7", "incomplete reset", "leaves 11 sd in the step response"):  # fmt: skip
        assert said in text
    assert " ".join(d.patched.toml().split()) in text
    for _, needs in d.not_testable:
        assert needs in text
    for stage in d.stages:
        assert stage in text


def test_nothing_found_shows_its_upper_bounds_and_unknown_its_structure() -> None:
    none = Page(written("none")).text
    for b in made_up.none().bounds:
        assert f"< {at_most(b)}" in none
    assert (
        "modulation (frequency 2000 Hz)" in none
        and "These recordings give no bound" in none
        and "longer recordings" in none
    )
    unknown = Page(written("unknown")).text
    assert "Grows with the level to the power of 1.02" in unknown
    assert "Depends on earlier spikes not seen" in unknown


def test_the_same_diagnosis_gives_the_same_bytes() -> None:
    """Of four recordings: those in motion are drawn by the same functions."""
    assert report(made_up.parameter()) == written("parameter")


def test_text_of_a_campaign_cannot_become_markup(tmp_path: Path) -> None:
    d = replace(made_up.data(), campaign="<script>x</script>", data=("flat <b>&amp;",), evidence=None)
    write_report(d, tmp_path / "report.html")
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert not page.of("script") and not page.of("b")
    assert "<script>x</script>" in page.text and "flat <b>&amp;" in page.text


@pytest.mark.parametrize(
    "effect, loud", [("photodiode_lag", "step"), ("dead_time", "rates"), ("light_flicker", "spectrum")]
)
def test_the_exhibit_of_an_effect_is_among_the_first_and_the_patch_closes_it(effect: str, loud: str) -> None:
    d = made_up.named(effect)
    made = {e.name: e for e in exhibits(d.evidence, 40_000.0)}
    first = by_z(list(made.values()), d.statistics)[0][:2]
    assert loud in [e.name for e in first]
    panel = max(made[loud].panels, key=lambda p: p.z)
    with np.errstate(divide="ignore", invalid="ignore"):
        left = np.abs(panel.measured - panel.after) / panel.sd
    print(f"{effect}: {panel.title}: z {panel.z:.1f} before, median {np.nanmedian(left):.2f} after")
    assert panel.z > 4.5
    assert np.nanmedian(left) < 2


def test_without_a_gap_the_panels_stay_within_their_bands() -> None:
    d = made_up.none()
    z = np.concatenate(
        [
            ((p.measured - p.before) / p.sd)[np.isfinite((p.measured - p.before) / p.sd) & (p.sd > 0)]
            for e in exhibits(d.evidence, 40_000.0)
            for p in e.panels
            if "y" not in p.log
        ]
    )
    print(f"{z.size} points: rms z {np.sqrt(np.mean(z**2)):.2f}, outside the band {np.mean(np.abs(z) > 2):.1%}")
    # The recordings furthest off are the ones drawn, so that somewhat more than 4.6 % are outside.
    assert np.mean(np.abs(z) > 2) < 0.12


def test_recordings_without_spikes_or_labels_leave_out_what_they_cannot_show() -> None:
    d = made_up.named("dead_time")
    e = unlabelled(d.evidence, "flat-200")
    assert {x.name for x in exhibits(e, 40_000.0)} - {"clock"} == {x.name for x in exhibits(d.evidence, 40_000.0)}
    only_rates = (None,) * len(e.conditions)
    e = replace(e, measured=only_rates, before=only_rates, after=only_rates, again=None)
    left = exhibits(e, 40_000.0)
    print([(x.name, [p.title for p in x.panels]) for x in left])
    assert {x.name for x in left} == {"rates", "pattern"}
    Page(report(replace(d, evidence=e)))


def test_the_spectrum_of_independent_spikes_is_flat_at_one() -> None:
    counts = np.random.default_rng(0).poisson(50, 20_000).astype(np.int32)
    frequency, power, count = averaged(counts, 40_000.0)
    z = (power - 1) * np.sqrt(count)
    print(f"mean power {np.average(power, weights=count):.3f}, rms z {np.sqrt(np.mean(z**2)):.2f}")
    assert abs(np.average(power, weights=count) - 1) < 0.05
    assert np.sqrt(np.mean(z**2)) < 1.4
    assert frequency[-1] <= 20_000


def test_a_model_that_is_silent_in_the_dark_has_a_spectrum_to_draw() -> None:
    """Power 0 beside measured power: no infinite band of noise, no warning."""
    seen = made_up.evidence(None)
    silent = tuple(
        replace(o, frame=np.zeros_like(o.frame)) if c.kind == "dark" else o
        for c, o in zip(seen.conditions, seen.before, strict=True)
    )
    drawn = list(panels(replace(seen, before=silent), 40_000.0))
    assert [p.title for p in drawn if "dark" in p.title]
    for p in drawn:
        assert np.isfinite(p.sd).all() and np.isfinite(p.before).all(), p.title


@pytest.mark.parametrize("z, shown", [(3.0, False), (6.0, True)])
def test_exhibits_that_differ_by_four_standard_deviations_are_shown(z: float, shown: bool) -> None:
    quiet = replace(made_up.named().statistics[0], group="rates", z=z)
    first, folded = by_z([Exhibit("rates", "Rates", "", ())], [quiet])
    assert (len(first), len(folded)) == ((1, 0) if shown else (0, 1))


def test_light_that_was_counted_anew_has_its_own_name_on_the_axes() -> None:
    labelled = made_up.evidence("dead_time")
    for seen, name in ((labelled, LABELLED_LIGHT), (replace(labelled, light=NOMINAL_LIGHT), NOMINAL_LIGHT)):
        axes = {p.xlabel for e in exhibits(seen, 40_000.0) for p in e.panels if p.xlabel.startswith("radiance")}
        assert axes == {name}


def unlabelled(evidence: Evidence, name: str) -> Evidence:
    """The evidence with one flat of unknown light, which the refit leaves out."""
    shown = tuple(replace(c, kind="unknown", level=np.nan, light=None) if c.name == name else c
                  for c in evidence.conditions)  # fmt: skip
    kept = evidence.free_refit, evidence.before_base, evidence.after_base
    bases = [replace(b, residual=b.residual[:5]) for b in kept if b is not None]
    return replace(evidence, conditions=shown, free_refit=bases[0], before_base=bases[1], after_base=bases[2])


def test_every_axis_says_its_unit() -> None:
    d = made_up.named()
    made = exhibits(unlabelled(d.evidence, "flat-200"), 40_000.0)
    assert {e.name for e in made} >= {"clock", "moving", "step", "pattern"}
    labels = [label for e in made for p in e.panels for label in (p.ylabel, *([] if p.labels else [p.xlabel]))]
    drawn = [strip(d.statistics), plots.gap_bars(d.gap, list(d.gap.by_recording))]
    labels += [figure.axes[0].get_xlabel() for figure in (*drawn, plots.rungs(["a"], [2.0], [{"rates": 1.0}]))]
    labels += [plots.pixel_map(m.measured, "", (0.0, 1.0), m.unit).axes[1].get_ylabel() for e in made for m in e.maps]
    assert not [label for label in labels if not re.search(r"\[[^]]+\]", label)]


def test_numbers_under_a_panel_of_names_do_not_touch() -> None:
    """Correlations of -0.51 that differ in the fourth digit."""
    x = np.arange(2.0)
    values = np.array([-0.5128, -0.5127])
    figure = plots.panel(
        PlotPanel("", "", "[1]", x, values, values, None, np.full(2, 1.5e-4), labels=("wall", "held out"))
    )
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    low, high = figure.axes[0].get_xlim()
    boxes = [
        t.get_window_extent(renderer) for t in figure.axes[0].get_xticklabels() if low <= t.get_position()[0] <= high
    ]
    assert len(boxes) > 2 and all(a.x1 < b.x0 for a, b in pairwise(boxes))


def test_candidates_stand_in_the_steps_of_the_search() -> None:
    """An accepted candidate of the first step leaves more than rejected ones of the second, which are added to it."""
    d = made_up.named()
    (first, *_) = d.ranking
    later = replace(first, name="optical_blur", misfit_before=3.0, misfit=0.5, accepted=False, reason="")
    d = replace(d, ranking=(*d.ranking, later), evidence=None)
    text = Page(report(d)).text
    assert re.search(r"Step 1: the model as given \(misfit 6.3\).*Step 2: with photodiode lag \(misfit 3\)", text)
    patched = report(replace(d, verdict="unknown", effects=(), unknown={}))
    assert "in the patch: passes the gate" in patched and "accepted: " not in patched


def test_what_a_group_of_statistics_looks_at_is_said_under_the_largest_differences() -> None:
    assert group_meaning("rows") == "Noise that rows or columns have in common, in steady light."
    assert group_meaning("none of these") == ""
    assert group_meaning("step") in Page(written("named")).text


def test_a_page_says_the_code_that_made_it_and_how_the_campaign_was_made() -> None:
    version = f"spikecam-env {__version__}, code {code_version(*MADE_BY)}"
    assert Page(written("named")).text.count(version) == 2
    assert "spikecam campaign import here there" in report(
        replace(made_up.none(), evidence=None), "spikecam campaign import here there"
    )


def test_groups_as_far_off_as_each_other_are_drawn_in_the_order_of_the_statistics() -> None:
    """Deviates end at 40, where several groups may be: an order of chance would draw another page in every process."""
    first = made_up.named().statistics[0]
    names = [f"group {n}" for n in range(8)]
    figure = strip([replace(first, group=name, z=40.0) for name in names])
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == names


def test_written_files_are_whole_and_the_model_loads_back(tmp_path: Path) -> None:
    d = replace(made_up.named(), evidence=None)
    d.write(tmp_path)
    write_report(d, tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == report(d)
    assert {p.name for p in tmp_path.iterdir()} == {"diagnosis.json", "model.toml", "report.html"}
    assert SensorModel.from_toml(tmp_path / "model.toml") == d.patched


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_no_page_scrolls_sideways_at_400_pixels(tmp_path: Path) -> None:
    """All details open, one page of each verdict."""
    for verdict in VERDICTS:
        (tmp_path / f"{verdict}.html").write_text(written(verdict).replace("<details>", "<details open>"), "utf-8")
    laid = laid_out(tmp_path, (400,))
    if not laid:
        pytest.skip("Chromium did not render")
    assert {page.page for page in laid} == {f"{verdict}.html" for verdict in VERDICTS}
    assert not [(page.page, page.page_width, page.cut) for page in laid if page.page_width > 400 or page.cut]
