from __future__ import annotations

import numpy as np
import pytest

from spikecam_env.errors import InputError
from spikecam_env.streams import isi_plane, isi_planes


def by_definition(spikes: np.ndarray, t: int, future: int | None) -> np.ndarray:
    count = len(spikes)
    plane = np.empty(spikes.shape[1:])
    for pixel in np.ndindex(*spikes.shape[1:]):
        train = np.flatnonzero(spikes[(slice(None), *pixel)])
        last = max((s for s in train if s <= t), default=-1)
        following = min((s for s in train if s > t), default=count)
        plane[pixel] = min(following, t + 1 + (count if future is None else future)) - last
    return plane


@pytest.mark.parametrize("future", [None, 0, 1, 7, 1000])
@pytest.mark.parametrize("rate", [0.0, 0.05, 0.5, 1.0])
def test_planes_equal_the_definition(rate: float, future: int | None) -> None:
    spikes = (np.random.default_rng(3).random((40, 5, 7)) < rate).astype(np.uint8)
    expected = np.stack([by_definition(spikes, t, future) for t in range(40)])
    planes = isi_planes(spikes, future=future)
    assert planes.dtype == np.float32
    np.testing.assert_array_equal(planes, expected)
    np.testing.assert_array_equal(isi_plane(spikes, 17, future=future), expected[17])
    np.testing.assert_array_equal(isi_planes(spikes, start=11, stop=29, future=future), expected[11:29])


def test_more_pixels_than_a_strip_changes_nothing() -> None:
    spikes = (np.random.default_rng(4).random((12, 70, 71)) < 0.2).astype(np.uint8)
    together = isi_planes(spikes, future=3)
    np.testing.assert_array_equal(together[:, 40:], isi_planes(spikes[:, 40:], future=3))


def test_plane_depends_on_frames_up_to_t_plus_future_only() -> None:
    spikes = (np.random.default_rng(5).random((60, 8, 8)) < 0.1).astype(np.uint8)
    for t in (0, 20, 40):
        np.testing.assert_array_equal(isi_plane(spikes, t, future=15), isi_plane(spikes[: t + 16], t, future=15))


def test_normalised_is_the_inverse_and_at_most_one() -> None:
    spikes = np.ones((5, 2, 2), np.uint8)
    np.testing.assert_array_equal(isi_planes(spikes, normalised=True), 1.0)
    spikes[1:4] = 0
    assert isi_plane(spikes, 2, normalised=True)[0, 0] == np.float32(0.25)


def test_regular_spikes_have_their_period() -> None:
    spikes = np.zeros((50, 1, 1), np.uint8)
    spikes[3::6] = 1
    np.testing.assert_array_equal(isi_planes(spikes)[3:45], 6.0)


def test_bad_requests_say_what_is_allowed() -> None:
    spikes = np.zeros((5, 2, 2), np.uint8)
    with pytest.raises(InputError, match="5 frames"):
        isi_plane(spikes, 5)
    with pytest.raises(InputError, match="future is -1"):
        isi_planes(spikes, future=-1)
    with pytest.raises(InputError, match="float64"):
        isi_planes(np.zeros((5, 2, 2)))


def test_frames_beyond_two_to_the_24_are_counted_exactly() -> None:
    """float32 holds whole numbers to 2^24 only; a stream of one pixel is that long in 17 MB."""
    spikes = np.zeros((2**24 + 64, 1, 1), np.uint8)
    at = 2**24 + np.array([3, 10, 17, 24])
    spikes[at] = 1
    planes = isi_planes(spikes, start=int(at[0]), stop=int(at[-1]))[:, 0, 0]
    np.testing.assert_array_equal(planes, 7.0)
    np.testing.assert_array_equal(
        isi_planes(spikes, start=int(at[0]), stop=int(at[0]) + 3, future=2)[:, 0, 0], [3, 4, 5]
    )
