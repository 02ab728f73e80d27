"""Campaigns: a folder of recordings of one camera with what it was shown; read, written, and recorded by simulation."""

from spikecam_env.campaign.reading import Campaign, CampaignRecording, read_campaign
from spikecam_env.campaign.takes import Take, at_v_d, record_takes

__all__ = ["Campaign", "CampaignRecording", "Take", "at_v_d", "read_campaign", "record_takes"]
