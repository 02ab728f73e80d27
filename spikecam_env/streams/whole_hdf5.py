"""An HDF5 file that appears whole, on a disk that may fill up.

HDF5 does not bear a write that fails: it drops errors of closing datasets, and crashes when the process ends.  So it
writes to a `_Disk` that takes everything: after the first failure it keeps later writes in memory until the file is
closed.  These are no more than the caches of HDF5.  `WholeHDF5` raises the failure.
"""

from __future__ import annotations

import io
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py

from spikecam_env.whole import said_of, whole_file


class WholeHDF5:
    """A new HDF5 file, open for writing; it replaces `path` when the `with` block ends without an exception.

    The same calls write the same bytes.

    Args:
        path: of the file.
        options: of `h5py.File`.

    Raises:
        InputError: nothing can be written at `path`, or writing fails.

    Example:
        >>> with WholeHDF5("maps.h5") as file:
        ...     file["gain"] = [1.0, 0.9]
    """

    def __init__(self, path: str | Path, **options: Any) -> None:
        self._path, self._options = path, options
        self._ends = ExitStack()
        self._disk: _Disk | None = None

    def __enter__(self) -> h5py.File:
        with self._ends:
            beside = self._ends.enter_context(whole_file(self._path))
            self._ends.callback(self.check)
            self._disk = self._ends.enter_context(_Disk(beside))
            file = self._ends.enter_context(h5py.File(self._disk, "w", **self._options))
            self._ends = self._ends.pop_all()
        return file

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ends.__exit__(kind, error, trace)

    def check(self) -> None:
        """Raise the first failure so far."""
        failure = self._disk and self._disk.failure
        if failure:
            with said_of(self._path):
                raise failure


class _Disk(io.RawIOBase):
    """A file of which no call fails; from the first `failure` on writes stay in memory."""

    def __init__(self, path: Path) -> None:
        self._file = io.FileIO(path, "w+")
        self._at = 0
        self._size = 0
        self._kept: list[tuple[int, bytes]] = []
        self.failure: BaseException | None = None

    def close(self) -> None:
        """A failure of closing, as on network file systems, counts as one of writing."""
        try:
            self._file.close()
        except OSError as error:
            self.failure = self.failure or error
        super().close()

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        self._at = offset + (0, self._at, self._size)[whence]
        return self._at

    def write(self, data: Any, /) -> int:
        """All of it, always."""
        block = bytes(data)
        if self.failure is None:
            try:
                self._file.seek(self._at)
                written = 0
                while written < len(block):
                    written += self._file.write(block[written:]) or 0
            except BaseException as error:  # an interrupt too: HDF5 would take it for a failure
                self.failure = error
        if self.failure is not None:
            self._kept.append((self._at, block))
        self._at += len(block)
        self._size = max(self._size, self._at)
        return len(block)

    def readinto(self, buffer: Any, /) -> int:
        """Read the bytes written last, kept in memory or not; zeros where there are none."""
        view = memoryview(buffer).cast("B")
        count = max(0, min(len(view), self._size - self._at))
        self._file.seek(self._at)
        block = bytearray((self._file.read(count) or b"").ljust(count, b"\0"))
        for start, kept in self._kept:
            first, last = max(start, self._at), min(start + len(kept), self._at + count)
            if first < last:
                block[first - self._at : last - self._at] = kept[first - start : last - start]
        view[:count] = block
        self._at += count
        return count

    def truncate(self, size: int | None = None, /) -> int:
        self._size = self._at if size is None else size
        if self.failure is None:
            try:
                self._file.truncate(self._size)
            except BaseException as error:
                self.failure = error
        return self._size

    def flush(self) -> None:
        """Nothing is held back."""
