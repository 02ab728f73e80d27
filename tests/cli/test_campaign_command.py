"""`spikecam campaign`, `spikecam effects`, and the options `--effect` and `--without`."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from spikecam_env.campaign import read_campaign
from spikecam_env.cli.camera import CameraOptions
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.streams import load_vidar_dat, save_npz
from tests.commands import spikecam


def test_simulate_writes_the_model_asked_for(tmp_path: Path, capsys) -> None:
    out = tmp_path / "late"
    options = ("--shape", 8, 8, "--frames", 150, "--seed", 3)
    effects = ("--effect", "dead_time:tau_us=0.2", "--effect", "readout_skew", "--without", "reset_noise")
    chosen = ("--recording", "dark", "--recording", "flat:radiance=0.3,use=holdout", "--second-v-d", 0.7)
    assert spikecam("campaign", "simulate", out, *options, *effects, *chosen) == 0
    assert "wrote 3 recordings of 8 x 8 pixels" in capsys.readouterr().out
    assert [r.name for r in read_campaign(out).recordings] == ["dark", "flat-0.3", "dark-at-0.7V"]
    base = SensorModel.preset("scsim").without("reset_noise")
    late, skew = CATALOGUE["dead_time"](tau_us=0.2), CATALOGUE["readout_skew"]()
    assert SensorModel.from_toml(out / "model.toml") == base.with_effect(late).with_effect(skew)


def test_simulate_records_the_standard_design_by_default(tmp_path: Path) -> None:
    assert spikecam("campaign", "simulate", tmp_path / "c", "--shape", 8, 8, "--frames", 40, "--model", "ideal") == 0
    assert len(read_campaign(tmp_path / "c").recordings) == 13


def test_import_takes_labels_from_flags_and_a_table(tmp_path: Path, capsys) -> None:
    spikes = (np.random.default_rng(0).random((50, 6, 8)) < 0.2).astype(np.uint8)
    (tmp_path / "in").mkdir()
    for name in ("a", "b"):
        save_npz(tmp_path / "in" / f"{name}.npz", spikes)
    (tmp_path / "labels.csv").write_text("file,radiance,use\na.npz,0.2,fit\n")
    labels = ("--table", tmp_path / "labels.csv", "--label", "b.npz=unknown")
    out = tmp_path / "out"
    assert spikecam("campaign", "import", tmp_path / "in", out, *labels, "--frame-rate-hz", 20000, "--rows", 1, 5) == 0
    assert "unknown" in capsys.readouterr().out
    campaign = read_campaign(out)
    assert campaign.shape == (4, 8) and [r.name for r in campaign.recordings] == ["a", "b"]


def test_record_takes_effects(tmp_path: Path) -> None:
    size = ("--size", 16, 16, "--frames", 60)
    for name, options in (("plain", ()), ("dead", ("--effect", "dead_pixels:fraction=1"))):
        assert spikecam("record", "--out", tmp_path / f"{name}.dat", *size, *options) == 0
    plain, dead = (load_vidar_dat(tmp_path / f"{name}.dat", height=16, width=16) for name in ("plain", "dead"))
    assert plain.any() and not dead.any()


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_every_effect_is_an_option_with_all_its_parameters(name: str, capsys) -> None:
    """As `spikecam effects` prints it, and back."""
    assert spikecam("effects") == 0
    option = next(
        line.split()[0]
        for line in capsys.readouterr().out.splitlines()
        if line.split()[0] == name or line.startswith(f"{name}:")
    )
    effect = next(e for e in CameraOptions(model="ideal", effect=(option,)).load().effects)
    for f in fields(effect):
        given = getattr(effect, f.name)
        assert type(given) is type(f.default)
        assert given == (f.default if isinstance(f.default, str) else pytest.approx(f.default, rel=1e-4))


def test_effects_explains_one(capsys) -> None:
    assert spikecam("effects", "show", "dead_time") == 0
    printed = capsys.readouterr().out
    assert "T = 1/x + tau" in printed and "0 .. 25" in printed and "Seen in: flats at x > 0.3" in printed
