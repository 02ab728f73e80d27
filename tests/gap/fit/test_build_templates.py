"""`python -m tools.build_templates --rebuild`: some made anew, all others as they are shipped, or nothing at all."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spikecam_env.errors import InputError
from spikecam_env.gap.fit import standard_case
from spikecam_env.gap.screen.templates import Template, Templates, read_templates, save_templates, shipped_templates
from spikecam_env.sensor import CATALOGUE
from spikecam_env.sensor.effect_law import law_digest
from tools import build_templates
from tools.build_templates import main, merged


def made(shipped: Templates, noise: float = 1.0) -> Templates:
    """As if dead time had been simulated anew, with so many times the noise."""
    entry = Template("dead_time", {"tau_us": 0.3}, np.ones(shipped.noise.size))
    laws = {"dead_time": law_digest(CATALOGUE["dead_time"])}
    return replace(shipped, noise=shipped.noise * noise, entries=(entry,), laws=laws)


def test_all_others_stay_bit_for_bit() -> None:
    shipped = shipped_templates()
    found = merged(shipped, made(shipped, 1.0 + 0.7e-3))
    others = [(a, b) for a in shipped.entries for b in found.entries if a.shape == b.shape and a.times == b.times]
    assert all(np.array_equal(a.shift, b.shift) for a, b in others if a.name != "dead_time")
    assert {a.name for a, _ in others} >= {e.name for e in shipped.entries} - {"dead_time"}
    [anew] = [e for e in found.entries if e.name == "dead_time"]
    assert anew.parameters == {"tau_us": 0.3}


@pytest.mark.parametrize("noise", [1.0 - 1.5e-3, 1.0 + 1.5e-3, np.nan])
def test_another_null_model_is_refused(noise: float) -> None:
    shipped = shipped_templates()
    with pytest.raises(InputError, match=r"noise of the null model has changed.*rebuild all"):
        merged(shipped, made(shipped, noise))


def test_other_statistics_are_refused() -> None:
    shipped = shipped_templates()
    fewer = replace(made(shipped), keys=shipped.keys[1:], noise=shipped.noise[1:])
    with pytest.raises(InputError, match=r"statistics have changed \(0 new, 1 gone\); rebuild all"):
        merged(shipped, fewer)


@pytest.fixture
def package(tmp_path: Path, monkeypatch) -> Path:
    """The package's file is another one, of which dead time and crosstalk are of other laws."""
    shipped = shipped_templates()
    place = tmp_path / "templates.npz"
    save_templates(replace(shipped, laws={**shipped.laws, "dead_time": "x", "crosstalk": "x"}), place)
    monkeypatch.setattr(build_templates, "SHIPPED", place)
    monkeypatch.setattr(build_templates, "shipped_templates", lambda: read_templates(place))
    monkeypatch.setattr(standard_case, "SHAPE", (16, 16))
    monkeypatch.setattr(standard_case, "FRAMES", 400)
    return place


def test_what_is_refused_leaves_the_package_as_it_was(package: Path, tmp_path: Path) -> None:
    """A real build, of a small array, whose statistics are others."""
    before = package.read_bytes()
    with pytest.raises(InputError, match="statistics have changed"):
        main(tmp_path / "out", rebuild=("dead_time",))
    with pytest.raises(InputError, match="unknown candidate 'dead_tme'"):
        main(tmp_path / "out", rebuild=("dead_tme",))
    assert package.read_bytes() == before
    law = law_digest(CATALOGUE["dead_time"])[:8]
    names = sorted(p.name for p in (tmp_path / "out").iterdir())
    assert names == [f"dead_time-{law}.npz", f"dead_time-x50-{law}.npz", f"dead_time-x8-{law}.npz"]


def test_some_are_rebuilt_and_what_else_is_of_another_law_is_named(package: Path, tmp_path: Path, monkeypatch, capsys):
    monkeypatch.setattr(build_templates, "standard_case", lambda jobs: None)
    monkeypatch.setattr(build_templates, "build", lambda folder, standard, names: made(shipped_templates()))
    main(tmp_path / "out", rebuild=("dead_time",))
    assert "of another law than now: crosstalk; give them to --rebuild" in capsys.readouterr().out
    main(tmp_path / "out", same_law=("crosstalk",))
    assert "of another law" not in capsys.readouterr().out
    now, shipped = read_templates(package), shipped_templates()
    assert now.laws == shipped.laws
    crosstalk = [[e.shift for e in t.entries if e.name == "crosstalk"] for t in (now, shipped)]
    assert np.array_equal(*crosstalk)
