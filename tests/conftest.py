"""What holds for all tests.  Torch's threads must not spin long while they wait: tests share their cores.

Files with slow tests come first: two processes that take file after file end together, not one with a long file last.
"""

from __future__ import annotations

import os
from collections import Counter

import pytest

os.environ.setdefault("GOMP_SPINCOUNT", "10000")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


def pytest_terminal_summary(terminalreporter) -> None:
    """Cases of malformed input by reader and command (`tests/hostile`)."""
    tally: dict[str, Counter[str]] = {}
    for report in (r for reports in terminalreporter.stats.values() for r in reports):
        if getattr(report, "when", "") != "teardown":
            continue
        for name, counts in getattr(report, "user_properties", ()):
            for target, outcomes in counts.items() if name == "malformed input" else ():
                tally.setdefault(target, Counter()).update(outcomes)
    if tally:
        total = sum(sum(outcomes.values()) for outcomes in tally.values())
        terminalreporter.write_line(f"\nmalformed input: {total} cases, refused in one line or taken as good after all")
    for target, outcomes in sorted(tally.items()):
        terminalreporter.write_line(f"  {target:42} {outcomes['refused']:5} refused {outcomes['taken']:4} taken")
