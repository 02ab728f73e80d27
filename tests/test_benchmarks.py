"""Benchmarks take minutes and are run by hand; that they still find what they import is told here."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "benchmarks"


@pytest.mark.parametrize("name", sorted(p.stem for p in FOLDER.glob("*.py")))
def test_a_benchmark_imports(name):
    assert import_module(f"benchmarks.{name}")
