"""The first words of a command line: none at all, wrong ones, and options that a command does not have."""

from __future__ import annotations

import re

import pytest

from spikecam_env.cli.first_words import START, options_of
from spikecam_env.cli.main import COMMANDS, run
from tests.commands import every_command


def test_the_name_alone_prints_three_commands_to_begin_with(capsys) -> None:
    assert run([]) == 0
    printed = capsys.readouterr()
    assert printed.out == START + "\n" and not printed.err
    lines = re.findall(r"^  spikecam (\S+)", START, re.MULTILINE)
    assert len(lines) == 3 and set(lines) <= set(COMMANDS)


@pytest.mark.parametrize("line", re.findall(r"^  spikecam (.+?)   ", START, re.MULTILINE))
def test_what_the_start_shows_is_understood(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    ran = []
    command, *_ = line.split()
    monkeypatch.setattr(COMMANDS[command], "run", lambda self: ran.append(self))
    assert run(line.split()) == 0 and len(ran) == 1


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("recrod --out x.h5", "unknown command 'recrod'; did you mean record?"),
        ("denosie x.h5", "did you mean denoise?"),
        ("fly", "unknown command 'fly'; choose one of bench, calibrate,"),
        ("evaluate tabel1", "unknown command 'tabel1'; did you mean table1? `spikecam evaluate --help`"),
        ("effects sow dead_time", "did you mean show?"),
        ("record --frame 3 --out x.h5", "unknown option '--frame' of `spikecam record`; did you mean --frames?"),
        ("record --frame=3 --out x.h5", "did you mean --frames?"),
        ("demo --modes best", "did you mean --mode?"),
        ("demo --no-opne", "did you mean --no-open?"),
        ("evaluate table1 --sceens disk", "did you mean --scenes?"),
        ("demo --zzz", "unknown option '--zzz' of `spikecam demo`; `spikecam demo --help` lists them"),
    ],
)
def test_a_wrong_word_suggests_the_right_one(line: str, said: str, capsys) -> None:
    assert run(line.split()) == 2
    error = capsys.readouterr().err
    assert error.startswith("spikecam: ") and error.count("\n") == 1 and said in error


@pytest.mark.parametrize("command", every_command())
def test_the_options_that_are_known_are_those_that_the_help_lists(command: str, capsys) -> None:
    with pytest.raises(SystemExit):
        run([*command.split(), "--help"])
    heads = re.findall(r"^\S?\s*(--?[a-z].*?)(?:  |$)", capsys.readouterr().out, re.MULTILINE)
    listed = {name for head in heads for name in re.findall(r"--([a-z0-9-]+)", head)}
    assert listed and listed - {"help"} == options_of(every_command()[command]).keys()


def test_an_option_may_be_written_with_underscores(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    monkeypatch.setattr(COMMANDS["record"], "run", lambda self: seen.append(self.truth_every))
    assert run(["record", "--out", "x.h5", "--truth_every", "7"]) == 0 and seen == [7]
