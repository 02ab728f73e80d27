"""Streams of packed frames as they come: from a file, a pipe or a socket, block by block into arrays of the caller.

    -                       standard input
    tcp://HOST:PORT         a server that sends frames
    a socket, a FIFO        by its path
    any other path          a recording (`recording.ENDINGS`), from its first frame on

A pipe or socket carries frames as a `.dat` file holds them, one after the other and nothing else; the size is the
caller's to give, 250 x 400 if he does not.  Whatever order rows and bits come in, frames are handed on packed as in
`packing`.  `.dat` files and recordings of this package are read as they are asked for, others whole.
"""

from __future__ import annotations

import io
import os
import socket
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError, shown
from spikecam_env.renamed import old_names
from spikecam_env.streams.hdf5 import HDF5, is_recording, open_recording
from spikecam_env.streams.packing import pack_checked, packed_bytes, unpack_frames
from spikecam_env.streams.recording import check_options, read_recording
from spikecam_env.streams.side_file import FrameLayout, geometry
from spikecam_env.streams.vidar import USUAL, read_dat

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

Packed = NDArray[np.uint8]
"""(frames, ceil(H W / 8))."""
Receive = Callable[[memoryview], int]
"""Puts bytes that have come into a buffer; returns their number, 0 at the end of a stream."""

FRAME_RATE_HZ = 40_000.0
"""Of a stream that does not say: the Vidar camera's."""
STANDARD_INPUT = "-"
TCP, UNIX = "tcp://", "unix://"
CONNECT_S = 5.0
"""For which a server is waited for [s]."""
PIPE_BYTES = 1 << 20
"""A pipe is made to hold, where the system lets it: a fiftieth of a second of the camera's stream at 250 x 400, and the
most that Linux gives a user."""
SET_PIPE_SIZE = 1031
"""F_SETPIPE_SZ of Linux; Python has the name from 3.10 on, there alone."""
_REVERSED = np.packbits(np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1)[:, ::-1], axis=1)[:, 0]
"""(256,) a byte with its bits in the other order."""
MEASURED = 512
"""Frames that `StoredFrames.read_rate` reads."""
FLOWING = ("height", "width", "crop_width", "flip", "bit_order")
"""Options of pipes and sockets."""


class Source(Protocol):
    """A stream of packed frames."""

    @property
    def title(self) -> str:
        """Its name."""

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""

    @property
    def frame_rate_hz(self) -> float:
        """Of the camera."""

    @property
    def waits(self) -> bool:
        """Whether frames wait to be read, as those of a file do."""

    @property
    def cut(self) -> str:
        """The fault of the end of the stream, once it has ended; empty where none is known."""

    def read(self, rows: Packed) -> int:
        """Fill rows with the next frames, from the first row on; how many, 0 at the end of the stream."""

    def skip(self, frames: int, keep: int = 0) -> int:
        """Leave out the next frames, but none of the last `keep` of a stream that ends; how many were left out."""


@dataclass
class StoredFrames:
    """Frames of a file."""

    title: str
    shape: tuple[int, int]
    frame_rate_hz: float
    frames: int
    fetch: Callable[[int, Packed], object]
    """Fills rows with the frames from a number on."""
    loop: bool = False
    """Begin again at the end."""
    waits: bool = field(default=True, init=False)
    cut: str = field(default="", init=False)
    _next: int = field(default=0, init=False)

    def read(self, rows: Packed) -> int:
        if self.loop and self._next >= self.frames:
            self._next %= self.frames
        count = max(0, min(len(rows), self.frames - self._next))
        if count:
            self.fetch(self._next, rows[:count])
            self._next += count
        return count

    def skip(self, frames: int, keep: int = 0) -> int:
        skipped = frames if self.loop else max(0, min(frames, self.frames - self._next - keep))
        self._next += skipped
        return skipped

    def read_rate(self) -> float:
        """Frames a second at which the first frames are read; measured, on a second reading."""
        rows = np.empty((min(MEASURED, self.frames), packed_bytes(self.shape)), np.uint8)
        self.fetch(0, rows[:1])
        began = time.perf_counter()
        self.fetch(0, rows)
        return len(rows) / max(time.perf_counter() - began, 1e-9)


@dataclass
class Flowing:
    """Frames that a pipe or a socket brings, one after the other, in the layout `taken`."""

    title: str
    taken: FrameLayout
    receive: Receive
    waits: bool = field(default=False, init=False)
    cut: str = field(default="", init=False)
    _frames: int = field(default=0, init=False)

    @property
    def shape(self) -> tuple[int, int]:
        return self.taken.height, _columns(self.taken)

    @property
    def frame_rate_hz(self) -> float:
        return self.taken.frame_rate_hz or FRAME_RATE_HZ

    def read(self, rows: Packed) -> int:
        """Fill rows with the next frames; returns their number, 0 at the end.

        Raises:
            InputError: the connection breaks, or ends before its first frame.
        """
        try:
            frames, rest = _whole_frames(self.receive, rows, self.taken)
        except OSError as error:
            raise InputError(f"{self.title} broke after {self._frames} frames: {error.strerror or error}") from error
        self._frames += frames
        if rest or not self._frames:
            size = f"a frame of {self.taken.height} x {self.taken.width}"
            here = f"{rest} of {packed_bytes(self.taken.shape)} bytes of {size}"
            if not self._frames:
                raise InputError(f"{self.title} ended before a frame had come, with {here}")
            taken = f"its {self._frames} whole frames were taken"
            self.cut = f"{self.title} ended in the middle of a frame, with {here}; {taken}"
        return frames

    def skip(self, frames: int, keep: int = 0) -> int:
        raise InputError(f"{self.title} brings frames when it has them; none can be left out")


@contextmanager
def open_source(where: str, *, loop: bool = False, **options: Any) -> Iterator[Source]:
    """The stream at an address, open inside the `with` block.  Warns as `read_recording` does.

    Args:
        where: an address that the module lists.
        loop: a recording begins again when it is over.
        options: of `read_recording`; of pipes and sockets height, width, crop_width, flip and bit_order.

    Raises:
        InputError: a stream that cannot be opened or read, or options that do not apply.
    """
    with ExitStack() as stack:
        if is_flow(where):
            if loop:
                raise InputError(f"{where} cannot begin again; a recording can")
            yield _flowing(where, options, stack)
        else:
            yield _stored(Path(where), loop, options, stack)


def turned(packed: Packed, taken: FrameLayout) -> Packed:
    """Frames as they lie in a file -> as this package packs them: columns kept, rows from the top, bits little-endian.

    Args:
        packed: (T, ceil(height width / 8)).
        taken: the layout of the file.

    Returns:
        (T, ceil(height columns / 8)), columns being crop_width where it is given.
    """
    columns = _columns(taken)
    if taken.width % 8 or columns % 8:
        spikes = unpack_frames(packed, taken.shape, bit_order=taken.bit_order)[:, :, :columns]
        return pack_checked(np.ascontiguousarray(spikes[:, ::-1] if taken.flip else spikes))
    if taken.bit_order == "big":
        packed = _REVERSED[packed]
    rows = packed.reshape(len(packed), taken.height, taken.width // 8)[:, :, : columns // 8]
    return (rows[:, ::-1] if taken.flip else rows).reshape(len(packed), taken.height * columns // 8)


def is_flow(where: str) -> bool:
    """Whether it is a pipe or a socket, and no file."""
    if where == STANDARD_INPUT or where.startswith((TCP, UNIX)):
        return True
    try:
        kind = os.stat(where).st_mode
    except (OSError, ValueError):  # no such file, or a zero in its name: an error where it is opened
        return False
    return stat.S_ISFIFO(kind) or stat.S_ISSOCK(kind)


def _whole_frames(receive: Receive, rows: Packed, taken: FrameLayout) -> tuple[int, int]:
    """Fill rows, from the first on, with frames that have come, one at least; (frames, bytes of a frame that was cut by
    the end of the stream)."""
    size = packed_bytes(taken.shape)
    lying = rows if _lies_as_packed(taken) else np.empty((len(rows), size), np.uint8)
    room = lying.reshape(-1).data
    got = receive(room)
    while got % size and (more := receive(room[got : got + size - got % size])):
        got += more
    frames, rest = divmod(got, size)
    if lying is not rows:
        rows[:frames] = turned(lying[:frames], taken)
    return frames, rest


def _lies_as_packed(taken: FrameLayout) -> bool:
    return not taken.flip and taken.bit_order == "little" and _columns(taken) == taken.width


def _columns(taken: FrameLayout) -> int:
    return taken.width if taken.crop_width is None else taken.crop_width


def _stored(path: Path, loop: bool, options: dict[str, Any], stack: ExitStack) -> StoredFrames:
    ending = path.suffix.lower()
    if ending == ".dat":
        check_options(options, (*FLOWING, "layout"), f"{ending} files")
        how = read_dat(path, count=1, **options)[1]
        if how["layout"] == "bits":
            return _dat_file(path, loop, how, stack)
    elif ending in HDF5 and is_recording(path):
        check_options(options, (), f"{ending} files of this package")
        return _own_recording(path, loop, stack)
    recording = read_recording(path, **options)
    packed = pack_checked(recording.spikes)

    def fetch(first: int, rows: Packed) -> None:
        rows[:] = packed[first : first + len(rows)]

    shape = (recording.spikes.shape[1], recording.spikes.shape[2])
    return StoredFrames(path.name, shape, recording.frame_rate_hz or FRAME_RATE_HZ, len(packed), fetch, loop)


def _dat_file(path: Path, loop: bool, how: dict[str, Any], stack: ExitStack) -> StoredFrames:
    taken = FrameLayout(
        height=how["height"],
        width=how["width"],
        flip=how["flip"],
        bit_order=how["bit_order"],
        crop_width=how.get("crop_width"),
        layout="bits",
        frame_rate_hz=how.get("frame_rate_hz"),
        source=how["geometry_from"],
    )
    file = stack.enter_context(path.open("rb", buffering=0))
    size = packed_bytes(taken.shape)

    def fetch(first: int, rows: Packed) -> None:
        file.seek(first * size)
        done = 0
        while done < len(rows):
            frames, _ = _whole_frames(lambda room: file.readinto(room) or 0, rows[done:], taken)
            if not frames:
                raise InputError(f"{path} became shorter while it was read")
            done += frames

    shape, frames = (taken.height, _columns(taken)), path.stat().st_size // size
    return StoredFrames(path.name, shape, taken.frame_rate_hz or FRAME_RATE_HZ, frames, fetch, loop)


def _own_recording(path: Path, loop: bool, stack: ExitStack) -> StoredFrames:
    recording = stack.enter_context(open_recording(path))
    frames = recording.frames("spikes")
    if not frames:
        raise InputError(f"{path} holds no frame")

    def fetch(first: int, rows: Packed) -> None:
        rows[:] = recording.read("spikes", slice(first, first + len(rows)))

    rate = recording.attributes.get("frame_rate_hz") or FRAME_RATE_HZ
    return StoredFrames(path.name, recording.shape, rate, frames, fetch, loop)


def _flowing(where: str, options: dict[str, Any], stack: ExitStack) -> Flowing:
    title = "standard input" if where == STANDARD_INPUT else where
    check_options(options, FLOWING, "pipes and sockets")
    taken = geometry(Path(where), options, USUAL)
    if where == STANDARD_INPUT:
        if os.isatty(0):
            raise InputError("standard input is a terminal; pipe packed frames into it, e.g. with < recording.dat")
        return Flowing(title, taken, _of_pipe(0))
    try:
        if where.startswith((TCP, UNIX)) or stat.S_ISSOCK(os.stat(where).st_mode):
            return Flowing(title, taken, stack.enter_context(_connected(where)).recv_into)
        pipe = stack.enter_context(io.FileIO(where))
        return Flowing(title, taken, _of_pipe(pipe.fileno()))
    except OSError as error:
        raise InputError(f"cannot connect to {where}: {error.strerror or error}") from error


def _connected(where: str) -> socket.socket:
    """A socket that is connected to a server; raises OSError where there is none, InputError for no address."""
    if where.startswith(TCP):
        try:
            address = urlsplit(where)
            host, port = address.hostname, address.port
        except ValueError:
            host = port = None
        if not host or not port or where != f"{TCP}{address.netloc}":
            raise InputError(f"{shown(where)} is no address of a server; give tcp://HOST:PORT")
        connection = socket.create_connection((host, port), CONNECT_S)
    else:
        if not hasattr(socket, "AF_UNIX"):
            raise InputError(f"{where}: this system has no sockets with a path; use tcp://HOST:PORT")
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            connection.settimeout(CONNECT_S)
            connection.connect(where.removeprefix(UNIX))
        except BaseException:
            connection.close()
            raise
    connection.settimeout(None)
    return connection


def _of_pipe(number: int) -> Receive:
    """From a file descriptor."""
    if fcntl is not None:
        with suppress(OSError):  # no pipe, or no right to so large a one
            fcntl.fcntl(number, SET_PIPE_SIZE, PIPE_BYTES)
    return lambda room: os.readv(number, [room])


__getattr__ = old_names(__name__, {"Stored": "StoredFrames"})
