"""DnSS, the online denoiser of spike streams: modes `paper` (the published network) and `best`."""

from denoiser.online import OnlineDnSS, denoise
from denoiser.wrapper import DenoiseObservation

__all__ = ["DenoiseObservation", "OnlineDnSS", "denoise"]
