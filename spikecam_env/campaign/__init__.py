"""Campaigns: a folder of recordings of one camera with the light that it saw: designed, simulated, imported, read."""

from spikecam_env.campaign.reading import Campaign, CampaignRecording, read_campaign
from spikecam_env.campaign.takes import PlannedRecording, at_v_d, record_takes
from spikecam_env.renamed import old_names

__all__ = ["Campaign", "CampaignRecording", "PlannedRecording", "at_v_d", "read_campaign", "record_takes"]


__getattr__ = old_names(__name__, {"Take": "PlannedRecording"})
