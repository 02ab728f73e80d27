"""References that move within the frame: against pixels worked out event by event, and in limiting cases."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from laws import camera, check, with_effects

from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, Effect, SensorModel, SpikeSensor, Stage
from spikecam_env.sensor.effects.base import ExposureBlock, Shift, parameter

SWING_MV = 1e3 * SensorModel.preset("ideal").circuit.swing_V
A_FRAME = 256
"""Steps of a frame of the event by event simulation, a whole number of which every edge below is from its start."""


def event_times(
    rate: np.ndarray, phase: np.ndarray, threshold: Callable[[float, float], float], frames: int
) -> np.ndarray:
    """Which pixels cross in which frame (frames, P): charge at a constant rate from a share `phase` on.

    threshold(t, beside): at t [frames], on the side of t on which `beside` is.  A crossing clears the pixel.
    """
    charge, spikes, step = phase.copy(), np.zeros((frames, rate.size), dtype=bool), 1.0 / A_FRAME
    for i in range(frames * A_FRAME):
        t, middle = i * step, (i + 0.5) * step
        low, high = threshold(t, middle), threshold(t + step, middle)
        fallen = charge >= low
        charge[fallen] = 0.0
        share = np.clip((low - charge) / (rate * step - (high - low)), 0.0, None)
        crosses = share <= 1.0
        charge = np.where(crosses, rate * step * (1.0 - share), charge + rate * step)
        spikes[i // A_FRAME] |= fallen | crosses
    return spikes


def intervals_of(spikes: np.ndarray) -> list[np.ndarray]:
    return [np.diff(np.flatnonzero(column)) for column in spikes.T]


def test_supply_ripple_of_17_kHz_leaves_the_interval_variance_of_the_read_out() -> None:
    """At T = 4.5 frames intervals are 4 or 5, variance f (1 - f) = .25, as far as the ripple leaves T where it is.

    Sampled at the frame's middle a ripple of 2 % gives .41.  Error: of a mean over pixels, as they scatter.
    """
    pixels, frames, rho, hz = 400, 120, 0.02, 17_000.0
    sensor = camera("supply_ripple", (1, pixels), ripple=rho, frequency_hz=hz)
    spikes = sensor.step(np.full((1, pixels), 1 / 4.5), frames)[:, 0].astype(bool)
    cycles = hz / 40_000.0
    events = event_times(
        np.full(pixels, 1 / 4.5), sensor.phase[0], lambda t, _: 1.0 + rho * np.sin(2 * np.pi * cycles * t), frames
    )
    ours, theirs = (np.array([i.var() for i in intervals_of(s)]) for s in (spikes, events))
    check("interval variance", ours.mean(), 0.25, 4.5 * ours.std() / np.sqrt(pixels) + 0.01)
    check("less that of events", ours.mean() - theirs.mean(), 0.0, 4.5 * (ours - theirs).std() / np.sqrt(pixels) + 1e-3)


@pytest.mark.parametrize("amplitude", [-9.0, 9.0])
def test_clock_feedthrough_gathers_the_pixels_that_an_event_by_event_simulation_gathers(amplitude: float) -> None:
    """Pixels of T = 3.9 .. 4.1: those that have 60 intervals of 4 in a row are those of the events.

    The decay is linear in parts: the edges of the gathering are off by .005 a T, 1.6e-4 frames, a pixel or two each;
    at most one in 100 of the pixels is counted wrongly.
    """
    rate, tau, v0 = 1.0 / np.linspace(3.9, 4.1, 2000), 0.24, 0.25
    sensor = camera("clock_feedthrough", (1, rate.size), amplitude_mV=amplitude, tau_us=25 * tau, phase_frames=v0)
    spikes = sensor.step(rate[None], 260)[:, 0].astype(bool)
    mean = tau * (1 - np.exp(-1 / tau))

    def reference(t: float, beside: float) -> float:
        since = t - v0 - np.floor(beside - v0)
        return 1 + amplitude / SWING_MV * (np.exp(-since / tau) - mean)

    events = event_times(rate, sensor.phase[0], reference, 260)
    without = SpikeSensor("ideal", (1, rate.size), 0).step(rate[None], 260)[:, 0].astype(bool)
    of_clock, of_events, by_chance = (
        np.array([np.all(i[-60:] == 4) for i in intervals_of(s)]) for s in (spikes, events, without)
    )
    print(f"whole intervals: {of_clock.sum()}, by events {of_events.sum()}, without {by_chance.sum()}")
    assert (of_clock != of_events).mean() < 0.01
    assert (spikes != events).mean() < 0.01 * spikes.mean()
    assert of_clock.sum() > by_chance.sum() + 4 * np.sqrt(by_chance.sum())


@pytest.mark.parametrize("span", [-1.1, 0.7])
def test_clock_feedthrough_comes_as_much_later_in_a_row_as_the_row_is_read_before_the_end_of_the_frame(
    span: float,
) -> None:
    """The same bits as without skew, the edge moved by the row's lead: v = u - e is v0 at u = v0 + e."""
    shape, v0 = (5, 300), 0.79
    effect = CATALOGUE["clock_feedthrough"]
    light = np.random.default_rng(0).uniform(0.2, 0.3, shape)
    skewed = with_effects("ideal", effect(phase_frames=v0), CATALOGUE["readout_skew"](span=span))
    spikes = SpikeSensor(skewed, shape, 0).step(light, 200)
    early = abs(span) * np.linspace(1.0, 0.0, 5)[:: 1 if span > 0 else -1]
    for row in range(5):
        alone = SpikeSensor(with_effects("ideal", effect(phase_frames=(v0 + early[row]) % 1.0)), shape, 0)
        np.testing.assert_array_equal(spikes[:, row], alone.step(light, 200)[:, row])
    assert not np.array_equal(
        spikes, SpikeSensor(with_effects("ideal", effect(phase_frames=v0)), shape, 0).step(light, 200)
    )


@dataclass(frozen=True)
class Raised(Effect):
    """A reference that is raised for good."""

    by: float = parameter(0.05, unit="relative", bounds=(0.0, 1.0), doc="of the threshold")

    stage = Stage.THRESHOLD
    strength = "by"

    def compare(self, now: ExposureBlock, memory: Any) -> tuple[Shift, Any]:
        return Shift(factor=1.0 + self.by), memory


@pytest.mark.parametrize("engine", ["fast", "reference"])
def test_ripple_of_no_frequency_is_a_constant_factor(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(CATALOGUE, "raised", Raised)
    light = np.random.default_rng(0).uniform(0.0, 2.0, (20, 30))
    still = with_effects("ideal", CATALOGUE["supply_ripple"](ripple=0.05, frequency_hz=0.0, phase_cycles=0.25))
    raised = with_effects("ideal", Raised())
    one, other = (SpikeSensor(model, (20, 30), 3, engine).step(light, 60) for model in (still, raised))
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    "name, wrong", [("supply_ripple", {"frequency_hz": 1e6}), ("clock_feedthrough", {"tau_us": 0.2})]
)
def test_what_is_too_fast_for_the_frame_is_refused_by_name(name: str, wrong: dict[str, float]) -> None:
    model = with_effects("ideal", CATALOGUE[name](**wrong))
    SpikeSensor(model, (2, 2))
    with pytest.raises(InputError, match=f"{name} moves the reference too fast: a frame of 1000 us"):
        replace(model, frame_rate_hz=1000.0)
