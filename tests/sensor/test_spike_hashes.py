"""The hashes by which engines are compared from commit to commit: other spikes have others, however they are cut."""

from __future__ import annotations

from dataclasses import replace

import pytest

from spikecam_env.sensor import SensorModel
from tools.spike_hashes import FRAMES, LIGHTS, STEPS, HashCase, models

PLAIN = HashCase("scsim", SensorModel.preset("scsim"), "fast", (9, 11), "keys", (FRAMES,), 1)


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("light", LIGHTS)
def test_a_hash_is_of_the_spikes_and_not_of_the_steps(light: str, steps: tuple[int, ...]) -> None:
    plain = replace(PLAIN, light=light)
    assert replace(plain, steps=steps, threads=2).digest() == plain.digest()
    assert replace(plain, model=SensorModel.preset("physical"), steps=steps).digest() != plain.digest()


def test_every_effect_is_among_the_models_at_two_strengths() -> None:
    from spikecam_env.sensor import CATALOGUE

    names = {name for name, *_ in models()}
    assert {f"{effect} {level}" for effect in CATALOGUE for level in (0, 1)} <= names
