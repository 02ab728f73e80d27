"""The calibration map: from SNEE's results, from files and pairs; other objects are refused."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from denoiser.online import OnlineDnSS
from denoiser.passes.pixel_map import PixelMap
from spikecam_env.calibration import calibrate, save_calibration, write_flats
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensor

SHAPE = (16, 24)
SEED = 3


@pytest.fixture(scope="module")
def calibration(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flats")
    model = SensorModel.preset("scsim")
    return calibrate(write_flats(folder, model, levels=(0.0, 0.1, 0.4), frames=4000, shape=SHAPE, seed=SEED))


def test_a_calibration_says_each_pixel_s_gain_and_dark_rate(calibration):
    """Gains within a half percent of the unit's own, over their mean; dark rates within 3e-4 spikes a frame."""
    unit = SpikeSensor("scsim", SHAPE, SEED).unit
    found = PixelMap.of(calibration)
    gain, dark = unit.gain.reshape(SHAPE), unit.dark.reshape(SHAPE)
    print(f"gain {np.std(found.gain / (gain / gain.mean()) - 1):.5f}, dark {np.std(found.dark - dark):.2e}")
    assert np.std(found.gain / (gain / gain.mean()) - 1) < 5e-3 < np.std(gain)
    assert np.std(found.dark - dark) < 3e-4 < np.std(dark)
    assert abs(found.gain.mean() - 1) < 1e-6


def test_files_hold_the_same_map(calibration, tmp_path):
    save_calibration(calibration, tmp_path)
    for path in (tmp_path, tmp_path / "maps.h5", str(tmp_path / "maps.h5")):
        assert PixelMap.of(path).digest == PixelMap.of(calibration).digest
    OnlineDnSS.pretrained("best", unit=tmp_path).push(np.zeros((1, *SHAPE), np.uint8))


def maps_file(path, gain, dark):
    """A maps.h5 of `spikecam calibrate`, with these values."""
    with h5py.File(path, "w") as file:
        file.attrs["format"] = "spikecam-maps/1"
        file["setting_0/gain"], file["setting_0/dark"] = gain, dark
    return path


ODD_GAINS = [(gain, 0.001) for gain in (np.nan, -0.1, 0.0, np.inf, 1e300, 0.9)]
ODD_DARKS = [(0.002, dark) for dark in (np.nan, np.inf, 7.0, -3.0)]


@pytest.mark.parametrize("wrong", [*ODD_GAINS, *ODD_DARKS])
def test_a_pixel_that_is_not_known_or_odd_gets_the_median(wrong, tmp_path):
    gain, dark = np.full((2, 3), 0.002), np.full((2, 3), 0.001)
    gain[0, 0], dark[0, 0] = wrong
    found = PixelMap.of(maps_file(tmp_path / "maps.h5", gain, dark))
    assert np.allclose(found.gain, 1.0) and np.allclose(found.dark, 0.001)


WHOLE = np.full((2, 3), 0.002)
REFUSED = {
    "NaN": (WHOLE * np.nan, WHOLE),
    "negative": (-WHOLE, WHOLE),
    "infinite": (WHOLE * np.inf, WHOLE),
    "zero": (0 * WHOLE, WHOLE),
    "far too large": (WHOLE * 1e40, WHOLE),
    "dark NaN": (WHOLE, WHOLE * np.nan),
    "dark negative": (WHOLE, -100 * WHOLE),
    "dark above 1": (WHOLE, 1000 * WHOLE),
    "most of it": (np.where(np.arange(3) < 2, np.nan, WHOLE), WHOLE),
    "another shape": (WHOLE, WHOLE[:1]),
    "one row": (WHOLE[0], WHOLE[0]),
    "whole numbers": (WHOLE.astype(int) + 1, WHOLE),
    "complex": (WHOLE.astype(complex), WHOLE),
    "nothing": (np.zeros((0, 3)), np.zeros((0, 3))),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_of_values_that_no_calibration_gives_is_refused(name, tmp_path):
    path = maps_file(tmp_path / "maps.h5", *REFUSED[name])
    with pytest.raises(InputError, match=r"maps\.h5: ") as caught:
        OnlineDnSS.pretrained("best", unit=path)
    print(caught.value)
    assert "\n" not in str(caught.value)


GAIN, DARK = np.ones((2, 3)), np.full((2, 3), 0.01)
PAIRS = {
    "NaN": (np.where(np.arange(3) == 1, np.nan, GAIN), DARK, r"gain nan at pixel \(0, 1\); it must be a number"),
    "infinite": (GAIN * np.inf, DARK, "gain inf at pixel"),
    "negative": (-GAIN, DARK, "gain -1 at pixel"),
    "zero": (0 * GAIN, DARK, "gain 0 at pixel"),
    "in another unit": (50 * GAIN, DARK, "mean 50; they are relative to the mean pixel"),
    "dark above 1": (GAIN, 2 + DARK, "dark 2.01 at pixel"),
    "dark negative": (GAIN, -DARK, "dark -0.01 at pixel"),
    "true": (GAIN > 0, DARK, "holds bool"),
    "complex": (GAIN * 1j, DARK, "holds complex128"),
    "objects": (np.full((2, 3), None), DARK, "holds object"),
    "text": (GAIN.astype(str), DARK, "holds <U"),
}  # fmt: skip


@pytest.mark.parametrize("name", PAIRS)
def test_a_pair_of_maps_out_of_range_is_refused_with_the_pixel(name):
    gain, dark, said = PAIRS[name]
    with pytest.raises(InputError, match=said):
        OnlineDnSS.pretrained("best", unit=(gain, dark))


@pytest.mark.parametrize(
    "unit",
    [
        *(3, None, (GAIN,), GAIN, (GAIN, GAIN, GAIN), ("gain", "dark"), (GAIN, DARK[:1]), (GAIN[0], DARK[0])),
        *((GAIN[:0], DARK[:0]), ([[1.0], [1.0, 2.0]], DARK), (1e300 * GAIN, DARK), (GAIN, np.nan * DARK)),
    ],
)
def test_other_objects_are_refused_in_one_line(unit):
    with pytest.raises(InputError, match="map") as caught:
        PixelMap.of(unit)
    assert "\n" not in str(caught.value)


def test_files_that_hold_no_map_are_refused_in_one_line(tmp_path):
    (tmp_path / "text.h5").write_text("no map")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.attrs["format"] = "spikecam-recording/1"
    with h5py.File(tmp_path / "empty.h5", "w") as file:
        file.attrs["format"] = "spikecam-maps/1"
    with h5py.File(tmp_path / "words.h5", "w") as file:
        file.attrs["format"] = "spikecam-maps/1"
        file["setting_0/gain"], file["setting_0/dark"] = np.ones((2, 2), "i4"), np.ones((2, 2), "i4")
    for name in ("text.h5", "other.h5", "empty.h5", "words.h5", "missing.h5"):
        with pytest.raises(InputError) as caught:
            PixelMap.of(tmp_path / name)
        assert "\n" not in str(caught.value) and name in str(caught.value)


def test_a_pair_of_maps_that_is_masked_in_part_is_refused():
    gain = np.ma.masked_array(np.ones(SHAPE), mask=np.eye(*SHAPE, dtype=bool))
    with pytest.raises(InputError, match="masked in part; fill it first"):
        PixelMap.of((gain, np.zeros(SHAPE)))
