"""A calibration as files: model.toml, maps.h5 and report.html, all of them or none."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from spikecam_env.calibration.findings import findings
from spikecam_env.calibration.population import FLAGS, fitted_model
from spikecam_env.calibration.snee import Calibration
from spikecam_env.sensor import SensorModel
from spikecam_env.streams.whole_hdf5 import WholeHDF5
from spikecam_env.version import __version__
from spikecam_env.whole import whole_folder, write_text_whole

MAPS_FORMAT = "spikecam-maps/1"


def save_calibration(calibration: Calibration, folder: str | Path) -> list[Path]:
    """Write the three files, all of them or none.

    Args:
        calibration: as `calibrate` returns it.
        folder: for the files, made if needed; those of the same names in it are replaced.

    Returns:
        Their paths.

    Raises:
        WriteError: where they cannot be written.

    Example:
        >>> from spikecam_env.sensor import SensorModel
        >>> levels = (0.0, 0.2, 0.5)
        >>> campaign = write_flats("camera", SensorModel.preset("scsim"), levels=levels, frames=400, shape=(8, 8))
        >>> [path.name for path in save_calibration(calibrate(campaign), "calibrated")]
        ['model.toml', 'maps.h5', 'report.html']
    """
    from spikecam_env.calibration.report import report  # imports matplotlib, for drawing alone

    names = ("model.toml", "maps.h5", "report.html")
    with whole_folder(folder, replace=True) as beside:
        model, maps, page = (beside / name for name in names)
        calibrated_model(calibration).to_toml(model)
        save_maps(calibration, maps)
        write_text_whole(page, report(calibration, findings(calibration)))
    return [Path(folder) / name for name in names]


def calibrated_model(calibration: Calibration) -> SensorModel:
    """A model of cameras like this one: its spreads, noise and odd pixels, on the prior circuit.

    Its radiance is that of the labels times `radiance_scale` of the maps (mean alpha/phi), so that 1.0 keeps meaning
    one spike a frame of the nominal pixel.

    Example:
        >>> from spikecam_env.sensor import SensorModel
        >>> levels = (0.0, 0.2, 0.5)
        >>> campaign = write_flats("camera", SensorModel.preset("scsim"), levels=levels, frames=400, shape=(8, 8))
        >>> calibrated_model(calibrate(campaign)).name
        'calibrated from camera'
    """
    c = calibration
    electrons, reset_noise_mV = c.circuit.threshold_electrons, c.circuit.thermal_noise_mV
    if c.charge is not None:
        electrons, reset_noise_mV = c.charge.electrons, c.charge.reset_noise_mV
    return fitted_model(
        f"calibrated from {c.campaign}",
        c.circuit,
        c.frame_rate_hz,
        gain=c.main.gain,
        gain_sd=c.main.gain_sd,
        dark=c.main.dark,
        flags=c.flags,
        electrons=electrons,
        reset_noise_mV=reset_noise_mV,
        swing_V=c.swing_V,
        swing_sd_V=c.swing_sd_V,
    )


def save_maps(calibration: Calibration, path: str | Path) -> None:
    """Per-pixel maps (H, W) as HDF5: flags, swing_V, and a group a setting with gain, dark, their errors and fit."""
    c = calibration
    with WholeHDF5(path) as file:
        file.attrs.update(
            format=MAPS_FORMAT,
            version=__version__,
            campaign=c.campaign,
            frame_rate_hz=c.frame_rate_hz,
            radiance_scale=float(c.main.gain[c.flags == 0].mean()),
        )
        flags = file.create_dataset("flags", data=c.flags, compression="gzip")
        flags.attrs.update({f"bit_{name}": bit for name, bit in FLAGS.items()})
        for i, setting in enumerate(c.settings):
            group = file.create_group(f"setting_{i}")
            group.attrs["v_d"] = np.nan if setting.v_d is None else setting.v_d
            for name, unit in _MAPS.items():
                group.create_dataset(name, data=getattr(setting, name), compression="gzip").attrs["unit"] = unit
        if c.swing_V is not None:
            for name in ("swing_V", "swing_sd_V"):
                file.create_dataset(name, data=getattr(c, name), compression="gzip").attrs["unit"] = "V"


_MAPS = {
    "gain": "thresholds/frame at radiance 1 (alpha/phi)",
    "gain_sd": "thresholds/frame at radiance 1",
    "dark": "thresholds/frame (I_dark/phi)",
    "dark_sd": "thresholds/frame",
    "covariance": "(thresholds/frame)^2, of gain and dark",
    "chi2": "reduced",
    "used": "recordings",
}
