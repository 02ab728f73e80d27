"""The reference has every public name, command and option, and the examples of docstrings do what they say."""

from __future__ import annotations

import doctest
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spikecam_env.cli.first_words import commands_of, options_of
from tools.site import commands
from tools.site.docstrings import rendered
from tools.site.pages import GENERATED, ROOT, filled_in
from tools.site.public import MODULES, docstring_of, home_of, kind_of, names_of

API = ROOT / "docs" / "reference" / "api"
PACKAGES = ("spikecam_env", "spikecam_env.sensor", "spikecam_env.streams", "spikecam_env.gap", "spikecam_env.datasets",
            "spikecam_env.calibration", "spikecam_env.campaign", "spikecam_env.envs.wrappers", "scenes",
            "scenes.catalogue", "denoiser")  # fmt: skip
"""Packages whose names users import; each is in the reference, whatever else is."""
NAMES = [(module, name) for module in MODULES for name in names_of(module) if home_of(module, name) == module]


def test_every_module_of_the_reference_stands_on_one_page() -> None:
    placed = [m["of"] for page in API.glob("*.md") for m in GENERATED.finditer(page.read_text(encoding="utf-8"))]
    assert sorted(placed) == sorted(MODULES) and set(PACKAGES) <= set(MODULES)


@pytest.mark.parametrize("module, name", NAMES, ids=lambda part: part)
def test_a_public_name_says_what_it_is(module: str, name: str) -> None:
    value = getattr(import_module(module), name)
    assert docstring_of(module, name) or kind_of(value) == "module"


@pytest.fixture(scope="module")
def command_line() -> str:
    """The page of the command line, for which every command's parser is made."""
    return filled_in("<!-- generated: commands -->", "reference/command_line.md")


@pytest.mark.parametrize(
    "words, kind", [*commands.every_command()], ids=lambda value: " ".join(value) if isinstance(value, tuple) else ""
)
def test_every_option_of_a_command_is_in_the_reference(words: tuple[str, ...], kind: Any, command_line: str) -> None:
    title = f"spikecam {' '.join(words)}"
    [section] = re.findall(rf"^#+ {title}\n(.*?)(?=^## |^### |\Z)", command_line, re.MULTILINE | re.DOTALL)
    written = set(re.findall(r"--([a-z][a-z0-9-]*)", " ".join(re.findall(r"^`(-.*?)`", section, re.MULTILINE))))
    assert written == (set() if commands_of(kind) else options_of(kind).keys())


def test_docstrings_become_fields_and_nothing_of_them_is_markup() -> None:
    text = """A camera of `shape` pixels: 2*3.

    T = 1/x

model: what kind of
    camera.  seed: which unit.
radius     [pixels] of the disk
           at rest
Raises InputError for a seed_ below 0.

>>> 1 + 1
2
"""
    lines = rendered(text, ("model", "seed", "radius"))
    assert lines[:1] == [r"A camera of \ ``shape``\  pixels: 2\*3."]
    assert "       T = 1/x" in lines and "::" in lines
    fields = [line for line in lines if line.startswith(":")][1:]
    assert fields == [
        ":param model: what kind of camera.",
        ":param seed: which unit.",
        ":param radius: [pixels] of the disk at rest",
        r":raises InputError: for a seed\_ below 0.",
    ]
    assert lines[-3:] == [">>> 1 + 1", "2", ""]


def test_sections_of_a_docstring_become_fields() -> None:
    text = """A camera.

Args:
    model: what kind of
        camera, a `str`.
    rows, columns: size.

Returns:
    (T, H, W) uint8.

Raises:
    InputError: for a seed_ below 0.

Example:
    >>> 1 + 1
    2
"""
    assert rendered(text) == [
        "A camera.",
        "",
        r":param model: what kind of camera, a \ ``str``\ .",
        ":param rows: size.",
        ":param columns: size.",
        ":returns: (T, H, W) uint8.",
        r":raises InputError: for a seed\_ below 0.",
        "",
        ">>> 1 + 1",
        "2",
        "",
    ]


@pytest.mark.parametrize(
    "text, code",
    [
        ('env = gymnasium.make_vec("spikecam_env/Fan-v0", num_envs=2)', True),
        ("import numpy", True),
        ("T = 1/x + tau", False),
        ("x <- x (1 - exp(-t/tau))", False),
        ("begin    what the effect remembers", False),
    ],
)
def test_python_in_a_docstring_is_code_and_a_formula_is_not(text: str, code: bool) -> None:
    assert (".. code-block:: python" in rendered(f"A camera.\n\n    {text}\n")) is code


def test_a_paragraph_of_titled_lines_becomes_a_list_and_one_titled_line_stays_prose() -> None:
    assert rendered("A task.\n\nScene: a disc\n    turns.\nAction: `two` numbers: pan, tilt.")[2:4] == [
        ":Scene: a disc turns.",
        r":Action: \ ``two``\  numbers: pan, tilt.",
    ]
    assert rendered("A task.\n\nScene: a disc.")[2] == "Scene: a disc."


def examples_of(module: str, name: str) -> list[doctest.DocTest]:
    """Of a function or class and its methods, with what the reference says they begin with: numpy, and the names of
    their module."""
    value = getattr(import_module(module), name)
    if kind_of(value) not in ("class", "function"):
        return []
    given = {offered: getattr(import_module(module), offered) for offered in names_of(module)}
    home = import_module(value.__module__)
    found = doctest.DocTestFinder().find(value, name, module=home, globs={**given, "np": np})
    return [one for one in found if one.examples]


WITH_EXAMPLE = [(module, name) for module, name in NAMES if examples_of(module, name)]


@pytest.mark.parametrize("module, name", WITH_EXAMPLE, ids=lambda part: part)
def test_examples_in_docstrings_of_public_names_do_what_they_say(
    module: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    runner = doctest.DocTestRunner()
    for found in examples_of(module, name):
        runner.run(found)
    assert runner.failures == 0 and runner.tries > 0


def test_every_public_function_and_class_has_an_example() -> None:
    callable_names = {(m, n) for m, n in NAMES if kind_of(getattr(import_module(m), n)) in ("class", "function")}
    print(f"{len(callable_names)} public functions and classes")
    assert not callable_names - {*WITH_EXAMPLE}
