"""Pictures from spikes: classical and learned methods by name."""

from denoiser.reconstruct.pictures import RECONSTRUCTORS, reconstruct, reconstruct_many

__all__ = ["RECONSTRUCTORS", "reconstruct", "reconstruct_many"]
