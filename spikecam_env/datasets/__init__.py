"""Datasets: many scenes through the camera into a folder of recordings, on one machine or on many."""

from spikecam_env.datasets.build import Built, build
from spikecam_env.datasets.plan import PHM, Entry, Plan, phm_n, spift_n
from spikecam_env.datasets.verify import verify
from spikecam_env.datasets.window import Window, read_window

__all__ = ["PHM", "Built", "Entry", "Plan", "Window", "build", "phm_n", "read_window", "spift_n", "verify"]
