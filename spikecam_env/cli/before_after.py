"""Pictures of a stream before and after the denoiser, and their captions, for `demo` and `denoise`.

A picture is a mean over a window of frames (TFP), or of one instant (TFI of spikes, the denoiser's rate plane).  Every
caption says which: motion smears the first, not the second.
"""

from __future__ import annotations

from denoiser.evaluate.metrics import psnr_db
from spikecam_env.cli.screen.screen import PicturePanel
from spikecam_env.streams import middleTFP
from spikecam_env.types import Pictures, Spikes

WINDOW = 41
"""Frames of a mean (TFP): the width of the denoiser's own window in the paper."""
WHITE = 99.8
"""Percentile of light that is shown white: the few pixels above it are highlights."""


def mean_panel(title: str, spikes: Spikes, frame: int, window: int, light: Pictures | None = None) -> PicturePanel:
    """A panel of the mean over the window about a frame.

    Args:
        title: Its first line.
        spikes: (T, H, W).
        frame: The middle of the window.
        window: [frames]; the whole window lies in the stream.
        light: (H, W) true light at the frame, where it is known.
    """
    picture = middleTFP(spikes, frame, window)
    return PicturePanel(picture, title, _line(over(window), picture, light))


def instant_panel(title: str, picture: Pictures, light: Pictures | None = None) -> PicturePanel:
    """A panel of one frame's picture (H, W); light: true light at the frame, where it is known."""
    return PicturePanel(picture, title, _line(over(1), picture, light))


def light_panel(light: Pictures, frame: int, frame_rate_hz: float | None) -> PicturePanel:
    """A panel of the true light (H, W) in the middle of a frame."""
    return PicturePanel(light, "true light", instant(frame, frame_rate_hz))


def over(window: int) -> str:
    """Frames of a picture, in words: `mean of 41 frames`, `one frame`."""
    return "one frame" if window == 1 else f"mean of {window} frames"


def instant(frame: int, frame_rate_hz: float | None) -> str:
    """The middle of a frame by its number, and by the camera's clock where its rate is known: `frame 187, 4.69 ms`."""
    return f"frame {frame}" + ("" if frame_rate_hz is None else f", {1e3 * (frame + 0.5) / frame_rate_hz:.2f} ms")


def light_db(picture: Pictures, light: Pictures) -> float:
    """PSNR [dB] of a picture against the true light (H, W), whose brightest pixel is the peak."""
    return psnr_db(picture, light, float(light.max()) or 1.0)


def _line(what: str, picture: Pictures, light: Pictures | None) -> str:
    return what if light is None else f"{what}, PSNR {light_db(picture, light):.2f} dB"
