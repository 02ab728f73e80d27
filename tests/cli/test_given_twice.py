"""Options, entries and arrays that are given twice are refused by name."""

from __future__ import annotations

import json
import zipfile
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from spikecam_env.cli.main import run
from spikecam_env.errors import InputError
from spikecam_env.gap import diagnose, write_campaign
from spikecam_env.sensor import SensorModel
from spikecam_env.untrusted import parse_json, read_arrays

RECORD = ("record", "--size", "8", "8", "--frames", "2", "--out", "{out}.h5")
CAMPAIGN = ("campaign", "simulate", "{out}", "--shape", "8", "8", "--frames", "2")

TWICE = {
    "a parameter of an effect": (*RECORD, "--effect", "dead_time:tau_us=1,tau_us=2"),
    "a parameter, the same": (*RECORD, "--effect", "dead_time:tau_us=1,tau_us=1"),
    "a parameter, spaced": (*RECORD, "--effect", "dead_time:tau_us=1, tau_us =2"),
    "an effect": (*RECORD, "--effect", "dead_time:tau_us=1", "--effect", "dead_time:tau_us=2"),
    "an effect, the same": (*RECORD, "--effect", "dead_time", "--effect", "dead_time"),
    "an effect to remove": (*RECORD, "--without", "shot_noise", "--without", "shot_noise"),
    "a number": (*RECORD, "--seed", "1", "--seed", "2"),
    "a number with and without =": (*RECORD, "--seed=1", "--seed", "2"),
    "with a dash and an underscore": (*RECORD, "--truth-every", "1", "--truth_every", "2"),
    "a switch and its opposite": ("demo", "--quick", "--no-quick", "--out", "{out}"),
    "a parameter of a recording": (*CAMPAIGN, "--recording", "flat:radiance=0.1,radiance=0.2"),
    "a recording": (*CAMPAIGN, "--recording", "flat:radiance=0.1", "--recording", "flat:radiance=0.1"),
    "a recording's name": (*CAMPAIGN, "--recording", "flat:radiance=0.1,name=a", "--recording", "dark:name=a"),
    "a candidate": ("diagnose", "{here}", "--out", "{out}", "--candidates", "dead_time", "dead_time"),
    "an excluded effect": ("diagnose", "{here}", "--out", "{out}", "--exclude", "dead_time", "dead_time"),
    "a scene": ("dataset", "phm-n", "--out", "{out}", "--scenes", "ball", "ball"),
    "a row": ("evaluate", "table1", "--out", "{out}", "--rows", "noisy", "noisy"),
    "an interval": ("evaluate", "table1", "--out", "{out}", "--rows", "noisy", "--intervals", "10", "10.0"),
    "a task": ("evaluate", "tasks", "--json", "{out}.json", "--tasks", "Catch-v1", "Catch-v1"),
    "a pixel": ("view", "disk", "--save", "{out}.rrd", "--pixels", "1,1", "1,1"),
    "a source": ("export", "{here}/a.h5", "{here}/a.h5", "--out", "{out}"),
}


@pytest.mark.parametrize("what", TWICE)
def test_what_is_given_twice_on_a_command_line_is_refused_by_name(what: str, tmp_path: Path, capsys) -> None:
    words = [word.replace("{here}", str(tmp_path)).replace("{out}", str(tmp_path / "out")) for word in TWICE[what]]
    assert run(words) == 2
    said = capsys.readouterr().err.splitlines()
    print(said)
    assert len(said) == 1
    assert "more than once; give it once" in said[0] or "are named 'a'" in said[0]
    assert not list(tmp_path.iterdir())


def test_options_that_may_be_repeated_still_may(tmp_path: Path) -> None:
    out = tmp_path / "out.npz"
    effects = ["--effect", "dead_time", "--effect", "crosstalk", "--without", "reset_noise", "--without", "shot_noise"]
    assert run(["record", "--size", "8", "8", "--frames", "2", "--out", str(out), *effects]) == 0


@pytest.mark.parametrize("name", ["candidates", "exclude"])
def test_a_candidate_that_is_given_twice_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"{name}: 'dead_time' is given more than once"):
        diagnose(write_campaign(tmp_path / "c", "scsim", shape=(8, 8), frames=40), "scsim", **{name: ["dead_time"] * 2})


def test_a_key_that_stands_twice_in_a_file_is_refused(tmp_path: Path) -> None:
    assert parse_json('{"a": {"b": 1}, "c": {"b": 2}}', "x.json") == {"a": {"b": 1}, "c": {"b": 2}}
    with pytest.raises(InputError, match=r"x\.json is not a JSON file: 'b' is given more than once"):
        parse_json(json.dumps({"a": {"b": 1, "c": 2}}).replace('"c"', '"b"'), "x.json")
    with pytest.raises(InputError, match="is not a TOML file"):
        (tmp_path / "m.toml").write_text("format = 1\nformat = 2\n")
        SensorModel.from_toml(tmp_path / "m.toml")
    twice = tmp_path / "twice.npz"
    with zipfile.ZipFile(twice, "w") as archive:
        for value in (1.0, 2.0):
            with pytest.warns(UserWarning, match="Duplicate") if value == 2.0 else nullcontext():
                file = archive.open("gain.npy", "w")
            with file:
                np.lib.format.write_array(file, np.full(3, value))
    with pytest.raises(InputError, match=r"twice.npz: 'gain.npy' is given more than once"):
        read_arrays(twice)
