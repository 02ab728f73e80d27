"""Datasets: many scenes through the camera into a folder of recordings, on one machine or on many."""

from spikecam_env.datasets.build import Built, build
from spikecam_env.datasets.films import FilmFolder
from spikecam_env.datasets.plan import PHM, Plan, PlannedScene, film_cuts, phm_n, spift_n
from spikecam_env.datasets.twins import TwinRecording, twin_recordings
from spikecam_env.datasets.verify import verify
from spikecam_env.datasets.window import SpikeWindow, read_window
from spikecam_env.renamed import old_names

__all__ = [
    "PHM",
    "Built",
    "FilmFolder",
    "Plan",
    "PlannedScene",
    "SpikeWindow",
    "TwinRecording",
    "build",
    "film_cuts",
    "phm_n",
    "read_window",
    "spift_n",
    "twin_recordings",
    "verify",
]


__getattr__ = old_names(__name__, {"Window": "SpikeWindow"})
