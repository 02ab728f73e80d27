"""Old names of public classes: they work for one version, with a warning."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any
from warnings import warn


def old_names(module: str, names: dict[str, str]) -> Callable[[str], Any]:
    """The `__getattr__` of a module whose classes were renamed.

    Args:
        module: its `__name__`.
        names: old name -> the name in that module now.
    """

    def attribute(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        warn(f"{module}.{name} is now {names[name]}", DeprecationWarning, stacklevel=2)
        return getattr(sys.modules[module], names[name])

    return attribute
