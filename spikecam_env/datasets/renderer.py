"""Which back-end draws a dataset: bytes depend on it, so it is chosen once and then written down."""

from __future__ import annotations

import logging
import os
from functools import cache

from scenes.renderers.choose import BACKENDS, VARIABLE, choose_renderer, problem
from scenes.renderers.contexts import FIX
from scenes.renderers.protocol import Renderer

AUTO = "auto"

logger = logging.getLogger(__name__)


def first_that_works() -> str:
    """SPIKECAM_RENDERER, else the best back-end that this machine serves; a WARNING where there is no OpenGL."""
    named = os.environ.get(VARIABLE, AUTO)
    if named != AUTO:
        return named
    best = next(name for name in BACKENDS if problem(name) is None)
    if best == BACKENDS[-1]:
        logger.warning("renderer: %s; no OpenGL here, several times slower; for OpenGL %s", best, FIX["egl-software"])
    return best


@cache
def renderer_of_process(name: str) -> Renderer:
    """One of each name in a process, for as long as it lives: contexts do not come and go well."""
    return choose_renderer(name)
