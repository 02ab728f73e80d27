"""DnSS, the online denoiser of spike streams: modes `paper` (the published network) and `best`."""

from denoiser.online import OnlineDnSS, denoise
from denoiser.wrapper import DenoiseObservation
from spikecam_env.renamed import old_modules

old_modules(
    "denoiser",
    {
        "accumulate": "decoders.accumulate",
        "metrics": "evaluate.metrics",
        "mus": "decoders.mus",
        "niqe": "evaluate.niqe",
        "reconstruct.weights": "weights",
        "reconstruct.spk2imgnet": "networks.spk2imgnet",
        "run": "training.resumable_run",
        "train": "training.train",
    },
)

DISTRIBUTION = "spikecam-env"
"""By which `spikecam_env.siblings` knows this package from another of its name."""

__all__ = ["DenoiseObservation", "OnlineDnSS", "denoise"]
