"""Benches that are programs of a checkout: the command names their place, and the program is there."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from spikecam_env.cli.bench import BENCHES, MOVED
from spikecam_env.cli.main import run


@pytest.mark.parametrize("name", MOVED)
def test_a_bench_that_moved_says_where_it_is(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["bench", name]) == 2
    assert f"python -m benchmarks.{name}" in capsys.readouterr().err
    assert find_spec(f"benchmarks.{name}")


@pytest.mark.parametrize("place", BENCHES.values())
def test_a_bench_is_installed(place: str) -> None:
    assert find_spec(place.split(":")[0])
