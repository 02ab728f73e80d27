"""Windows of crops are those of the whole streams, and the whole streams are not read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spikecam_env.datasets import read_window
from spikecam_env.errors import InputError
from spikecam_env.streams import SpikeWriter, isi_plane


def streams(frames: int, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Two streams of random spikes at rates from never to often."""
    rng = np.random.default_rng(0)
    rate = rng.choice([0.0, 0.002, 0.02, 0.3], shape)
    noisy, clean = (rng.random((2, frames, *shape)) < rate).astype(np.uint8)
    return noisy, clean


def written(path: Path, noisy: np.ndarray, clean: np.ndarray | None) -> Path:
    with SpikeWriter(path, noisy.shape[1:], 40_000.0) as writer:
        writer.append(noisy, clean)
    return path


@pytest.mark.parametrize("shape", [(33, 29), (64, 48), (5, 3)])
def test_windows_equal_those_cut_from_the_whole_streams(tmp_path: Path, shape: tuple[int, int]) -> None:
    noisy, clean = streams(700, shape)
    path = written(tmp_path / "a.h5", noisy, clean)
    rng = np.random.default_rng(1)
    for reach in (0, 20):
        for frame in (reach, 699 - reach, *rng.integers(reach, 700 - reach, 20).tolist()):
            top, left = (int(rng.integers(n)) for n in shape)
            rows = slice(top, int(rng.integers(top + 1, shape[0] + 1)))
            columns = slice(left, int(rng.integers(left + 1, shape[1] + 1)))
            window = read_window(path, frame, reach=reach, rows=rows, columns=columns)
            expected = noisy[frame - reach : frame + reach + 1, rows, columns]
            np.testing.assert_array_equal(window.spikes, expected)
            plane = isi_plane(clean, frame, normalised=True)[rows, columns]
            np.testing.assert_array_equal(window.clean_isi, plane)


def test_a_crop_reads_little_of_the_file(tmp_path: Path) -> None:
    """Bound: chunks (32 frames x 16 rows) that 41 noisy and 96 + 32 clean frames x 32 rows can touch, twice over."""
    shape, frames = (256, 256), 2048
    phase = np.random.default_rng(0).integers(10, size=shape)
    ten = np.stack([phase == n for n in range(10)]).astype(np.uint8)
    path = written(tmp_path / "a.h5", ten[np.arange(frames) % 10], ten[np.arange(frames) % 10])
    before = bytes_read()
    read_window(path, 1000, rows=slice(40, 72), columns=slice(0, 32))
    read = bytes_read() - before
    bound = 2 * (3 + 4) * 3 * 32 * 16 * shape[1] // 8
    print(f"{read} bytes read of {path.stat().st_size}, bound {bound}")
    assert read < bound < path.stat().st_size / 20


def bytes_read() -> int:
    return int(Path("/proc/self/io").read_text().split()[1])


def test_what_is_not_in_the_file_is_refused(tmp_path: Path) -> None:
    noisy, clean = streams(100, (8, 8))
    path = written(tmp_path / "a.h5", noisy, clean)
    with pytest.raises(InputError, match="frames -1 to 40 asked"):
        read_window(path, 19)
    with pytest.raises(InputError, match="rows 4 to 9 asked"):
        read_window(path, 50, rows=slice(4, 9))
    with pytest.raises(InputError, match="no clean twin"):
        read_window(written(tmp_path / "b.h5", noisy, None), 50)
