"""The event camera against a literal simulation in tiny steps, closed forms, and the statistics of its noise."""

from __future__ import annotations

import math
import pickle
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from laws import check

from spikecam_env.errors import InputError
from spikecam_env.sensor import EventCamera, EventList, EventPixel, Keyframes
from spikecam_env.sensor.event_camera.event_list import sent_bits
from spikecam_env.types import Floats

RATE = 40_000.0
QUIET = EventPixel(refractory_us=0.0).noiseless()
"""Equal thresholds, and nothing else."""
SHAPE = (12, 20)


def film(seed: int, shape: tuple[int, int] = SHAPE, frames: int = 200, keys: int = 40) -> Keyframes:
    """Light at random times, whole and not, over two decades; some keys outside the frames, and a jump."""
    rng = np.random.default_rng(seed)
    times = np.sort(np.concatenate([rng.uniform(-5, frames + 5, keys - 10), rng.integers(0, frames, 10)]))
    times = np.unique(np.append(times, np.nextafter(times[keys // 2], np.inf)))
    return Keyframes(times, (10.0 ** rng.uniform(-2.0, 0.0, (times.size, *shape))).astype(np.float32))


def recorded(camera: EventCamera, light: Keyframes | Floats, cuts: Sequence[int]) -> EventList:
    return EventList.joined([camera.step(light, count) for count in cuts])


def uniform(times: Sequence[float], values: Sequence[float], shape: tuple[int, int] = (1, 1)) -> Keyframes:
    levels = np.asarray(values, np.float32)[:, None, None]
    return Keyframes(np.asarray(times, float), np.broadcast_to(levels, (len(values), *shape)))


def with_dark(light: float, pixel: EventPixel = QUIET) -> float:
    """Light with the dark current, from the float32 that a film holds."""
    return float(np.float32(light)) + pixel.dark


def literal(camera: EventCamera, light: Keyframes, frames: int, per_frame: int) -> list[tuple[float, bool]]:
    """Pixel (0, 0) of a camera that has not begun, by the law of `event_camera.pixel` in tiny steps.

    Nothing is shared with the camera but its parameters and its first reference.
    """
    pixel, state = camera.pixel, camera.state()
    on, off = math.log(state.thresholds.on[0]), math.log(state.thresholds.off[0])
    levels = np.interp(np.arange(frames * per_frame) / per_frame, light.frame, light.radiance[:, 0, 0].astype(float))
    log_light = np.log(levels + pixel.dark).tolist()
    reference = log_light[0] + math.log(-state.pixels.reference[0])
    fall = pixel.leak_hz * pixel.threshold_on / RATE / per_frame
    refractory, held, found = round(pixel.refractory_us * 1e-6 * RATE * per_frame), 0, []
    for step, now in enumerate(log_light):
        if step <= held:
            reference = now if step else reference
            continue
        reference -= fall
        while not off < now - reference < on:
            rose = now - reference >= on
            found.append((step / per_frame / RATE, rose))
            held = step + refractory
            if refractory:
                break
            reference += on if rose else off
    return found


def coarse_film(seed: int) -> Keyframes:
    """Light of one pixel at times that a literal simulation hits, quarters of a frame, with a jump."""
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.integers(4, 32, 24)) / 4.0 - 4.0
    times = np.insert(times, 12, np.nextafter(times[12], -np.inf))
    return Keyframes(times, (10.0 ** rng.uniform(-2.0, 0.0, (times.size, 1, 1))).astype(np.float32))


@pytest.mark.parametrize(
    ("changes", "tolerance"),
    [
        ({}, 0.001),
        ({"leak_hz": 2000.0}, 0.001),
        ({"refractory_us": 500.0}, 0.15),
        ({"leak_hz": 900.0, "refractory_us": 75.0}, 0.15),
    ],
    ids=["plain", "leak", "refractory", "both"],
)
def test_events_are_those_of_a_literal_simulation(changes: dict[str, float], tolerance: float) -> None:
    """In steps of a thousandth of a frame: each event is there, with its polarity, a step late at most.

    A refractory period then ends a step late too, and the reference is off by the change of light in a step: the next
    event is off by as many steps as light was faster there than it is now, up to a hundred in these films.
    """
    per_frame, worst, events = 1000, 0.0, 0
    for seed in range(6):
        light = coarse_film(seed)
        camera = EventCamera(replace(QUIET, mismatch=0.03, **changes), (1, 1), seed)
        slow = literal(camera, light, 120, per_frame)
        fast = camera.step(light, 120)
        assert fast.p.tolist() == [rose for _, rose in slow]
        events += len(fast)
        worst = max(worst, float(np.abs(fast.t - [t for t, _ in slow]).max()) * RATE)
    print(f"{events} events of 6 films, times within {worst:.4f} frames")
    assert events >= 30 and worst < tolerance * (1 + 1e-6)


def test_a_ramp_gives_an_event_each_time_its_logarithm_is_a_threshold_higher() -> None:
    low, high, frames = 0.05, 0.9, 1000
    events = EventCamera(QUIET, (1, 1)).step(uniform([0, frames], [low, high]), frames)
    first, last = with_dark(low), with_dark(high)
    count = math.floor(math.log(last / first) / QUIET.threshold_on)
    times = (first * np.exp(QUIET.threshold_on * np.arange(1, count + 1)) - first) / (last - first) * frames / RATE
    assert len(events) == count == 14 and events.p.all()
    off = float(np.abs(events.t - times).max())
    check("worst error of a time [s]", off, 0.0, 1e-12)
    down = EventCamera(QUIET, (1, 1)).step(uniform([0, frames], [high, low]), frames)
    times = (last - last * np.exp(-QUIET.threshold_off * np.arange(1, count + 1))) / (last - first) * frames / RATE
    assert len(down) == count and not down.p.any()
    check("worst error of a time down [s]", float(np.abs(down.t - times).max()), 0.0, 1e-12)


@pytest.mark.parametrize("ratio", [0.3, 1.1, 1.3, 7.0])
def test_a_step_gives_its_events_at_once_and_one_with_a_refractory_period(ratio: float) -> None:
    when = 10.25
    light = Keyframes.steps([0.0, when], np.array([0.1, 0.1 * ratio], np.float32).reshape(2, 1, 1))
    change = math.log(with_dark(0.1 * ratio) / with_dark(0.1))
    count = math.floor(abs(change) / QUIET.threshold_on)
    at_once = EventCamera(QUIET, (1, 1)).step(light, 40)
    held = EventCamera(replace(QUIET, refractory_us=100.0), (1, 1)).step(light, 40)
    print(f"ratio {ratio}: {len(at_once)} events, {len(held)} with a refractory period")
    assert len(at_once) == count and len(held) == min(count, 1)
    np.testing.assert_allclose(at_once.t, when / RATE, rtol=1e-12)
    assert (at_once.p == (change > 0)).all()


def test_leak_events_come_at_their_rate_at_even_times_and_start_anywhere() -> None:
    """In steady light; a pixel's rate is that of a nominal one times theta / theta_on of its own."""
    pixel = replace(QUIET, leak_hz=50.0, mismatch=0.03)
    camera, frames = EventCamera(pixel, (40, 50), 3), 40_000
    own = np.log(camera.state().thresholds.on).reshape(camera.shape)
    events = camera.step(np.full(camera.shape, 0.3, np.float32), frames)
    assert events.p.all()
    counts = events.counts(camera.shape)[0]
    assert (np.abs(counts - 50.0 * 0.2 / own) <= 1.0).all(), "a period has one event"
    share = float(np.mean(counts - np.floor(50.0 * 0.2 / own)))
    expected = float(np.mean((50.0 * 0.2 / own) % 1.0))
    check("mean beyond whole periods", share, expected, 4.5 * 0.5 / math.sqrt(counts.size))
    (one,) = (np.diff(events.t[(events.x == 7) & (events.y == 9)]),)
    np.testing.assert_allclose(one, own[9, 7] / (0.2 * 50.0), rtol=1e-9)


@pytest.mark.parametrize(("light", "share"), [(0.0, 1.0), (0.4, 0.7), (1.0, 0.25), (3.0, 0.25)])
def test_noise_is_poisson_of_both_polarities_and_falls_with_light(light: float, share: float) -> None:
    pixel = EventPixel(noise_hz=40.0, leak_hz=0.0, refractory_us=0.0)
    camera, seconds = EventCamera(pixel, (60, 80), 1), 0.5
    events = camera.step(np.full(camera.shape, light, np.float32), int(seconds * RATE))
    expected = 40.0 * seconds * share
    counts = events.counts(camera.shape).reshape(2, -1)
    for name, its in (("ON", counts[0]), ("OFF", counts[1])):
        check(f"{name} a pixel", its.mean(), expected / 2, 4.5 * math.sqrt(expected / 2 / its.size))
    total, pixels = counts.sum(axis=0), counts.shape[1]
    error = 4.5 * math.sqrt((2.0 + 1.0 / expected) / pixels)
    check("variance over mean", total.var() / total.mean(), 1.0, error)
    correlation = float(np.corrcoef(*counts)[0, 1])
    check("correlation of ON and OFF", correlation, 0.0, 4.5 / math.sqrt(pixels))
    gaps = np.diff(np.sort(events.t))
    check("spread over mean of gaps", gaps.std() / gaps.mean(), 1.0, 4.5 * math.sqrt(2.0 / gaps.size))


def test_a_refractory_period_limits_the_rate() -> None:
    """Light rises without end: an event takes the refractory period and the time to the next threshold."""
    pixel = replace(QUIET, refractory_us=250.0)
    events = EventCamera(pixel, (1, 1)).step(uniform([0, 400], [1e-4, 1000.0]), 400)
    gaps = np.diff(events.t) * 1e6
    print(f"{len(events)} events, gaps of {gaps.min():.1f} us and more")
    assert gaps.min() >= 250.0 - 1e-6
    c, slope, expected = pixel.dark + float(np.float32(1e-4)), (1000.0 - float(np.float32(1e-4))) / 400, []
    t = c * (math.exp(0.2) - 1.0) / slope
    while t < 400:
        expected.append(t / RATE)
        t += 10.0 + (c + slope * (t + 10.0)) * (math.exp(0.2) - 1.0) / slope
    np.testing.assert_allclose(events.t, expected, rtol=1e-9)


def test_noise_events_keep_the_refractory_period() -> None:
    """Of a Poisson process of rate r a dead time tau leaves r / (1 + r tau)."""
    pixel = EventPixel(noise_hz=2000.0, leak_hz=0.0, refractory_us=500.0)
    camera = EventCamera(pixel, (50, 40), 2)
    events = camera.step(np.zeros(camera.shape, np.float32), 20_000)
    expected = 2000.0 / (1.0 + 2000.0 * 500e-6)
    check("events a second and pixel", len(events) / 2000 / 0.5, expected, 4.5 * expected / math.sqrt(len(events)))
    last = np.full(camera.shape, -1.0)
    for t, x, y in zip(events.t, events.x, events.y, strict=True):
        assert t - last[y, x] > 500e-6 - 1e-12
        last[y, x] = t


@pytest.mark.parametrize(
    "pixel", [QUIET, EventPixel(), EventPixel(leak_hz=3000.0, refractory_us=80.0, noise_hz=500.0)], ids=str
)
def test_no_cut_of_the_stream_changes_a_bit(pixel: EventPixel) -> None:
    light, rng = film(1), np.random.default_rng(0)
    whole = EventCamera(pixel, SHAPE, 5).step(light, 200)
    cuts = np.diff(np.unique([0, *rng.integers(1, 200, 30), 200])).tolist()
    parts = recorded(EventCamera(pixel, SHAPE, 5), light, cuts)
    print(f"{len(whole)} events, {len(cuts)} calls")
    assert len(whole) > 1000
    assert parts == whole
    assert (np.diff(whole.t) >= 0).all()


def test_no_cut_changes_a_bit_of_wild_light_late_in_a_stream() -> None:
    """Keys from 1e-10 to 100 frames apart, light of fifteen decades and none, after up to a million frames."""
    rng, total = np.random.default_rng(0), 0
    for trial in range(200):
        begin = int(rng.choice([0, 1000, 10**6]))
        times = np.unique(begin + np.cumsum(10.0 ** rng.uniform(-10.0, 2.0, rng.integers(1, 12))) - rng.uniform(0, 20))
        levels = 10.0 ** rng.uniform(-9.0, 6.0, (times.size, 2, 3))
        light = Keyframes(times, np.where(rng.random(levels.shape) < 0.2, 0.0, levels).astype(np.float32))
        pixel = EventPixel(
            threshold_on=float(rng.choice([0.01, 0.2, 3.0])),
            threshold_off=float(rng.choice([0.01, 0.2, 3.0])),
            refractory_us=float(rng.choice([0.0, 1e-12, 1.0, 500.0])),
            leak_hz=float(rng.choice([0.0, 0.1, 1e4])),
            noise_hz=float(rng.choice([0.0, 5.0, 1e4])),
        )
        camera = EventCamera(pixel, (2, 3), trial)
        camera.step(np.zeros((2, 3), np.float32), begin or 1)
        state = camera.state()
        whole = camera.step(light, 60)
        camera.restore(state)
        assert recorded(camera, light, (1, 13, 6, 1, 39)) == whole, pixel
        total += len(whole)
    print(f"{total} events")
    assert total > 20_000


def test_light_in_pieces_gives_the_events_of_the_whole() -> None:
    """Each call has the key frames about its own frames, as environments give them."""
    times = np.arange(0.0, 201.0, 4.0)
    light = film(2)
    whole = Keyframes(times, np.stack([light.at(t) for t in times]))
    one, other = (EventCamera(EventPixel(), SHAPE, 1) for _ in range(2))
    parts = []
    for key in range(0, 50, 10):
        own = Keyframes(times[key : key + 11], whole.radiance[key : key + 11])
        parts.append(other.step(own, 40))
    assert EventList.joined(parts) == one.step(whole, 200)


def test_light_that_is_another_in_the_next_call_acts_from_there() -> None:
    camera = EventCamera(QUIET, (1, 1))
    assert len(camera.step(np.full((1, 1), 0.2, np.float32), 10)) == 0
    events = camera.step(np.full((1, 1), 0.4, np.float32), 10)
    assert events.t.tolist() == [10 / RATE] * 3


def test_a_state_goes_on_where_it_was_taken_and_through_a_pickle() -> None:
    light = film(3)
    camera = EventCamera(EventPixel(), SHAPE, 7)
    camera.step(light, 90)
    state = pickle.loads(pickle.dumps(camera.state()))
    expected = camera.step(light, 60)
    other = EventCamera(EventPixel(), SHAPE, 0)
    other.restore(state)
    again = other.step(light, 60)
    assert again == expected and len(again) > 100
    other.reset()
    assert other.frame == 0
    assert other.step(light, 90) == EventCamera(EventPixel(), SHAPE, 7).step(light, 90)


def test_thresholds_are_normal_with_their_spread_and_units_differ() -> None:
    pixel = EventPixel(threshold_on=0.3, threshold_off=0.25, mismatch=0.04)
    state = EventCamera(pixel, (100, 100), 1).state()
    for name, theta, mean in (
        ("on", np.log(state.thresholds.on), 0.3),
        ("off", -np.log(state.thresholds.off), 0.25),
    ):
        check(f"mean theta_{name}", theta.mean(), mean, 4.5 * 0.04 / 100)
        check(f"spread of theta_{name}", theta.std(), 0.04, 4.5 * 0.04 / math.sqrt(2e4))
    other = EventCamera(pixel, (100, 100), 2).state()
    assert not np.array_equal(other.thresholds.on, state.thresholds.on)
    wide = EventCamera(EventPixel(mismatch=1.0), (100, 100)).state()
    assert np.log(wide.thresholds.on).min() >= 0.01 - 1e-12


def test_a_factor_on_all_light_changes_no_event_but_by_the_dark_current() -> None:
    """The logarithm sees ratios alone."""
    pixel = replace(QUIET, dark=1e-6)
    light = film(4)
    dim = Keyframes(light.frame, light.radiance * np.float32(1.0 / 16.0))
    bright, dimmer = (EventCamera(pixel, SHAPE).step(its, 200) for its in (light, dim))
    assert abs(len(bright) - len(dimmer)) <= 0.002 * len(bright)
    drowned = EventCamera(replace(pixel, dark=1.0), SHAPE).step(dim, 200)
    print(f"{len(bright)} events, {len(dimmer)} in a sixteenth of the light, {len(drowned)} under a dark current of 1")
    assert len(drowned) < 0.1 * len(bright)


def test_counts_and_tables_are_the_list() -> None:
    events = EventCamera(EventPixel(), SHAPE, 1).step(film(5), 200)
    counts = events.counts(SHAPE, 4, 0.0, 200 / RATE)
    assert counts.shape == (8, *SHAPE) and counts.sum() == len(events)
    np.testing.assert_array_equal(counts[0::2].sum(axis=0) + counts[1::2].sum(axis=0), events.counts(SHAPE).sum(axis=0))
    second = (events.t >= 50 / RATE) & (events.t < 100 / RATE)
    assert counts[2].sum() == (second & events.p).sum() and counts[3].sum() == (second & ~events.p).sum()
    table = events.as_table()
    assert table.dtype.names == ("t", "x", "y", "p") and table["p"].sum() == events.p.sum()
    assert (np.abs(table["t"] - events.t * 1e6) <= 1.0).all()
    assert sent_bits(10, 1e-3) == 32 * (10 + 1000 / 64)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: EventPixel(threshold_on=0.0), r"event_pixel\.threshold_on = 0\.0.*0\.01 to 5"),
        (lambda: EventPixel(dark=0.0), r"event_pixel\.dark = 0\.0"),
        (lambda: EventPixel(refractory_us=-1.0), r"event_pixel\.refractory_us"),
        (lambda: EventPixel(leak_hz=math.nan), r"event_pixel\.leak_hz"),
        (lambda: EventCamera("davis"), "pixel is 'davis'; give an EventPixel"),  # type: ignore[arg-type]
        (lambda: EventCamera(shape=(0, 4)), "shape"),
        (lambda: EventCamera(seed=-1), "seed = -1"),
        (lambda: EventCamera(frame_rate_hz=0.0), "frame_rate_hz = 0"),
        (lambda: EventCamera(shape=(2, 2)).step(np.ones((2, 3))), "radiance has shape"),
        (lambda: EventCamera(shape=(2, 2)).step(np.full((2, 2), np.nan)), "NaN"),
        (lambda: EventCamera(shape=(2, 2)).step(np.ones((2, 2)), 0), "frames = 0"),
        (lambda: EventCamera(shape=(2, 2)).restore(3), "state is a int"),  # type: ignore[arg-type]
        (lambda: EventCamera(shape=(2, 2)).restore(EventCamera(shape=(2, 3)).state()), "with shape"),
        (lambda: EventList.none().counts((2, 2), bins=2), "stop_s = None"),
        (lambda: EventList.none().counts((2, 2), bins=0), "bins = 0"),
        (lambda: EventCamera(QUIET, (1, 9)).step(film(0, (1, 9)), 50).counts((1, 2)), r"shape = \(1, 2\)"),
    ],
)
def test_wrong_use_is_named(call: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
