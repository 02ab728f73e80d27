"""docs/gap.md: its Python runs as it stands, but for sizes, so that it is quick."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from spikecam_env.gap import Dark, Flat, read_campaign, write_campaign
from spikecam_env.sensor import SensorModel

PAGE = Path(__file__).parents[2] / "docs" / "gap.md"


def test_every_block_of_python_on_the_page_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    design = (Dark(), Flat(radiance=0.1), Flat(radiance=0.3))
    write_campaign("camera-17", SensorModel.preset("scsim"), shape=(16, 16), frames=300, recordings=design, seed=1)
    campaign, diagnosis = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)

    exec(campaign.replace("seed=3", "seed=3, shape=(16, 16), frames=200"), {})
    assert len(read_campaign("late").recordings) > 10

    exec(diagnosis.replace('"scsim"', '"scsim", candidates=["vignetting"]'), {})
    assert {p.name for p in Path("diagnosed").iterdir()} == {"diagnosis.json", "model.toml", "report.html"}


@pytest.mark.parametrize("name", ["diagnose", "ladder"])
def test_the_packages_name_is_the_function_whichever_is_imported_first(name):
    """The module of that name, imported later, would take its place."""
    import importlib

    import spikecam_env.gap as gap

    module = importlib.import_module(f"spikecam_env.gap.{name}")
    assert getattr(gap, name) is getattr(module, name) and callable(getattr(gap, name))
