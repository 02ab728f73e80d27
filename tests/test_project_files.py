"""Files about the project describe it as it is: versions, Pythons, formats, commands."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from PIL import Image

from spikecam_env import __version__
from spikecam_env.cli.first_words import check_words
from spikecam_env.cli.main import COMMANDS

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("spikecam_env", "scenes", "denoiser")
FORMAT = re.compile(r"\bspikecam-[a-z]+/[0-9]+\b")


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


PROJECT = tomllib.loads(text_of("pyproject.toml"))["project"]


def test_the_citation_is_of_this_version() -> None:
    assert f"\nversion: {__version__}\n" in text_of("CITATION.cff")
    assert f"\nlicense: {PROJECT['license']}\n" in text_of("CITATION.cff")


def test_the_pictures_of_the_readme_move_and_load_at_once() -> None:
    names = re.findall(r"!\[[^]]*\]\(([^)]*)\)", text_of("README.md"))
    assert names
    for name in names:
        with Image.open(ROOT / name) as picture:
            print(f"{name}: {picture.n_frames} pictures, {(ROOT / name).stat().st_size} bytes")
            assert picture.n_frames > 1 and (ROOT / name).stat().st_size < 3_000_000


def test_hosted_ci_runs_every_python_that_is_declared_and_no_other() -> None:
    matrix = re.search(r"python: \[(.*)\]", text_of(".github/workflows/ci.yml"))
    assert matrix is not None
    tried = re.findall(r"3\.[0-9]+", matrix.group(1))
    declared = [c.rpartition(" ")[2] for c in PROJECT["classifiers"] if re.search(r"Python :: 3\.", c)]
    assert tried == declared and PROJECT["requires-python"] == f">={declared[0]}"
    assert (ROOT / ".ci" / "run").is_file() and "run: .ci/run" in text_of(".github/workflows/ci.yml")
    assert "run: make test-oldest" in text_of(".github/workflows/ci.yml")


def test_the_changelog_lists_every_format_with_the_module_that_names_it() -> None:
    rows = re.findall(r"^\| `(\S+)` \| .+ \| `(\S+)` \|$", text_of("CHANGELOG.md"), re.MULTILINE)
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    written = {name for path in files for name in FORMAT.findall(path.read_text(encoding="utf-8"))}
    assert {name for name, _ in rows} == written
    for name, module in rows:
        assert f'"{name}"' in text_of(module), (name, module)


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", "CHANGELOG.md", ".github/ISSUE_TEMPLATE/effect.md"])
def test_commands_and_files_that_a_page_names_are_there(page: str) -> None:
    text = text_of(page)
    for words in re.findall(r"(?:\.venv/bin/|`)spikecam ([a-z][^`#\n]*)", text):
        if words.split()[0] != "blind-trial":  # named as what it was
            check_words(words.split(), COMMANDS)
    for target in re.findall(r"(?:`|^ +)make ([a-z-]+)", text, re.MULTILINE):
        assert f"\n{target}:" in text_of("Makefile"), target
    for module in re.findall(r"python -m (benchmarks\.\w+|tools\.\w+)", text):
        assert (ROOT / module.replace(".", "/")).with_suffix(".py").is_file(), module
    for link in re.findall(r"\]\((?!http)([^)#]+)", text):
        assert (ROOT / link).is_file(), link
