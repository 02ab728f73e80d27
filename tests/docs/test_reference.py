"""The reference has every public name, command and option; docstrings have one form, and their examples hold."""

from __future__ import annotations

import doctest
import inspect
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sphinx.ext.napoleon import Config, GoogleDocstring

from spikecam_env.cli.first_words import commands_of, options_of
from tools.site import commands
from tools.site.docstrings import TASK_SECTIONS, as_restructured
from tools.site.pages import GENERATED, ROOT, filled_in
from tools.site.public import MODULES, docstring_of, home_of, kind_of, names_of

API = ROOT / "docs" / "reference" / "api"
PACKAGES = ("spikecam_env", "spikecam_env.sensor", "spikecam_env.streams", "spikecam_env.gap", "spikecam_env.datasets",
            "spikecam_env.calibration", "spikecam_env.campaign", "spikecam_env.envs.wrappers", "scenes",
            "scenes.catalogue", "denoiser")  # fmt: skip
"""Packages whose names users import; each is in the reference, whatever else is."""
SECTION = re.compile(r"^(Args|Returns|Yields|Raises|Example):$", re.MULTILINE)
OTHER_FORMS = re.compile(
    r"\b(?:Errors?: |Raises (?:\w+Error|it\b))|^>>>|^(?:Args|Returns|Yields|Raises|Examples?): ?\S", re.MULTILINE
)
"""Errors in prose, examples without a heading, and headings with text behind them."""
NAMES = [(module, name) for module in MODULES for name in names_of(module) if home_of(module, name) == module]


def test_every_module_of_the_reference_stands_on_one_page() -> None:
    placed = [m["of"] for page in API.glob("*.md") for m in GENERATED.finditer(page.read_text(encoding="utf-8"))]
    assert sorted(placed) == sorted(MODULES) and set(PACKAGES) <= set(MODULES)


@pytest.mark.parametrize("module, name", NAMES, ids=lambda part: part)
def test_a_public_name_says_what_it_is(module: str, name: str) -> None:
    value = getattr(import_module(module), name)
    assert docstring_of(module, name) or kind_of(value) == "module"


def explained(module: str, name: str) -> list[tuple[Any, str]]:
    """A public name and, of a class, its public methods, each with its docstring."""
    value = getattr(import_module(module), name)
    inside = vars(value).items() if kind_of(value) == "class" else ()
    members = (getattr(value, key) for key, _ in inside if not key.startswith("_"))
    methods = [member for member in members if inspect.isfunction(member) or inspect.ismethod(member)]
    return [(value, docstring_of(module, name)), *((method, inspect.getdoc(method) or "") for method in methods)]


@pytest.mark.parametrize("module, name", NAMES, ids=lambda part: part)
def test_a_docstring_has_sections_where_it_says_more_than_a_line_and_no_other_form(module: str, name: str) -> None:
    for value, text in explained(module, name):
        assert not OTHER_FORMS.search(text), f"{value}: {OTHER_FORMS.search(text)}"
        takes_arguments = inspect.isroutine(value) and {*inspect.signature(value).parameters} - {"self"}
        if takes_arguments and "\n\n" in text:
            assert SECTION.search(text), f"{value} says more than a line and has no section"


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


def napoleon(text: str, **options: bool) -> str:
    """A docstring as docs/conf.py has it read, a space between words."""
    config = Config(napoleon_use_param=False, napoleon_use_rtype=False,
                    napoleon_custom_sections=[(title, "returns_style") for title in TASK_SECTIONS])  # fmt: skip
    made = GoogleDocstring(as_restructured(text, **options), config)
    return re.sub(r"(?<!\\)\s+", " ", str(made)).strip()


def test_sections_of_a_docstring_become_fields_and_only_code_is_markup() -> None:
    text = """A camera of `shape` pixels: 2*3, |z|, seed_.

    T = 1/x

Args:
    model: a `str`.
    rows, columns: size.

Returns:
    (T, H, W) uint8: spikes.

Raises:
    InputError: for a seed_ below 0.

Example:
    >>> 1 * 1
    1
"""
    assert napoleon(text) == (
        r"A camera of \ ``shape``\  pixels: 2\*3, \|z\|, seed\_. :: T = 1/x "
        r":Parameters: * **model** -- a \ ``str``\ . * **rows, columns** -- size. :returns: (T, H, W) uint8: spikes. "
        r":raises InputError: for a seed\_ below 0. .. rubric:: Example >>> 1 * 1 1"
    )


def test_parts_of_a_task_become_fields_and_an_attribute_has_no_type_in_its_words() -> None:
    text = "A task.\n\nScene:\n    a disc: it\n    turns.\nAction:\n    two numbers."
    assert napoleon(text) == "A task. :Scene: a disc: it turns. :Action: two numbers."
    assert napoleon("Least: most.", attribute=True) == ": Least: most."


def examples_of(module: str, name: str) -> list[doctest.DocTest]:
    """Examples of a function, or of a class and its methods; given are numpy and the names of their module."""
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
