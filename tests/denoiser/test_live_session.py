"""A stream taken in by one thread and denoised by another, at the pace of a source that is made up."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
import torch

from denoiser.live import LiveDnSS
from denoiser.live.session import NOTHING, Figures, Session
from spikecam_env.errors import InputError
from spikecam_env.streams.packing import pack_frames

SHAPE = (8, 16)
RATE_HZ = 2000.0
"""Of the made-up camera: slow, so that a busy machine is on time."""


class MadeUp:
    """Frames of random bits.  stall_s: of the third read.  broken: error of the read after 200 frames."""

    title, shape, frame_rate_hz, cut = "made up", SHAPE, RATE_HZ, ""

    def __init__(
        self, frames: int, *, waits: bool = True, stall_s: float = 0.0, broken: Exception | None = None
    ) -> None:
        rng = np.random.default_rng(0)
        self.packed = pack_frames((rng.random((frames, *SHAPE)) < 0.2).astype(np.uint8))
        self.waits, self.stall_s, self.broken = waits, stall_s, broken
        self.at = self.reads = self.skipped = 0

    def read(self, rows: np.ndarray) -> int:
        self.reads += 1
        if self.broken is not None and self.at >= 200:
            raise self.broken
        if self.reads == 3:
            time.sleep(self.stall_s)
        count = max(0, min(len(rows), len(self.packed) - self.at, 64))
        rows[:count] = self.packed[self.at : self.at + count]
        self.at += count
        return count

    def skip(self, frames: int, keep: int = 0) -> int:
        skipped = max(0, min(frames, len(self.packed) - self.at - keep))
        self.at += skipped
        self.skipped += skipped
        return skipped


@pytest.fixture(scope="module")
def live() -> LiveDnSS:
    return LiveDnSS(SHAPE, "best", precision="float32")


@pytest.fixture
def every() -> LiveDnSS:
    """Of mode `picture`."""
    return LiveDnSS(SHAPE, precision="float32")


def watched(session: Session) -> list:
    """All pictures that were seen until the session was over."""
    seen = [None]
    while not session.over:
        seen.append(session.newest(seen[-1], 0.2) or seen[-1])
    return [shown for shown, before in zip(seen[1:], seen, strict=False) if shown is not before]


def test_a_file_is_taken_in_at_its_pace_and_nothing_is_lost(live: LiveDnSS, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("denoiser.live.session.BUFFER_S", 10.0)  # longer than any machine stands still
    source = MadeUp(1000)
    with Session(source, live, pictures=20.0) as session:
        seen = watched(session)
    figures = session.figures
    assert (figures.frames, figures.lost) == (1000, 0)
    assert figures.seconds >= 0.45
    assert figures.pictures <= 20.0 * figures.seconds + 3  # the first, the last, and one that comes early
    frames = [shown.frame for shown in seen]
    assert frames == sorted(set(frames)) and frames[-1] == live.frame
    assert live.count == 1000 and 1000 - live.frame <= live.latency + live.step
    print(f"{figures}")


@pytest.mark.parametrize("speed", [0.5, 4.0])
def test_speed_stretches_the_time_that_a_file_takes(live: LiveDnSS, speed: float) -> None:
    with Session(MadeUp(800), live, speed=speed, pictures=5.0) as session:
        watched(session)
    assert 800 / RATE_HZ / speed <= session.figures.seconds + 0.05
    assert session.figures.frames + session.figures.lost >= 800


def test_a_reader_that_is_late_loses_frames_and_counts_them(live: LiveDnSS) -> None:
    """It stands still for 0.5 s, of which frames of 0.1 s wait: 0.4 s of 2000 frames/s are lost, and no others."""
    source = MadeUp(2000, stall_s=0.5)
    with Session(source, live, pictures=10.0) as session:
        watched(session)
    figures = session.figures
    print(f"{figures.lost} frames lost")
    assert figures.lost == source.skipped >= 0.4 * RATE_HZ - 64
    assert figures.frames + figures.lost == live.count == 2000
    assert live.ring.extent[0] > 0


@pytest.mark.parametrize("frames", [60, 200, 300])
def test_a_short_file_that_is_read_late_loses_no_frame_that_its_last_picture_needs(live: LiveDnSS, frames: int) -> None:
    """The reader stands still for as long as the whole file and the frames that may wait, and longer."""
    source = MadeUp(frames, stall_s=frames / RATE_HZ + 0.3)
    with Session(source, live) as session:
        seen = watched(session)
    figures = session.figures
    print(f"{frames} frames: {figures.frames} read, {figures.lost} lost, {figures.pictures} pictures")
    assert figures.frames + figures.lost == live.count == frames
    assert figures.frames >= live.needed and figures.pictures >= 1
    assert frames - seen[-1].frame <= live.latency + live.step


def test_frames_that_are_lost_as_a_picture_begins_end_nothing(live: LiveDnSS, monkeypatch: pytest.MonkeyPatch) -> None:
    picture, calls = live.picture, []

    def interrupted() -> np.ndarray:
        calls.append(1)
        if len(calls) == 4:  # the first two are the warm-up's
            live.skip(7)
        return picture()

    monkeypatch.setattr(live, "picture", interrupted)
    with Session(MadeUp(600), live, pictures=20.0) as session:
        seen = watched(session)
    assert len(calls) > 4 and seen[-1].frame == live.frame


def test_a_stream_with_a_pace_of_its_own_is_taken_as_it_comes_and_loses_nothing(live: LiveDnSS) -> None:
    with Session(MadeUp(4000, waits=False, stall_s=0.3), live, pictures=5.0) as session:
        watched(session)
    assert (session.figures.frames, session.figures.lost) == (4000, 0)
    assert session.figures.seconds < 4000 / RATE_HZ


@pytest.mark.parametrize("limit", [{"frames": 300}, {"seconds": 0.2}], ids=["frames", "seconds"])
def test_it_ends_after_so_many_frames_or_so_long(live: LiveDnSS, limit: dict) -> None:
    with Session(MadeUp(100_000), live, **limit) as session:
        watched(session)
    assert session.figures.frames == 300 if "frames" in limit else session.figures.frames < 2000


def test_a_time_limit_holds_for_a_sender_that_has_fallen_silent(live: LiveDnSS) -> None:
    with Session(MadeUp(1000, waits=False, stall_s=5.0), live, seconds=0.3) as session:
        begun = time.perf_counter()
        watched(session)
    assert time.perf_counter() - begun < 2.5


def test_mode_picture_shows_so_many_pictures_a_second_and_the_frames_that_are_left(
    every: LiveDnSS, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("denoiser.live.session.BUFFER_S", 10.0)
    with Session(MadeUp(1050), every, pictures=20.0) as session:
        seen = watched(session)
    figures = session.figures
    assert every.step == 100 and (figures.frames, figures.lost) == (1050, 0)
    assert 1 <= figures.pictures <= 11 and figures.pictures <= 20.0 * figures.seconds + 2
    assert seen[-1].frame == every.frame == 1050 - 1 - every.latency


@pytest.mark.parametrize("waits", [True, False], ids=["file", "pipe"])
@pytest.mark.parametrize("frames", [1, 31, 60])
def test_a_recording_shorter_than_a_step_shows_a_picture(every: LiveDnSS, frames: int, waits: bool) -> None:
    with Session(MadeUp(frames, waits=waits), every, pictures=20.0) as session:
        seen = watched(session)
    assert session.figures.pictures == 1 and seen[-1].frame == max(frames - 1 - every.latency, 0)


def test_a_sender_waits_for_mode_picture_so_that_nothing_is_lost() -> None:
    small = LiveDnSS(SHAPE, precision="float32", step=50, room=300)
    with Session(MadeUp(6000, waits=False), small, pictures=1000.0) as session:
        watched(session)
    assert (session.figures.frames, session.figures.lost) == (6000, 0)
    assert small.count == 6000 and small.frame == 6000 - 1 - small.latency


def test_a_source_that_stalls_and_a_slow_network_lose_no_frame(
    every: LiveDnSS, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The network takes a quarter of a second, in which 500 frames come; steps would be of 100, and become longer."""
    monkeypatch.setattr("denoiser.live.session.BUFFER_S", 10.0)
    run = every._engine.run

    def delayed(*given: object) -> object:
        time.sleep(0.25)
        return run(*given)

    with Session(MadeUp(4000, stall_s=0.5), every, pictures=20.0) as session:
        object.__setattr__(every._engine, "run", delayed)
        seen = watched(session)
    steps = np.diff([shown.frame for shown in seen])
    print(f"{session.figures}; steps of {steps} frames")
    assert (session.figures.frames, session.figures.lost) == (4000, 0)
    assert every.step == 100 and max(steps) > 300
    assert seen[-1].frame == 4000 - 1 - every.latency


def test_torch_has_its_threads_again_after_a_session(every: LiveDnSS) -> None:
    before = torch.get_num_threads()
    try:
        torch.set_num_threads(3)
        with Session(MadeUp(100), every) as session:
            assert torch.get_num_threads() == 2, "one thread is left to take frames in"
            watched(session)
        assert torch.get_num_threads() == 3
    finally:
        torch.set_num_threads(before)


def test_a_source_slower_than_its_camera_gets_shorter_steps(every: LiveDnSS) -> None:
    """Its first picture is of 40 000 / 30 frames; 2000 come in a second."""
    source = MadeUp(4000, waits=True)
    source.waits, source.frame_rate_hz = False, 40_000.0
    read = source.read

    def slowly(rows: np.ndarray) -> int:
        time.sleep(0.01)
        return read(rows[:20])

    source.read = slowly
    with Session(source, every) as session:
        watched(session)
    print(f"{session.figures}; steps of {every.step} frames")
    assert every.step < 300 and session.figures.pictures > 4


def test_a_stream_that_breaks_says_so_to_whoever_watches(live: LiveDnSS) -> None:
    with pytest.raises(InputError, match="broken"), Session(MadeUp(1000, broken=InputError("broken")), live) as session:
        watched(session)


def test_a_denoiser_of_frames_of_another_size_is_refused(live: LiveDnSS) -> None:
    source = MadeUp(10)
    source.shape = (8, 8)
    with pytest.raises(InputError, match=r"frames of \(8, 16\), made up has \(8, 8\)"):
        Session(source, live)


def test_leaving_ends_its_threads(live: LiveDnSS) -> None:
    before = set(threading.enumerate())
    with Session(MadeUp(100_000), live) as session:
        session.newest(None, 1.0)
        assert set(threading.enumerate()) - before
    assert not set(threading.enumerate()) - before


def test_latency_is_the_time_from_a_frames_coming(live: LiveDnSS) -> None:
    """Mostly at least that of the frames that the network looks ahead, of 2000 a second; a late reader takes several at
    once."""
    with Session(MadeUp(1000), live, pictures=20.0) as session:
        seen = watched(session)
    latencies = [shown.latency_s for shown in seen]
    print(f"latency {1e3 * min(latencies):.1f} to {1e3 * max(latencies):.1f} ms")
    assert np.median(latencies) >= (live.latency - 4) / RATE_HZ
    assert session.figures.latency_ms == pytest.approx(1e3 * session.figures.latency_s / session.figures.pictures)


def test_figures_of_a_stretch_are_differences() -> None:
    stretch = Figures(3.0, 90, 4, 6, 1.2).since(Figures(1.0, 30, 4, 2, 0.4))
    assert (stretch.frames_per_s, stretch.pictures_per_s, stretch.lost) == (30.0, 2.0, 0)
    assert stretch.latency_ms == pytest.approx(200.0)
    assert NOTHING.latency_ms is None and NOTHING.frames_per_s == 0.0
    assert "latency -" in str(NOTHING)
