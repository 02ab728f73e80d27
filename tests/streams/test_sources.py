"""Packed frames as they come from files, pipes and sockets."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spikecam_env.errors import InputError
from spikecam_env.streams import SpikeWriter, pack_frames, save_npz, save_vidar_dat
from spikecam_env.streams.sources import Source, open_source
from spikecam_env.streams.vidar import load_vidar_dat

pytestmark = pytest.mark.filterwarnings("ignore:.*rows look")  # frames so small say little of their geometry

SHAPE = (10, 16)
SIZE = {"height": 10, "width": 16}


def stream(frames: int = 40, shape: tuple[int, int] = SHAPE) -> np.ndarray:
    """Regular spikes, as a camera's are, of a bright middle."""
    period = 3 + np.add.outer(np.arange(shape[0]), np.arange(shape[1])) % 5
    return (np.arange(frames)[:, None, None] % period == 0).astype(np.uint8)


def all_of(source: Source, block: int = 7) -> np.ndarray:
    """All its frames, packed, read a block at a time."""
    rows, blocks = np.empty((block, -(-source.shape[0] * source.shape[1] // 8)), np.uint8), []
    while count := source.read(rows):
        blocks.append(rows[:count].copy())
    return np.concatenate(blocks)


def written(path: Path, spikes: np.ndarray, **options: Any) -> Path:
    """A recording; the ending of its name says of which format."""
    if path.suffix == ".h5":
        with SpikeWriter(path, spikes.shape[1:], 20_000.0) as writer:
            writer.append(spikes)
    elif path.suffix == ".npz":
        save_npz(path, spikes)
    else:
        save_vidar_dat(path, spikes, side_file=True, frame_rate_hz=20_000.0, **options)
    return path


@contextmanager
def sent(content: bytes, kind: str, folder: Path, piece: int = 33) -> Iterator[str]:
    """Where a server sends this, `piece` bytes at a time, and then closes."""
    server = socket.create_server(("127.0.0.1", 0)) if kind == "tcp" else socket.socket(socket.AF_UNIX)
    if kind != "tcp":
        server.bind(os.fspath(folder / "camera"))
        server.listen()

    def send() -> None:
        connection, _ = server.accept()
        with connection:
            for first in range(0, len(content), piece):
                connection.sendall(content[first : first + piece])

    sending = threading.Thread(target=send)
    sending.start()
    path = f"{folder}/camera"
    yield {"tcp": f"tcp://127.0.0.1:{server.getsockname()[1]}", "unix": f"unix://{path}", "path": path}[kind]
    sending.join()
    server.close()


@pytest.mark.parametrize("name", ["a.dat", "a.h5", "a.npz"])
def test_a_recording_comes_in_blocks(name: str, tmp_path: Path) -> None:
    spikes = stream()
    with open_source(str(written(tmp_path / name, spikes))) as source:
        assert source.shape == SHAPE and source.waits
        assert source.frame_rate_hz == (40_000.0 if name == "a.npz" else 20_000.0)
        np.testing.assert_array_equal(all_of(source), pack_frames(spikes))


@pytest.mark.parametrize("name", ["a.dat", "a.h5", "a.npz"])
def test_a_recording_begins_again_where_it_is_to_and_frames_can_be_left_out(name: str, tmp_path: Path) -> None:
    packed, rows = pack_frames(stream()), np.empty((30, 20), np.uint8)
    with open_source(str(written(tmp_path / name, stream())), loop=True) as source:
        assert source.read(rows) == 30
        assert source.read(rows) == 10
        assert source.read(rows) == 30
        np.testing.assert_array_equal(rows, packed[:30])
        source.skip(15)
        assert source.read(rows) == 30
        np.testing.assert_array_equal(rows, packed[5:35])


@pytest.mark.parametrize("bit_order", ["little", "big"])
@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize(("shape", "crop_width"), [(SHAPE, None), (SHAPE, 8), (SHAPE, 11), ((9, 13), None)])
def test_frames_are_turned_as_the_files_reader_turns_them(
    bit_order: str, flip: bool, shape: tuple[int, int], crop_width: int | None, tmp_path: Path
) -> None:
    path = tmp_path / "a.dat"
    options: dict[str, Any] = {"height": shape[0], "width": shape[1], "bit_order": bit_order, "flip": flip}
    options |= {} if crop_width is None else {"crop_width": crop_width}
    save_vidar_dat(path, stream(64, shape), flip=flip, bit_order=bit_order)
    with open_source(str(path), **options) as source:
        np.testing.assert_array_equal(all_of(source), pack_frames(load_vidar_dat(path, **options)))


@pytest.mark.skipif(not hasattr(socket, "AF_UNIX"), reason="no sockets with a path on this system")
@pytest.mark.parametrize("kind", ["tcp", "unix", "path"])
def test_a_server_sends_frames_in_pieces_of_any_size(kind: str, tmp_path: Path) -> None:
    packed = pack_frames(stream())
    with sent(packed.tobytes(), kind, tmp_path) as where, open_source(where, **SIZE) as source:
        assert not source.waits and source.frame_rate_hz == 40_000.0
        np.testing.assert_array_equal(all_of(source), packed)


def test_a_server_that_sends_rows_from_the_bottom(tmp_path: Path) -> None:
    spikes = stream()
    content = pack_frames(spikes[:, ::-1]).tobytes()
    with sent(content, "tcp", tmp_path) as where, open_source(where, flip=True, **SIZE) as source:
        np.testing.assert_array_equal(all_of(source), pack_frames(spikes))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_a_named_pipe_brings_frames(tmp_path: Path) -> None:
    packed, fifo = pack_frames(stream()), tmp_path / "pipe"
    os.mkfifo(fifo)
    writing = threading.Thread(target=fifo.write_bytes, args=(packed.tobytes(),))
    writing.start()
    with open_source(str(fifo), **SIZE) as source:
        np.testing.assert_array_equal(all_of(source), packed)
    writing.join()


def test_a_stream_that_ends_within_a_frame_says_so_and_keeps_the_whole_ones(tmp_path: Path) -> None:
    packed = pack_frames(stream())
    with sent(packed.tobytes()[:-7], "tcp", tmp_path) as where, open_source(where, **SIZE) as source:
        np.testing.assert_array_equal(all_of(source), packed[:39])
        assert "in the middle of a frame, with 13 of 20 bytes of a frame of 10 x 16; its 39 whole" in source.cut


@pytest.mark.parametrize("content", [b"", b"1234567"], ids=["empty", "cut"])
def test_a_stream_without_a_whole_frame_is_refused(content: bytes, tmp_path: Path) -> None:
    with (
        sent(content, "tcp", tmp_path) as where,
        open_source(where, **SIZE) as source,
        pytest.raises(InputError, match=rf"ended before a frame had come, with {len(content)} of 20 bytes"),
    ):
        all_of(source)


def test_a_connection_that_breaks_is_named(tmp_path: Path) -> None:
    """A socket that is closed with bytes unread resets the connection."""
    server = socket.create_server(("127.0.0.1", 0))
    with open_source(f"tcp://127.0.0.1:{server.getsockname()[1]}", **SIZE) as source:
        connection, _ = server.accept()
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\0\0\0\0\0\0\0")
        connection.close()
        with pytest.raises(InputError, match="broke after 0 frames: Connection reset"):
            all_of(source)
    server.close()


@pytest.mark.parametrize(
    ("where", "options", "message"),
    [
        ("{folder}/none.dat", {}, "none.dat"),
        ("{folder}/empty.dat", {}, "empty.dat"),
        ("{folder}/a.avi", {}, "a recording is one of"),
        ("{folder}", {}, "a recording is one of"),
        ("\0.dat", {}, "dat"),
        ("tcp://127.0.0.1:1", {}, "cannot connect to tcp://127.0.0.1:1: Connection refused"),
        ("tcp://127.0.0.1", {}, "no address of a server"),
        ("tcp://127.0.0.1:99999", {}, "no address of a server"),
        ("tcp://:80", {}, "no address of a server"),
        ("tcp://127.0.0.1:80/x", {}, "no address of a server"),
        ("unix://{folder}/none", {}, "cannot connect to unix://"),
        ("unix://" + "x" * 300, {}, "cannot connect to unix://"),
        ("-", {"loop": True}, "cannot begin again"),
        ("-", {"key": "spikes"}, "option key does not apply to pipes and sockets; they take height"),
        ("-", {"height": 0}, "height"),
        ("{folder}/a.dat", {"key": "spikes"}, "option key does not apply to .dat files"),
        ("{folder}/a.h5", {"height": 10}, "option height does not apply to .h5 files of this package"),
    ],
)  # fmt: skip
def test_what_cannot_be_opened_is_named_in_a_line(where: str, options: dict, message: str, tmp_path: Path) -> None:
    (tmp_path / "empty.dat").touch()
    written(tmp_path / "a.dat", stream())
    written(tmp_path / "a.h5", stream())
    with (
        pytest.raises(InputError, match=message) as caught,
        open_source(where.format(folder=tmp_path), **options) as source,
    ):
        all_of(source)
    assert "\n" not in str(caught.value)


def test_a_file_that_becomes_shorter_is_named(tmp_path: Path) -> None:
    path = written(tmp_path / "a.dat", stream())
    with open_source(str(path)) as source:
        path.write_bytes(b"")
        with pytest.raises(InputError, match="became shorter"):
            all_of(source)
