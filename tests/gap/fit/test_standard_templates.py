"""Templates of candidates that have none shipped: simulated once, kept, and the same wherever they come from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from effect_file import written

from spikecam_env import cache_folder
from spikecam_env.gap.candidates.table import NOISE_OF_A_RESET
from spikecam_env.gap.fit import standard_case, standard_templates
from spikecam_env.gap.fit.standard_templates import is_lacking, simulated_of, templates_of
from spikecam_env.gap.screen.templates import SEVERE, Template, Templates, rounded, shipped_templates
from spikecam_env.sensor import CATALOGUE, effects_from
from spikecam_env.sensor.effect_law import law_digest


@pytest.fixture
def kept_in(tmp_path: Path, monkeypatch) -> Path:
    """A cache folder of the test's own, and nothing in memory."""
    monkeypatch.setenv(cache_folder.VARIABLE, str(tmp_path / "cache"))
    monkeypatch.setattr(standard_templates, "_IN_MEMORY", {})
    return tmp_path / "cache" / "templates"


@pytest.fixture
def own(tmp_path: Path) -> Iterator[str]:
    """The name of a user's effect."""
    with effects_from(written(tmp_path / "grey_filter.py")) as [effect]:
        yield effect.name


@pytest.fixture
def made_up(monkeypatch) -> list[str]:
    """Simulation replaced: a template that says how many were made; the names are noted."""
    noted: list[str] = []

    def made(names, **_):
        noted.extend(names)
        shipped = shipped_templates()
        shift = np.random.default_rng(len(noted)).normal(0, 10, shipped.noise.size)
        laws = {name: law_digest(CATALOGUE[name]) for name in names}
        entries = tuple(Template(name, {CATALOGUE[name].strength: 0.05}, shift) for name in names)
        return [(name, replace(shipped, entries=entries, laws=laws)) for name in names]

    monkeypatch.setattr(standard_templates, "simulated_of", made)
    return noted


def shift_of(templates: Templates, name: str) -> np.ndarray:
    return np.array([e.shift for e in templates.entries if e.name == name])


def test_of_what_is_shipped_nothing_is_simulated(kept_in: Path, made_up: list[str]) -> None:
    found, shipped = templates_of(list(CATALOGUE)), shipped_templates()
    assert not made_up and not kept_in.exists()
    assert [e.name for e in found.entries] == [e.name for e in shipped.entries]
    assert not any(is_lacking(name, replace(shipped, laws={})) for name in NOISE_OF_A_RESET)


def test_a_users_effect_is_simulated_once_and_the_same_from_memory_and_from_the_file(
    kept_in: Path, own: str, made_up: list[str]
) -> None:
    first = templates_of([own, "dead_time"])
    again = templates_of([own])
    [file] = kept_in.iterdir()
    standard_templates._IN_MEMORY.clear()
    from_file = templates_of([own])
    assert made_up == [own]
    assert np.array_equal(shift_of(first, own), shift_of(again, own))
    assert np.array_equal(shift_of(first, own), shift_of(from_file, own)) and shift_of(first, own).any()
    assert len(first.entries) == len(shipped_templates().entries) + 1
    order = [name for name in CATALOGUE if name in {e.name for e in first.entries}]
    assert list(dict.fromkeys(e.name for e in first.entries)) == order
    assert file.suffix == ".npz" and not any("partial" in p.name for p in kept_in.iterdir())


@pytest.mark.parametrize("damage", ["cut", "empty", "of another", "a folder"])
def test_a_file_that_is_damaged_is_made_anew(kept_in: Path, own: str, made_up: list[str], damage: str) -> None:
    first = templates_of([own])
    [file] = kept_in.iterdir()
    data = file.read_bytes()
    file.unlink()
    if damage == "a folder":
        file.mkdir()
    elif damage == "of another":
        standard_templates.save_templates(shipped_templates(), file)
    else:
        file.write_bytes(data[: len(data) // 2] if damage == "cut" else b"")
    standard_templates._IN_MEMORY.clear()
    second = templates_of([own])
    assert made_up == [own, own] and not np.array_equal(shift_of(first, own), shift_of(second, own))
    standard_templates._IN_MEMORY.clear()
    templates_of([own])
    assert len(made_up) == (3 if damage == "a folder" else 2)


def test_where_nothing_can_be_kept_it_is_in_memory(
    tmp_path: Path, kept_in: Path, own: str, made_up, monkeypatch
) -> None:
    (tmp_path / "file").touch()
    for place in (str(tmp_path / "file"), "/proc/cache"):
        made_up.clear()
        standard_templates._IN_MEMORY.clear()
        monkeypatch.setenv(cache_folder.VARIABLE, place)
        assert np.array_equal(shift_of(templates_of([own]), own), shift_of(templates_of([own]), own))
        assert made_up == [own]


def test_an_effect_whose_law_has_changed_is_simulated_anew(kept_in: Path, tmp_path: Path, made_up, monkeypatch) -> None:
    shipped = shipped_templates()
    other = replace(shipped, laws={**shipped.laws, "dead_time": "0" * 64})
    monkeypatch.setattr(standard_templates, "shipped_templates", lambda: other)
    found = templates_of(["dead_time", "crosstalk"])
    assert made_up == ["dead_time"] and len(shift_of(found, "dead_time")) == 1
    assert np.array_equal(shift_of(found, "crosstalk"), shift_of(shipped, "crosstalk"))
    for loss in (0.05, 0.06):
        with effects_from(written(tmp_path / "grey_filter.py", ("0.05", f"{loss}"))) as [effect]:
            templates_of([effect.name])
    assert made_up == ["dead_time", "grey_filter", "grey_filter"]


def test_the_cache_is_where_the_system_has_it(monkeypatch, tmp_path: Path) -> None:
    monkeypatch.delenv(cache_folder.VARIABLE, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr("sys.platform", "linux")
    assert cache_folder.cache_folder("templates") == tmp_path / "spikecam" / "templates"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert cache_folder.cache_folder("x") == tmp_path / "home" / ".cache" / "spikecam" / "x"
    monkeypatch.setattr("sys.platform", "darwin")
    assert cache_folder.cache_folder("x") == tmp_path / "home" / "Library" / "Caches" / "spikecam" / "x"
    monkeypatch.setenv(cache_folder.VARIABLE, str(tmp_path / "mine"))
    assert cache_folder.cache_folder("x") == tmp_path / "mine" / "x"


def test_a_filter_of_grey_is_simulated_weak_and_severe_on_the_standard_case(own: str, monkeypatch, capsys) -> None:
    """In a small array."""
    monkeypatch.setattr(standard_case, "SHAPE", (16, 16))
    monkeypatch.setattr(standard_case, "FRAMES", 400)
    [(name, made)] = simulated_of([own], progress=True)
    assert name == own and "templates of grey_filter" in capsys.readouterr().err
    assert [e.times for e in made.entries] == [1.0, *SEVERE][: len(made.entries)]
    assert made.laws == {own: law_digest(CATALOGUE[own])} and made.kinds["step"] == "step"
    again = rounded(made)
    assert np.allclose([e.shift for e in again.entries], [e.shift for e in made.entries], rtol=2e-3, atol=1e-3)
    print([(e.parameters, float(np.abs(e.shift).max())) for e in made.entries])
