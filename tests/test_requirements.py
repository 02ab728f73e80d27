"""The pinned releases are of the packages that pyproject.toml declares; the oldest pins are its lower ends."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[1]


def normal(name: str) -> str:
    return name.strip().lower().replace("_", "-")


def declared() -> dict[str, str]:
    """Package -> oldest release that is allowed."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    parts = [requirement.partition(";")[0].partition(">=") for requirement in project["dependencies"]]
    return {normal(name): oldest.strip() for name, _, oldest in parts}


def pins(file: str) -> dict[str, str]:
    lines = [line.partition(";")[0] for line in (ROOT / file).read_text(encoding="utf-8").splitlines()]
    parts = [line.partition("==") for line in lines if "==" in line and not line.startswith("#")]
    return {normal(name): version.strip() for name, _, version in parts}


def numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("+")[0].split(".") if part.isdigit())


def test_the_oldest_pins_are_the_lower_ends_of_what_is_declared():
    oldest = pins("constraints-oldest.txt")
    assert set(declared()) <= set(oldest)
    for name, lowest in declared().items():
        if name != "torch":
            assert numbers(oldest[name])[: len(numbers(lowest))] == numbers(lowest), name


@pytest.mark.parametrize("file", ["constraints.txt", "constraints-oldest.txt"])
def test_every_declared_package_is_pinned_within_its_range(file):
    pinned = pins(file)
    for name, lowest in declared().items():
        if name != "tomli" or file != "constraints.txt":  # needed by Python 3.10 alone
            assert numbers(pinned[name]) >= numbers(lowest), name
