"""The model, and how to make a page again."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from importlib import metadata

from spikecam_env.gap.result import Diagnosis
from spikecam_env.gap.twins.budget import CAMPAIGNS
from spikecam_env.page import element, table
from spikecam_env.version import __version__


def model_section(d: Diagnosis) -> Iterator[str]:
    """The patched model as a file."""
    added = "The model as it was given" if d.verdict in ("none", "data") else "The model with what was found"
    yield element("p", f"{added}: model.toml beside this page. It loads wherever a model is asked for.")
    yield element("pre", d.patched.toml().strip())


def reproduce_section(d: Diagnosis) -> Iterator[str]:
    """Command, seed, versions, seconds."""
    yield element("pre", command_of(d))
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("numpy", "scipy", "numba", "matplotlib"))
    yield element(
        "p",
        f"Seed {d.seed}: the same seed gives the same result. spikecam-env {__version__}, Python "
        f"{platform.python_version()}, {versions}.",
    )
    rows = [(name, f"{seconds:.1f}") for name, seconds in d.stages.items()]
    yield table(("stage", "seconds"), [*rows, ("all", f"{sum(d.stages.values()):.1f}")], numbers=(1,))
    if d.simulated:
        yield element("p", f"{d.simulated} recordings were simulated to find this.")


def command_of(d: Diagnosis) -> str:
    """The command that makes this diagnosis again."""
    words = ["spikecam diagnose", d.campaign, f"--model {d.model_name}", "--out DIR", f"--seed {d.seed}"]
    if d.candidates is not None:
        words.append(f"--candidates {' '.join(d.candidates)}")
    if d.exclude:
        words.append(f"--exclude {' '.join(d.exclude)}")
    if d.effort != CAMPAIGNS:
        words.append(f"--effort {d.effort:g}")
    if d.static_only:
        words.append("--static-only")
    return " ".join(words)
