from __future__ import annotations

import pytest

from scenes.renderers.embree import Embree


@pytest.fixture(scope="session")
def renderer() -> Embree:
    return Embree()
