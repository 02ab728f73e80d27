"""docs/own_effect.md from its first command to its last, in a small array: the hidden effect is named."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spikecam_env import cache_folder
from spikecam_env.cli.main import run
from spikecam_env.gap.fit import standard_case, standard_templates
from spikecam_env.sensor import CATALOGUE, effects_from
from tools.page_blocks import COMMANDS, PYTHON, blocks_of, command_lines

PAGE = Path(__file__).parents[2] / "docs" / "own_effect.md"
BLOCKS = blocks_of(PAGE.read_text(encoding="utf-8"))
LAW, LIMITING_CASE, IN_PYTHON = (block.code for block in BLOCKS if block.kind == PYTHON)
LINES = [line for block in BLOCKS if block.kind == COMMANDS for line in command_lines(block.code)]

SHAPE, FRAMES = (16, 16), 1000
SMALLER = {
    "campaign": ["--shape", "16", "16", "--frames", str(FRAMES)],
    "record": ["--size", "16", "16", "--frames", "100"],
}
"""Options added to the page's, by command."""
STRONGER = ("sag=0.004,tau_ms=40", "sag=0.02,tau_ms=10")
"""The hidden effect: a hundredth of the pixels and frames show five times as much, over a shorter recording."""


@pytest.mark.slow
def test_the_page_does_what_it_says(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(cache_folder.VARIABLE, str(tmp_path / "cache"))
    monkeypatch.setattr(standard_templates, "_IN_MEMORY", {})
    monkeypatch.setattr(standard_case, "SHAPE", SHAPE)
    monkeypatch.setattr(standard_case, "FRAMES", FRAMES)
    for line in LINES:
        program, *words = shlex.split(line.replace(*STRONGER))
        if program == "python":
            pytest_says(words)
        else:
            assert program == "spikecam" and run([*words, *SMALLER.get(words[0], [])]) == 0, line
        if words[:2] == ["effects", "new"]:
            with_the_pages_code("threshold_sag")
    assert Path("sag.h5").exists() and "threshold_sag" not in CATALOGUE
    done = subprocess.run([sys.executable, "-c", IN_PYTHON], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = json.loads(Path("diagnosed/diagnosis.json").read_text())
    [effect] = found["effects"]
    sag, tau = (effect["parameters"][name] for name in ("sag", "tau_ms"))
    print(capsys.readouterr().out.splitlines()[-4:], sag, tau, found["gap"]["removed"])
    assert (found["verdict"], effect["name"]) == ("named", "threshold_sag")
    assert sag["value"] == pytest.approx(0.02, rel=0.2) and tau["value"] == pytest.approx(10.0, rel=0.5)
    assert found["effect_files"] == ["threshold_sag.py"]
    assert "--effect-file threshold_sag.py" in Path("diagnosed/report.html").read_text()
    assert len(list(Path("cache/templates").glob("*.npz"))) == 1
    assert_the_same_from_the_cache(monkeypatch)


def assert_the_same_from_the_cache(monkeypatch) -> None:
    """A second diagnosis has the templates of the first, from the file, bit by bit; the rest follows from its seed."""
    (made,) = standard_templates._IN_MEMORY.values()
    standard_templates._IN_MEMORY.clear()
    monkeypatch.setattr(standard_templates, "simulated_of", lambda names, **_: [] if not names else pytest.fail("made"))
    with effects_from("threshold_sag.py"):
        standard_templates.templates_of(["threshold_sag"])
    (read,) = standard_templates._IN_MEMORY.values()
    assert len(read.entries) == len(made.entries) > 1
    for now, before in zip(read.entries, made.entries, strict=True):
        assert replace(now, shift=()) == replace(before, shift=()) and np.array_equal(now.shift, before.shift)
    assert np.array_equal(read.noise, made.noise) and np.array_equal(read.mean, made.mean)
    assert replace(read, entries=(), noise=(), mean=()) == replace(made, entries=(), noise=(), mean=())


def with_the_pages_code(name: str) -> None:
    """The page's law and limiting case in place of those of the new file."""
    Path(f"{name}.py").write_text(LAW, encoding="utf-8")
    test = Path(f"test_{name}.py")
    before, _, _ = test.read_text(encoding="utf-8").partition("def test_limiting_case")
    test.write_text(before + LIMITING_CASE, encoding="utf-8")


def pytest_says(words: list[str]) -> None:
    done = subprocess.run([sys.executable, *words, "-q", "-p", "no:cacheprovider"], capture_output=True, text=True)
    assert done.returncode == 0 and " passed" in done.stdout, done.stdout + done.stderr
