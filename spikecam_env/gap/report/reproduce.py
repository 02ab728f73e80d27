"""The model, and how to make a page again."""

from __future__ import annotations

import platform
import shlex
from collections.abc import Iterator
from importlib import metadata

from spikecam_env.code_version import code_version
from spikecam_env.gap.result import Diagnosis
from spikecam_env.gap.twins.budget import CAMPAIGNS
from spikecam_env.page import element, table
from spikecam_env.version import __version__

MADE_BY = ("spikecam_env.gap.diagnose", "spikecam_env.gap.report.page")
"""Modules that, with all they import, make a diagnosis and its page."""


def version_of_code() -> str:
    """The package's version, and the digest of the code that makes a page."""
    return f"spikecam-env {__version__}, code {code_version(*MADE_BY)}"


def model_section(d: Diagnosis) -> Iterator[str]:
    """The patched model as a file."""
    added = "The model as it was given" if d.verdict in ("none", "data") else "The model with what was found"
    with_files = ", ".join(["", *(f"with {option}" for option in _effect_files(d))])
    yield element("p", f"{added}; as a file, model.toml, it loads wherever a model is asked for{with_files}.")
    yield element("pre", d.patched.toml().strip())


def reproduce_section(d: Diagnosis, campaign_command: str = "") -> Iterator[str]:
    """Commands, seed, versions, seconds.  campaign_command: what made the campaign, if it is known."""
    yield element("pre", "\n".join(filter(None, (campaign_command, command_of(d)))))
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("numpy", "scipy", "numba", "matplotlib"))
    yield element(
        "p",
        f"Seed {d.seed}: the same seed gives the same result. {version_of_code()}, Python "
        f"{platform.python_version()}, {versions}.",
    )
    rows = [(name, f"{seconds:.1f}") for name, seconds in d.stages.items()]
    yield table(("stage", "seconds"), [*rows, ("all", f"{sum(d.stages.values()):.1f}")], numbers=(1,))
    if d.simulated:
        yield element("p", f"{d.simulated} recordings were simulated to find this.")
    if d.settings:
        yield element(
            "p", f"Settings other than the defaults: {', '.join(f'{k} = {v}' for k, v in d.settings.items())}."
        )


def command_of(d: Diagnosis) -> str:
    """The command that makes this diagnosis again."""
    words = ["spikecam diagnose", d.campaign, f"--model {d.model_name}", "--out DIR", f"--seed {d.seed}"]
    words += _effect_files(d)
    if d.candidates is not None:
        words.append(f"--candidates {' '.join(d.candidates)}")
    if d.exclude:
        words.append(f"--exclude {' '.join(d.exclude)}")
    if d.effort != CAMPAIGNS:
        words.append(f"--effort {d.effort:g}")
    if d.static_only:
        words.append("--static-only")
    if d.with_bounds:
        words.append("--bounds")
    if d.settings:
        words.append("--settings FILE")
    return " ".join(words)


def _effect_files(d: Diagnosis) -> list[str]:
    """The options that give effects of a user's own."""
    return [f"--effect-file {shlex.quote(file)}" for file in d.effect_files]
