"""A diagnosis from files to verdict, on small campaigns."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small import DESIGN, MODEL, SHAPE, effect

from spikecam_env.cli.diagnose import summary
from spikecam_env.errors import InputError
from spikecam_env.gap import Bars, Flat, Step, read_campaign, write_campaign
from spikecam_env.gap.diagnose import diagnose, read_case
from spikecam_env.gap.report.page import report
from spikecam_env.gap.report.reproduce import command_of
from spikecam_env.gap.result import VERDICTS, Diagnosis, Note
from spikecam_env.sensor import SensorModel

pytestmark = pytest.mark.slow

LAG = effect("photodiode_lag", fraction=0.08, tau_us=1000.0)
ONLY = ("photodiode_lag", "incomplete_reset")
MOVED = ("photodiode_lag", "readout_skew", "optical_blur", "blooming")
BOUNDED = ("vignetting", "spurious_spikes")
"""Candidates where nothing is found, and each is simulated for its bound; the alarm asks for none.  One acts on the
light, one has no light in it; other bounds are found in the same way (`verdict/test_bounds.py`)."""
FRAMES = 1000
FEW = 6
"""Twins, to be quick."""
KEYS = {
    "format": str, "verdict": str, "degree": (str, type(None)), "sentence": str, "effects": list, "stand_ins": list,
    "unknown": (dict, type(None)), "class": (dict, type(None)), "remainder": (dict, type(None)), "parameters": dict,
    "data": list,
    "gap": (dict, type(None)), "discrepancies": list, "not_testable": list, "bounds": list, "not_bounded": list,
    "motion": list, "static_share": float, "ranking": list,
    "model": str, "effect_files": list, "campaign": str,
    "seed": int, "simulated": int, "stages_s": dict, "elapsed_s": float,
}  # fmt: skip


def asked(campaign, model="scsim", **options) -> Diagnosis:
    found = diagnose(campaign, model, **{"twin_count": FEW, "progress": False, **options})
    print(found.verdict, [(e.name, e.parameters) for e in found.effects], found.sentence)
    return found


def written(folder: Path, model: SensorModel, recordings=DESIGN):
    return write_campaign(folder, model, shape=SHAPE, frames=FRAMES, recordings=recordings, seed=4)


@pytest.fixture(scope="module")
def lagging(tmp_path_factory):
    return written(tmp_path_factory.mktemp("lagging"), MODEL.with_effect(LAG))


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    return written(tmp_path_factory.mktemp("clean"), MODEL)


@pytest.fixture(scope="module")
def named(lagging) -> Diagnosis:
    return asked(lagging)


@pytest.fixture(scope="module")
def nothing(clean) -> Diagnosis:
    return asked(clean, candidates=BOUNDED, bounds="simulated")


@pytest.fixture(scope="module")
def quick(clean) -> Diagnosis:
    return asked(clean, candidates=(*BOUNDED, "photodiode_lag"))


@pytest.fixture(scope="module")
def only(lagging) -> Diagnosis:
    return asked(lagging, candidates=ONLY)


def relabelled(campaign, name: str, factor: float, folder: Path):
    """The campaign with one label multiplied, its files beside."""
    folder.mkdir()
    for path in campaign.folder.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    entry = next(r for r in campaign.recordings if r.name == name)
    with np.load(campaign.folder / f"{entry.name}.npz") as light:
        changed = {"frame": light["frame"], "radiance": (light["radiance"] * factor).astype(np.float32)}
    np.savez(folder / f"{entry.name}.npz", **changed)
    return read_campaign(folder)


def test_a_strong_effect_is_named_with_its_parameters(named):
    """Within 15 % of the strength: the time constant, which goes with it, is one of a factor of two here."""
    assert named.verdict == "named"
    (found,) = named.effects
    assert found.name == "photodiode_lag" and found.family == "lag" and found.confidence > 0.5
    assert found.parameters["fraction"].value == pytest.approx(0.08, rel=0.15)
    assert 500 < found.parameters["tau_us"].value < 2000


def test_the_patched_model_holds_what_was_named_and_loads_back(named, tmp_path):
    named.write(tmp_path)
    model = SensorModel.load(tmp_path / "model.toml")
    assert {e.name for e in model.effects} == {e.name for e in MODEL.effects} | {"photodiode_lag"}
    patched = next(e for e in model.effects if e.name == "photodiode_lag")
    assert patched.fraction == pytest.approx(named.effects[0].parameters["fraction"].value)


def test_nothing_is_found_where_nothing_is_missing(nothing):
    assert nothing.verdict == "none"
    assert nothing.effects == () and nothing.ranking == () and nothing.unknown is None
    assert nothing.patched == MODEL


def test_the_gap_of_nothing_is_chance(nothing):
    """Mean square of about 50 held-out statistics of one flat, some on a floor: 1 -+ 3 sqrt(2 / 20), or less."""
    print(nothing.gap)
    assert nothing.gap.before < 1 + 3 * np.sqrt(2 / 20)
    assert nothing.gap.before == nothing.gap.after


def test_bounds_are_simulated_on_request_only(clean, nothing, quick):
    """Without them the answer is the same, costs no twin more than the null model's, and says how to have them."""
    print(quick.simulated, nothing.simulated)
    assert quick.verdict == nothing.verdict == "none" and quick.sentence == nothing.sentence
    assert quick.simulated == FEW * len(DESIGN) + FEW * sum(isinstance(p, (Step, Bars)) for p in DESIGN)
    assert quick.simulated < nothing.simulated
    assert nothing.bounds and not any("--bounds" in note for note in nothing.data)
    assert "--bounds" in summary(quick) and "--bounds" not in summary(nothing)
    assert f"{command_of(quick)} --bounds simulated" in report(quick)
    assert command_of(nothing).endswith("--bounds simulated") and "--bounds" not in command_of(quick)


def test_every_effect_that_is_not_found_has_a_bound_by_linear_response(quick, nothing, tmp_path):
    """Its kind is marked in the file, on the page and in the terminal."""
    quick.write(tmp_path)
    said = json.loads((tmp_path / "diagnosis.json").read_text())
    assert {b["name"]: b["kind"] for b in said["bounds"]} == dict.fromkeys((*BOUNDED, "photodiode_lag"), "linear")
    assert said["not_bounded"] == [] and any("linear response" in note for note in said["data"])
    assert {b.kind for b in nothing.bounds} == {"simulated"}
    for shown in (report, summary):
        assert "at most (95 %, by linear response)" in shown(quick) and "at most (95 %, simulated)" in shown(nothing)


def test_bounds_may_be_left_out(clean, quick):
    """The rest of the answer is the same."""
    without = asked(clean, candidates=quick.candidates, bounds="none")
    assert without.bounds == () == without.not_bounded and "bounds" not in without.stages
    assert without.sentence == quick.sentence and command_of(without) == f"{command_of(quick)} --bounds none"
    assert any("left out" in note for note in without.data) and "at most (95 %" not in report(without)


@pytest.mark.parametrize("kind", [True, "exact", None])
def test_an_unknown_kind_of_bounds_is_refused_in_one_line(kind, clean):
    with pytest.raises(
        InputError, match=r"unknown kind of bounds .*; choose one of linear, none, simulated"
    ) as refused:
        asked(clean, bounds=kind)
    assert "\n" not in str(refused.value)


def test_a_wrong_label_is_the_datas_fault(clean, tmp_path):
    found = asked(relabelled(clean, "flat-0.2", 1.02, tmp_path / "wrong"))
    assert found.verdict == "data"
    assert len(found.data) == 1 and found.data[0].startswith("flat-0.2")
    assert found.to_json()["data"] == list(found.data)


def test_an_effect_in_held_out_motion_alone_is_found_and_its_gap_is_no_check(tmp_path):
    design = [r for r in DESIGN if not isinstance(r, (Step, Bars))] + [Bars(high=1.4, period=16.0, use="holdout")]
    found = asked(written(tmp_path / "held", MODEL.with_effect(LAG), design), candidates=ONLY)
    assert found.verdict == "named" and [e.name for e in found.effects] == ["photodiode_lag"]
    assert found.effects[0].parameters["fraction"].value == pytest.approx(0.08, rel=0.15)
    assert Note.ONLY_HELD_OUT_DISAGREE in found.data and "which were fitted too" in found.sentence


def test_an_effect_in_held_out_motion_alone_is_found_beside_one_of_the_others(tmp_path):
    design = [r for r in DESIGN if not isinstance(r, (Step, Bars))] + [Bars(high=1.4, period=16.0, use="holdout")]
    both = MODEL.with_effect(LAG).with_effect(effect("dead_time", tau_us=0.5))
    found = asked(written(tmp_path / "held", both, design), candidates=("dead_time", ONLY[0]))
    assert found.verdict == "named" and [e.name for e in found.effects] == ["dead_time", "photodiode_lag"]
    assert found.effects[1].parameters["fraction"].value == pytest.approx(0.08, rel=0.15)
    assert Note.ONLY_HELD_OUT_DISAGREE in found.data


def test_a_parameter_that_is_off_is_set_and_shrinks_the_gap(tmp_path):
    noisy = written(tmp_path / "noisy", MODEL.with_effect(effect("reset_noise", sigma_mV=19.1)))
    found = asked(noisy, candidates=BOUNDED[:1], bounds="simulated")
    assert {b.name for b in found.bounds} == set(BOUNDED[:1])
    assert found.verdict == "parameter" and list(found.parameters) == ["reset_noise"]
    row = found.parameters["reset_noise"]
    assert row["measured"] == pytest.approx(19.1, rel=0.1) and row["nominal"] == 6.36
    assert row["ratio"] == pytest.approx(row["measured"] / row["nominal"])
    assert next(e for e in found.patched.effects if e.name == "reset_noise").sigma_mV == row["measured"]
    assert found.gap is not None and found.gap.removed > 0.9


@pytest.mark.parametrize("which", ["named", "nothing"])
def test_json_has_the_documented_entries(which, request, tmp_path):
    diagnosis = request.getfixturevalue(which)
    diagnosis.write(tmp_path)
    said = json.loads((tmp_path / "diagnosis.json").read_text())
    assert list(said) == list(KEYS)
    assert all(isinstance(said[k], kind) for k, kind in KEYS.items())
    assert said["format"] == "spikecam-diagnosis/1" and said["verdict"] in VERDICTS
    assert said["elapsed_s"] == pytest.approx(sum(said["stages_s"].values()))
    assert set(said["gap"]) == {"before", "after", "floor", "removed", "by_recording"}
    for e in said["effects"]:
        assert {"name", "family", "confidence", "parameters", "alternatives"} <= set(e)
        assert all(set(p) == {"value", "sd", "interval"} for p in e["parameters"].values())
        assert all({"name", "confidence"} <= set(a) <= {"name", "confidence", "removed"} for a in e["alternatives"])
        assert not e["alternatives"] or "removed" in e["alternatives"][0], "the best of them was confirmed"
    for d in said["discrepancies"]:
        assert set(d) == {"statistic", "group", "recordings", "z", "p_adjusted"} and d["p_adjusted"] < 0.05
    z = [abs(d["z"]) for d in said["discrepancies"]]
    assert z == sorted(z, reverse=True)
    assert all(set(n) == {"name", "needs"} for n in said["not_testable"])


def test_the_same_seed_gives_the_same_answer_by_any_number_of_threads(lagging, only):
    again = asked(lagging, candidates=ONLY, jobs=2)
    assert again.to_json() | {"stages_s": 0, "elapsed_s": 0} == only.to_json() | {"stages_s": 0, "elapsed_s": 0}


def test_simulated_recordings_are_counted(only, nothing):
    assert min(only.simulated, nothing.simulated) >= FEW * len(DESIGN)
    assert not any("Skipped" in note for note in only.data), "the default is enough for one effect"
    assert "--effort" not in command_of(only)
    assert command_of(replace(only, effort=5.0)).endswith("--effort 5")


def test_labels_in_another_unit_change_no_bound_and_the_page_says_so(clean, nothing, tmp_path):
    """Light labelled in thousandths: a bound without light in it is the same to the rounding of light."""
    folder = tmp_path / "thousandths"
    shutil.copytree(clean.folder, folder)
    for recording in clean.recordings:
        with np.load(folder / f"{recording.name}.npz") as light:
            labels = {"frame": light["frame"], "radiance": light["radiance"] * np.float32(1000)}
        np.savez(folder / f"{recording.name}.npz", **labels)
    found = asked(folder, candidates=BOUNDED, bounds="simulated")
    assert found.verdict == nothing.verdict and found.not_testable == nothing.not_testable
    assert [b.name for b in found.bounds] == [b.name for b in nothing.bounds] == sorted(BOUNDED)
    for one, other in zip(found.bounds, nothing.bounds, strict=True):
        print(one, other)
        assert one.below == pytest.approx(other.below, rel=1e-3)
    (said,) = [note for note in found.data if "labels are in another unit" in note]
    factor = float(re.search(r"gain is (\S+) of nominal", said)[1])
    assert factor == pytest.approx(1e-3, rel=0.2)
    assert (
        "gain is" in report(replace(found, evidence=None))
        and "gain is" in summary(found)
        and "gain is" not in summary(nothing)
    )


def test_no_effort_is_refused(clean):
    with pytest.raises(InputError, match="effort = 0"):
        asked(clean, effort=0)


def test_a_name_that_is_excluded_is_not_named(lagging):
    found = asked(lagging, candidates=ONLY, exclude=["photodiode_lag"])
    names = {e.name for e in found.effects} | {r.name for r in found.ranking}
    names |= {n for n, _ in found.not_testable} | set((found.class_ or {}).get("members", ()))
    print(names)
    assert "photodiode_lag" not in names
    assert found.verdict == "unknown" and found.exclude == ("photodiode_lag",)


def test_only_candidates_are_tried(only):
    assert {r.name for r in only.ranking} <= set(ONLY)
    assert [e.name for e in only.effects] == ["photodiode_lag"] and only.candidates == ONLY


def test_effects_that_a_campaign_cannot_show_are_listed_with_their_needs(tmp_path):
    still = tuple(p for p in DESIGN if not isinstance(p, Step | Bars))
    found = asked(written(tmp_path, MODEL, still), candidates=(*MOVED, "vignetting"), bounds="simulated")
    needs = dict(found.not_testable)
    print(needs)
    assert found.verdict == "none" and [b.name for b in found.bounds] == ["vignetting"]
    for name in MOVED:
        assert name in needs and needs[name].startswith("a recording with")


def test_a_campaign_without_holdout_is_diagnosed(clean, tmp_path):
    found = asked(written(tmp_path, MODEL, tuple(p for p in DESIGN if p.use == "fit")), candidates=["vignetting"])
    assert found.verdict == "none"


def test_unknown_names_are_errors_that_say_so(clean):
    for option in ("candidates", "exclude"):
        with pytest.raises(InputError, match="'dead_tim'"):
            asked(clean, **{option: ["dead_tim"]})
    with pytest.raises(InputError, match="'scs'"):
        asked(clean, "scs")


def test_a_folder_that_is_no_campaign_is_an_error(tmp_path):
    with pytest.raises(InputError, match="no campaign"):
        asked(tmp_path)


def test_too_few_static_recordings_are_an_error(tmp_path):
    campaign = written(tmp_path, MODEL, (Flat(radiance=0.2), Step()))
    with pytest.raises(InputError, match="fewer than two static recordings"):
        asked(campaign)


def test_another_voltage_than_most_is_left_out(clean):
    odd = replace(clean.recordings[2], v_d=0.7)
    case = read_case(replace(clean, recordings=(*clean.recordings[:2], odd, *clean.recordings[3:])))
    assert [c.name for c in case.conditions] == [r.name for r in clean.recordings if r.name != odd.name]
