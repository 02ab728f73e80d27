"""Another distribution that has a package `scenes` or `denoiser`: importing ours says so, and mixes nothing."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from spikecam_env.siblings import MARK, SIBLINGS

ROOT = Path(__file__).resolve().parents[1]


def python(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Python with a folder before ours on its path."""
    path = os.pathsep.join((str(folder), str(ROOT)))
    return subprocess.run(
        [sys.executable, "-P", *words] if sys.version_info >= (3, 11) else [sys.executable, *words],
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
    )


def foreign(folder: Path, name: str) -> Path:
    """A package of that name, which says when it is imported."""
    (folder / name).mkdir()
    file = folder / name / "__init__.py"
    file.write_text("print('imported')\nDISTRIBUTION = 'another'\n")
    return file


@pytest.mark.parametrize("name", SIBLINGS)
def test_a_foreign_package_of_that_name_is_named_and_not_imported(name: str, tmp_path: Path) -> None:
    file = foreign(tmp_path, name)
    done = python(tmp_path, "-c", "import spikecam_env")
    *_, said = done.stderr.strip().splitlines()
    assert done.returncode == 1 and not done.stdout
    assert said.startswith(
        f"ImportError: the package {name!r} that Python finds, {file}, is not that of spikecam-env; "
    )


@pytest.mark.parametrize("name", SIBLINGS)
def test_the_command_says_so_in_one_line(name: str, tmp_path: Path) -> None:
    foreign(tmp_path, name)
    done = python(tmp_path, "-m", "spikecam_env", "effects")
    assert done.returncode == 2 and not done.stdout
    assert done.stderr.startswith(f"spikecam: the package {name!r}") and done.stderr.count("\n") == 1


def test_a_folder_of_that_name_is_not_taken_for_a_package(tmp_path: Path) -> None:
    """Python looks on: a package later on the path is found before a folder without an `__init__.py`."""
    (tmp_path / "scenes").mkdir()
    done = python(tmp_path, "-c", "import spikecam_env, scenes; print(scenes.DISTRIBUTION)")
    assert (done.returncode, done.stdout) == (0, "spikecam-env\n"), done.stderr


@pytest.mark.parametrize("name", SIBLINGS)
def test_ours_are_marked(name: str) -> None:
    assert MARK in (ROOT / name / "__init__.py").read_text(encoding="utf-8").splitlines()
