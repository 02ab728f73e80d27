"""`spikecam live`: figures, films and windows of streams as they come; none of it needs a display."""

from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from scenes import RotatingDisk
from spikecam_env.cli.live.live_screen import LiveScreen
from spikecam_env.cli.live.simulated import SimulatedSource
from spikecam_env.cli.screen.screen import MARGIN, display
from spikecam_env.sensor import SpikeSensor
from spikecam_env.streams import pack_frames, save_vidar_dat
from spikecam_env.streams.sources import StoredFrames
from tests.commands import film_in, spikecam

SHAPE = (24, 40)
SIZE = ("--height", 24, "--width", 40)
SCALE = 8
"""Pixels of the screen a pixel of so small a picture takes, each way."""


@pytest.fixture(autouse=True)
def no_display(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("spikecam_env.cli.screen.window.has_display", lambda: False)
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def spikes() -> np.ndarray:
    return SpikeSensor("scsim", SHAPE, 0).step(RotatingDisk(SHAPE).radiance(0, 512), 512)


@pytest.fixture
def recording(spikes: np.ndarray, tmp_path: Path) -> Path:
    save_vidar_dat(tmp_path / "disk.dat", spikes, side_file=True)
    return tmp_path / "disk.dat"


def figures(printed: str) -> dict[str, float]:
    """The row that the command prints."""
    *_, names, _, row = (line for line in printed.splitlines() if not line.startswith("wrote"))
    columns = [name.strip() for name in names.split("  ") if name.strip()]
    cells = dict(zip(columns, (cell for cell in row.split("  ") if cell.strip()), strict=True))
    return {name: float(cell) for name, cell in cells.items() if name != "stream"}


@contextmanager
def standard_input(content: bytes) -> Iterator[None]:
    """File descriptor 0 brings this, as a pipe."""
    before, (reading, writing) = os.dup(0), os.pipe()

    def write() -> None:
        with os.fdopen(writing, "wb") as pipe:
            pipe.write(content)

    writer = threading.Thread(target=write)
    writer.start()
    os.dup2(reading, 0)
    os.close(reading)
    try:
        yield
    finally:
        os.dup2(before, 0)
        os.close(before)
        writer.join()


def test_without_a_display_the_figures_of_a_file_are_printed(recording: Path, capsys) -> None:
    assert spikecam("live", recording, "--loop", "--frames", 1200, "--speed", 0.05) == 0
    printed = capsys.readouterr()
    assert printed.out.startswith("no display: the figures alone; --film FILE.mp4 writes the pictures")
    row = figures(printed.out)
    assert row["frames"] == 1200 and row["lost"] < 1200
    assert row["seconds"] >= 0.6 and row["x real time"] <= 0.051
    assert 1 <= row["pictures"] <= 30 * row["seconds"] + 2
    assert row["latency [ms]"] >= 1e3 * 12 / 2000, "a picture is of the frame 12 before the newest"


def test_a_film_is_what_a_window_would_show(recording: Path, capsys, tmp_path: Path) -> None:
    """Noisy on the left, denoised on the right, as many pictures as the stream lasted."""
    film = tmp_path / "a.mp4"
    options = ("--loop", "--seconds", 1.5, "--speed", 0.02, "--mode", "best")
    assert spikecam("live", recording, *options, "--film", film) == 0
    printed = capsys.readouterr().out
    assert printed.endswith(f"wrote {film}\n")
    pictures = [picture[..., 0].astype(float) for picture in film_in(film)]
    assert 0.5 * 30 <= len(pictures) <= (figures(printed)["seconds"] + 0.2) * 30
    rows, columns = SHAPE[0] * SCALE, SHAPE[1] * SCALE
    noisy, clean = (pictures[-1][MARGIN : MARGIN + rows, left:][:, :columns] for left in (MARGIN, 2 * MARGIN + columns))
    by_pixel = [panel.reshape(SHAPE[0], SCALE, SHAPE[1], SCALE).mean(axis=(1, 3)) for panel in (noisy, clean)]
    rough = [np.abs(np.diff(panel, axis=0)).mean() for panel in by_pixel]
    print(f"differences between rows: noisy {rough[0]:.1f}, denoised {rough[1]:.1f} grey values")
    assert rough[1] < 0.8 * rough[0]
    assert np.corrcoef(by_pixel[0].ravel(), by_pixel[1].ravel())[0, 1] > 0.7
    assert max(np.abs(picture - pictures[0]).mean() for picture in pictures) > 1


def test_a_file_that_is_read_too_slowly_to_be_live_is_named_at_the_start(recording: Path, capsys, monkeypatch) -> None:
    monkeypatch.setattr(StoredFrames, "read_rate", lambda _: 3000.0)
    assert spikecam("live", recording, "--loop", "--frames", 64, "--speed", 0.05) == 0
    said = capsys.readouterr().out
    assert "disk.dat is read at 3000 frames a second" in said and "2000 are needed" in said and "--speed 0.04" in said
    assert spikecam("live", recording, "--loop", "--frames", 64, "--speed", 0.03) == 0
    assert "is read at" not in capsys.readouterr().out


def test_packed_frames_are_taken_from_standard_input(spikes: np.ndarray, capfd) -> None:
    with standard_input(pack_frames(spikes).tobytes()[:-50]):
        assert spikecam("live", "-", *SIZE) == 0
    printed = capfd.readouterr()
    assert figures(printed.out)["frames"] == 511
    assert "spikecam: warning: standard input ended in the middle of a frame, with 70 of 120 bytes" in printed.err


@pytest.mark.parametrize(
    ("mode", "content", "said"),
    [
        ("picture", b"", "standard input ended before a frame had come, with 0 of 120 bytes"),
        ("picture", bytes(100), "standard input ended before a frame had come, with 100 of 120 bytes"),
        ("best", bytes(120 * 31), "standard input ended after 31 frames; a picture needs 32"),
    ],
    ids=["empty", "cut", "short"],
)
@pytest.mark.parametrize("film", [(), ("--film", "a.mp4")], ids=["figures", "film"])
def test_a_stream_without_a_picture_is_refused_in_a_line(
    mode: str, content: bytes, said: str, film: tuple, capfd
) -> None:
    with standard_input(content):
        assert spikecam("live", "-", *SIZE, *film, "--mode", mode) == 2
    assert capfd.readouterr().err.startswith(f"spikecam: {said}")
    assert not os.listdir()


@pytest.mark.parametrize("film", [(), ("--film", "a.mp4")], ids=["figures", "film"])
def test_a_recording_shorter_than_a_step_shows_its_picture(spikes: np.ndarray, film: tuple, capfd) -> None:
    with standard_input(pack_frames(spikes[:31]).tobytes()):
        assert spikecam("live", "-", *SIZE, *film) == 0
    row = figures(capfd.readouterr().out)
    assert (row["frames"], row["lost"], row["pictures"]) == (31, 0, 1)


@pytest.mark.parametrize("mode", ["best", "fast"])
def test_other_modes_skip_passes_for_which_they_are_too_slow(recording: Path, mode: str, capsys) -> None:
    assert spikecam("live", recording, "--frames", 400, "--speed", 0.05, "--mode", mode, "--passes", 2) == 0
    assert 1 <= figures(capsys.readouterr().out)["pictures"] <= 400 / 16


def test_passes_are_not_of_mode_picture(recording: Path, capsys) -> None:
    assert spikecam("live", recording, "--passes", 2) == 2
    said = capsys.readouterr().err
    assert said.startswith("spikecam: passes and plane are of other modes than 'picture'") and said.count("\n") == 1


def test_a_wrong_size_of_a_pipes_frames_is_noticed(spikes: np.ndarray, capfd) -> None:
    with standard_input(pack_frames(spikes).tobytes()):
        assert spikecam("live", "-", "--height", 24, "--width", 48) == 0
    assert "read as 24 x 48 pixels: " in (said := capfd.readouterr().err) and "frames look 120 bytes long" in said


def test_a_server_that_breaks_off_ends_the_command_in_a_line(spikes: np.ndarray, capfd) -> None:
    server = socket.create_server(("127.0.0.1", 0))

    def send() -> None:
        connection, _ = server.accept()
        connection.sendall(pack_frames(spikes[:64]).tobytes())
        time.sleep(0.5)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\0\0\0\0\0\0\0")  # resets
        connection.close()

    sending = threading.Thread(target=send)
    sending.start()
    assert spikecam("live", f"tcp://127.0.0.1:{server.getsockname()[1]}", *SIZE) == 2
    sending.join()
    server.close()
    said = capfd.readouterr().err
    assert said.startswith("spikecam: tcp://") and "frames: Connection reset by peer" in said


def test_in_a_window_escape_ends_an_endless_stream(recording: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    shown = []

    class Window:
        closed = False

        def __init__(self, title: str) -> None:
            assert title == "spikecam live disk.dat"

        def show(self, picture: np.ndarray, seconds: float) -> None:
            shown.append(picture)

        def wait(self, seconds: float) -> None:
            threading.Event().wait(seconds)

        def taken(self) -> list[str]:
            return ["escape"] if len(shown) > 3 else []

    monkeypatch.setattr("spikecam_env.cli.screen.window.has_display", lambda: True)
    monkeypatch.setattr("spikecam_env.cli.screen.window.DisplayWindow", Window)
    assert spikecam("live", recording, "--loop", "--speed", 0.05) == 0
    assert len(shown) == 4 and len({picture.shape for picture in shown}) == 1
    assert figures(capsys.readouterr().out)["pictures"] >= 4


def test_a_scene_is_simulated_no_faster_than_its_speed(capsys) -> None:
    assert spikecam("live", "disk", "--size", *SHAPE, "--frames", 640, "--speed", 0.04, "--rpm", 1000) == 0
    row = figures(capsys.readouterr().out)
    assert row["frames"] == 640 and row["seconds"] >= 0.97 * (640 - 128) / 1600 and row["lost"] == 0


def test_a_simulated_source_gives_the_sensors_frames(spikes: np.ndarray) -> None:
    source = SimulatedSource("disk", RotatingDisk(SHAPE), SpikeSensor("scsim", SHAPE, 0), speed=1e6)
    rows = np.empty((512, 120), np.uint8)
    done = 0
    while done < 512:
        done += source.read(rows[done:])
    np.testing.assert_array_equal(rows, pack_frames(spikes))


def test_the_screen_shows_grey_values_of_a_screen_and_follows_the_light() -> None:
    rng = np.random.default_rng(0)
    screen, rate = LiveScreen("disk", "best"), rng.random(SHAPE).astype(np.float32)
    rows, columns = SHAPE[0] * SCALE, SHAPE[1] * SCALE

    def panels(light: float) -> tuple[np.ndarray, np.ndarray]:
        picture = screen.picture(light * rate / 2, light * rate, "figures")
        assert picture.shape[0] % 2 == picture.shape[1] % 2 == 0
        cut = [picture[MARGIN : MARGIN + rows, left:][:, :columns] for left in (MARGIN, 2 * MARGIN + columns)]
        return tuple(panel[::SCALE, ::SCALE, 0].astype(int) for panel in cut)

    noisy, clean = panels(1.0)
    white = float(np.percentile(rate[::4, ::4], 99.5))
    for seen, light in ((noisy, rate / 2), (clean, rate)):
        assert np.abs(seen - display(light, white)).max() <= 2
    dimmed = [panels(0.1)[1].mean() for _ in range(60)]
    assert dimmed[0] < 0.5 * clean.mean() and dimmed[-1] > 0.95 * clean.mean()
    assert dimmed[9] < 0.8 * clean.mean() < dimmed[-1]
