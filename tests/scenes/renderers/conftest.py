from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from glob import glob

import pytest

from scenes.renderers.choose import make
from scenes.renderers.protocol import Renderer
from spikecam_env.errors import InputError

CARDS = glob("/dev/dri/*") + glob("/dev/nvidia*")
KINDS = ("embree", "egl-software", *(("egl-hardware",) if CARDS else ()))


@pytest.fixture(scope="session", params=KINDS)
def renderer(request: pytest.FixtureRequest) -> Iterator[Renderer]:
    made = made_or_skipped(request.param)
    yield made
    made.close()


def made_or_skipped(kind: str) -> Renderer:
    """On CI a renderer that does not work is a failure."""
    try:
        return make(kind)
    except InputError as error:
        if os.environ.get("CI") == "true":
            raise
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def opengl() -> Iterator[Renderer]:
    made = made_or_skipped("egl-software")
    yield made
    made.close()


@pytest.fixture
def another_opengl() -> Callable[[], Renderer]:
    return lambda: made_or_skipped("egl-software")
