"""The blind trial end to end, with the real diagnosis, on two tiny cases."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from importlib import import_module

import pytest

from benchmarks.blind_trial import BlindTrial
from tests.hidden_world import trial
from tests.hidden_world.trial import chosen

SHAPE, FRAMES = (16, 16), 1000
CANDIDATES, TWINS = ("dead_time", "vignetting"), 6
"""Of the diagnosis, so that it is quick: it has a bound to find of each where nothing is hidden."""


@pytest.mark.slow
def test_trial_runs_the_real_diagnosis_and_scores_it(tmp_path, monkeypatch, capsys):
    """A camera with nothing hidden and a strong effect; the test checks that it works, not how well."""

    def tiny(*options):
        return [replace(c, recipe=replace(c.recipe, shape=SHAPE, frames=FRAMES)) for c in chosen(*options)]

    real = import_module("spikecam_env.gap.diagnose")
    monkeypatch.setattr(real, "diagnose", partial(real.diagnose, candidates=CANDIDATES, twin_count=TWINS))
    monkeypatch.setattr(trial, "chosen", tiny)
    BlindTrial(tmp_path, set="quick", part="tune", only=["none", "tricky"], limit=1).run()
    printed = capsys.readouterr().out
    print(printed)
    results = [json.loads(p.read_text()) for p in sorted((tmp_path / "results").glob("*.json"))]
    assert len(results) == 2
    for result in results:
        assert "error" not in result, result.get("error")
        assert result["diagnosis"]["format"] == "spikecam-diagnosis/1"
        made = {p.name for p in (tmp_path / "diagnoses" / result["id"]).iterdir()}
        assert made == {"diagnosis.json", "model.toml", "report.html"}
    scores = json.loads((tmp_path / "trial.json").read_text())
    assert (scores["cases"], scores["of"], scores["errors"]) == (2, 2, 0)
    assert "false alarms, nothing hidden" in printed and (tmp_path / "trial.md").is_file()
    verdicts = {s["group"]: s["answer"] for s in scores["scored"]}
    print(verdicts)
    assert set(verdicts) == {"none", "tricky"}
