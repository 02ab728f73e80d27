"""Settings of all tests.

Two processes that test have a core each, so BLAS and torch take one thread in each, and in their children: a second
one that waits spins, on the other's core.  A solve of 128 equations then takes 27 times the processor time, on two busy
cores.  A test that sets torch's threads sets them back: else it would slow all that come after.

Files with slow tests come first: two processes that take file after file end together, not one with a long file last.
The very first takes a minute and needs no compiled code, which the other process compiles meanwhile: two that need the
same function at once wait for each other.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterator

import pytest

os.environ.setdefault("OMP_NUM_THREADS", "1")  # read by OpenBLAS, MKL and torch as they are imported
os.environ.setdefault("GOMP_SPINCOUNT", "10000")  # as in the command: a test with two threads waits asleep


FIRST = "test_site.py"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: (item.path.name != FIRST, item.path not in slow))


@pytest.fixture(autouse=True)
def torch_keeps_its_threads() -> Iterator[None]:
    """Every test leaves as many as it found."""
    before = _threads_of_torch()
    yield
    assert before in (None, _threads_of_torch()), "torch has other threads than before: use `torch_settings`"


def _threads_of_torch() -> int | None:
    return sys.modules["torch"].get_num_threads() if "torch" in sys.modules else None


def pytest_terminal_summary(terminalreporter) -> None:
    """Cases of malformed input by reader and command (`tests/hostile`), and blocks of the pages (`tests/docs`)."""
    tally = counted(terminalreporter, "malformed input")
    if tally:
        total = sum(sum(outcomes.values()) for outcomes in tally.values())
        terminalreporter.write_line(f"\nmalformed input: {total} cases, refused in one line or taken as good after all")
    for target, outcomes in sorted(tally.items()):
        terminalreporter.write_line(f"  {target:42} {outcomes['refused']:5} refused {outcomes['taken']:4} taken")
    pages = counted(terminalreporter, "pages")
    for what, outcomes in sorted(pages.items()):
        terminalreporter.write_line(f"  {what:70} {outcomes['count']:5}")


def counted(terminalreporter, name: str) -> dict[str, Counter[str]]:
    """Counts that tests have recorded under a name, over all of them: target -> outcome -> count."""
    tally: dict[str, Counter[str]] = {}
    for report in (r for reports in terminalreporter.stats.values() for r in reports):
        if getattr(report, "when", "") != "teardown":
            continue
        for recorded, counts in getattr(report, "user_properties", ()):
            for target, outcomes in counts.items() if recorded == name else ():
                tally.setdefault(target, Counter()).update(outcomes)
    return tally
