"""Bad campaigns: a clear error, or a stated loss."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from campaigns import flats

from spikecam_env.calibration import calibrate, findings
from spikecam_env.campaign import read_campaign
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel

LEVELS = (0.0, 0.1, 0.3, 0.6)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    flats(tmp_path, SensorModel.preset("physical"), levels=LEVELS, frames=1500, shape=(8, 8))
    return tmp_path


def edit(folder: Path, change) -> Path:
    path = folder / "campaign.json"
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))
    return folder


def relabel(folder: Path, name: str, radiance: float) -> None:
    np.savez(folder / f"{name}.npz", frame=np.zeros(1), radiance=np.full((1, 1, 1), radiance, np.float32))


def test_a_campaign_reads_back(folder: Path) -> None:
    campaign = read_campaign(folder)
    assert campaign.shape == (8, 8)
    assert [float(r.static_radiance()[0, 0]) for r in campaign.recordings] == pytest.approx(LEVELS)
    assert campaign.recordings[2].load().shape == (1500, 8, 8)
    assert campaign.recordings[0].v_d == pytest.approx(1.1)


def test_a_missing_recording_is_named(folder: Path) -> None:
    (folder / "flat-02.dat").unlink()
    with pytest.raises(InputError, match=r"'flat-02'.*missing"):
        read_campaign(folder)


def test_a_wrong_length_is_named_with_the_right_one(folder: Path) -> None:
    edit(folder, lambda d: d["recordings"][1].update(frames=1400))
    with pytest.raises(InputError, match=r"'flat-01'.*the file holds 1500"):
        read_campaign(folder)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.update(format="spikecam-campaign/9"), "spikecam-campaign/1"),
        (lambda d: d.update(recordings=[]), "no recordings"),
        (lambda d: d["camera"].update(height=0), "camera.height"),
        (lambda d: d["recordings"][0].update(use="train"), "fit, holdout"),
        (lambda d: d["recordings"][0].update(gain=2), "entry"),
        (lambda d: d["recordings"][0].pop("spikes"), "either spikes"),
        (lambda d: d["recordings"][1].update(name="dark-00"), "2 recordings are named 'dark-00'"),
    ],
)
def test_a_wrong_entry_is_named(folder: Path, change, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_campaign(edit(folder, change))


def test_a_folder_without_a_campaign_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"campaign\.json"):
        read_campaign(tmp_path)


def test_swapped_labels_are_named(folder: Path) -> None:
    relabel(folder, "flat-01", 0.6)
    relabel(folder, "flat-03", 0.1)
    with pytest.raises(InputError, match=r"contradict their labels.*swapped"):
        calibrate(folder)


def test_one_level_fixes_only_a_sum(folder: Path) -> None:
    edit(folder, lambda d: d.update(recordings=d["recordings"][2:3]))
    with pytest.raises(InputError, match=r"one level only.*neither alone"):
        calibrate(folder)


def test_all_dark_says_what_to_add(folder: Path) -> None:
    edit(folder, lambda d: d.update(recordings=d["recordings"][:1]))
    with pytest.raises(InputError, match=r"are dark.*add a lit flat"):
        calibrate(folder)


def test_no_spikes_at_all_is_noticed(folder: Path) -> None:
    for path in folder.glob("*.dat"):
        path.write_bytes(bytes(path.stat().st_size))
    with pytest.raises(InputError, match="no pixel responds"):
        calibrate(folder)


def test_two_levels_say_that_linearity_is_untested(folder: Path) -> None:
    edit(folder, lambda d: d.update(recordings=d["recordings"][1:3]))
    assert any("linear" in w for w in calibrate(folder).warnings)


def test_rates_alone_give_lines_but_no_charge(folder: Path) -> None:
    for recording in read_campaign(folder).recordings:
        rate = recording.load().mean(axis=0, dtype=np.float64)
        np.savez(folder / f"{recording.name}-rates.npz", rate=rate, frames=recording.frames)

    def only_rates(data) -> None:
        for entry in data["recordings"]:
            del entry["spikes"], entry["frames"]
            entry["rates"] = f"{entry['name']}-rates.npz"

    calibration = calibrate(edit(folder, only_rates))
    assert calibration.charge is None
    assert any("temporal noise is not identified" in w for w in calibration.warnings)
    assert {f.quantity: f.status for f in findings(calibration)}["1/N + kappa²"] == "not identified"
    assert calibration.main.gain.mean() == pytest.approx(1.0, abs=0.1)


def test_labels_that_are_off_widen_the_intervals(folder: Path) -> None:
    sure = calibrate(folder).main.gain_sd.mean()
    relabel(folder, "flat-02", 0.303)
    unsure = calibrate(folder)
    assert any("labels" in w for w in unsure.warnings)
    assert unsure.main.gain_sd.mean() > 2 * sure
