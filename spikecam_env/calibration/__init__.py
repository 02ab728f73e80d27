"""Calibration: a camera's noise from grey-level recordings (SNEE)."""

from spikecam_env.calibration.findings import Finding, findings
from spikecam_env.calibration.results import calibrated_model, save_calibration
from spikecam_env.calibration.snee import Calibration, calibrate
from spikecam_env.campaign.flats import write_flats

__all__ = [
    "Calibration",
    "Finding",
    "calibrate",
    "calibrated_model",
    "findings",
    "save_calibration",
    "write_flats",
]
