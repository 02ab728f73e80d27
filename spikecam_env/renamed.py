"""Old names of public classes, and old places of modules: they work for one version, with a warning."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
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


def old_modules(package: str, moved: Mapping[str, str]) -> None:
    """Let modules of a package be imported from where they were.

    Args:
        package: its `__name__`.
        moved: old name of a module below `package` -> its name below `package` now.
    """
    sys.meta_path.append(_Moved({f"{package}.{old}": f"{package}.{new}" for old, new in moved.items()}))


class _Moved(MetaPathFinder, Loader):
    def __init__(self, moved: Mapping[str, str]) -> None:
        self.moved = moved
        self.own: dict[str, ModuleSpec | None] = {}

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        return ModuleSpec(fullname, self) if fullname in self.moved else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        warn(f"{spec.name} is now {self.moved[spec.name]}", DeprecationWarning, stacklevel=2)
        module = import_module(self.moved[spec.name])
        self.own[spec.name] = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Give the module its own spec back: it has been executed where it is now."""
        module.__spec__ = self.own.pop(module.__spec__.name if module.__spec__ else "", module.__spec__)
