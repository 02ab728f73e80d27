"""Imports: imports of programs, and imports that packages spare, offer, or may not make.

Programs of a checkout take minutes and are run by hand; these tests say that their imports are still found.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("benchmarks", "tools")
NOT_INSTALLED = (*ROOMS, "tests")
PROGRAMS = sorted(f"{room}.{path.stem}" for room in ROOMS for path in (ROOT / room).glob("*.py"))


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_imports(name: str) -> None:
    assert import_module(name)


@pytest.mark.parametrize(
    ("module", "spared"),
    [
        ("spikecam_env.sensor", ("torch", "matplotlib", "scipy.stats", "scipy.interpolate", "cv2")),
        ("scenes", ("torch", "matplotlib", "scipy.stats", "trimesh", "OpenGL")),
        ("denoiser", ("matplotlib", "scipy.stats", "trimesh", "OpenGL")),
        ("spikecam_env.calibration", ("torch", "matplotlib", "scipy.stats")),
    ],
)
def test_an_import_spares_what_only_some_calls_need(module: str, spared: tuple[str, ...]) -> None:
    """They take up to seconds, in each process that a vector or a dataset starts."""
    code = f"import sys, {module}; print(sorted({set(spared)!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("package", ["spikecam_env", "scenes", "denoiser"])
def test_what_a_package_offers_is_not_lost_to_a_module_of_that_name(package: str) -> None:
    """When a module is first imported, it becomes an attribute of its package, over whatever has the same name there:
    `from package import name` would depend on earlier imports."""
    lost = []
    for init in (ROOT / package).rglob("__init__.py"):
        inside = {path.stem for path in init.parent.iterdir() if path.suffix == ".py" or path.is_dir()}
        home = ".".join(init.parent.relative_to(ROOT).parts)
        for node in ast.walk(ast.parse(init.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                names = {alias.asname or alias.name for alias in node.names} & inside
                lost += [
                    f"{home}.{name} of {node.module}" for name in names if node.module not in (home, f"{home}.{name}")
                ]
    assert not lost


@pytest.mark.parametrize("room", NOT_INSTALLED)
def test_no_library_imports_what_is_not_installed(room: str) -> None:
    said = [
        path
        for package in ("spikecam_env", "scenes", "denoiser")
        for path in (ROOT / package).rglob("*.py")
        for line in path.read_text(encoding="utf-8").splitlines()
        if line.strip().startswith((f"from {room}", f"import {room}")) or f'"{room}.' in line
    ]
    assert not said
