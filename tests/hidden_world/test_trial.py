"""The trial: cases, seals, scores, a run that goes on where it stopped."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from typing import Any

import pytest

from benchmarks.blind_trial import BlindTrial, run
from spikecam_env.errors import InputError
from spikecam_env.gap.candidates.table import candidate
from tests.hidden_world import trial
from tests.hidden_world.cases import PARTS, SAME_TO_THE_EYE, SETS, Case, cases
from tests.hidden_world.catalogue import BASE_EFFECTS, CATALOGUE
from tests.hidden_world.keys import BrokenSealError, key_text, open_key, seal
from tests.hidden_world.mechanism import Hidden, limits, with_less_data
from tests.hidden_world.outside import REPORT, TUNE
from tests.hidden_world.record import in_short, pack, unpack
from tests.hidden_world.score import (
    FAMILIES,
    binomial_90,
    by_category,
    by_degree,
    family_of,
    figures,
    is_covered,
    score_case,
)
from tests.hidden_world.trial import as_text, chosen, code, is_done, run_trial, score_trial

FULL = {part: cases("full", part) for part in PARTS}
LAWS = {part: cases("laws", part) for part in PARTS}
SMALL = {part: cases("small", part) for part in PARTS}
TITLE = {"set": "full", "part": "tune"}


def small(case: Case) -> Case:
    return replace(case, recipe=replace(case.recipe, shape=(8, 8), frames=64))


def key_of(case: Case) -> dict[str, Any]:
    return json.loads(key_text(case))


def case_of(group: str, what: str = "", part: str = "tune") -> Case:
    return next(c for c in FULL[part] if c.group == group and what in c.what)


def answered(case: Case, verdict: str, *names: str, **rest: Any) -> Any:
    diagnosis = {"verdict": verdict, "effects": [{"name": n} for n in names], **rest}
    return score_case(key_of(case), {"diagnosis": diagnosis, "seconds": 1.0})


# ---- cases


def test_full_set_has_the_numbers_that_are_asked():
    for part, listed in FULL.items():
        count = Counter(c.group for c in listed)
        each = Counter(c.what for c in listed if c.group == "strong")
        assert count["none"] >= 60 and count["pair"] >= 30
        assert set(each) == set(CATALOGUE) and min(each.values()) >= 3
        assert len({c.what for c in listed if c.group == "outside"}) >= 10, part
        assert len({c.what for c in listed if c.group == "tricky"}) >= 11


def test_parts_and_sets_share_no_seed_and_no_outside_mechanism():
    every = [c for which in SETS for part in PARTS for c in cases(which, part)]
    assert len({c.recipe.seed for c in every}) == len(every) == len({c.id for c in every})
    outside = [{c.what for c in FULL[part] if c.group == "outside"} for part in ("tune", "report")]
    assert outside == [set(TUNE), set(REPORT)]


def test_strengths_are_within_their_group():
    for case in FULL["tune"]:
        low, high = {"strong": (3, 10), "severe": (30, 100), "weak": (1, 3), "pair": (3, 10)}.get(case.group, (0, 1e9))
        by_clock = case.what == "clock_feedthrough + readout_skew"  # rows are read over most of the frame
        drawn = case.recipe.hidden[:1] if by_clock else case.recipe.hidden
        assert all(low <= h.times_limit <= high for h in drawn)


def test_the_clock_and_the_rows_that_see_it_are_hidden_together():
    both = [c for c in FULL["verify"] if c.what == "clock_feedthrough + readout_skew"]
    assert len(both) >= 6 and all(c.truth == ("clock_feedthrough", "readout_skew") for c in both[-6:])
    spans = [c.recipe.hidden[1].parameters["span"] for c in both[-6:]]
    assert min(spans) < 0 < max(spans) and all(0.6 <= abs(s) <= 1.0 for s in spans)


def test_sets_by_near_laws_hide_no_far_one():
    assert not any(h.law for which in ("quick", "full") for part in PARTS for c in cases(which, part)
                   for h in c.recipe.hidden)  # fmt: skip


@pytest.mark.parametrize("part", PARTS)
def test_each_mechanism_is_hidden_by_its_near_law_and_by_a_far_one(part):
    for group in ("strong", "weak", "severe"):
        count = Counter((c.what, bool(c.recipe.hidden[0].law)) for c in LAWS[part] if c.group == group)
        assert set(count.values()) == {1} and {name for name, _ in count} == set(CATALOGUE)
        assert all((name, bool(far)) in count for name in CATALOGUE for far in {0, len(CATALOGUE[name].far)})


@pytest.mark.parametrize(("group", "size", "least"), [("strong_pair", 2, 30), ("triple", 3, 10)])
def test_strong_effects_together_are_many_and_of_different_families(group, size, least):
    for listed in LAWS.values():
        picked = [c for c in listed if c.group == group]
        assert len({frozenset(c.truth) for c in picked}) == len(picked) >= least
        assert all(len({family_of(name) for name in c.truth}) == len(c.truth) == size for c in picked)
        assert not any(
            set(c.truth) >= {a, b} for c in picked for same in SAME_TO_THE_EYE for a in same for b in same - {a}
        )
        strengths = {h.name: h.times_limit for c in picked for h in c.recipe.hidden}
        events = {"missed_spikes", "spurious_spikes", "afterpulsing"}
        assert all(5 <= times <= (100 if name not in events else 1e5) for name, times in strengths.items())
        far = [bool(h.law) for c in picked for h in c.recipe.hidden]
        assert 0.25 < sum(far) / len(far) < 0.75


def test_small_cameras_have_an_eighth_of_the_data_and_effects_as_many_of_their_limits_strong():
    """Noise goes down by the root of the data: of rare events the limit rises eightfold, of noise by a fourth root."""
    wanted = {"dead_time": 8**0.5, "row_temporal_noise": 8**0.25, "missed_spikes": 8.0}
    for name, louder in wanted.items():
        limit = limits()[name]
        hidden = Hidden(name, {limit.parameter: limit.strength(2.0), "other": 1.0}, 2.0)
        stronger = with_less_data(hidden, 1 / 8)
        assert stronger.parameters[limit.parameter] == pytest.approx(louder * limit.strength(2.0))
        assert stronger.parameters["other"] == 1.0 and stronger.times_limit == 2.0
    worst = Hidden("vignetting", {"falloff": -limits()["vignetting"].most}, 20.0)
    assert with_less_data(worst, 1 / 8) == worst
    for case in SMALL["verify"]:
        assert (case.recipe.shape, case.recipe.frames) == ((32, 32), 4000)
    assert [c.group for c in SMALL["verify"]] == [c.group for c in LAWS["verify"]]


def test_the_sign_of_an_effect_goes_by_the_power_of_its_strength_that_the_diagnosis_takes():
    """But of pixels: the number of hot or dead ones counts, though the diagnosis draws units to see their effect."""
    for name in set(CATALOGUE) - {"hot_pixels", "dead_pixels"}:
        assert limits()[name].power == candidate(name).power, name


def test_what_a_case_hides_is_not_in_its_id_or_withheld_names_of_others():
    case = case_of("left_out", "photo_response_nonlinearity")
    assert set(case.exclude) == {"photo_response_nonlinearity", "ir_drop", "dead_time", "synchronous_reset"}
    assert all(not c.exclude for c in FULL["tune"] if c.group != "left_out")
    assert all(set(c.id) <= set("0123456789abcdef") for c in FULL["tune"])


def test_only_and_limit_pick_evenly():
    picked = chosen("full", "tune", ["strong", "none"], 5)
    assert Counter(c.group for c in picked) == {"strong": 5, "none": 5}
    assert len({c.what for c in picked if c.group == "strong"}) == 5
    with pytest.raises(ValueError, match="no group 'strongest'"):
        chosen("full", "tune", ["strongest"])


# ---- seals


def test_cases_that_hide_a_mechanism_are_picked_alone_and_beside_another():
    picked = chosen("full", "verify", ["strong", "pair"], hiding=["clock_feedthrough"])
    assert {case.what for case in picked if case.group == "strong"} == {"clock_feedthrough"}
    pairs = [case for case in picked if case.group == "pair"]
    assert len(pairs) >= 6
    assert all("clock_feedthrough" in case.truth for case in pairs)
    with pytest.raises(ValueError, match="no case hides 'clock'"):
        chosen("full", "verify", hiding=["clock"])


def test_a_key_that_was_changed_is_not_opened(tmp_path):
    manifest = seal(FULL["tune"][:3], tmp_path, TITLE)
    case = FULL["tune"][0]
    assert open_key(tmp_path, case.id) == key_of(case)
    assert set(manifest["cases"][0]) == {"id", "model", "exclude", "key_sha256"}
    path = tmp_path / "sealed" / f"{case.id}.json"
    path.write_text(path.read_text().replace('"none"', '"strong"'))
    with pytest.raises(BrokenSealError, match=case.id):
        open_key(tmp_path, case.id)


def test_a_folder_of_another_trial_is_refused(tmp_path):
    seal(FULL["tune"][:3], tmp_path, TITLE)
    seal(FULL["tune"][:3], tmp_path, TITLE)
    with pytest.raises(ValueError, match="another trial"):
        seal(FULL["tune"][:4], tmp_path, TITLE)


# ---- scores


def test_families_hold_every_candidate_once():
    names = [name for family in FAMILIES.values() for name in family]
    assert sorted(names) == sorted(set(CATALOGUE) | set(BASE_EFFECTS))
    assert family_of("dead_time") == family_of("comparator_delay") == "saturation"


def test_right_names_families_and_twins():
    case = case_of("strong", "dead_time")
    assert answered(case, "named", "dead_time").right
    twin = answered(case, "named", "comparator_delay")
    assert not twin.right and twin.family and twin.spurious == ("comparator_delay",)
    assert not answered(case, "named", "dead_time", "vignetting").right
    assert not answered(case, "named", "vignetting").family
    assert not answered(case, "unknown").right
    other = case_of("strong", "photo_response_nonlinearity")
    members = {"members": ["photo_response_nonlinearity", "ir_drop"], "experiment": "a masked row"}
    assert answered(other, "class", "ir_drop", **{"class": members}).right
    wide = {"members": ["photo_response_nonlinearity", "comparator_delay"], "experiment": "more levels"}
    assert not answered(other, "class", "comparator_delay", **{"class": wide}).right


def test_of_two_effects_one_may_be_a_class():
    case = replace(case_of("pair", ""), truth=("threshold_flicker_noise", "dead_time"))
    members = {"members": ["dead_time", "photo_response_nonlinearity"], "experiment": "a masked row"}
    both = answered(case, "class", "dead_time", "threshold_flicker_noise", **{"class": members})
    assert both.right and set(both.found) == set(case.truth) and not both.spurious
    assert not answered(case, "class", "dead_time", **{"class": members}).right
    third = answered(case, "class", "dead_time", "threshold_flicker_noise", "vignetting", **{"class": members})
    assert not third.right and third.spurious == ("vignetting",)


def test_excess_noise_may_be_called_a_wrong_parameter():
    case = case_of("strong", "excess_threshold_noise")
    assert case.model == "physical"
    assert answered(case, "parameter", parameters={"reset_noise": {"ratio": 4.0}}).right
    assert answered(case, "named", "reset_noise").right
    assert not answered(case, "parameter", parameters={"dark_current": {"ratio": 4.0}}).right


def test_parameters_that_are_off_beside_effects_are_named_too():
    case = replace(case_of("pair", ""), truth=("random_telegraph_noise", "excess_threshold_noise"))
    off = {"parameters": {"reset_noise": {"ratio": 20.0}}}
    both = answered(case, "named", "random_telegraph_noise", **off)
    assert both.right and set(both.found) == set(case.truth) and not both.spurious
    assert not answered(case, "named", "random_telegraph_noise").right
    assert answered(case_of("strong", "dead_time"), "named", "dead_time", **off).spurious == ("reset_noise",)


def test_tricky_cases_have_their_own_answers():
    assert answered(case_of("tricky", "wrong_label"), "data").right
    assert not answered(case_of("tricky", "wrong_label"), "unknown").right
    dropped = case_of("tricky", "dropped_frames")
    assert answered(dropped, "data").right
    assert not answered(dropped, "unknown", unknown={"light": "lit"}).right
    assert answered(dropped, "unknown", unknown={"when": "frames 3000 .. 5000 of bars"}).right
    skew = case_of("tricky", "skew")
    assert not answered(skew, "none").right
    assert answered(skew, "none", not_testable=[{"name": "readout_skew", "needs": "motion"}]).right
    both = case_of("tricky", "dead time against")
    assert answered(both, "named", "dead_time", "photo_response_nonlinearity").right
    assert not answered(both, "named", "dead_time").right
    noise = case_of("tricky", "threshold noise")
    assert answered(noise, "parameter", parameters={"reset_noise": {"ratio": 9.0}}).right


def test_pairs_and_outside_are_counted_as_the_acceptance_says():
    pair = case_of("pair")
    first, second = pair.truth
    some = [answered(pair, "named", first), answered(pair, "named", first, second), answered(pair, "unknown")]
    some.append(answered(pair, "named", first, second, next(n for n in CATALOGUE if n not in pair.truth)))
    value = {f.what: f.value for f in figures(some)}
    assert value["pairs: at least one right"] == 0.75
    assert value["pairs: both right"] == 0.5
    assert value["pairs: a spurious third"] == 0.25
    assert value["false unknown, catalogue cases"] == 0.25
    outside = case_of("outside")
    value = {f.what: f.value for f in figures([answered(outside, "unknown"), answered(outside, "named", "dead_time")])}
    assert value["outside the catalogue: unknown"] == 0.5


def test_gap_and_parameters_of_right_names():
    case = case_of("strong", "dead_time")
    true = case.recipe.hidden[0].parameters["tau_us"]
    made = []
    for removed, error, sd in ((0.99, 0.0, 0.01), (0.9, 0.1, 0.05), (0.96, 0.5, 0.1)):
        stated = {"tau_us": {"value": true * (1 + error), "sd": true * sd}}
        diagnosis = {
            "verdict": "named",
            "effects": [{"name": "dead_time", "parameters": stated}],
            "gap": {"before": 9.0, "floor": 1.0, "removed": removed},
        }
        made.append(score_case(key_of(case), {"diagnosis": diagnosis, "seconds": 130.0}))
    value = {f.what: f for f in figures(made)}
    assert value["gap removed, right names with one held out: median"].value == 0.96
    assert value["parameters within 15 % or twice their sd"].value == pytest.approx(2 / 3)
    assert value["90 % intervals cover"].value == pytest.approx(1 / 3)
    assert not value["90 % intervals cover"].met and not value["median diagnosis [s], threads: 1"].met
    assert value["slowest diagnosis [s], threads: 1"].met


@pytest.mark.parametrize(
    "true, interval, covered",
    [(2.0, [1.0, 3.0], True), (4.0, [1.0, 3.0], False), (0.97, [0.9, 0.1], True), (0.5, [0.9, 0.1], False)],
)
def test_a_stated_interval_covers_what_is_in_it(true: float, interval: list[float], covered: bool):
    """Of a phase through the end of its period too; the standard deviation beside it would say the other."""
    error = {"effect": "", "parameter": "", "true": true, "value": 5.0, "sd": 1e-9 if covered else 9.0}
    assert is_covered({**error, "interval": interval}) is covered


def test_times_are_printed_by_threads():
    case = case_of("strong", "dead_time")
    diagnosis = {"verdict": "unknown", "effects": [], "gap": None}
    one, two = (
        score_case(key_of(case), {"diagnosis": diagnosis, "seconds": seconds, "threads": threads})
        for seconds, threads in ((200.0, 1), (100.0, 2))
    )
    value = {f.what: f.value for f in figures([one, two])}
    assert value["slowest diagnosis [s], threads: 1"] == 200.0 and value["slowest diagnosis [s], threads: 2"] == 100.0


def test_a_share_of_a_gap_that_is_hardly_above_its_floor_is_not_scored():
    case = case_of("strong", "dead_time")
    gaps = [{"before": before, "floor": 1.0, "removed": 0.3} for before in (1.4, 1.6)]
    assert [answered(case, "named", "dead_time", gap=gap).removed for gap in gaps] == [None, 0.3]


def test_binomial_interval_is_clopper_pearson():
    low, high = binomial_90(57, 60)
    assert low == pytest.approx(0.8761, abs=2e-3) and high == pytest.approx(0.9863, abs=2e-3)
    assert binomial_90(0, 10)[0] == 0.0 and binomial_90(10, 10)[1] == 1.0


def test_categories_are_counted_by_near_and_far_laws():
    near, far = (
        next(c for c in LAWS["tune"] if c.group == "strong" and bool(c.recipe.hidden[0].law) == f) for f in (0, 1)
    )
    off = {"parameters": {"reset_noise": {"ratio": 20.0}}}
    remainder = {"remainder": {"noises": 55.0, "share": 0.0001}}
    some = [answered(near, "named", near.what), answered(far, "unknown"), answered(far, "named", far.what, **remainder)]
    some += [answered(far, "named", far.what, "vignetting", **off), answered(case_of("none"), "named", "dead_time")]
    rows = {(row["category"], row["law"]): row for row in by_category(some)}
    assert rows["strong", "near"]["right"] == "1/1" and rows["strong", "far"]["right"] == "1/3"
    assert rows["strong", "far"]["all found"] == "2/3" and rows["strong", "far"]["90 %"] == "2 - 86 %"
    assert (rows["strong", "far"]["spurious effects"], rows["strong", "far"]["spurious parameters"]) == (1, 1)
    (outside,) = by_category([answered(case_of("outside"), "unknown")])
    assert outside["right"] == "1/1" and outside["law"] == outside["all found"] == ""
    assert rows["none", ""]["false alarms"] == 1 and rows["none", ""]["median [s]"] == "1"
    value = {f.what: f.value for f in figures(some)}
    assert (
        value["strong, far laws: right name"] == pytest.approx(1 / 3) and value["strong, near laws: right name"] == 1.0
    )


def test_degrees_count_true_names_and_whole_answers():
    """A pair of which one effect is named has true names, and not all of them."""
    pair, outside = next(c for c in LAWS["tune"] if c.group == "strong_pair"), case_of("outside")
    one = answered(pair, "named", pair.truth[0], degree="largest of several")
    wrong = answered(outside, "named", "dead_time", degree="largest of several")
    both = answered(pair, "named", *pair.truth, degree="explains nearly all")
    rows = {r["degree"]: r for r in by_degree([one, wrong, both, answered(outside, "unknown", degree="unknown")])}
    assert (rows["largest of several"]["names true"], rows["largest of several"]["and all of them"]) == ("1/2", "0/2")
    assert rows["explains nearly all"]["and all of them"] == "1/1" and rows["unknown"]["names true"] == "1/1"


def test_strong_effects_together_have_their_figures():
    pair = next(c for c in LAWS["tune"] if c.group == "strong_pair")
    third = next(n for n in CATALOGUE if n not in pair.truth)
    some = [answered(pair, "named", *pair.truth), answered(pair, "named", *pair.truth, third)]
    value = {f.what: f.value for f in figures([*some, answered(pair, "named", pair.truth[0])])}
    assert value["pairs of strong effects: all right"] == pytest.approx(2 / 3)
    assert value["pairs of strong effects: a spurious effect or parameter"] == pytest.approx(1 / 3)


# ---- a run


def test_a_run_goes_on_where_it_stopped(tmp_path):
    picked = [small(c) for c in chosen("full", "tune", ["none", "strong"], 2)]
    said = "tests.hidden_world.bench:says_dead_time"
    steps = run_trial(tmp_path, "full", "tune", said, picked=picked)
    assert [next(steps) for _ in range(3)] == [(0, 4), (1, 4), (2, 4)]
    steps.close()
    assert sum(is_done(tmp_path, c.id) for c in picked) == 2
    assert list(run_trial(tmp_path, "full", "tune", said, picked=picked, threads=2))[-1] == (4, 4)
    asked = (tmp_path / "asked.txt").read_text().splitlines()
    assert [line.split()[2] for line in asked] == ["1", "1", "2", "2"]
    assert sorted(line.split()[0] for line in asked) == sorted(c.id for c in picked)
    assert all(line.split()[3:] == [".dat", ".json", ".npz"] for line in asked)
    assert not any((tmp_path / "campaigns").iterdir())
    scored = score_trial(tmp_path, picked)
    assert scored["cases"] == 4 and scored["errors"] == 0
    assert [s["answer"] for s in scored["scored"] if s["what"] == "nothing"] == ["dead_time"] * 2
    page = (tmp_path / "trial.md").read_text()
    assert page == as_text(scored) and "false alarms, nothing hidden | 100 % | 22 - 100 %" in page


def test_a_diagnosis_that_breaks_is_counted_and_tried_again(tmp_path):
    picked = [small(case_of("none"))]
    assert list(run_trial(tmp_path, "full", "tune", "tests.hidden_world.bench:fails", picked=picked))[-1] == (1, 1)
    assert score_trial(tmp_path, picked)["errors"] == 1
    assert not is_done(tmp_path, picked[0].id)
    list(run_trial(tmp_path, "full", "tune", "tests.hidden_world.bench:says_dead_time", picked=picked))
    assert score_trial(tmp_path, picked)["errors"] == 0


def test_a_record_holds_a_trial_to_be_scored_and_gone_on_with(tmp_path):
    far = next(c for c in LAWS["tune"] if c.group == "strong" and c.recipe.hidden[0].law)
    picked = [small(c) for c in (far, next(c for c in LAWS["tune"] if c.group == "none"))]
    said, first, second = "tests.hidden_world.bench:says_dead_time", tmp_path / "first", tmp_path / "second"
    record, ids = tmp_path / "records" / "full.jsonl", {c.id for c in picked}
    assert unpack(record, first, ids) == 0
    list(run_trial(first, "laws", "tune", said, picked=picked[:1]))
    assert pack(first, record) == 1
    assert unpack(record, second, ids) == 1 and unpack(record, second, ids) == 0
    assert list(run_trial(second, "laws", "tune", said, picked=picked)) == [(1, 2), (2, 2)]
    assert pack(second, record) == 2
    scored = score_trial(second, picked)
    assert scored["code"] == {code() or "unknown code": 2} and scored["cases"] == 2
    assert scored["scored"][0] == score_trial(first, picked[:1])["scored"][0]
    lines = [json.loads(line) for line in record.read_text().splitlines()]
    assert [line["hidden"] for line in lines if line["id"] == far.id] == [[f"{far.what}/{far.recipe.hidden[0].law}"]]
    line = lines[0]
    assert {"id", "code", "threads", "seconds", "diagnosis"} < set(line) and "statistics" not in line["diagnosis"]


def test_what_is_no_record_is_an_error_before_anything_is_run(tmp_path):
    for text in ("nonsense", "[1, 2]", '{"id": "a"}'):
        (tmp_path / "record").write_text(text + "\n")
        with pytest.raises(InputError, match="no record of a trial"):
            BlindTrial(tmp_path / "out", only=["none"], limit=1, record=tmp_path / "record").run()
    (tmp_path / "record").write_text(json.dumps({"id": case_of("strong", "dead_time").id, "diagnosis": {}}) + "\n")
    with pytest.raises(InputError, match="of another trial"):
        BlindTrial(tmp_path / "out", only=["none"], limit=1, record=tmp_path / "record").run()
    with pytest.raises(InputError, match="record"):
        BlindTrial(tmp_path / "out", only=["none"], limit=1, record=tmp_path / "record" / "in" / "a" / "file").run()


def test_what_is_not_scored_is_not_recorded():
    gap = {"before": 2.0, "removed": 0.5, "by_recording": {"disk": {}}}
    said = {"verdict": "named", "effects": [], "ranking": [1], "discrepancies": [2], "gap": gap}
    kept = in_short({"id": "a", "seconds": 3.0, "diagnosis": said})
    assert kept["diagnosis"] == {"verdict": "named", "effects": [], "gap": {"before": 2.0, "removed": 0.5}}
    assert (
        kept["seconds"] == 3.0 and in_short({"diagnosis": {"verdict": "data", "gap": None}})["diagnosis"]["gap"] is None
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--jobs", "0"), "--jobs 0; it must be"),
        (("--threads", "0"), "--threads 0; it must be"),
        (("--limit", "-3"), "--limit -3; it must be"),
        (("--only", "all"), "there is no group 'all'"),
        (("--hiding", "nothing_known"), "no case hides 'nothing_known'"),
        (("--out", __file__), "test_trial.py"),
    ],
)
def test_unusable_options_end_in_one_line_and_code_2(words, said, tmp_path, capsys):
    assert run(["--out", str(tmp_path / "trial"), *words]) == 2
    error = capsys.readouterr().err
    assert error.startswith("spikecam: ") and error.count("\n") == 1 and said in error
    assert not (tmp_path / "trial").exists()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("benchmarks.blind_trial:nothing", "benchmarks.blind_trial has no 'nothing'"),
        ("benchmarks.blind_trial", "benchmarks.blind_trial has no ''"),
        ("benchmarks.nothing:diagnosed", "No module named 'benchmarks.nothing'"),
    ],
)
def test_a_function_to_try_that_is_not_there_is_an_error_and_no_wrong_answer(name, said, tmp_path, monkeypatch, capsys):
    picked = [small(case_of("none"))]
    monkeypatch.setattr(trial, "chosen", lambda *_: picked)
    monkeypatch.setattr(trial, "cases", lambda *_: picked)
    assert run(["--diagnose", name, "--out", str(tmp_path)]) == 2
    assert f"spikecam: {said}\n" in capsys.readouterr().err
    assert not list((tmp_path / "results").iterdir())


def test_command_prints_the_figures(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(trial, "chosen", lambda *a: [small(c) for c in chosen(*a)])
    said = "tests.hidden_world.bench:says_dead_time"
    BlindTrial(tmp_path, set="quick", part="report", only=["weak"], limit=2, diagnose=said).run()
    printed = capsys.readouterr().out
    assert "near the limit, near laws: right name" in printed and "| weak | near | " in printed
    assert (tmp_path / "trial.json").is_file()
