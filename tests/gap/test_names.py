"""The names of `spikecam_env.gap` that are also names of its modules."""

from __future__ import annotations

import pytest


@pytest.mark.parametrize("name", ["diagnose", "ladder"])
def test_the_packages_name_is_the_function_whichever_is_imported_first(name):
    """The module of that name, imported later, would take its place."""
    import importlib

    import spikecam_env.gap as gap

    module = importlib.import_module(f"spikecam_env.gap.{name}")
    assert getattr(gap, name) is getattr(module, name) and callable(getattr(gap, name))
