"""The modules of the API reference, and the public names of each."""

from __future__ import annotations

import ast
import inspect
import sys
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

MODULES = (
    "spikecam_env",
    "spikecam_env.sensor",
    "spikecam_env.sensor.effects.base",
    "spikecam_env.sensor.effects.identification",
    "spikecam_env.streams",
    "spikecam_env.envs.registration",
    "spikecam_env.envs.rotating_disk",
    "spikecam_env.envs.scene",
    "spikecam_env.envs.tasks.env",
    "spikecam_env.envs.tasks.base",
    "spikecam_env.envs.vector",
    "spikecam_env.envs.light_between",
    "spikecam_env.envs.wrappers",
    "spikecam_env.envs.wrappers.sb3",
    "spikecam_env.agents.agent",
    "spikecam_env.agents.training",
    "spikecam_env.agents.tracker",
    "spikecam_env.campaign",
    "spikecam_env.calibration",
    "spikecam_env.gap",
    "spikecam_env.datasets",
    "spikecam_env.errors",
    "scenes",
    "scenes.catalogue",
    "scenes.world",
    "scenes.mujoco",
    "scenes.camera",
    "scenes.exposure",
    "scenes.meshes",
    "scenes.trajectories",
    "scenes.textures",
    "denoiser",
    "denoiser.dataset",
)
"""Each stands on one page of docs/reference/api."""


def names_of(module: str) -> list[str]:
    """Public names of a module: its `__all__`, or the functions and classes that it defines, private ones apart."""
    loaded = import_module(module)
    offered = getattr(loaded, "__all__", None)
    if offered is not None:
        return sorted(offered, key=str.casefold)
    made_here = (n for n, value in vars(loaded).items() if getattr(value, "__module__", None) == module)
    offered = (n for n in made_here if not n.startswith("_") and kind_of(vars(loaded)[n]) in ("class", "function"))
    return sorted(offered, key=str.casefold)


def home_of(module: str, name: str) -> str:
    """The module that explains a name: one above its definition that offers it too, or else `module`."""
    made_in = getattr(getattr(import_module(module), name), "__module__", None) or module
    above = [m for m in MODULES if f"{made_in}.".startswith(f"{m}.") and name in names_of(m)]
    return max(above, key=len, default=module)


def kind_of(value: Any) -> str:
    """`module`, `class`, `function` or `data`, as Sphinx's directives are named."""
    if isinstance(value, ModuleType):
        return "module"
    if inspect.isclass(value):
        return "class"
    return "function" if inspect.isroutine(value) else "data"


def docstring_of(module: str, name: str) -> str:
    """The docstring of an offered name: its own, not that of its type; of data, the string below its assignment."""
    value = getattr(import_module(module), name)
    if kind_of(value) != "data":
        return inspect.getdoc(value) or ""
    return next(filter(None, (_below_assignment(home, name) for home in _homes(value, module, name))), "")


def _homes(value: Any, module: str, name: str) -> list[ModuleType]:
    """Loaded modules that have this very value under this name, the one that offers it first."""
    package = module.partition(".")[0]
    others = [m for key, m in sorted(sys.modules.items()) if key.split(".")[0] == package and key != module]
    return [m for m in (import_module(module), *others) if vars(m).get(name) is value]


def _below_assignment(module: ModuleType, name: str) -> str:
    body = ast.parse(Path(module.__file__ or "").read_text(encoding="utf-8")).body
    for assigned, below in pairwise(body):
        targets = assigned.targets if isinstance(assigned, ast.Assign) else [getattr(assigned, "target", None)]
        if any(isinstance(t, ast.Name) and t.id == name for t in targets) and isinstance(below, ast.Expr):
            said = getattr(below.value, "value", "")
            return inspect.cleandoc(said) if isinstance(said, str) else ""
    return ""
