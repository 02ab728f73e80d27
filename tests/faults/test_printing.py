"""Output of the command that nobody takes, and warnings."""

from __future__ import annotations

import subprocess
import sys
import warnings

import pytest

from spikecam_env.cli import main

SPIKECAM = f"{sys.executable} -m spikecam_env"


@pytest.mark.parametrize(
    ("line", "codes", "error"),
    [
        ("{} effects > /dev/full", {2}, "spikecam: cannot write to standard output: No space left on device\n"),
        ("{} --help > /dev/full", {2}, "spikecam: cannot write: the disk is full\n"),
        ("{} effects >&-", {2}, "spikecam: standard output is closed; give it somewhere to go, e.g. > /dev/null\n"),
        ("set -o pipefail; {} effects | head -1 > /dev/null", {0, 141}, ""),
        ("set -o pipefail; {} --help | true", {0, 141}, ""),
        ("{} effects nope 2>&-", {2}, ""),
        ("{} effects show dead_time > /dev/null 2>&-", {0}, ""),
    ],
)
def test_output_that_nobody_takes_ends_without_a_traceback(line: str, codes: set[int], error: str) -> None:
    done = subprocess.run(["bash", "-c", line.format(SPIKECAM)], capture_output=True, text=True)
    assert done.returncode in codes, (done.returncode, done.stderr)
    assert "Traceback" not in done.stderr and "ignored" not in done.stderr
    assert done.stderr in (error, "spikecam: cannot write: the disk is full\n" if error else "")


@pytest.mark.filterwarnings("ignore:not ours")
def test_warnings_of_this_project_are_lines_and_each_is_said_once(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    def warn(self) -> None:
        for _ in range(2):
            for text in ("the frame rate is\nnot known", "half a frame"):
                warnings.warn_explicit(text, UserWarning, main.__file__, 1, registry={})
        warnings.warn_explicit("not ours", UserWarning, "/elsewhere/torch.py", 1, registry={})

    monkeypatch.setattr(main.Effects, "run", warn)
    before = warnings.showwarning
    for _ in range(2):
        assert main.run(["effects"]) == 0
        lines = capsys.readouterr().err.splitlines()
        ours = [line for line in lines if line.startswith("spikecam: ")]
        assert ours == ["spikecam: warning: the frame rate is not known", "spikecam: warning: half a frame"]
    assert warnings.showwarning is before


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (OSError(28, "No space left on device", "/data/x"), "spikecam: the disk is full: /data/x\n"),
        (PermissionError(13, "Permission denied", "/data/x"), "spikecam: Permission denied: /data/x\n"),
        (MemoryError("Unable to allocate 8 TiB"), "spikecam: out of memory (Unable to allocate 8 TiB); "),
        (MemoryError(), "spikecam: out of memory\n"),
    ],
)
def test_faults_of_the_machine_are_a_line_and_code_2(error: Exception, line: str, monkeypatch, capsys) -> None:
    def fail(self) -> None:
        raise error

    monkeypatch.setattr(main.Effects, "run", fail)
    assert main.run(["effects"]) == 2
    assert capsys.readouterr().err.startswith(line)


def test_a_bug_is_not_hidden(monkeypatch) -> None:
    def fail(self) -> None:
        raise RuntimeError("a bug")

    monkeypatch.setattr(main.Effects, "run", fail)
    with pytest.raises(RuntimeError, match="a bug"):
        main.run(["effects"])
