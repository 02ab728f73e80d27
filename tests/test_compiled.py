"""Compiled code runs where the package does: read-only, without a home, on a full disk; kept where no other writes.

Of processes that start together one compiles."""

from __future__ import annotations

import errno
import fcntl
import os
import re
import shutil
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from spikecam_env import compiled
from spikecam_env.locks import lock

ROOT = Path(__file__).parents[1]
PACKAGES = ("spikecam_env", "scenes", "denoiser")
BOUND_BY_MODES = ["setpriv", "--bounding-set=-dac_override,-dac_read_search", "--inh-caps=-all"]
"""Makes root heed permission bits."""

USES_A_KERNEL = """
import numpy as np
from spikecam_env.sensor import light
a = np.ones(5, np.float32)
assert light.same_light(a, a)
print(sum(light._same_words.stats.cache_hits.values()), "from the cache")
"""


@pytest.fixture
def read_only(tmp_path: Path) -> Iterator[Path]:
    """A copy of the packages and a home, neither of which can be written to."""
    package = tmp_path / "package"
    for name in PACKAGES:
        shutil.copytree(ROOT / name, package / name, ignore=shutil.ignore_patterns("__pycache__", "*.pt"))
    (tmp_path / "home").mkdir()
    (tmp_path / "tmp").mkdir()
    closed = [tmp_path / "home", package, *package.rglob("*")]
    for path in closed:
        path.chmod(path.stat().st_mode & ~0o222)
    yield tmp_path
    for path in closed:
        path.chmod(path.stat().st_mode | 0o200)


def run(folder: Path, *arguments: str) -> str:
    """Output of Python with a read-only package, no home to write to, and TMPDIR in `folder`."""
    as_user = BOUND_BY_MODES if os.getuid() == 0 else []
    if as_user and not shutil.which("setpriv"):
        pytest.skip("root writes everywhere, and there is no setpriv to hold it back")
    environment = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    environment |= {
        "HOME": str(folder / "home"),
        "TMPDIR": str(folder / "tmp"),
        "PYTHONPATH": str(folder / "package"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    done = subprocess.run(
        [*as_user, sys.executable, *arguments], env=environment, cwd=folder, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_read_only_package_without_a_home_runs_and_keeps_what_it_compiles(read_only: Path) -> None:
    assert "tau_us" in run(read_only, "-m", "spikecam_env", "effects", "show", "dead_time")
    assert run(read_only, "-c", USES_A_KERNEL) == "0 from the cache\n"
    assert run(read_only, "-c", USES_A_KERNEL) == "1 from the cache\n"
    kept = read_only / "tmp" / f"spikecam-env-{os.getuid()}"
    assert stat.S_IMODE(kept.stat().st_mode) == 0o700
    assert list(kept.rglob("light._same_words*.nbc"))


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where the private folder is looked for, instead of among the machine's temporary files."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    compiled.private_folder.cache_clear()
    yield tmp_path / f"spikecam-env-{os.getuid()}"
    compiled.private_folder.cache_clear()


@pytest.mark.parametrize("trap", ["others may write", "a link", "a file", "somebody else's"])
def test_code_is_not_kept_where_others_could_put_theirs(trap: str, temporary: Path, monkeypatch) -> None:
    if trap == "others may write":
        temporary.mkdir()
        temporary.chmod(0o777)
    elif trap == "a link":
        (temporary.parent / "theirs").mkdir(mode=0o700)
        temporary.symlink_to(temporary.parent / "theirs")
    elif trap == "a file":
        temporary.touch()
    else:
        uid = os.getuid()
        temporary.with_name(f"spikecam-env-{uid + 1}").mkdir(mode=0o700)
        monkeypatch.setattr(os, "getuid", lambda: uid + 1)
    assert compiled.private_folder() is None


def no_place(dispatcher: object) -> None:
    raise RuntimeError("cannot cache function: no locator available")


def test_without_any_place_for_a_cache_functions_are_compiled_all_the_same(monkeypatch) -> None:
    from numba.core.dispatcher import Dispatcher

    monkeypatch.setattr(Dispatcher, "enable_caching", no_place)
    for folder in (None, Path("/nowhere")):
        monkeypatch.setattr(compiled, "private_folder", lambda folder=folder: folder)
        assert compiled.njit(cache=True)(lambda x: x + 1)(2) == 3


def test_a_full_disk_loses_the_cache_and_not_the_result(monkeypatch) -> None:
    from numba.core.caching import FunctionCache

    def full(*arguments: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(FunctionCache, "_save_overload", full)
    doubled = compiled.njit(cache=True)(lambda x: 2 * x)
    assert doubled(4) == 8
    assert doubled._cache.cache_path


def test_of_processes_that_need_a_function_at_once_one_compiles_it(tmp_path: Path) -> None:
    turn = tmp_path / "turn"
    code = f"""
from pathlib import Path
from spikecam_env import compiled
from spikecam_env.locks import lock
alone = compiled._alone
compiled._alone = lambda path: alone(Path({str(turn)!r}))  # one file for all, which the test holds at first
{USES_A_KERNEL.replace("a = np", "print('ready', flush=True); a = np", 1)}
"""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    running = []
    with compiled._alone(turn):
        for _ in range(3):
            running.append(
                subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True)
            )
        for process in running:
            assert process.stdout is not None and process.stdout.readline() == "ready\n"
    said = sorted(process.communicate(timeout=120)[0] for process in running)
    assert said == ["0 from the cache\n", "1 from the cache\n", "1 from the cache\n"]


def test_a_process_that_never_ends_its_turn_delays_others_and_no_more(tmp_path: Path, monkeypatch) -> None:
    turn = tmp_path / "turn"
    turn.touch()
    monkeypatch.setattr(compiled, "LONGEST_WAIT_S", 0.2)
    began = time.monotonic()
    held = lock(turn)
    with compiled._alone(turn):
        assert time.monotonic() - began >= 0.2
    os.close(held)
    with compiled._alone(tmp_path / "no such folder" / "turn"):
        pass


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.ENOLCK])
def test_where_there_are_no_locks_nobody_waits(number: int, tmp_path: Path, monkeypatch) -> None:
    def flock(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", flock)
    monkeypatch.setattr(compiled, "LONGEST_WAIT_S", 2.0)
    (tmp_path / "turn").touch()  # as an earlier process leaves it
    began = time.monotonic()
    with compiled._alone(tmp_path / "turn"):
        assert time.monotonic() - began < 1.0


def test_all_compiled_code_is_decorated_in_one_place() -> None:
    files = [f for name in PACKAGES for f in (ROOT / name).rglob("*.py") if f.name != "compiled.py"]
    others = re.compile(r"numba\.(njit|jit)\b|from numba import .*\bn?jit\b|cache=True.*\bvectorize")
    assert not [str(f.relative_to(ROOT)) for f in files if others.search(f.read_text(encoding="utf-8"))]


def test_without_compiling_the_sensor_s_specification_runs_and_the_fast_engine_says_why_it_cannot() -> None:
    code = (
        "import numpy as np; from spikecam_env.sensor import SensorModel, SpikeSensor\n"
        "model, light = SensorModel.preset('scsim'), np.full((4, 4), 0.3)\n"
        "print(int(SpikeSensor(model, (4, 4), engine='reference').step(light, frames=20).sum()) > 0)\n"
        "try: SpikeSensor(model, (4, 4), engine='fast').step(light, frames=20)\n"
        "except NotImplementedError as error: print(error)"
    )
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=120)
    assert done.stdout.startswith("True\n") and "not usable in pure-python" in done.stdout, done.stderr


LAW = "from spikecam_env.compiled import njit\n\n@njit(inline='always')\ndef law(x):\n    return x + {step}\n"
CALLER = """
import numpy as np
from law import law
from spikecam_env.compiled import njit
from sizes import SIZE

@njit(cache=True)
def total(x):
    return law(x) * SIZE

print(total(1), sum(total.stats.cache_hits.values()))
"""


def test_kept_code_is_stale_when_a_file_or_a_number_that_it_is_compiled_with_has_changed(tmp_path: Path) -> None:
    """numba by itself looks only at the file of the function."""
    (tmp_path / "caller.py").write_text(CALLER)

    def printed(step: int, size: int) -> str:
        for name, text in (("law.py", LAW.format(step=step)), ("sizes.py", f"SIZE = {size}\n")):
            if not (tmp_path / name).exists() or (tmp_path / name).read_text() != text:
                (tmp_path / name).write_text(text)
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
        environment.pop("NUMBA_CACHE_DIR", None)
        asked = [sys.executable, "-c", "import caller"]
        return subprocess.run(asked, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True).stdout

    assert printed(step=1, size=10) == "20 0\n"
    assert printed(step=2, size=10) == "30 0\n"
    assert printed(step=2, size=7) == "21 0\n"
    assert printed(step=2, size=7) == "21 1\n", "kept while nothing has changed"
