"""Calibration: a camera's noise from grey-level recordings (SNEE), and the preset fitted to real ones."""

from spikecam_env.calibration.campaign import Campaign, CampaignRecording, read_campaign
from spikecam_env.calibration.findings import Finding, findings
from spikecam_env.calibration.flats import write_flats
from spikecam_env.calibration.results import calibrated_model, save_calibration
from spikecam_env.calibration.snee import Calibration, calibrate
from spikecam_env.calibration.takes import Take, at_v_d, record_takes

__all__ = [
    "Calibration",
    "Campaign",
    "CampaignRecording",
    "Finding",
    "Take",
    "at_v_d",
    "calibrate",
    "calibrated_model",
    "findings",
    "read_campaign",
    "record_takes",
    "save_calibration",
    "write_flats",
]
