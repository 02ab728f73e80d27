"""Calibration: a camera's noise from grey-level recordings (SNEE), and the preset fitted to real ones."""

from spikecam_env.calibration.campaign import Campaign, CampaignRecording, read_campaign
from spikecam_env.calibration.flats import at_v_d, write_flats
from spikecam_env.calibration.snee import Calibration, calibrate

__all__ = ["Calibration", "Campaign", "CampaignRecording", "at_v_d", "calibrate", "read_campaign", "write_flats"]
