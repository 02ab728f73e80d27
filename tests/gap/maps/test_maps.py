"""Recordings that are rates only: spreads, dark tails and shading are found in maps of a simulated unit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from small import effect

from spikecam_env.errors import InputError
from spikecam_env.gap import read_campaign
from spikecam_env.gap.diagnose import diagnose
from spikecam_env.sensor import Effect, SensorModel

SHAPE, FRAMES = (80, 100), 4000
SCSIM = SensorModel.preset("scsim")
LEVELS = {"light": 0.16, "dim": 0.08}


def campaign_of(folder: Path, *effects: Effect, without: tuple[str, ...] = (), seed: int = 3, shape=SHAPE) -> Path:
    """Maps of a fresh unit: light, dark, and a dimmer light that is held out."""
    model = SCSIM
    for name in without:
        model = model.without(name)
    for e in effects:
        model = model.with_effect(e)
    unit = model.draw_unit(shape, seed)
    rng = np.random.default_rng(seed)
    folder.mkdir()
    entries = []
    for name, level in {"dark": 0.0, **LEVELS}.items():
        rate = np.clip(unit.gain * level + unit.dark, 0.0, 1.0)
        counted = np.floor(FRAMES * rate + rng.random(rate.size)) / FRAMES
        np.savez(folder / f"{name}-rates.npz", rate=np.minimum(counted, 1.0).reshape(shape), frames=FRAMES)
        np.savez(folder / f"{name}.npz", frame=[0.0], radiance=np.full((1, 1, 1), level, np.float32))
        use = "holdout" if name == "dim" else "fit"
        entries.append({"name": name, "rates": f"{name}-rates.npz", "radiance": f"{name}.npz", "use": use})
    camera = {"height": shape[0], "width": shape[1], "frame_rate_hz": 40_000.0}
    about = {"format": "spikecam-campaign/1", "camera": camera, "recordings": entries}
    (folder / "campaign.json").write_text(json.dumps(about))
    return folder


@pytest.mark.slow
def test_a_unit_of_the_model_is_not_off_whatever_its_spreads(tmp_path: Path) -> None:
    wider = SCSIM.with_effect(effect("conversion_gain_spread", sigma=0.08)).effects
    for name, effects in (("nominal", ()), ("wider", wider)):
        found = diagnose(campaign_of(tmp_path / name, *effects), "scsim", bounds="simulated", progress=False)
        worst = max(abs(s.z) for s in found.statistics)
        print(f"{name}: {found.verdict}, gap {found.gap.before:.2f}; at worst {worst:.1f}")
        assert found.verdict == "none" and not found.parameters
        assert not found.bounds and any("have no upper bounds" in note for note in found.data)


@pytest.mark.slow
def test_tail_and_shading_are_named_and_a_narrow_spread_is_a_parameter(tmp_path: Path) -> None:
    """The unit's 2 % are 0.27 of scsim's 7.5 %.  The tail takes the place of the Gaussian spread, in part."""
    added = (
        effect("vignetting", falloff=0.2),
        effect("dark_current_tail", sigma=0.45),
        effect("conversion_gain_spread", sigma=0.02),
    )
    folder = campaign_of(tmp_path / "maps", *added, without=("bias_voltage_spread", "dark_current_spread"))
    found = diagnose(folder, "scsim", jobs=2, progress=False)
    names = {e.name: e for e in found.effects}
    print(found.verdict, {n: {k: (p.value, p.sd) for k, p in e.parameters.items()} for n, e in names.items()})
    print(found.parameters, found.gap)
    assert found.verdict == "named" and set(names) == {"vignetting", "dark_current_tail"}
    assert names["vignetting"].parameters["falloff"].value == pytest.approx(0.2, rel=0.1)
    assert names["dark_current_tail"].parameters["sigma"].value == pytest.approx(0.45, rel=0.15)
    assert found.parameters["conversion_gain_spread"]["ratio"] == pytest.approx(0.27, rel=0.15)
    assert found.gap.removed > 0.9
    spikes_needed = dict(found.not_testable)
    assert "spikes" in spikes_needed["dead_time"]
    again = diagnose(folder, "scsim", jobs=1, progress=False)
    said, said_again = (
        json.dumps({**d.to_json(), "stages_s": 0, "elapsed_s": 0}, default=float) for d in (found, again)
    )
    assert said_again == said, "as text, where not a number is itself"


def test_shading_is_named_in_maps_of_a_thousand_pixels(tmp_path: Path) -> None:
    """Whose gains differ by 7 %: the fall to the corners is known to some 4 standard deviations of 0.02."""
    folder = campaign_of(tmp_path / "maps", effect("vignetting", falloff=0.3), shape=(32, 40))
    found = diagnose(folder, "scsim", candidates=("vignetting", "hot_pixels"), progress=False)
    print(found.sentence)
    assert found.verdict == "named" and [e.name for e in found.effects] == ["vignetting"]
    assert found.effects[0].parameters["falloff"].value == pytest.approx(0.3, abs=0.08)


def test_the_centre_of_shading_is_found_where_the_lens_is_off_the_middle(tmp_path: Path) -> None:
    folder = campaign_of(tmp_path / "maps", effect("vignetting", falloff=0.4, centre_x=0.65, centre_y=0.3))
    found = diagnose(folder, "scsim", candidates=("vignetting",), progress=False)
    values = {name: p.value for name, p in found.effects[0].parameters.items()}
    print(values)
    assert (values["centre_x"], values["centre_y"]) == pytest.approx((0.65, 0.3), abs=0.05)


def test_two_dozen_dead_pixels_of_eight_thousand_are_named(tmp_path: Path) -> None:
    """Thirty times the default, from which a search starts."""
    folder = campaign_of(tmp_path / "maps", effect("dead_pixels", fraction=0.003))
    found = diagnose(folder, "scsim", candidates=("dead_pixels", "hot_pixels"), progress=False)
    print(found.sentence)
    assert found.verdict == "named" and [e.name for e in found.effects] == ["dead_pixels"]
    low, high = found.effects[0].parameters["fraction"].interval
    assert low < 0.003 < high


def test_rates_of_unknown_light_alone_say_nothing(tmp_path: Path) -> None:
    folder = campaign_of(tmp_path / "maps")
    about = json.loads((folder / "campaign.json").read_text())
    for entry in about["recordings"]:
        entry["radiance"] = None
    (folder / "campaign.json").write_text(json.dumps(about))
    with pytest.raises(InputError, match="neither spikes nor rates in known, steady light"):
        diagnose(read_campaign(folder), "scsim", progress=False)
