"""Spikes are 0 and 1: every function that takes a stream sees its values."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spikecam_env.errors import InputError
from spikecam_env.streams import (
    SpikeWriter,
    isi_plane,
    isi_planes,
    middleTFI,
    middleTFP,
    pack_frames,
    save_npz,
    save_vidar_dat,
    tfp_film,
)


def write(path: Path, spikes: Any) -> None:
    with SpikeWriter(path, (4, 8), None) as writer:
        writer.append(spikes)


def write_twin(path: Path, spikes: Any) -> None:
    with SpikeWriter(path, (4, 8), None) as writer:
        writer.append(np.zeros((6, 4, 8), np.uint8), spikes)


TAKERS: dict[str, Callable[[Any, Path], Any]] = {
    "middleTFP": lambda spikes, folder: middleTFP(spikes),
    "middleTFI": lambda spikes, folder: middleTFI(spikes),
    "tfp_film": lambda spikes, folder: tfp_film(spikes),
    "isi_plane": lambda spikes, folder: isi_plane(spikes, 2),
    "isi_planes": lambda spikes, folder: isi_planes(spikes),
    "pack_frames": lambda spikes, folder: pack_frames(spikes),
    "save_npz": lambda spikes, folder: save_npz(folder / "a.npz", spikes),
    "save_vidar_dat": lambda spikes, folder: save_vidar_dat(folder / "a.dat", spikes),
    "SpikeWriter": lambda spikes, folder: write(folder / "a.h5", spikes),
    "SpikeWriter, clean": lambda spikes, folder: write_twin(folder / "a.h5", spikes),
}

ONE = np.zeros((6, 4, 8), np.uint8)
ONE[3, 1, 2] = 1
NOT_SPIKES: dict[str, tuple[Any, str]] = {
    "0 and 255": (ONE * 255, "value 255"),
    "one 2": (ONE * 2, "value 2"),
    "-1": (-ONE.view(np.int8), "value -1"),
    "masked": (np.ma.masked_array(ONE, ONE), "masked"),
    "complex": (ONE.astype(complex), "complex128"),
    "float": (ONE.astype(float), "float64"),
    "int64": (ONE.astype(int), "int64"),
    "text": (ONE.astype(str), "<U"),
    "objects": (ONE.astype(object), "object"),
    "one frame": (ONE[0], r"\(4, 8\)"),
    "a batch": (ONE[None], r"\(1, 6, 4, 8\)"),
}


@pytest.mark.parametrize("taker", TAKERS)
@pytest.mark.parametrize("name", NOT_SPIKES)
def test_spikes_that_are_not_0_and_1_are_refused(taker: str, name: str, tmp_path: Path) -> None:
    spikes, said = NOT_SPIKES[name]
    with pytest.raises(InputError, match=said):
        TAKERS[taker](spikes, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("taker", TAKERS)
@pytest.mark.parametrize("kind", [np.uint8, np.int8, np.bool_])
def test_spikes_of_8_bits_are_taken(taker: str, kind: type, tmp_path: Path) -> None:
    TAKERS[taker](ONE.astype(kind), tmp_path)


def test_a_picture_sees_the_values_of_its_window_only() -> None:
    """So that a film of a long stream, picture by picture, is no pass over all of it for each."""
    late = np.zeros((100, 4, 8), np.uint8)
    late[90] = 255
    assert not middleTFP(late, 20, 11).any()
    with pytest.raises(InputError, match="255"):
        middleTFP(late, 88, 11)
