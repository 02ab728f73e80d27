"""Optical flow: DIS on pictures of streams, flows of other programs, and an evaluation that goes on after a stop."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from denoiser.evaluate import work
from denoiser.evaluate.flow import dis, end_point_errors, evaluate_flow
from denoiser.evaluate.flow_page import drawn
from denoiser.evaluate.flow_report import flow_report
from denoiser.evaluate.tables import TableRequest
from spikecam_env.datasets import build, phm_n
from spikecam_env.datasets.export import export_scflow
from spikecam_env.datasets.scflow import read_flo, write_flo
from spikecam_env.errors import InputError
from tests.commands import said, spikecam

SMALL = TableRequest(
    scenes=("disk",), shape=(48, 80), seeds=2, frames=200, rows=("noisy", "fast", "fast-bright", "clean")
)


@pytest.fixture(scope="module")
def result(tmp_path_factory) -> dict:
    out = tmp_path_factory.mktemp("flow")
    return evaluate_flow(replace(SMALL, out=out)) | {"out": out}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    build(phm_n(scenes=("disk", "doll"), shape=(48, 80), frames=200, pan=(0.3, 0.0), renderer="embree"), folder)
    return folder


@pytest.fixture(scope="module")
def truth(dataset: Path, tmp_path_factory) -> Path:
    """The truth as SCFlow's layout has it."""
    out = tmp_path_factory.mktemp("exported") / "out"
    export_scflow([dataset], out)
    return out / "test"


def scores(result: dict, apart: int, group: int = 0) -> dict[tuple[str, str], dict]:
    return {(r["row"], r["picture"]): r for r in result["groups"][group]["rows"] if r["apart"] == apart}


@pytest.mark.parametrize("way", [(2, 0), (0, -3), (-4, 1)])
def test_dis_finds_the_way_of_a_shifted_picture_in_any_light(way: tuple[int, int]) -> None:
    y, x = np.mgrid[:64, :96]
    light = (np.sin(x / 5) * np.cos(y / 7) + np.sin((x + 2 * y) / 9) + 2.2).astype(np.float32)
    found = {}
    for brightest in (0.8, 0.01):
        flow = dis(light * brightest, np.roll(light, way[::-1], axis=(0, 1)) * brightest)[12:-12, 12:-12]
        found[brightest] = flow
        error = np.linalg.norm(flow - way, axis=-1).mean()
        print(f"brightest {brightest:g}: {error:.3f} pixels off")
        assert error < 0.15
    assert dis(np.zeros((16, 16)), np.zeros((16, 16))).max() == 0


def test_errors_are_distances_of_end_points_of_all_pixels_and_of_those_that_move() -> None:
    true = np.zeros((4, 4, 2))
    true[0, 0] = 3.0, -4.0
    assert end_point_errors(true, true, 10) == {"all": 0.0, "moving": 0.0}
    assert end_point_errors(0 * true, true, 10) == {"all": 5 / 16, "moving": 5.0}
    assert end_point_errors(0 * true + 1, 0 * true, 20) == {"all": pytest.approx(2**0.5), "moving": None}


def test_pictures_of_every_row_are_judged_and_still_pictures_are_the_score_to_beat(result: dict) -> None:
    for apart in (10, 20):
        found = scores(result, apart)
        for name, row in found.items():
            print(apart, *name, f"{row['all']:.3f} {row['moving']:.3f}")
        assert ("fast", "rate plane") in found and ("fast-bright", "rate plane") not in found
        still = found["noisy", "no motion"]["moving"]
        assert all(row["moving"] < 0.9 * still for (_, picture), row in found.items() if picture != "no motion")
        assert found["noisy", "TFP 21"]["all_spread"] > 0
    assert scores(result, 20)["noisy", "no motion"]["all"] == pytest.approx(
        2 * scores(result, 10)["noisy", "no motion"]["all"], rel=0.02
    )


def test_rate_planes_cut_the_error_over_all_pixels(result: dict) -> None:
    """Of a picture most of which is at rest: there noise is taken for motion."""
    found = scores(result, 10)
    print({name: found[name]["all"] for name in (("noisy", "TFP 21"), ("fast", "rate plane"))})
    assert found["fast", "rate plane"]["all"] < 0.7 * found["noisy", "TFP 21"]["all"]


def test_the_folder_has_tables_numbers_records_and_flows_that_a_person_can_look_at(result: dict) -> None:
    out = result["out"]
    assert (out / "flow.txt").read_text() == flow_report(result)
    assert json.loads((out / "flow.json").read_text())["groups"] == result["groups"]
    assert len((out / "flow.jsonl").read_text().splitlines()) == 1 + 2 * 4
    assert {"disk-noisy-TFP-21.png", "disk-fast-rate-plane.png", "disk-true.png"} <= {
        path.name for path in (out / "flows").iterdir()
    }
    assert np.asarray(Image.open(out / "flow.png")).std() > 10
    lines = [line for line in flow_report(result).splitlines() if line.startswith("|")]
    assert len({line.count("|") for line in lines}) == 1 and "| disk |" in lines[0]


def test_colours_show_direction_and_distance() -> None:
    right, left, near, none = (
        drawn(np.array([[way]], np.float32), 2.0)[0, 0] for way in ((2, 0), (-2, 0), (1, 0), (0, 0))
    )
    assert right.tolist() == [255, 0, 0] and left.tolist() == [0, 255, 255] and none.tolist() == [255, 255, 255]
    assert 100 < near[1] < 150


def test_an_evaluation_goes_on_where_it_was_and_refuses_other_settings(result: dict, monkeypatch) -> None:
    done = []
    monkeypatch.setattr(work, "do", lambda item, do=work.do: done.append(item.rows) or do(item))
    again = evaluate_flow(replace(SMALL, out=result["out"]))
    assert again == {name: found for name, found in result.items() if name != "out"} and not done
    evaluate_flow(replace(SMALL, out=result["out"], rows=("best-bright",), seeds=1))
    assert done == [("best-bright",)]
    with pytest.raises(InputError, match="other settings: pan None"):
        evaluate_flow(replace(SMALL, out=result["out"], pan=(0.5, 0.0)))


def test_flows_of_another_program_are_rows_under_their_folders_names(
    dataset: Path, truth: Path, tmp_path: Path
) -> None:
    """The truth itself has no error, a constant is off by it, and a folder may have flows over 10 frames alone."""
    off = tmp_path / "off"
    for file in truth.rglob("dt=10/motion_vector/*.flo"):
        place = off / file.relative_to(truth)
        place.parent.mkdir(parents=True, exist_ok=True)
        write_flo(place, read_flo(file) + np.float32((0.3, 0.4)))
    request = TableRequest(scenes=("disk", "doll"), data=dataset, rows=("noisy",), out=tmp_path / "out")
    result = evaluate_flow(request, [truth, off])
    near, far = scores(result, 10), scores(result, 20)
    for found in (near, far):
        assert found["test", "flow"]["all"] == 0 and set(found["test", "flow"]["by_scene"]) == {"disk", "doll"}
    assert near["off", "flow"]["all"] == near["off", "flow"]["moving"] == pytest.approx(0.5, abs=1e-5)
    assert ("off", "flow") not in far
    assert (tmp_path / "out" / "flows" / "disk-test-flow.png").read_bytes() == (
        tmp_path / "out" / "flows" / "disk-true.png"
    ).read_bytes()
    assert near["noisy", "no motion"]["all"] == near["noisy", "no motion"]["moving"] > 3  # the camera moves by 3


@pytest.mark.parametrize(
    "own",
    [{"shape": (48, 80)}, {"seeds": 1}, {"intervals": (3.0,)}, {"speeds": (2.0,)}, {"pan": (1, 0)}, {"frames": 300}],
)
def test_settings_that_a_dataset_has_of_its_own_are_refused(dataset: Path, own: dict[str, object]) -> None:
    with pytest.raises(InputError, match=f"{next(iter(own))} is that of the dataset"):
        evaluate_flow(TableRequest(scenes=("disk",), data=dataset, rows=("noisy",), **own))


def test_a_simulated_case_has_the_scores_of_the_dataset_with_the_same_settings(dataset: Path) -> None:
    """Before a camera that moves, too."""
    stored = evaluate_flow(TableRequest(scenes=("disk",), data=dataset, rows=("noisy", "clean")))
    request = TableRequest(
        scenes=("disk",), shape=(48, 80), frames=200, seeds=1, rows=("noisy", "clean"), pan=(0.3, 0.0)
    )
    assert evaluate_flow(request)["groups"] == stored["groups"]
    assert "gaze moving by 0.3, 0 pixels a frame" in flow_report(stored)


def test_nonsense_is_refused_in_a_line(dataset: Path, truth: Path, tmp_path: Path, capsys) -> None:
    empty, small, cut, noisy = (tmp_path / name for name in ("empty", "small", "cut", "noisy"))
    empty.mkdir()
    shutil.copytree(truth, noisy)
    for folder in (small, cut):
        shutil.copytree(truth, folder)
    write_flo(small / "disk" / "dt=10" / "motion_vector" / "0003.flo", np.zeros((8, 8, 2)))
    (cut / "disk" / "dt=10" / "motion_vector" / "0002.flo").unlink()
    data = ("--data", dataset, "--scenes", "disk", "--rows", "noisy")
    for options, message in (
        ((*data, "--flows", tmp_path / "none"), "there is no such folder"),
        ((*data, "--flows", empty), "has no flow of disk"),
        ((*data, "--flows", small), "has 8 x 8 pixels; need 48 x 80"),
        ((*data, "--flows", cut), "there is no file"),
        ((*data, "--flows", noisy), "'noisy'"),
        (
            ("--flows", truth, "--intervals", 10, 20, "--scenes", "disk", "--size", 16, 16),
            "one of --seeds, --intervals",
        ),
        (("--scenes", "disk", "--size", 8, 8, "--rows", "noisy"), "DIS needs 16 x 16"),
        (("--scenes", "disk", "--frames", 150), "at least 200"),
        (("--scenes", "disk", "--pan", "nan", 0), "--pan"),
        (("--data", dataset, "--scenes", "fan"), "no scene to evaluate"),
    ):
        capsys.readouterr()
        assert spikecam("evaluate", "flow", *options) == 2
        (line,) = said(capsys.readouterr().err)
        assert message in line
