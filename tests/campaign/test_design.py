"""Simulated campaigns: one unit, exact labels, same bytes, whole or unfinished."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from spikecam_env.campaign import takes as takes_module
from spikecam_env.errors import InputError
from spikecam_env.gap import Bars, Dark, Disk, Flat, MaskedRows, Step, read_campaign, write_campaign
from spikecam_env.sensor import CATALOGUE, SensorModel, SpikeSensor

SHAPE = (16, 24)
FRAMES = 700
ALL = (
    Dark(),
    Flat(radiance=0.3),
    Flat(radiance=0.3, name="again", use="holdout", frames=300),
    Step(),
    Bars(),
    Disk(),
    MaskedRows(),
    Flat(radiance=0.3, v_d=0.7),
)
MODEL = SensorModel.preset("scsim")


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return write_campaign(tmp_path_factory.mktemp("all"), MODEL, shape=SHAPE, frames=FRAMES, recordings=ALL, seed=3)


def test_a_written_campaign_reads_back(campaign) -> None:
    again = read_campaign(campaign.folder)
    assert again == campaign and again.shape == SHAPE and again.frame_rate_hz == 40_000.0
    assert [r.name for r in again.recordings] == [p.file_name for p in ALL]
    assert [r.use for r in again.recordings] == [p.use for p in ALL]
    assert [r.frames for r in again.recordings] == [FRAMES, FRAMES, 300, *[FRAMES] * 5]
    assert [r.v_d for r in again.recordings] == pytest.approx([1.1] * 7 + [0.7])
    assert SensorModel.from_toml(campaign.folder / "model.toml") == MODEL


def test_labels_are_the_light_the_sensor_saw(campaign) -> None:
    """Every stream again, from the light in its file, bit for bit."""
    for take, recording in enumerate(campaign.recordings[:7]):
        camera = SpikeSensor(MODEL, SHAPE, 3, engine="auto", take=take)
        np.testing.assert_array_equal(camera.step(recording.light(), recording.frames), recording.load())


def test_light_is_stored_small(campaign) -> None:
    stored = {r.name: np.load(r.radiance)["radiance"].shape[1:] for r in campaign.recordings}
    assert stored == {
        **dict.fromkeys(("dark", "flat-0.3", "again", "step", "flat-0.3-at-0.7V"), (1, 1)),
        "bars": (1, SHAPE[1]),
        **dict.fromkeys(("disk", "masked_rows"), SHAPE),
    }


def test_recordings_share_the_unit_and_nothing_else(campaign) -> None:
    """Pixel-to-pixel rates of two takes agree; the rest is read-out, not pattern.  Their spikes do not."""
    one, two = (r.load()[:300] for r in campaign.recordings[1:3])
    rates = [s.mean(axis=0).ravel() for s in (one, two)]
    correlation = np.corrcoef(*rates)[0, 1]
    # Spread of gain 7.3 % at rate 0.3: 0.022.  A count in 300 frames is off by less than 1.5 of 90: 0.003 rms.
    print(f"rates of two takes: correlation {correlation:.3f}")
    assert correlation > 0.9
    assert np.mean(one == two) < 0.9


def test_a_lower_voltage_fires_sooner_in_the_same_light(campaign) -> None:
    high, low = (campaign.recordings[i].load().mean() for i in (1, 7))
    swing = 1.1 - 0.0076, 0.7 - 0.0076
    print(f"rates {high:.4f}, {low:.4f}, ratio {low / high:.3f}, of the swings {swing[0] / swing[1]:.3f}")
    # V_S is 4.5 % of the first swing, 7.2 % of the second: E[1/(1 + v)] differs by 0.3 %; 384 pixels know it to 0.4 %.
    assert low / high == pytest.approx(swing[0] / swing[1], rel=0.02)


def test_same_seed_same_bytes(tmp_path: Path) -> None:
    some = (Dark(), Bars(), Flat(radiance=0.2, use="holdout"))
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        write_campaign(tmp_path / name, MODEL, shape=(8, 8), frames=200, recordings=some, seed=seed)
    a, b, c = (files(tmp_path / name) for name in "abc")
    assert a == b
    assert a["bars.npz"] == c["bars.npz"] and a["bars.dat"] != c["bars.dat"]


def test_effects_are_in_the_recordings(tmp_path: Path) -> None:
    """Dead time of a fifth of a frame at rate 0.5: interval 2.2 frames."""
    late = SensorModel.preset("ideal").with_effect(CATALOGUE["dead_time"](tau_us=5.0))
    written = write_campaign(tmp_path / "late", late, shape=(8, 8), frames=2200, recordings=[Flat(radiance=0.5)])
    rate = written.recordings[0].load().mean()
    print(f"rate {rate:.5f}")
    assert rate == pytest.approx(1 / 2.2, abs=1 / 2200)


class Killed(Exception):
    """Stands for a process that ends in the middle."""


def test_a_killed_write_leaves_no_campaign_and_goes_on(tmp_path: Path, monkeypatch) -> None:
    some = (Dark(), Flat(radiance=0.2), Step())
    settings = {"shape": (8, 8), "frames": 300, "recordings": some, "seed": 5}
    whole = write_campaign(tmp_path / "whole", MODEL, **settings)
    made = []

    class Mortal(SpikeSensor):
        def __init__(self, *args, **kwargs) -> None:
            made.append(kwargs["take"])
            super().__init__(*args, **kwargs)

        def step(self, *args):
            if len(made) == 2:
                raise Killed
            return super().step(*args)

    monkeypatch.setattr(takes_module, "SpikeSensor", Mortal)
    with pytest.raises(Killed):
        write_campaign(tmp_path / "killed", MODEL, **settings)
    left = set(files(tmp_path / "killed"))
    assert left == {"model.toml", "simulation.json", "dark.dat", "dark.npz", "flat-0.2.npz"}
    with pytest.raises(InputError, match=r"no campaign"):
        read_campaign(tmp_path / "killed")
    write_campaign(tmp_path / "killed", MODEL, **settings)
    assert made == [0, 1, 1, 2]
    assert files(tmp_path / "killed") == files(whole.folder)
    write_campaign(tmp_path / "killed", MODEL, **settings)
    assert made == [0, 1, 1, 2]


@pytest.mark.parametrize("finished", [True, False])
def test_a_folder_of_something_else_is_left_alone(finished: bool, tmp_path: Path) -> None:
    settings = {"shape": (8, 8), "frames": 100, "recordings": (Dark(),)}
    write_campaign(tmp_path / "a", MODEL, seed=1, **settings)
    if not finished:
        (tmp_path / "a" / "campaign.json").unlink()
    before = files(tmp_path / "a")
    with pytest.raises(InputError, match="choose another folder"):
        write_campaign(tmp_path / "a", MODEL, seed=2, **settings)
    assert files(tmp_path / "a") == before


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"recordings": ()}, "at least one recording"),
        ({"recordings": (Dark(), Dark())}, "2 recordings are named 'dark'"),
        ({"recordings": (Dark(name="../dark"),)}, "plain file name"),
        ({"recordings": (Dark(use="test"),)}, "use of recording 'dark' 'test'; choose one of fit, holdout"),
        ({"recordings": (Dark(frames=0),)}, "frames = 0"),
        ({"recordings": (Dark(v_d=0.001),)}, "leaves no threshold"),
        ({"frames": -1}, "frames = -1"),
        ({"shape": (0, 8)}, r"shape = \(0, 8\)"),
        ({"seed": -1}, "seed = -1"),
        ({"model": "scs"}, "unknown preset 'scs'"),
        ({"engine": "slow"}, "unknown engine 'slow'"),
    ],
)
def test_an_impossible_design_is_refused_before_a_recording(changed, message: str, tmp_path: Path) -> None:
    settings = {"model": MODEL, "shape": (8, 8), "frames": 50, "recordings": (Dark(),)} | changed
    with pytest.raises(InputError, match=message):
        write_campaign(tmp_path / "bad", **settings)
    assert not (tmp_path / "bad" / "campaign.json").exists() and not list(tmp_path.glob("bad/*.dat"))


def test_a_file_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("")
    with pytest.raises(InputError, match="cannot use"):
        write_campaign(tmp_path / "a", MODEL, shape=(8, 8), frames=50, recordings=(Dark(),))


def test_campaign_json_has_the_entries_of_the_format(campaign) -> None:
    data = json.loads((campaign.folder / "campaign.json").read_text())
    assert data["format"] == "spikecam-campaign/1"
    assert data["recordings"][2] == {
        "name": "again",
        "spikes": "again.dat",
        "frames": 300,
        "radiance": "again.npz",
        "use": "holdout",
        "v_d": pytest.approx(1.1),
        "temperature_k": 300.0,
        "note": "flat",
    }
