"""Where model and measurement disagree: campaigns, and what is made of them."""

from spikecam_env.calibration import Campaign, CampaignRecording, read_campaign
from spikecam_env.gap.campaign import second_voltage, standard_design, write_campaign
from spikecam_env.gap.imports import import_campaign
from spikecam_env.gap.labels import Label, label_from_text, labels_from_table
from spikecam_env.gap.recordings import KINDS, Bars, Dark, Disk, Flat, MaskedRows, Planned, Step

__all__ = [
    "KINDS",
    "Bars",
    "Campaign",
    "CampaignRecording",
    "Dark",
    "Disk",
    "Flat",
    "Label",
    "MaskedRows",
    "Planned",
    "Step",
    "import_campaign",
    "label_from_text",
    "labels_from_table",
    "read_campaign",
    "second_voltage",
    "standard_design",
    "write_campaign",
]
