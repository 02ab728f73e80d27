"""Campaigns and their diagnosis: where a model and measurements disagree, and which effect is missing."""

# `diagnose` and `ladder` are functions of the modules of these names.  They are imported after their modules, so that
# the package's attribute is the function whichever is imported first.
from spikecam_env.campaign import Campaign, CampaignRecording, read_campaign
from spikecam_env.campaign.design import second_voltage, standard_design, write_campaign
from spikecam_env.campaign.labels import Label, label_from_text, labels_from_table
from spikecam_env.campaign.real_files import import_campaign
from spikecam_env.campaign.recording_kinds import KINDS, Bars, Dark, Disk, Flat, MaskedRows, Planned, Step
from spikecam_env.gap.diagnose import diagnose
from spikecam_env.gap.ladder import ladder
from spikecam_env.gap.report.page import write_report
from spikecam_env.gap.result import Diagnosis
from spikecam_env.gap.settings import DiagnosisSettings

__all__ = [
    "KINDS",
    "Bars",
    "Campaign",
    "CampaignRecording",
    "Dark",
    "Diagnosis",
    "DiagnosisSettings",
    "Disk",
    "Flat",
    "Label",
    "MaskedRows",
    "Planned",
    "Step",
    "diagnose",
    "import_campaign",
    "label_from_text",
    "labels_from_table",
    "ladder",
    "read_campaign",
    "second_voltage",
    "standard_design",
    "write_campaign",
    "write_report",
]
