"""The hidden world's campaigns: independent of the package, readable by it, the same for a seed."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spikecam_env.campaign.reading import read_campaign
from tests.hidden_world.mechanism import Hidden, draw
from tests.hidden_world.tricky import TRICKS
from tests.hidden_world.world import MECHANISMS, Recipe, stream, write_campaign

SMALL = Recipe(5, "scsim", shape=(24, 24), frames=800)
TINY = replace(SMALL, shape=(16, 16), frames=100)
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Path:
    """The small campaign's folder."""
    folder = tmp_path_factory.mktemp("small")
    write_campaign(SMALL, folder)
    return folder


def spikes_in(folder: Path) -> dict[str, np.ndarray]:
    return {r.name: r.load() for r in read_campaign(folder).recordings}


def loaded(recipe: Recipe, folder: Path) -> dict[str, np.ndarray]:
    write_campaign(recipe, folder)
    return spikes_in(folder)


def digest(folder: Path) -> str:
    files = sorted(p for p in folder.iterdir() if p.suffix != ".npz")
    return hashlib.sha256(b"".join(p.read_bytes() for p in files)).hexdigest()


def test_nothing_of_the_package_is_imported():
    code = (
        "import sys, tests.hidden_world.trial, tests.hidden_world.generate;"
        "print([m for m in sys.modules if m.split('.')[0] in ('spikecam_env', 'scenes', 'denoiser')])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    for path in (ROOT / "tests" / "hidden_world").glob("*.py"):
        if not path.name.startswith("test_"):
            text = path.read_text(encoding="utf-8")
            assert "import spikecam_env" not in text and "from spikecam_env" not in text, path.name


def test_reader_accepts_a_campaign_and_finds_its_recordings(small):
    campaign = read_campaign(small)
    assert campaign.shape == (24, 24) and campaign.frame_rate_hz == 40000.0
    fit = [r.name for r in campaign.recordings if r.use == "fit"]
    held = [r.name for r in campaign.recordings if r.use == "holdout"]
    assert len(fit) == 9 and fit[0] == "dark" and fit[-2:] == ["step", "bars"]
    assert len(held) == 4 and held[-1] == "disk"
    assert {p.suffix for p in small.iterdir()} == {".dat", ".npz", ".json"}
    for recording in campaign.recordings:
        light = recording.light()
        assert light is not None
        assert np.all(light.frame == np.round(light.frame)) == (recording.name != "step")


def test_spikes_follow_the_light_that_the_files_state(small):
    """Counts of every pixel of every recording: gain times the stated light, gain from one flat."""
    spikes = spikes_in(small)
    light = {r.name: r.light() for r in read_campaign(small).recordings}
    flat = next(name for name in spikes if name.startswith("flat-6") or name.startswith("flat-7"))
    dark = spikes["dark"].mean()
    gain = (spikes[flat].mean(axis=0) - dark) / light[flat].radiance[0, 0, 0]
    for name in ("bars", "disk"):
        keys = light[name]
        until = int(keys.frame[100])
        middles = 0.5 * (keys.radiance[:100] + keys.radiance[1:101])
        radiance = np.tensordot(np.diff(keys.frame[:101]), middles, 1)
        dim = keys.radiance[:101].max(axis=0) < 0.8
        counted = spikes[name][:until].sum(axis=0) - dark * until
        error = (counted - gain * radiance)[dim]
        print(f"{name}: {error.mean():.3f} +- {error.std() / np.sqrt(error.size):.3f} spikes of {radiance.mean():.0f}")
        assert abs(error.mean()) < 5 * 0.6 / np.sqrt(error.size) + 2e-3 * radiance.mean()
        assert np.abs(error).max() < 3 + 0.02 * radiance.max()


def test_the_same_recipe_gives_the_same_bytes(tmp_path):
    hidden = draw(MECHANISMS["random_telegraph_noise"], 5.0, stream(1, "x"))
    recipe = replace(TINY, hidden=(hidden,))
    for name in ("a", "b"):
        write_campaign(recipe, tmp_path / name)
    write_campaign(replace(recipe, seed=6), tmp_path / "c")
    assert digest(tmp_path / "a") == digest(tmp_path / "b") != digest(tmp_path / "c")


RARE = ("missed_spikes", "spurious_spikes", "afterpulsing", "spike_bursts", "repeated_frames", "cosmic_streaks")


@pytest.fixture(scope="module")
def nothing_hidden(tmp_path_factory):
    return loaded(TINY, tmp_path_factory.mktemp("plain"))


LAWS = [(m.name, law) for m in MECHANISMS.values() for law in ("", *(other.name for other in m.far))]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "law"), LAWS, ids=[f"{name}/{law}" if law else name for name, law in LAWS])
def test_every_law_makes_a_readable_campaign_that_differs(name, law, tmp_path, nothing_hidden):
    hidden = draw(MECHANISMS[name], 1e3 if name in RARE else 10.0, stream(1, name), law)
    spikes, plain = loaded(replace(TINY, hidden=(hidden,)), tmp_path), nothing_hidden
    assert list(spikes) == list(plain)
    assert any(np.any(spikes[key] != plain[key]) for key in plain)


@pytest.mark.parametrize("trick", sorted(TRICKS))
def test_tricks_do_what_they_say(trick, tmp_path, small):
    plain, tricked = spikes_in(small), loaded(replace(SMALL, trick=trick), tmp_path)
    light = [{r.name: r.light() for r in read_campaign(d).recordings} for d in (small, tmp_path)]
    if trick == "no_motion":
        assert set(plain) - set(tricked) == {"step", "bars", "disk"}
        return
    changed = [name for name in plain if not np.array_equal(plain[name], tricked[name])]
    if trick == "wrong_label":
        ratios = [light[1][n].radiance.mean() / light[0][n].radiance.mean() for n in plain if n != "dark"]
        assert not changed and sorted(np.round(np.abs(np.array(ratios) - 1), 4))[-2:] == [0.0, 0.02]
    elif trick == "swapped":
        assert len(changed) == 2
        assert np.array_equal(plain[changed[0]], tricked[changed[1]])
        assert np.array_equal(plain[changed[1]], tricked[changed[0]])
    elif trick == "dropped_frames":
        assert changed == ["bars"] and 120 <= len(plain["bars"]) - len(tricked["bars"]) <= 360
    elif trick == "reversed_rows":
        assert changed == ["bars"] and np.array_equal(plain["bars"], tricked["bars"][:, ::-1])


def test_an_effect_can_be_in_one_place_or_from_a_time_on(tmp_path, small):
    strong = {"probability": 0.02}
    plain = spikes_in(small)["dark"]
    corner = replace(SMALL, hidden=(Hidden("spurious_spikes", strong, 1.0, rows=(0, 8), columns=(16, 24)),))
    bits = loaded(corner, tmp_path / "corner")["dark"]
    where = (bits != plain).any(axis=0)
    assert where[:8, 16:].mean() > 0.9 and where.sum() == where[:8, 16:].sum()
    late = replace(SMALL, hidden=(Hidden("dead_time", {"tau_us": 20.0}, 1.0, since=0.5),))
    flat = next(n for n in loaded(late, tmp_path / "late") if n.startswith(("flat-6", "flat-7")))
    bits = {r.name: r.load() for r in read_campaign(tmp_path / "late").recordings}[flat]
    before, after = bits[:400].mean(), bits[400:].mean()
    assert abs(after / (1 / (1 / before + 0.8)) - 1) < 0.01
