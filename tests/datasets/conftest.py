from __future__ import annotations

from pathlib import Path

import pytest
from small_dataset import LONG, bytes_in, small_plan

from spikecam_env.datasets import build


@pytest.fixture(scope="session")
def whole(tmp_path_factory) -> dict[str, bytes]:
    """The files of the long small dataset, made in one go by this process."""
    folder: Path = tmp_path_factory.mktemp("whole")
    build(small_plan(LONG), folder)
    return bytes_in(folder)
