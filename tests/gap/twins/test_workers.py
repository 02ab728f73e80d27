"""Threads of linear algebra during a diagnosis."""

from __future__ import annotations

import importlib
from collections.abc import Iterator

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from spikecam_env.gap.diagnose import diagnose
from spikecam_env.gap.ladder import ladder
from spikecam_env.gap.twins.workers import sums_in_one_order


def threads_of_linear_algebra() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def two_threads_of_linear_algebra() -> Iterator[None]:
    """Tests have one (`tests/conftest.py`), users as many as processors."""
    with threadpool_limits(2, user_api="blas"):
        assert threads_of_linear_algebra() == {2}
        yield


def test_linear_algebra_takes_one_thread_during_a_diagnosis_and_what_it_took_after_it() -> None:
    assert sums_in_one_order(threads_of_linear_algebra)() == {1}
    assert threads_of_linear_algebra() == {2}


@pytest.mark.parametrize("command", [diagnose, ladder], ids=["diagnose", "ladder"])
def test_linear_algebra_takes_one_thread_in_a(command, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    class Read(Exception):
        """How far the command is to go."""

    def read(folder: object) -> None:
        raise Read(threads_of_linear_algebra())

    monkeypatch.setattr(importlib.import_module(command.__module__), "read_campaign", read)
    with pytest.raises(Read) as reached:
        command("anywhere")
    assert reached.value.args == ({1},)
