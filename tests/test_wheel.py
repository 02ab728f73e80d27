"""The sdist and the wheel that is built from it: their files, and that the installed package runs by itself."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("spikecam_env", "scenes", "denoiser")
NOT_INSTALLED = ("tests", "tools", "benchmarks", "examples", "docs")
OLDEST_SETUPTOOLS = 77
"""The first that reads the licence as pyproject.toml states it."""

pytestmark = pytest.mark.slow


def run(*words: object, cwd: Path, **environment: str) -> str:
    """Standard output of a program that succeeds.  Its environment has no PYTHONPATH but the given one."""
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [str(word) for word in words], cwd=cwd, capture_output=True, text=True, env={**inherited, **environment}
    )
    assert done.returncode == 0, f"{' '.join(map(str, words))}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The checkout's files, without built ones."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=ROOT, capture_output=True
    )
    if listed.returncode:
        pytest.skip("this is no git checkout")
    folder = tmp_path_factory.mktemp("sources")
    for name in listed.stdout.decode().split("\0"):
        if name and (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, folder / name)
    return folder


@pytest.fixture(scope="module")
def sdist(sources: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    try:
        built_by = version("setuptools")
    except PackageNotFoundError:
        built_by = "0"
    if int(built_by.split(".")[0]) < OLDEST_SETUPTOOLS or find_spec("pip") is None:
        pytest.skip(f"needs pip and setuptools {OLDEST_SETUPTOOLS} or later in the environment")
    out = tmp_path_factory.mktemp("sdist")
    build = "import sys; from setuptools import build_meta; print(build_meta.build_sdist(sys.argv[1]))"
    return out / run(sys.executable, "-c", build, out, cwd=sources).splitlines()[-1]


@pytest.fixture(scope="module")
def wheel(sdist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from the sdist, so that a file which the sdist lacks is missed."""
    out = tmp_path_factory.mktemp("wheel")
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-index", "--no-deps", "--no-build-isolation")
    run(*pip, "--wheel-dir", out, sdist, cwd=out)
    (built,) = out.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The only folder on PYTHONPATH below; the dependencies are the environment's."""
    folder = tmp_path_factory.mktemp("installed")
    pip = (sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps")
    run(*pip, "--target", folder, wheel, cwd=folder)
    return folder


def files_of(packages: tuple[str, ...], folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for name in packages for path in (folder / name).rglob("*") if path.is_file()}


def test_the_wheel_has_every_file_of_the_packages_and_nothing_else(wheel: Path, sources: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    inside = {name for name in names if not name.split("/")[0].endswith(".dist-info")}
    data = {name for name in inside if not name.endswith(".py")}
    print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.1f} MB, {len(inside)} files, {len(data)} of them data")
    assert inside == files_of(PACKAGES, sources)
    assert any(name.endswith("/licenses/LICENSE") for name in names)


def test_the_sdist_has_what_the_wheel_is_built_from_and_no_tests(sdist: Path, sources: Path) -> None:
    with tarfile.open(sdist) as archive:
        names = {member.name.partition("/")[2] for member in archive.getmembers() if member.isfile()}
    assert files_of(PACKAGES, sources) <= names
    assert {"pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md"} <= names
    assert not {name.split("/")[0] for name in names} & set(NOT_INSTALLED)


def test_the_installed_command_streams_denoises_and_shows(installed: Path, tmp_path: Path) -> None:
    """Model, scene, engine, weights and font, with code that is compiled anew; not optimised, which takes as long."""
    command = installed / "bin" / "spikecam"
    cache = {"PYTHONPATH": str(installed), "NUMBA_CACHE_DIR": str(tmp_path / "compiled"), "NUMBA_OPT": "0"}
    said = run(command, "demo", "--quick", "--frames", 175, "--size", 32, 48, "--out", "demo", cwd=tmp_path, **cache)
    print(said, end="")
    assert (tmp_path / "demo" / "demo.png").stat().st_size > 1000


def test_the_installed_package_imports_nothing_of_the_checkout(installed: Path, tmp_path: Path) -> None:
    """Every module of it, by a Python that does not look into the folder it is started in."""
    code = (
        "import pkgutil, sys, importlib\n"
        f"for package in {PACKAGES}:\n"
        "    root = importlib.import_module(package)\n"
        f"    assert root.__file__.startswith({str(installed)!r}), root.__file__\n"
        "    for module in pkgutil.walk_packages(root.__path__, package + '.'):\n"
        "        if not module.name.endswith('__main__'):\n"
        "            try:\n"
        "                importlib.import_module(module.name)\n"
        "            except ModuleNotFoundError as error:\n"
        "                print('left out:', module.name, 'needs', error.name)\n"
        f"print('from the checkout:', sorted({set(NOT_INSTALLED)} & set(sys.modules)))\n"
        "from spikecam_env.sensor import SensorModel\n"
        "print(*map(SensorModel.preset, ('ideal', 'scsim', 'physical', 'measured')))\n"
    )
    safe = ("-P",) if sys.version_info >= (3, 11) else ()
    said = run(sys.executable, *safe, "-c", code, cwd=tmp_path, PYTHONPATH=str(installed)).splitlines()
    left_out = [line for line in said if line.startswith("left out:")]
    print(*left_out, sep="\n")
    assert "from the checkout: []" in said
    assert not [line for line in left_out if line.split()[-1].split(".")[0] in (*PACKAGES, *NOT_INSTALLED)]
