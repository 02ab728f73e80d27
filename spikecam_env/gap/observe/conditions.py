"""The light of every recording of a campaign, and its kind.

Kinds of light: `dark`, `flat` (uniform and steady), `picture` (steady), `step` (uniform, changes in time), `moving`,
`unknown` (a static scene that nobody measured) and `rates` (no spikes, only the rates of pixels).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spikecam_env.campaign.reading import CampaignRecording
from spikecam_env.campaign.recording_kinds import Planned
from spikecam_env.sensor import Keyframes
from spikecam_env.types import Masks

STEADY_KNOWN = ("dark", "flat", "picture")
"""Kinds of steady light that was measured: a unit is refitted by these."""

STEADY = (*STEADY_KNOWN, "unknown")
"""Kinds of steady light."""

LABEL_ERROR = 2e-5
"""Standard deviation, relative, to which labels of light are exact, and first-order laws of it: an assumption
(docs/gap.md, "Known limits")."""


@dataclass(frozen=True)
class Condition:
    """One recording's conditions."""

    name: str
    kind: str
    level: float
    """Mean radiance."""
    light: Keyframes | None
    """None where unknown."""
    frames: int
    use: str
    """`fit` or `holdout`."""
    v_d: float | None = None
    static: Masks | None = None
    """(H, W) pixels that count, in this recording and in its twins; None: all."""

    @property
    def moves(self) -> bool:
        """Whether light changes in time."""
        return self.kind in ("step", "moving")

    @property
    def picture(self) -> NDArray[np.float64]:
        """(P,) radiance, of static light."""
        assert self.light is not None
        return np.asarray(self.light.radiance[0].reshape(-1).astype(np.float64))


def condition_of(recording: CampaignRecording) -> Condition:
    """The conditions of a recording, with its kind of light."""
    light = recording.light()
    if light is None:
        return Condition(recording.name, "unknown", np.nan, None, recording.frames, recording.use, recording.v_d)
    return _condition(recording.name, light, recording.frames, recording.use, recording.v_d)


def planned_conditions(design: Sequence[Planned], shape: tuple[int, int], frames: int) -> list[Condition]:
    """Conditions of recordings that are planned, not made."""
    conditions = []
    for p in design:
        light = p.light(shape, frames)
        whole = Keyframes(light.frame, np.broadcast_to(light.radiance, (len(light.frame), *shape)))
        conditions.append(_condition(p.file_name, whole, frames, p.use, p.v_d))
    return conditions


def _condition(name: str, light: Keyframes, frames: int, use: str, v_d: float | None) -> Condition:
    uniform = bool(np.all(light.radiance == light.radiance[:, :1, :1]))
    steady = bool(np.all(light.radiance == light.radiance[:1]))
    level = float(light.radiance.mean())
    if steady:
        kind = "dark" if level == 0 else "flat" if uniform else "picture"
        light = Keyframes(light.frame[:1], light.radiance[:1])
    else:
        kind = "step" if uniform else "moving"
    return Condition(name, kind, level, light, frames, use, v_d)
