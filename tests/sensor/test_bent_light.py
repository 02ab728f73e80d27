"""Light that bends within a frame is refused where an effect would be off by more than a hundredth of the charge."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from spikecam_env.errors import InputError
from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor
from spikecam_env.sensor import bent_light as bent
from spikecam_env.sensor.effects import CATALOGUE
from spikecam_env.sensor.effects.base import Bend
from spikecam_env.sensor.sensor import BENT_LIGHT

SHAPE = (3, 4)
DUTY = 0.2
PEAK = 2.0
MEAN = DUTY * PEAK


def strobe(frames: int = 40, peak: float = PEAK) -> Keyframes:
    """A flash of `peak` from .3 to .5 of every frame."""
    starts = np.arange(frames)[:, None]
    at = np.sort((starts + np.array([0.3, 0.3 + DUTY])).ravel())
    levels = np.tile([peak, 0.0], frames)
    return Keyframes.steps(
        np.concatenate([[0.0], at]),
        np.broadcast_to(np.concatenate([[0.0], levels])[:, None, None], (2 * frames + 1, *SHAPE)).astype(np.float32),
    )


def camera(name: str, engine: str = "fast", bent_light: str = "refuse", **parameters: Any) -> SpikeSensor:
    model = SensorModel.preset("ideal").with_effect(CATALOGUE[name](**parameters))
    return SpikeSensor(model, SHAPE, engine=engine, threads=1, bent_light=bent_light)


AT_BOUND = {
    "dead_time": ("tau_us", 25.0 * 0.01 / (PEAK - MEAN), {}),
    "comparator_delay": ("delay_us", 25.0 * 0.01 * np.sqrt(MEAN) / (PEAK - MEAN), {}),
    "crosstalk": ("kick", 0.01 / 4.0 / (1.0 - DUTY), {}),
    "incomplete_reset": ("fraction", 0.01, {"tau_us": 25.0}),
    "supply_ripple": ("ripple", 0.01 / 2.0, {"frequency_hz": 40e3}),
    "clock_feedthrough": ("amplitude_mV", -0.01 * 1092.4, {"tau_us": 1.0}),
}
"""Strength at which an effect is off by a hundredth in that strobe, and other parameters, by the equations of
`bent_light`.  Of ripple at the frame rate and of an edge that decays within a frame, only the range counts."""


@pytest.mark.parametrize("name", sorted(AT_BOUND))
@pytest.mark.parametrize("engine", ["fast", "reference"])
def test_one_per_cent_is_the_bound(name: str, engine: str) -> None:
    strength, bound, others = AT_BOUND[name]
    camera(name, engine, **{strength: 0.98 * bound}, **others).step(strobe(), 3)
    with pytest.raises(InputError, match=rf"{name} .*frame 0: .*bent_light"):
        camera(name, engine, **{strength: 1.02 * bound}, **others).step(strobe(), 3)


def test_the_frame_and_the_pixel_are_named_and_the_camera_is_as_it_was() -> None:
    radiance = np.full((5, *SHAPE), 0.2, np.float32)
    radiance[2, 1, 2] = 1.9
    film = Keyframes(np.array([0.0, 6.0, 6.5, 7.0, 20.0]), radiance)
    sensor, untouched = (camera("dead_time", tau_us=10.0) for _ in range(2))
    with pytest.raises(InputError, match=r"dead_time .*frame 6: .*pixel \(1, 2\)"):
        sensor.step(film, 12)
    picture = np.full(SHAPE, 0.4, np.float32)
    assert sensor.frame == 0
    assert np.array_equal(sensor.step(picture, 30), untouched.step(picture, 30))


def test_allowed_light_gives_the_bits_it_gave() -> None:
    """A bend that is small enough changes nothing whether it is looked for or not."""
    refusing, allowing = (camera("dead_time", bent_light=b, tau_us=0.1) for b in BENT_LIGHT)
    assert np.array_equal(refusing.step(strobe(), 30), allowing.step(strobe(), 30))
    assert camera("dead_time", bent_light="allow", tau_us=10.0).step(strobe(), 30).any()


@pytest.mark.parametrize("at", [[0.0, 5.0, 9.0], [0.0, 1.0, 2.0]])
def test_keys_at_whole_frames_are_not_looked_at(at: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bent, "bend_of", lambda *_: pytest.fail("looked at"))
    film = Keyframes(np.array(at), np.stack([np.full(SHAPE, x, np.float32) for x in (0.0, 1.5, 0.2)]))
    camera("dead_time", tau_us=20.0).step(film, 12)


def test_a_jump_at_a_whole_frame_bends_nothing() -> None:
    """Its first key lies just before the frame ends."""
    film = Keyframes.steps([0.0, 4.0], np.stack([np.full(SHAPE, x, np.float32) for x in (0.1, 1.5)]))
    camera("dead_time", tau_us=20.0).step(film, 12)


def test_an_effect_that_has_no_part_in_it_is_not_concerned() -> None:
    ideal = SensorModel.preset("ideal")
    for name in ("readout_skew", "common_threshold_noise", "light_flicker", "synchronous_reset"):
        sensor = SpikeSensor(ideal.with_effect(CATALOGUE[name]()), SHAPE)
        assert not bent.concerned(sensor._frame_effects, sensor._first_exposure()), name


def test_a_bend_is_that_of_small_steps() -> None:
    """Against sums over 20 000 parts of the frame, of light by random keys."""
    rng = np.random.default_rng(3)
    times = np.sort(np.concatenate([[2.0, 4.0], 2.0 + 2.0 * rng.random(9)]))
    film = Keyframes(times, rng.random((times.size, *SHAPE)).astype(np.float32))
    sensor = camera("dead_time", tau_us=1.0)
    bend = bent.bend_of(film, 3, sensor._first_exposure(), sensor._imaging.image)
    u = (np.arange(20_000) + 0.5) / 20_000
    light = np.stack([film.at(3.0 + t) for t in u]).astype(np.float64)
    mean = light.mean(axis=0)
    rise = 12.0 * ((u - 0.5)[:, None, None] * light).mean(axis=0)
    line = mean + rise * (u - 0.5)[:, None, None]
    away, off_line = abs(light - mean), abs(light - line)
    expected = Bend(mean, away.max(axis=0), away.mean(axis=0) / 2.0, off_line.max(axis=0), off_line.mean(axis=0))
    for name, ours, theirs in zip(Bend._fields, bend, expected, strict=True):
        assert np.allclose(ours, theirs, rtol=2e-3, atol=2e-4), name


@pytest.mark.parametrize(("share", "refused"), [(0.98, False), (1.02, True)])
def test_faint_light_is_held_to_a_ten_thousandth_of_a_threshold(share: float, refused: bool) -> None:
    """Of a tenth of FAINT ten times as large a part may be off."""
    sensor = camera("clock_feedthrough", amplitude_mV=-share * 0.1 * 1092.4, tau_us=1.0)
    film = strobe(peak=0.1 * 0.01 / DUTY)
    if refused:
        with pytest.raises(InputError, match="clock_feedthrough"):
            sensor.step(film, 2)
    else:
        sensor.step(film, 2)
