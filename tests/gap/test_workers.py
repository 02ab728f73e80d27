"""What runs on which threads."""

from __future__ import annotations

from threadpoolctl import threadpool_info

from spikecam_env.gap.diagnose import diagnose
from spikecam_env.gap.workers import sums_in_one_order


def threads_of_linear_algebra() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_linear_algebra_takes_one_thread_during_a_diagnosis_and_what_it_took_after_it() -> None:
    before = threads_of_linear_algebra()
    assert sums_in_one_order(threads_of_linear_algebra)() == {1}
    assert threads_of_linear_algebra() == before
    assert diagnose.__wrapped__, "as the diagnosis is"  # type: ignore[attr-defined]
