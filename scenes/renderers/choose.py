"""Which back-end draws: the first that works of a graphics card, OpenGL on the processor, rays.

    egl-hardware, egl-software, osmesa, embree

OpenGL drivers can crash or hang where they do not serve, so each is tried in a process of its own, which draws one
triangle.  `SPIKECAM_RENDERER` or the argument `wanted` names one instead; then nothing is tried beforehand.
Workers of a long job get their parent's choice so.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from functools import cache
from glob import glob
from importlib.util import find_spec

from scenes.renderers import contexts
from scenes.renderers.contexts import FIX
from scenes.renderers.opengl import OpenGL
from scenes.renderers.own_process import ProcessRenderer
from scenes.renderers.protocol import Renderer
from spikecam_env.errors import InputError, NotReadyError, unknown_name

VARIABLE = "SPIKECAM_RENDERER"

BACKENDS = ("egl-hardware", "egl-software", "osmesa", "embree")
"""Best first."""

LONGEST_TRIAL_S = 60.0
"""A driver that has not drawn a triangle by then hangs."""

_CARDS = ("/dev/dri/*", "/dev/nvidia*", "/dev/dxg")

logger = logging.getLogger(__name__)


def choose_renderer(wanted: str | None = None) -> Renderer:
    """A renderer, and one line in the log (INFO) that names it; a WARNING where there is no OpenGL at all.

    Args:
        wanted: one of `BACKENDS`, or "auto" for the first that works; default: SPIKECAM_RENDERER, else "auto".

    Raises:
        InputError: the name is unknown, or the back-end, or any, does not work here; the message has the remedy.
    """
    name = chosen(wanted)
    renderer = make(name)
    if name == "embree" and wanted != "embree" and os.environ.get(VARIABLE) != "embree":
        logger.warning(
            "renderer: %s; no OpenGL here, several times slower; for OpenGL %s", renderer.name, FIX["egl-software"]
        )
    else:
        logger.info("renderer: %s", renderer.name)
    return renderer


def chosen(wanted: str | None = None) -> str:
    """The name of the renderer that `choose_renderer` would make, without starting it."""
    name = wanted or os.environ.get(VARIABLE) or "auto"
    return _first_that_works() if name == "auto" else name


def make(name: str) -> Renderer:
    """The back-end of this name: in this process, or in its own where OpenGL cannot start here."""
    if name not in BACKENDS:
        raise unknown_name("renderer", name, (*BACKENDS, "auto"))
    try:
        if name == "embree":
            from scenes.renderers.embree import Embree

            return Embree()
        if not contexts.can_start():
            return ProcessRenderer(name)
        return OpenGL(name)
    except NotReadyError:
        raise
    except Exception as failure:
        reason = (str(failure).splitlines() or [type(failure).__name__])[0]
        raise InputError(
            f"renderer {name!r} does not work here: {reason}; {FIX[name]}, or leave the choice to 'auto'"
        ) from failure


@cache
def problem(name: str) -> str | None:
    """Why a back-end does not work on this machine; None where it does.  Tried once, in a process of its own."""
    if name == "embree":
        return None if find_spec("embreex") else "embreex is not installed"
    if name == "egl-hardware" and not any(glob(pattern) for pattern in _CARDS):
        return f"no graphics card: none of {', '.join(_CARDS)}"
    try:
        trial = subprocess.run(
            [sys.executable, "-m", "scenes.renderers.trial", name],
            capture_output=True,
            text=True,
            timeout=LONGEST_TRIAL_S,
            start_new_session=True,  # out of reach of Ctrl-C, which `run` passes on by killing it
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
    except subprocess.TimeoutExpired:
        return f"hangs: no triangle after {LONGEST_TRIAL_S:g} s"
    if trial.returncode == 0:
        return None
    if trial.returncode < 0:
        return f"crashes with signal {-trial.returncode}"
    return (trial.stderr.strip().splitlines() or ["no message"])[-1]


def _first_that_works() -> str:
    """Name of the best back-end that works; the error for none has every reason."""
    reasons = {}
    for name in BACKENDS:
        reason = problem(name)
        if reason is None:
            return name
        logger.debug("renderer %s is left out: %s", name, reason)
        reasons[name] = reason
    listed = "; ".join(f"{name}: {reason}" for name, reason in reasons.items())
    raise InputError(f"no renderer works here ({listed}); {FIX['egl-software']}, or {FIX['embree']}")
