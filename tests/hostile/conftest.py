"""Every case of malformed input goes through `meets`, which has the allowed outcomes; counts are printed at the end."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from tally import MALFORMED, TALLY, count

from spikecam_env.cli.main import run_parsed, understood


@cache
def command_of(words: tuple[str, ...]) -> Any:
    """The command of these words, parsed once: of many bad files in one place, the line is the same."""
    return understood(list(words))


@pytest.fixture
def meets(request, tmp_path: Path, capfd) -> Callable[..., int]:
    """Runs a command on malformed input: code 2 with one line and nothing left behind, or it was good after all.

    A third outcome fails the test.  folder: where the command may write, looked at before and after.
    """

    def call(target: str, *args: object, folder: Path = tmp_path, good_codes: tuple[int, ...] = (0,)) -> int:
        before = listing(folder)
        capfd.readouterr()
        try:
            code = run_parsed(lambda: command_of(tuple(str(a) for a in args)))
        except SystemExit as end:
            code = end.code
        printed = capfd.readouterr()
        assert "Traceback" not in printed.err
        if code == 2:
            said = [line for line in printed.err.splitlines() if line.strip() and not _is_aside(line)]
            assert len(said) == 1 and said[0].startswith("spikecam: "), printed.err
            assert len(said[0]) < 1000
            left = listing(folder) - before
            assert not left, left
        else:
            assert code in good_codes, printed.err
            for name in listing(folder) - before:
                path = folder / name
                shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
        count(target, "refused" if code == 2 else "taken")
        return code

    return call


def _is_aside(line: str) -> bool:
    """Progress bars, and warnings."""
    return "%|" in line or line.startswith("spikecam: warning: ")


def listing(folder: Path) -> set[str]:
    """Names of all that is in a folder; folders without files do not count."""
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if not p.is_dir() or any(p.iterdir())}


@pytest.fixture(autouse=True)
def counted(request) -> Iterator[None]:
    """Counts of a test go to its report, so that they are known whichever process ran it."""
    TALLY.clear()
    yield
    request.node.user_properties.append((MALFORMED, {target: dict(outcomes) for target, outcomes in TALLY.items()}))
