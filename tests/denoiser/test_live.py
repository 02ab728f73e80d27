"""Pictures of a stream that is watched, against the denoiser of the whole stream."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from denoiser.live import LiveDnSS
from denoiser.online import OnlineDnSS
from denoiser.passes.pixel_history import PictureLayout, PixelHistory
from denoiser.passes.recipe import RECIPES, recipe_of
from denoiser.passes.window import RollingWindow
from spikecam_env.errors import InputError, NotReadyError
from spikecam_env.streams.packing import pack_frames

SHAPE = (9, 13)
"""117 pixels: the last byte of a packed frame has three unused bits."""
PLANES = 16
HISTORY = 64


def stream(frames: int, shape: tuple[int, int] = SHAPE, seed: int = 0) -> np.ndarray:
    """(frames, H, W) spikes of pixels of all rates, some of which hardly ever fire."""
    rng = np.random.default_rng(seed)
    return (rng.random((frames, *shape)) < rng.random(shape) ** 4).astype(np.uint8)


def live(mode: str = "best", **options) -> LiveDnSS:
    return LiveDnSS(SHAPE, mode, precision="float32", **options)


def online(mode: str = "best", **options) -> OnlineDnSS:
    return OnlineDnSS.pretrained(mode, output="rate", precision="float32", **options)


@pytest.mark.parametrize("mode", RECIPES)
def test_pictures_of_every_pass_have_the_bits_of_the_whole_streams_denoiser(mode: str) -> None:
    spikes, watching = stream(150), live(mode)
    rates, step = online(mode).push(spikes), recipe_of(mode).layout.planes
    seen = 0
    for first in range(0, len(spikes), step):
        watching.push(pack_frames(spikes[first : first + step]))
        if watching.ready():
            np.testing.assert_array_equal(watching.picture(), rates[watching.frame])
            seen += 1
    assert seen == len(rates) // step > 6


def test_a_calibrated_unit_is_used_as_by_the_whole_streams_denoiser() -> None:
    rng = np.random.default_rng(1)
    unit = rng.uniform(0.8, 1.2, SHAPE).astype(np.float32), rng.uniform(0, 0.01, SHAPE).astype(np.float32)
    spikes, watching = stream(64), live(unit=unit)
    watching.push(pack_frames(spikes[:32]))
    first = watching.picture()
    rates = online(unit=unit).push(spikes)
    np.testing.assert_array_equal(first, rates[watching.frame])
    assert not np.array_equal(rates, online().push(spikes))
    with pytest.raises(InputError, match="calibration map has shape"):
        LiveDnSS((8, 8), unit=unit)


@pytest.mark.parametrize("mode", RECIPES)
def test_after_a_long_gap_a_picture_is_that_of_a_stream_that_began_shortly_before(mode: str) -> None:
    """The window and its planes are those of a new stream of HISTORY frames before it; ring and gap do not matter."""
    layout, spikes, watching = recipe_of(mode).layout, stream(1400), live(mode, room=700)
    for first in range(0, 1400, 70):
        watching.push(pack_frames(spikes[first : first + 70]))
    watching.picture()
    start = watching.window.start
    origin = start - layout.past - HISTORY
    fresh = RollingWindow(layout, SHAPE)
    (window,) = fresh.push(spikes[origin : start + layout.planes + layout.future], {start - origin})
    assert start > 1300
    np.testing.assert_array_equal(watching.window.spikes, window.spikes)
    np.testing.assert_array_equal(watching.window.planes, window.planes)


def test_more_passes_a_picture_know_what_the_whole_streams_denoiser_knows() -> None:
    """As many passes as there are give its bits however seldom a picture is asked for; two give others than one."""
    spikes = stream(240)
    rates, shown = online().push(spikes), {}
    for passes in (1, 2, 100):
        watching = live(passes=passes)
        for first in range(0, 240, 80):
            watching.push(pack_frames(spikes[first : first + 80]))
            shown[passes] = watching.picture()
    np.testing.assert_array_equal(shown[100], rates[watching.frame])
    errors = [np.abs(shown[passes] - shown[100]).mean() for passes in (1, 2)]
    print(f"1 pass errs by {errors[0]:.3g}, 2 by {errors[1]:.3g} spikes/frame")
    assert errors[0] > 1.2 * errors[1] > 0


def test_gain_and_carried_pictures_go_on_over_a_gap() -> None:
    spikes, watching, forgetful = stream(600), live(), live()
    watching.push(pack_frames(spikes[:48]))
    watching.picture()
    watching.push(pack_frames(spikes[48:]))
    forgetful.push(pack_frames(spikes))
    assert np.abs(watching.picture() - forgetful.picture()).max() > 0.01
    assert watching.frame == forgetful.frame
    assert np.any(watching.window.planes[-2]) and not np.any(forgetful.window.planes[-2])


def test_after_lost_frames_the_stream_begins_anew() -> None:
    spikes, watching = stream(200), live()
    watching.push(pack_frames(spikes[:100]))
    watching.picture()
    watching.skip(57)
    assert watching.count == 157 and not watching.ready()
    with pytest.raises(NotReadyError, match="0 frames have come"):
        watching.picture()
    watching.push(pack_frames(spikes[157:]))
    watching.picture()
    (window,) = RollingWindow(recipe_of("best").layout, SHAPE).push(spikes[157:189])
    np.testing.assert_array_equal(watching.window.spikes, window.spikes)
    np.testing.assert_array_equal(watching.window.planes[:-2] > 0, window.planes[:-2] > 0)
    assert watching.frame == 157 + PLANES // 2


@pytest.mark.parametrize(("plane", "latency"), [(0, 31), (None, 23), (15, 16)])
def test_a_picture_shows_the_frame_that_its_latency_says(plane: int | None, latency: int) -> None:
    spikes, watching = stream(48), live(plane=plane)
    assert watching.latency == latency and watching.step == PLANES and watching.frame is None
    with pytest.raises(NotReadyError, match="needs 32"):
        watching.picture()
    ages = []
    for frame in spikes:
        watching.push(pack_frames(frame[None]))
        if watching.count >= 32:
            watching.picture()
            ages.append(watching.count - 1 - watching.frame)
    assert (min(ages), max(ages)) == (latency, latency + PLANES - 1)


def test_a_stream_of_hours_is_denoised_as_a_young_one() -> None:
    """Frame numbers beyond 2^24 have no exact float32, and beyond 2^31 no int32."""
    spikes = stream(16 * 20)
    pictures = {}
    for lost in (0, 16 * (1 << 30)):
        watching = live()
        if lost:
            watching.skip(lost)
        for first in range(0, len(spikes), 16):
            watching.push(pack_frames(spikes[first : first + 16]))
            if watching.ready():
                pictures.setdefault(lost, []).append(watching.picture())
        assert watching.frame == lost + 296
    np.testing.assert_array_equal(*pictures.values())


def test_frames_that_are_overwritten_while_a_picture_reads_them_are_not_shown() -> None:
    """The writer overtakes the reader once, in the middle of its reading; the picture is then of newer frames."""
    spikes, watching = stream(1400), live(room=700)
    packed = pack_frames(spikes)
    watching.push(packed[:400])
    rows, calls = watching.ring.packed, []

    def overtaken(first: int, stop: int) -> np.ndarray:
        calls.append(first)
        if len(calls) == 1:
            watching.push(packed[400:])
        return rows(first, stop)

    watching.ring.packed = overtaken
    watching.picture()
    assert len(calls) > 1 and watching.frame > 1300 and watching.lost == 0
    np.testing.assert_array_equal(watching.window.spikes, spikes[watching.window.start - 16 :][:48])


@pytest.mark.parametrize("step", [8, 40, 100])
def test_mode_picture_runs_every_pass_however_seldom_a_picture_is_asked_for(step: int) -> None:
    spikes, (often, seldom) = stream(1210), (live("picture", step=step) for _ in range(2))
    pictures = online("picture", step=step).push(spikes)
    for first in range(0, 1210, 7):
        often.push(pack_frames(spikes[first : first + 7]))
        if often.ready():
            np.testing.assert_array_equal(often.picture(), pictures[(often.count // step) - 1])
            assert often.frame == max(often.count // step * step - 1 - often.latency, 0)
    seldom.push(pack_frames(spikes))
    np.testing.assert_array_equal(seldom.picture(), pictures[-1])
    assert seldom.frame == often.frame and seldom.lost == 0 and len(pictures) == 1210 // step


def test_the_end_of_a_stream_shorter_than_a_step_is_a_picture() -> None:
    spikes, watching, whole = stream(300), live("picture", step=200), online("picture", step=200)
    rates = np.concatenate([whole.push(spikes), whole.flush()])
    for first, stop in ((0, 60), (60, 300)):
        short = live("picture", step=200)
        short.push(pack_frames(spikes[:stop]))
        watching.push(pack_frames(spikes[first:stop]))
        short.end()
        assert short.ready() and short.picture().shape == SHAPE and short.frame == stop - 1 - short.latency
    watching.end()
    np.testing.assert_array_equal(watching.picture(), rates[-1])
    assert not watching.ready()


def test_frames_that_mode_picture_comes_too_late_for_are_lost_and_counted() -> None:
    """The stream then begins anew with the newest half of the ring; the gain stays."""
    spikes, watching, forgetful = stream(1500), live("picture", step=200, room=400), live("picture", step=200)
    for first in range(0, 600, 100):
        watching.push(pack_frames(spikes[first : first + 100]))
        watching.take_in()
    watching.push(pack_frames(spikes[600:]))
    assert watching.free == 0 and watching.ready()
    forgetful.push(pack_frames(spikes[1300:]))
    assert np.any(watching.picture() != forgetful.picture())
    assert (watching.lost, watching.free, watching.frame) == (1300 - 600, 400, 1500 - 1 - watching.latency)
    assert np.any(watching.window.planes[-2]) and not np.any(forgetful.window.planes[-2])


def test_mode_picture_shows_what_it_had_of_a_step_whose_rest_was_overwritten() -> None:
    spikes, watching = stream(1500), live("picture", step=500, room=600)
    watching.push(pack_frames(spikes[:200]))
    watching.take_in()
    assert not watching.ready()
    watching.push(pack_frames(spikes[200:]))
    assert watching.ready()
    (picture,) = online("picture", step=200).push(spikes[:200])
    np.testing.assert_array_equal(watching.picture(), picture)
    assert watching.lost == 1200 - 200 and watching.frame == 199 - watching.latency


def test_pace_makes_so_many_pictures_a_second_where_no_step_was_given() -> None:
    steps = []
    for frames_s in (40_000, 300, 10, 1e6):
        watching = live("picture")
        watching.pace(frames_s, 30)
        steps.append((watching.step, watching.needed))
    assert steps == [(1333, 1333), (10, 10), (8, 8), (4000, 4000)]
    given, other = live("picture", step=50), live("best")
    for watching in (given, other):
        watching.pace(40_000, 30)
    assert (given.step, other.step) == (50, PLANES)


def test_a_new_pace_holds_from_the_next_picture_on() -> None:
    watching, frames = live("picture"), []
    for count, frame in enumerate(stream(120)):
        watching.push(pack_frames(frame[None]))
        watching.take_in()
        if count == 20:
            watching.pace(300, 30)
        if watching.ready():
            watching.picture()
            frames.append(watching.frame + watching.latency + 1)
    assert frames == [40, 50, 60, 70, 80, 90, 100, 110, 120]


def slowly(watching: LiveDnSS, seconds: float) -> None:
    """Its network takes as long as that."""
    run = watching._engine.run

    def delayed(*given: object) -> object:
        time.sleep(seconds)
        return run(*given)

    object.__setattr__(watching._engine, "run", delayed)


@pytest.mark.parametrize("step", [40, 333])
def test_passes_on_a_thread_give_the_same_bits_while_frames_go_on(step: int) -> None:
    """Each pass is delayed until the frames of the next have come: a step that was given waits, and stays the same."""
    spikes, watching = stream(2400), live("picture", step=step)
    pictures, shown = online("picture", step=step).push(spikes), {}
    slowly(watching, 0.005)
    with ThreadPoolExecutor(1) as passes:
        watching.run_passes_on(passes)
        for first in range(0, 2400, 31):
            watching.push(pack_frames(spikes[first : first + 31]))
            watching.take_in()
            if watching.ready():
                picture = watching.picture()
                shown[(watching.frame + watching.latency + 1) // step] = picture
        watching.run_passes_on(None)
        shown[2400 // step] = watching.picture()
    assert len(shown) > 2 and watching.lost == 0
    for number, picture in shown.items():
        np.testing.assert_array_equal(picture, pictures[number - 1])


def test_a_slow_network_makes_paced_steps_longer_and_every_frame_is_in_a_picture() -> None:
    """Pictures are those of the denoiser of the whole stream whose steps end where these did."""
    spikes, watching = stream(3000), live("picture")
    watching.pace(4000, 50)  # 80 frames a step, if the network were fast enough
    slowly(watching, 0.02)
    ends, shown = [], []
    with ThreadPoolExecutor(1) as passes:
        watching.run_passes_on(passes)
        for first in range(0, 3000, 50):
            watching.push(pack_frames(spikes[first : first + 50]))
            watching.take_in()
            time.sleep(0.002)
            if watching.ready():
                shown.append(watching.picture())
                ends.append(watching.frame + watching.latency + 1)
        watching.run_passes_on(None)
    steps = np.diff([0, *ends])
    print(f"steps of {steps} frames")
    assert steps[0] == 80 and max(steps) > 200 and watching.lost == 0
    history, engine, carried = PixelHistory(PictureLayout(), SHAPE), live("picture")._engine, ()
    for begin, stop, picture in zip([0, *ends], ends, shown, strict=False):
        history.step = stop - begin
        (window,) = history.push(spikes[begin:stop])
        ((rates, carried),) = engine.run([window], [carried], SHAPE)
        history.learn(window, rates)
        np.testing.assert_array_equal(picture, rates[0])


def test_frames_before_a_gap_make_a_picture_of_mode_picture() -> None:
    spikes, watching = stream(90), live("picture", step=500)
    watching.push(pack_frames(spikes))
    watching.take_in()
    watching.skip(1000)
    (picture,) = online("picture", step=90).push(spikes)
    np.testing.assert_array_equal(watching.picture(), picture)
    assert watching.frame == 90 - 1 - watching.latency and watching.count == 1090


@pytest.mark.parametrize(("mode", "ahead"), [("picture", 12), ("best", 20), ("paper", 20)])
def test_the_noisy_picture_is_the_mean_of_41_frames_about_the_frame(mode: str, ahead: int) -> None:
    spikes, watching = stream(160), live(mode)
    watching.push(pack_frames(spikes))
    watching.picture()
    stop = watching.frame + ahead + 1
    np.testing.assert_allclose(watching.noisy(), spikes[stop - 41 : stop].mean(axis=0), rtol=1e-6)


def test_one_thread_pushes_while_another_asks_for_pictures() -> None:
    spikes, watching = stream(20_000), live(room=700)
    watching.warm_up()
    packed = pack_frames(spikes)
    watching.push(packed[:64])

    def push() -> None:
        for first in range(64, len(packed), 50):
            watching.push(packed[first : first + 50])
            time.sleep(0.002)  # a ring of 700 frames is overwritten in 30 ms

    pushing = threading.Thread(target=push)
    pushing.start()
    shown = 0
    while pushing.is_alive() or watching.ready():
        watching.picture()
        begin = watching.window.start - min(16, watching.window.start)
        np.testing.assert_array_equal(watching.window.spikes[-48:][-32:], spikes[begin:][:48][-32:])
        shown += 1
    pushing.join()
    assert shown > 1 and watching.count == 20_000


@pytest.mark.parametrize(
    "packed",
    [
        np.zeros((4, 16), np.uint8),
        np.zeros((4, 15), np.int8),
        np.zeros(15, np.uint8),
        np.zeros((4, 9, 13), np.uint8),
        b"\x00" * 15,
        [[0] * 15],
    ],
    ids=["wide", "int8", "flat", "unpacked", "bytes", "list"],
)
def test_frames_that_are_not_packed_as_the_stream_are_refused(packed: object) -> None:
    with pytest.raises(InputError, match=r"9 x 13 pixels need uint8 of shape \(frames, 15\)"):
        live().push(packed)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mode": "bets"}, "bets"),
        ({"mode": "none.pt"}, "none.pt"),
        ({"plane": 16}, "plane = 16"),
        ({"plane": -1}, "plane = -1"),
        ({"room": 223}, "room is 223"),
        ({"shape": (0, 4)}, "shape"),
        ({"precision": "float16"}, "precision"),
        ({"step": 40}, "step and look are of mode 'picture'"),
        ({"mode": "picture", "plane": 0}, "passes and plane are of other modes than 'picture'"),
        ({"mode": "picture", "passes": 1}, "passes and plane are of other modes than 'picture'"),
        ({"mode": "picture", "step": 7}, "step = 7"),
        ({"mode": "picture", "look": 25}, "look = 25"),
    ],
)
def test_unusable_options_are_named(options: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        LiveDnSS(**{"shape": SHAPE, "mode": "best", **options})
