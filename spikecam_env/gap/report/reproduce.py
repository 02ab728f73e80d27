"""The commands and the code that make a page again."""

from __future__ import annotations

import platform
import shlex
from importlib import metadata

from spikecam_env.code_version import code_version
from spikecam_env.gap.result import BOUND_KINDS, Diagnosis
from spikecam_env.gap.twins.budget import CAMPAIGNS
from spikecam_env.version import __version__

MADE_BY = ("spikecam_env.gap.diagnose", "spikecam_env.gap.report.page")
"""Modules that, with all they import, make a diagnosis and its page."""


def version_of_code() -> str:
    """The package's version, and the digest of the code that makes a page."""
    return f"spikecam-env {__version__}, code {code_version(*MADE_BY)}"


def versions() -> str:
    """Of this package, of Python, and of the packages that figures depend on."""
    others = (f"{name} {metadata.version(name)}" for name in ("numpy", "scipy", "numba", "matplotlib"))
    return ", ".join([version_of_code(), f"Python {platform.python_version()}", *others])


def command_of(d: Diagnosis) -> str:
    """The command that makes this diagnosis again."""
    words = ["spikecam diagnose", d.campaign, f"--model {d.model_name}", "--out DIR", f"--seed {d.seed}"]
    words += effect_files(d)
    if d.candidates is not None:
        words.append(f"--candidates {' '.join(d.candidates)}")
    if d.exclude:
        words.append(f"--exclude {' '.join(d.exclude)}")
    if d.effort != CAMPAIGNS:
        words.append(f"--effort {d.effort:g}")
    if d.static_only:
        words.append("--static-only")
    if d.bounds_kind != BOUND_KINDS[0]:
        words.append(f"--bounds {d.bounds_kind}")
    if d.settings:
        words.append("--settings FILE")
    return " ".join(words)


def effect_files(d: Diagnosis) -> list[str]:
    """The options that give effects of a user's own."""
    return [f"--effect-file {shlex.quote(file)}" for file in d.effect_files]
