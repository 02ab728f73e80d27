from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.commands import said
from tests.faults.writing import EndsInALine, inputs_in


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return inputs_in(tmp_path_factory.mktemp("inputs"))


@pytest.fixture
def ends_in_a_line(inputs: dict[str, Path], monkeypatch: pytest.MonkeyPatch, capsys) -> EndsInALine:
    """Runs a command that writes to a place: it ends with code 2 and one line, which is returned."""

    def line_of(write: Callable[..., int], out: Path) -> str:
        capsys.readouterr()
        code = write(out, inputs, monkeypatch)
        lines = said(capsys.readouterr().err)
        assert code == 2 and len(lines) == 1 and lines[0].startswith("spikecam: "), (code, lines)
        return lines[0]

    return line_of


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Callable[[int], Path]]:
    """Makes file systems of so many bytes; skips where none can be mounted."""
    mounted: list[Path] = []

    def mount(size: int) -> Path:
        folder = tmp_path / f"disk{len(mounted)}"
        folder.mkdir()
        command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
        try:
            done = subprocess.run(command, capture_output=True, text=True)
        except OSError as error:
            pytest.skip(f"no file system can be mounted: {error}")
        if done.returncode:
            pytest.skip(f"no file system can be mounted: {done.stderr.strip()}")
        mounted.append(folder)
        return folder

    yield mount
    for folder in mounted:
        subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.fixture
def read_only(tmp_path: Path) -> Iterator[Path]:
    """A folder that nothing can be written to; for root, whom permissions do not bind, a mounted one."""
    folder = tmp_path / "read-only"
    folder.mkdir()
    if os.geteuid():
        folder.chmod(0o555)
        yield folder
        folder.chmod(0o755)
        return
    command = ["mount", "-t", "tmpfs", "-o", "size=64k,ro", "tmpfs", str(folder)]
    if subprocess.run(command, capture_output=True).returncode:
        pytest.skip("root is bound by no permissions, and nothing can be mounted read-only")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)
