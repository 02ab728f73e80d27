"""Observations by name, for `obs=` of an environment."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pkgutil import resolve_name
from typing import Any

from spikecam_env.envs.observations.blocks import Multibinary, Packed, Spikes, block_shape
from spikecam_env.envs.observations.events import EventCounts
from spikecam_env.envs.observations.frame_camera import FrameCamera
from spikecam_env.envs.observations.frame_sensor import HIGH_SPEED, FrameSensor
from spikecam_env.envs.observations.intervals import ISI, TFI
from spikecam_env.envs.observations.playback import TFP
from spikecam_env.envs.observations.protocol import Blocks, CameraView, Observation, replaced, restarted, with_rows
from spikecam_env.envs.observations.state import with_state, with_state_space
from spikecam_env.envs.observations.stream import ObservedStream
from spikecam_env.envs.registration import OBSERVATIONS_ABOVE
from spikecam_env.errors import InputError, shown, unknown_name
from spikecam_env.renamed import old_names

__all__ = [
    "HIGH_SPEED",
    "ISI",
    "OBSERVATIONS",
    "TFI",
    "TFP",
    "Blocks",
    "CameraView",
    "EventCounts",
    "FrameCamera",
    "FrameSensor",
    "Multibinary",
    "Observation",
    "ObservedStream",
    "Packed",
    "Spikes",
    "block_shape",
    "observation",
    "replaced",
    "restarted",
    "with_rows",
    "with_state",
    "with_state_space",
]


def _of_place(place: str, keywords: dict[str, Any]) -> Observation:
    """The observation of a package above, which is imported now: torch takes seconds."""
    law: Observation = resolve_name(place)(**keywords)
    return law


SHORT_S = 2e-4
"""A short exposure [s]: 8 frames of the spike camera, as many as Read-v1 shows of a step."""
FRAME_CAMERAS: dict[str, dict[str, Any]] = {"": {}, "root_": {"gamma": 0.5}, "short_": {"exposure_s": SHORT_S}}
"""First part of a frame camera's name, and its keywords."""
OBSERVATIONS: dict[str, Callable[[], Observation]] = {
    "multibinary": Multibinary,
    "spikes": Spikes,
    "packed": Packed,
    "tfp": TFP,
    "root_tfp": partial(TFP, gamma=0.5),
    "tfi": TFI,
    "isi": ISI,
    **{name: partial(_of_place, place, keywords) for name, (place, keywords) in OBSERVATIONS_ABOVE.items()},
    **{
        f"{how}frame{rate}": partial(FrameCamera, float(rate), sensor=sensor, **keywords)
        for rate, sensor in ((30, FrameSensor()), (120, FrameSensor()), (1000, HIGH_SPEED))
        for how, keywords in FRAME_CAMERAS.items()
    },
    "events": EventCounts,
}


def observation(obs: str | Observation) -> Observation:
    """The observation of this name, or the one that was given.

    Raises:
        InputError: for anything else.
    """
    if isinstance(obs, Observation):
        return obs
    if not isinstance(obs, str):
        raise InputError(f"obs = {shown(obs)}; give a name, {', '.join(OBSERVATIONS)}, or an Observation")
    if obs not in OBSERVATIONS:
        raise unknown_name("obs", obs, OBSERVATIONS)
    return OBSERVATIONS[obs]()


__getattr__ = old_names(__name__, {"View": "CameraView"})
