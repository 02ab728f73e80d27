"""The denoiser of a stream that is watched: every frame is taken in, the network runs only for the pictures shown."""

from denoiser.live.online import LiveDnSS

__all__ = ["LiveDnSS"]
