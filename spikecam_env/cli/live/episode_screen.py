"""The screen of an episode: the camera's pictures with their middle marked, and the figures beside them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.cli.live.episodes import Moment
from spikecam_env.cli.screen.screen import PicturePanel, compose, white_of
from spikecam_env.types import Pictures, Spikes

WINDOW = 40
"""Frames of a noisy picture at least: a millisecond at 40 kHz."""


class EpisodeScreen:
    """Makes the pictures of one episode after another; all have one size.

    `noisy` is TFP over the newest blocks, WINDOW frames or more; `denoised` the newest rate plane of the online
    denoiser (`best`), 17 to 32 frames old, None before the first is finished.  Both are (H, W) [spikes/frame].

    Args:
        task: name of the environment.
        who: acts.
        denoise: show the denoised picture too.
        show_target: mark the target by a ring.
        keys: line that explains the keys.
    """

    def __init__(
        self, task: str, who: str, *, denoise: bool = False, show_target: bool = False, keys: str = ""
    ) -> None:
        self._task, self._who, self._keys, self._show_target = task, who, keys, show_target
        self.noisy: Pictures = np.empty((0, 0), np.float32)
        self.denoised: Pictures | None = None
        self._recent: list[Spikes] = []
        self._white = 1.0
        self._online: Any = None
        if denoise:
            from denoiser import OnlineDnSS

            self._online = OnlineDnSS.pretrained("best", output="rate")

    def see(self, moment: Moment) -> None:
        """Take in a moment's spikes; every moment, shown or not."""
        if moment.step == 0:
            self._recent, self.denoised = [], None
            if self._online is not None:
                self._online.reset()
        blocks = -(-WINDOW // len(moment.spikes))
        self._recent = [*self._recent, moment.spikes][-blocks:]
        self.noisy = np.concatenate(self._recent).mean(axis=0).astype(np.float32)
        if moment.step == 0:
            self._white = white_of(self.noisy)
        if self._online is not None and len(planes := self._online.push(moment.spikes)):
            self.denoised = planes[-1]

    def picture(self, moment: Moment) -> NDArray[np.uint8]:
        """(rows, columns, 3) uint8, even sizes, of the moment that was seen last."""
        shown = [(self.noisy, "noisy spikes (TFP)", self._who)]
        if self.denoised is not None:
            shown.append((self.denoised, "denoised (DnSS)", ""))
        elif self._online is not None:
            shown.append((self.noisy, "denoised (DnSS)", "noisy until the first frames are finished"))
        target = moment.info["target"] if self._show_target else None
        panels = [PicturePanel(*panel, aim=True, target=target) for panel in shown]
        return compose(panels, self._white, figures=[(self._task, ""), *figures(moment)], status=self._keys)


def figures(moment: Moment) -> list[tuple[str, str]]:
    """(name, value) of the lines beside the picture."""
    info = moment.info
    return [
        ("time", f"{1e3 * moment.time_s:.2f} ms"),
        ("step", str(moment.step)),
        ("reward", f"{moment.reward:+.3f}"),
        ("return", f"{moment.total:+.2f}"),
        ("distance", f"{info['distance_px']:.1f} px"),
        ("performance", f"{info['performance']:.3f}"),
        ("", outcome(moment)),
    ]


def outcome(moment: Moment) -> str:
    """How the episode stands, in a word or two."""
    if not moment.over:
        return "on target" if moment.info["is_success"] else ""
    return "success" if moment.info["is_success"] else "over"
