"""The tables: rows with and without weights, and a table that goes on after a stop."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from denoiser.evaluate import held_out, judge, tables, work
from denoiser.evaluate import rows as row_streams
from denoiser.evaluate.case import StreamCase
from denoiser.evaluate.judge import RowResult
from denoiser.evaluate.rows import ROWS, Weights, why_not
from denoiser.evaluate.table_report import report
from denoiser.evaluate.table_summary import mean_and_spread
from denoiser.evaluate.tables import TABLES, TableRequest, evaluate_table
from denoiser.passes.pixel_map import PixelMap
from spikecam_env.datasets import build, phm_n
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.streams import middleTFP

SMALL = TableRequest(
    scenes=("disk",), shape=(32, 48), seeds=2, frames=200, rows=("noisy", "tfp", "clean", "light", "light-mus")
)
CLASSICAL = ("tfp21", "tfp41", "tfi")


@pytest.fixture(scope="module")
def result() -> dict:
    return evaluate_table("table1", SMALL)


def test_noisy_is_at_0_and_clean_at_1_and_the_light_through_the_ideal_pixel_is_no_better(result: dict) -> None:
    (group,) = result["groups"]
    for column in CLASSICAL:
        db = {row: found["pictures"][column]["db"] for row, found in group["rows"].items()}
        gap = {row: found["pictures"][column].get("gap_closed") for row, found in group["rows"].items()}
        print(column, db, gap)
        assert db["noisy"] < db["clean"]
        assert (gap["noisy"], gap["clean"]) in ((0, 1), (None, None))  # none where clean gains under half a dB
        assert abs(db["light"] - db["clean"]) < 0.5
    assert group["seeds"] == 2 and group["rows"]["clean"]["pictures"]["tfi"]["db_spread"] > 0


def test_the_multi_stage_update_of_the_true_light_is_worse_than_its_accumulation(result: dict) -> None:
    rows = result["groups"][0]["rows"]
    for column in CLASSICAL:
        by_mus, summed = (rows[row]["pictures"][column]["db"] for row in ("light-mus", "light"))
        print(f"{column}: true light by MUS {by_mus:.2f} dB, accumulated {summed:.2f} dB")
        assert by_mus < summed


def test_rows_without_weights_are_named_with_the_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = Weights.path
    with monkeypatch.context() as patch:
        patch.setattr(Weights, "path", lambda self, name: tmp_path / "fast.pt" if name == "fast" else path(self, name))
        found = evaluate_table("table3", replace(SMALL, seeds=1, rows=("fast", "clean"), out=tmp_path / "out"))
    text = report(found)
    assert "fast: no weights are shipped under this name: fast.pt" in text
    line = next(line for line in text.splitlines() if line.startswith("fast "))
    assert set(line.removeprefix("fast")) <= set(" -|")
    with pytest.raises(InputError, match=r"there is no file .*none\.pt"):
        evaluate_table(
            "table3", replace(SMALL, weights=Weights({"paper-no-refine": tmp_path / "none.pt"}), rows=("baseline",))
        )


def test_shipped_weights_of_another_network_are_a_reason_and_given_ones_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    damaged = tmp_path / "best.pt"
    damaged.write_bytes(b"no weights")
    with monkeypatch.context() as patch:
        patch.setattr(Weights, "path", lambda self, name: damaged if name == "best" else tmp_path / "none.pt")
        found = evaluate_table("table1", replace(SMALL, seeds=1, rows=("best",)))
    assert "best.pt" in found["missing"]["best"] and "noisy" in found["groups"][0]["rows"]
    with pytest.raises(InputError, match=r"best\.pt"):
        evaluate_table("table1", replace(SMALL, seeds=1, rows=("best",), weights=Weights({"best": damaged})))


def test_the_folder_has_text_json_lines_and_a_page(tmp_path: Path, result: dict) -> None:
    found = evaluate_table("table1", replace(SMALL, out=tmp_path))
    assert found["scenes"] == result["scenes"]
    assert json.loads((tmp_path / "table1.json").read_text())["scenes"] == found["scenes"]
    assert (tmp_path / "table1.txt").read_text() == report(found)
    assert len((tmp_path / "table1.jsonl").read_text().splitlines()) == 1 + 2 * 5
    assert {"disk-noisy-tfp21.png", "disk-light-light.png"} <= {p.name for p in (tmp_path / "pictures").iterdir()}
    assert (tmp_path / "table1.png").stat().st_size > 1000


class Counted:
    """Stands in for `work.do`: counts tasks, and fails at one of them."""

    def __init__(self, fail_at: int | None = None) -> None:
        self.tasks: list[tuple[str, int, str]] = []
        self.fail_at = fail_at

    def __call__(self, task: work.WorkItem) -> list[RowResult]:
        if len(self.tasks) == self.fail_at:
            raise KeyboardInterrupt
        self.tasks.append((task.case.scene, task.case.seed, task.source))
        return DO(task)


DO = work.do


def run(
    monkeypatch: pytest.MonkeyPatch, request: TableRequest, fail_at: int | None = None
) -> list[tuple[str, int, str]]:
    """The tasks that were done for a table."""
    counted = Counted(fail_at)
    monkeypatch.setattr(work, "do", counted)
    if fail_at is None:
        evaluate_table("table1", request)
    else:
        with pytest.raises(KeyboardInterrupt):
            evaluate_table("table1", request)
    return counted.tasks


def test_a_table_that_was_stopped_goes_on_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, result: dict
) -> None:
    request = replace(SMALL, out=tmp_path / "out")
    done = run(monkeypatch, request, fail_at=3)
    rest = run(monkeypatch, request)
    assert len(done) == 3 and not set(done) & set(rest)
    assert {*done, *rest} == {("disk", seed, s) for seed in (0, 1) for s in ("noisy", "tfp41", "clean", "light")}
    assert json.loads((tmp_path / "out" / "table1.json").read_text())["scenes"] == result["scenes"]
    assert run(monkeypatch, request) == []


def test_more_scenes_seeds_and_intervals_are_added_to_what_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    request = replace(SMALL, seeds=1, rows=("noisy",), shape=(16, 24), out=tmp_path)
    assert run(monkeypatch, request) == [("disk", 0, "noisy")]
    more = replace(request, seeds=2, scenes=("disk", "collage"), rows=("noisy", "clean"))
    assert len(run(monkeypatch, more)) == 2 * 2 * 2 - 1
    assert len(run(monkeypatch, replace(more, intervals=(10.0, 20.0)))) == 2 * 2 * 2


def test_other_weights_are_measured_again_and_other_settings_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    request = replace(SMALL, seeds=1, rows=("noisy", "paper"), shape=(16, 24), out=tmp_path)
    assert len(run(monkeypatch, request)) == 2
    copy = tmp_path / "paper.pt"
    copy.write_bytes(Weights().path("paper").read_bytes())
    same = replace(request, weights=Weights({"paper": copy}))
    assert run(monkeypatch, same) == []
    digest = Weights.digest
    monkeypatch.setattr(Weights, "digest", lambda self, name: "other" if name == "paper" else digest(self, name))
    assert run(monkeypatch, same) == [("disk", 0, "paper")]
    for other in (replace(request, shape=(16, 32)), replace(request, frames=210)):
        with pytest.raises(InputError, match="other settings"):
            evaluate_table("table1", other)


@pytest.mark.slow
def test_two_processes_find_what_one_does(result: dict) -> None:
    request = replace(SMALL, rows=("noisy",), jobs=2)
    rows = [r for r in result["scenes"] if r["row"] in request.rows]
    assert evaluate_table("table1", request)["scenes"] == rows


def test_rate_planes_are_judged_beside_spikes() -> None:
    if why := why_not("best", Weights()):
        pytest.skip(why)
    found = evaluate_table("table1", replace(SMALL, seeds=1, rows=("best", "paper-mus"), shape=(16, 24)))
    best, mus = (found["groups"][0]["rows"][row] for row in ("best", "paper-mus"))
    assert best["pictures"]["plane"]["db"] > 10 and "plane" not in mus["pictures"]
    assert len(best["db_by_place"]) > 1 and np.isfinite(best["flicker"])
    assert abs(best["lag"]) < 6 and abs(best["bias"]) < 0.2


def test_learned_reconstructions_are_columns_and_pipelines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """TFP 41 stands in for them: their columns and rows are then its own."""
    for name in ("ssml", "spk2img-clean", "spk2img-noisy"):
        torch.save({"state_dict": {"weight": torch.zeros(3, 4)}}, tmp_path / f"{name}.pt")

    def films(name, spikes, frames, weights):
        return np.stack([middleTFP(spikes, t, 41) for t in frames])

    monkeypatch.setattr(judge, "reconstruct", lambda name, spikes, t, weights: middleTFP(spikes, t, 41))
    monkeypatch.setattr(row_streams, "reconstruct_many", films)
    request = replace(SMALL, seeds=1, rows=("noisy", "tfp", "ssml", "spk2img-noisy"))
    found = evaluate_table("table1", replace(request, weights=Weights.found(tmp_path, {})))
    rows = found["groups"][0]["rows"]
    assert found["parameters"] == {"noisy": None, "tfp": None, "ssml": 12, "spk2img-noisy": 12}
    assert "SSML, then spikes, 0.00 M" in report(found)
    assert rows["ssml"] == rows["tfp"] == rows["spk2img-noisy"]
    pictures = rows["noisy"]["pictures"]
    assert pictures["spk2img-clean"] == pictures["spk2img-noisy"] == pictures["tfp41"]
    weights = next(r["weights"] for r in found["scenes"] if r["row"] == "ssml")
    assert set(weights) == {"ssml", "spk2img-clean", "spk2img-noisy"} and None not in weights.values()


def test_streams_come_from_a_dataset_too(tmp_path: Path) -> None:
    """Seed 0 is the dataset's camera: the same streams, so the same figures."""
    plan = phm_n(scenes=("disk",), shape=(32, 48), frames=264)
    build(plan, tmp_path / "data")
    request = replace(SMALL, seeds=1, frames=264, rows=("noisy", "clean"))
    simulated = evaluate_table("table1", request)
    stored = TableRequest(scenes=SMALL.scenes, rows=request.rows, data=tmp_path / "data")
    assert evaluate_table("table1", stored)["groups"] == simulated["groups"]
    (tmp_path / "data" / "test" / "disk.h5").unlink()
    with pytest.raises(InputError, match=r"disk\.h5"):
        evaluate_table("table1", stored)


@pytest.mark.slow
def test_real_recordings_are_judged_by_niqe_or_named_as_absent(tmp_path: Path) -> None:
    spikes = (np.random.default_rng(0).random((120, 250, 400)) < 0.3).astype(np.uint8)
    np.savez(tmp_path / "wall.npz", arr_0=spikes)
    found = evaluate_table("table2", replace(SMALL, rows=("noisy",), real=tmp_path))
    (group,) = found["groups"]
    assert group["scenes"] == ["wall.npz"] and group["rows"]["noisy"]["pictures"]["tfp41"]["niqe"] > 0
    assert "helicopter_low_light.npz" in found["missing"] and "there is no recording" in report(found)
    with pytest.raises(InputError, match="true light"):
        evaluate_table("table2", replace(SMALL, rows=("clean",), real=tmp_path))
    with pytest.raises(InputError, match=r"there is no folder .*nowhere; give the folder of the recordings"):
        evaluate_table("table4", replace(SMALL, rows=("noisy",), real=tmp_path / "nowhere", out=tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_at_rest_the_mean_of_clean_frames_is_the_light_and_that_of_noisy_ones_has_the_fixed_pattern() -> None:
    found = evaluate_table("still", TableRequest(still_scenes=1, seeds=1, shape=(40, 40), rows=("noisy", "clean")))
    rows = found["groups"][0]["rows"]
    print({row: m["mean_db"] for row, m in rows.items()})
    assert all(0.01 < row["change"] < 0.2 for row in rows.values())  # counts of 40 frames differ by one
    assert rows["clean"]["mean_db"] > 45 > 35 > rows["noisy"]["mean_db"]
    assert rows["clean"]["lag"] is None


def test_unknown_names_and_short_streams_are_refused() -> None:
    for request, why in (
        (replace(SMALL, scenes=("disks",)), "disk"),
        (replace(SMALL, rows=("bests",)), "best"),
        (replace(SMALL, frames=150), "200"),
        (replace(SMALL, seeds=0), "seeds"),
    ):
        with pytest.raises(InputError, match=why):
            evaluate_table("table1", request)
    with pytest.raises(InputError, match="table1"):
        evaluate_table("table9")


def test_every_table_has_rows_that_there_are() -> None:
    for table in TABLES.values():
        assert set(table.rows) <= set(ROWS) and table.rows[0] == "noisy"
    assert set(tables.ABLATION) >= {"baseline-held", "baseline-mus", "paper-held", "paper-mus"}


def test_the_spread_is_over_seeds_of_the_mean_over_scenes() -> None:
    assert mean_and_spread([(0, 1.0), (0, 3.0), (1, 3.0), (1, 5.0), (1, None)]) == (
        3.0,
        pytest.approx(2**0.5, abs=1e-4),
    )
    assert mean_and_spread([(0, 1.0)]) == (1.0, None)
    assert mean_and_spread([(0, None)]) == (None, None)


def test_the_calibration_of_a_still_scene_is_of_the_camera_before_it() -> None:
    """Against the rates of the same camera before even light: its gain and dark explain nearly all of their spread."""
    case = StreamCase("bright 0", 3, (24, 32), 400)
    found = PixelMap.of(held_out.calibrated(case))
    camera = SpikeSensor(SensorModel.preset("scsim"), case.shape, held_out.unit_seed(case))
    rate = camera.step(np.full(case.shape, 0.3, np.float32), 4000).mean(axis=0)
    left = np.std(rate - (0.3 * found.gain + found.dark)) / np.std(rate)
    print(f"spread of the rates that the maps leave: {left:.3f}")
    assert left < 0.1
