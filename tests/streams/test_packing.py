from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spikecam_env.errors import InputError
from spikecam_env.streams import pack_frames, unpack_frames


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 5), st.integers(1, 9), st.integers(1, 19), st.sampled_from(["little", "big"]))
def test_unpack_undoes_pack(frames: int, height: int, width: int, order: str) -> None:
    spikes = np.random.default_rng(frames).integers(0, 2, (frames, height, width), dtype=np.uint8)
    packed = pack_frames(spikes, bit_order=order)
    assert packed.shape == (frames, -(-height * width // 8))
    np.testing.assert_array_equal(unpack_frames(packed, (height, width), bit_order=order), spikes)


def test_first_pixel_is_the_least_significant_bit() -> None:
    spikes = np.zeros((1, 2, 8), np.int8)
    spikes[0, 0, 0] = spikes[0, 1, 7] = 1
    np.testing.assert_array_equal(pack_frames(spikes), [[0b00000001, 0b10000000]])
    np.testing.assert_array_equal(pack_frames(spikes, bit_order="big"), [[0b10000000, 0b00000001]])


def test_wrong_width_and_order_are_refused() -> None:
    with pytest.raises(InputError, match=r"\(frames, 4\)"):
        unpack_frames(np.zeros((3, 5), np.uint8), (4, 8))
    with pytest.raises(InputError, match="bit_order"):
        pack_frames(np.zeros((1, 1, 8), np.uint8), bit_order="middle")  # type: ignore[arg-type]
