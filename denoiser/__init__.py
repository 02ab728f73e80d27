"""DnSS, the online denoiser of spike streams: modes `paper` (the published network) and `best`."""

from denoiser.online import OnlineDnSS, denoise
from denoiser.wrapper import DenoiseObservation

DISTRIBUTION = "spikecam-env"
"""By which `spikecam_env.siblings` knows this package from another of its name."""

__all__ = ["DenoiseObservation", "OnlineDnSS", "denoise"]
