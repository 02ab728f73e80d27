"""Options that change nothing beside others are refused; an option that a run leaves unread shows a missing rule."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from denoiser.weights import pretrained_path
from spikecam_env.cli.main import understood
from spikecam_env.cli.without_effect import WithoutEffect, names_of, rules_of
from spikecam_env.streams import SpikeWriter
from tests.commands import every_command, said, spikecam

REFUSED = {
    "record --out a.h5 --scene ball": "--rpm 3",
    "demo --scene ball": "--rpm 3",
    "film a.mp4 --out a.h5 --frames 3": "--seconds 1",
    "scenes": "--frames 8; --every 4; --size 8 8; --seed 1",
    "scenes disk --out a.png": "--frames 8; --every=4",
    "play Fan-v0": "--split train",
    "view disk": "--policy oracle; --split train; --flip; --height 8",
    "view a.dat": "--policy oracle; --split train; --seed 0; --size 8 8; --model ideal; --without shot_noise",
    "view Track-v1": "--every 4; --key a",
    "view Fan-v0": "--split test",
    "dataset phm-n --out a --ray auto": "--jobs 2",
    "dataset films a --out a --ray ray-head:6379": "--jobs 2",
    "export a --out b": "--overlap; --ease; --brightness 4",
    "export a --out b --denoise best --overlap": "--ease",
    "export a --out b --layout scflow": "--frames 301; --clips 1; --first 0; --count 9; --rate 1; --bits 8",
    "denoise a.h5 --weights a.pt": "--mode best",
    "denoise a.h5 --overlap": "--ease",
    "live disk": "--loop; --flip; --bit_order big",
    "live ball": "--rpm 3",
    "live a.dat": "--size 8 8; --rpm 3; --seed 1; --effect dead_time; --frame-rate 3",
    "live a.dat --weights a.pt": "--mode best",
    "live tcp://camera:5000": "--speed 1; --size 8 8",
    "train --out a --minutes 3": "--steps 4",
    "train --out a --recordings a.h5": "--panned 0.3; --weak 0.3; --compiled; --no-compiled",
    "evaluate quick --modes best": "--paper a.pt; --fast a.pt",
    "evaluate spikezoo a --modes fast best-overlap": "--paper a.pt",
    "evaluate truth --modes paper": "--best a.pt; --fast a.pt",
    "evaluate table1 --data a": "--size 250 400; --seeds 3; --intervals 10; --speeds 2; --frames 300; --pan 0 0",
    "evaluate table3 --data a": "--speeds 2; --best a.pt",
    "evaluate flow --data a": "--size 8 8; --no-refine a.pt",
    "evaluate table1 --rows noisy best-map": "--paper a.pt; --no-refine a.pt",
    "evaluate table2 --rows paper": "--best a.pt",
    "evaluate table4": "--best a.pt",
    "evaluate still --rows best": "--paper a.pt; --no-refine a.pt",
    "evaluate agents --out a --suite v1": (
        "--tasks Track-v1; --observations tfp; --levels 1; --trained-levels 1 2; --learners ppo; --seeds 5; --steps 9; "
        "--episodes 3"
    ),
    "evaluate agents --out a --learners sb3": "--imitate",
    "evaluate agents --out a --ray auto": "--jobs 2",
}
"""Lines, and options that change nothing in them."""

READ = {
    "live a.h5 --frames 64 --mode fast": (),
    "live disk --frames 64 --mode fast --size 16 24": (),
    f"live a.h5 --frames 64 --weights {pretrained_path('fast')}": (),
    "view a.h5 --no-denoise --save a.rrd": (),
    "view disk --no-denoise --save a.rrd --frames 40 --size 16 24": (),
    "view Track-v1 --no-denoise --save a.rrd --frames 40 --size 16 24": (),
    "scenes": (),
    "scenes disk --out a.png --size 16 24": (),
    "scenes disk --film a.mp4 --size 16 24 --frames 64": (),
    "record --out b.h5 --scene ball --size 16 24 --frames 64": (),
    "record --out b.dat --size 16 24 --frames 64": (),
    "film a.npy --film-rate 1000 --out b.h5 --size 16 24 --frames 64": (),
    "denoise a.h5 --mode fast --no-film": (),
    f"denoise a.h5 --weights {pretrained_path('fast')} --no-film": (),
    "export data --out zoo --frames 41": (),
    "export data --out windows --layout scflow": (),
    "dataset phm-n --out more --scenes disk --size 16 24 --frames 64": (),
    "evaluate flow --data data --scenes disk --rows noisy": ("best", "paper", "no_refine"),  # by name, of OWN_WEIGHTS
    "evaluate table1 --scenes disk --rows noisy --size 16 24 --frames 220": ("best", "paper", "no_refine"),
    "play Catch-v1 --film a.mp4 --size 16 24": (),
    "bench online": (),
    "demo --quick --size 48 80 --no-open": (),
    "demo --size 48 80 --frames 500 --no-open": (),
    "campaign simulate camera --shape 16 16 --frames 400 --recording flat:radiance=0.3": (),
    "campaign import . camera --label a.h5=unknown --outside": (),
    "effects": ("effect_file",),  # by `effects_of`, before the run
    "effects show dead_time": ("effect_file",),
    "effects new sag": (),
    "dataset verify data": (),
    "evaluate tasks --tasks Catch-v1 --episodes 1": (),
    "evaluate agents --out study --tasks Catch-v1 --observations oracle --episodes 1 --size 16 16": (),
    "train-agent Catch-v1 --out agent --steps 2 --environments 2": (),
}
"""Lines that run in a second, and options that are read in them by another way than by their name."""


def options_of_lines(lines: dict[str, str]) -> Iterator[tuple[str, str]]:
    for line, options in lines.items():
        for option in options.split("; "):
            yield line, option


@pytest.mark.parametrize(("line", "option"), list(options_of_lines(REFUSED)))
def test_an_option_that_changes_nothing_is_refused_in_a_line(
    line: str, option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    understood(shlex.split(line))
    capsys.readouterr()
    assert spikecam(*shlex.split(line), *shlex.split(option)) == 2
    (refusal,) = said(capsys.readouterr().err)
    name = option.split()[0].partition("=")[0].replace("_", "-")
    names = (name, name.replace("--no-", "--"))
    assert any(refusal.startswith(f"spikecam: {one} has no effect: ") for one in names), refusal
    assert refusal.endswith("; leave it out") and not list(tmp_path.iterdir())


def test_every_rule_of_every_command_has_its_line() -> None:
    shown: set[tuple[str, WithoutEffect]] = set()
    for line, option in options_of_lines(REFUSED):
        command = innermost(understood(shlex.split(line)))
        typed = option.split()[0].partition("=")[0][2:].replace("_", "-")
        for rule in rules_of(command):
            if {typed, typed.removeprefix("no-")} & set(names_of(rule, command)) and rule.where(command):
                shown.add((type(command).__name__, rule))
    declared = {(kind.__name__, rule) for kind in every_command().values() for rule in rules_of(kind)}
    seen = {rule for _, rule in shown}
    assert declared and not [(name, rule.options) for name, rule in declared if rule not in seen]


def innermost(command: Any) -> Any:
    """The command of a group of commands."""
    for name in ("action", "what"):
        if is_dataclass(below := getattr(command, name, None)):
            return innermost(below)
    return command


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording, a film and a dataset."""
    made = tmp_path_factory.mktemp("made")
    with SpikeWriter(made / "a.h5", (16, 24), 40_000.0) as writer:
        writer.append((np.random.default_rng(0).random((96, 16, 24)) < 0.2).astype(np.uint8))
    np.save(made / "a.npy", np.random.default_rng(0).integers(20, 200, (8, 16, 24)).astype(np.uint8))
    small = ("--scenes", "disk", "--size", 16, 24, "--frames", 240, "--truth-every", 10)
    assert spikecam("dataset", "phm-n", "--out", made / "data", *small) == 0
    return made


@pytest.mark.parametrize("line", READ)
def test_an_option_that_is_not_read_is_refused(
    line: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    """An option of which a run reads nothing can have no effect."""
    for item in folder.iterdir():
        (tmp_path / item.name).symlink_to(item)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("spikecam_env.cli.screen.window.has_display", lambda: False)
    monkeypatch.setattr("spikecam_env.bench.online.bench_online", lambda: [])
    monkeypatch.setattr("spikecam_env.cli.live.rerun_log.recorded", lambda _, rate_hz, shown: bytes(len(list(shown))))
    command = innermost(understood(shlex.split(line)))
    kind, read = type(command), set()
    monkeypatch.setattr(
        kind, "__getattribute__", lambda self, name: read.add(name) or object.__getattribute__(self, name)
    )
    command.run()
    monkeypatch.undo()
    unread = {field.name for field in fields(kind)} - read - set(READ[line])
    refused = {option for rule in rules_of(command) if rule.where(command) for option in rule.options}
    print(f"{line}: not read: {', '.join(sorted(unread)) or 'none'}")
    assert not unread - refused
