"""The calibration map: from SNEE's results, from files and pairs; what is no map is refused."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from denoiser.online import OnlineDnSS
from denoiser.pixel_map import PixelMap
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


def test_pixels_that_are_not_known_get_the_median():
    gain, dark = np.full((2, 3), 0.002), np.full((2, 3), 0.001)
    gain[0, 0], dark[1, 2] = np.nan, np.inf
    found = PixelMap._measured(gain, dark)
    assert np.allclose(found.gain, 1.0) and np.allclose(found.dark, 0.001)
    with pytest.raises(InputError, match="no pixel"):
        PixelMap._measured(np.full((2, 2), np.nan), np.zeros((2, 2)))


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
