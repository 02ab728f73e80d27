"""The ladder: from `ideal`, the base model's effects are found one after another and the gap falls at every rung."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

from spikecam_env.cli.main import run
from spikecam_env.gap import Dark, Flat, Step, read_campaign, write_campaign
from spikecam_env.gap.diagnose import read_case
from spikecam_env.gap.ladder import ladder, ladder_figure, rung_rows
from spikecam_env.gap.unit.label_unit import label_unit_note


@pytest.mark.slow
def test_from_ideal_the_gap_falls_with_every_effect_down_to_chance(tmp_path: Path) -> None:
    """Twelve twins know the noise of a mean square of some 30 statistics to a third: chance is below 2."""
    recordings = [Dark(), *(Flat(radiance=x) for x in (0.05, 0.2, 0.5)), Step(), Flat(radiance=0.12, use="holdout")]
    campaign = write_campaign(tmp_path / "c", "physical", shape=(32, 32), frames=2500, recordings=recordings, seed=3)
    made = ladder(campaign, "ideal")
    for row in rung_rows(made):
        print(row)
    gaps = [r.gap for r in made.rungs]
    added = [r.added.name for r in made.rungs[1:] if r.added]
    assert set(added) == {"conversion_gain_spread", "dark_current", "dark_current_spread", "shot_noise"}
    assert gaps[0] > 1000 * gaps[-1] and gaps[-1] < 2.0
    assert all(later < 1.3 * earlier for earlier, later in itertools.pairwise(gaps))
    made.write(tmp_path / "out")
    assert json.loads((tmp_path / "out" / "ladder.json").read_text())["rungs"][1]["added"] == added[0]
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"ladder.json", "ladder.png", "model.toml"}
    assert "added" not in ladder_figure(made).axes[0].get_title()


@pytest.mark.slow
def test_a_model_that_lacks_nothing_has_one_rung(tmp_path: Path) -> None:
    recordings = [Dark(), *(Flat(radiance=x) for x in (0.05, 0.2, 0.5))]
    campaign = write_campaign(tmp_path / "c", "physical", shape=(24, 24), frames=2000, recordings=recordings, seed=5)
    assert len(ladder(campaign, "physical").rungs) == 1


@pytest.mark.slow
def test_the_command_climbs_it_and_says_where_its_files_are(tmp_path: Path, capsys) -> None:
    recordings = [Dark(), *(Flat(radiance=x) for x in (0.1, 0.3))]
    write_campaign(tmp_path / "c", "physical", shape=(16, 16), frames=300, recordings=recordings, seed=5)
    assert run(["ladder", str(tmp_path / "c"), "--model", "physical", "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    assert "gap" in printed and str(tmp_path / "out" / "ladder.png") in printed
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"ladder.json", "ladder.png", "model.toml"}


def test_labels_in_another_unit_have_the_note_of_a_diagnosis(tmp_path: Path, capsys) -> None:
    """Light labelled in thousandths: the note of `diagnose`, word for word."""
    recordings = [Dark(), *(Flat(radiance=x) for x in (0.1, 0.3))]
    folder = tmp_path / "c"
    campaign = write_campaign(folder, "physical", shape=(16, 16), frames=300, recordings=recordings, seed=5)
    for recording in campaign.recordings:
        with np.load(folder / f"{recording.name}.npz") as light:
            labels = {"frame": light["frame"], "radiance": light["radiance"] * np.float32(1000)}
        np.savez(folder / f"{recording.name}.npz", **labels)
    assert run(["ladder", str(folder), "--model", "physical", "--out", str(tmp_path / "out")]) == 0
    said = [line for line in capsys.readouterr().out.splitlines() if line.startswith("note: ")]
    case = read_case(read_campaign(folder))
    assert said == [f"note: {note}" for note in label_unit_note(case.nominal_per_label, case.base)] and len(said) == 1
    assert "labels are in another unit" in said[0]
