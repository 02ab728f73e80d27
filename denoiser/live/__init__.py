"""The denoiser of a stream that is watched: packed frames in, one picture of many frames out."""

from denoiser.live.online import LiveDnSS

__all__ = ["LiveDnSS"]
