"""Simulated campaigns of flats: one unit of a model before evenly lit screens, in the dark, at one or two V_d."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from spikecam_env.campaign.reading import Campaign
from spikecam_env.campaign.takes import PlannedRecording, own_v_d, record_takes
from spikecam_env.errors import InputError
from spikecam_env.sensor import Keyframes, SensorModel


def write_flats(
    folder: str | Path,
    model: SensorModel,
    *,
    levels: Sequence[float],
    frames: int | Sequence[int] = 20_000,
    shape: tuple[int, int] = (64, 64),
    seed: int = 0,
    second_v_d: float | None = None,
    engine: str = "auto",
    progress: bool = False,
) -> Campaign:
    """Record flats of one unit into a campaign.

    Args:
        folder: folder of the campaign.
        model: the camera's model.
        levels: radiance of each recording, its label; 0 is a dark recording.
        frames: lengths of the recordings, or one for all.
        shape: rows and columns.
        seed: seed of the unit and of its temporal noise.
        second_v_d: V_D - V_ref [V] at which all levels are recorded once more, in the same light.
        engine: as in `SpikeSensor`.
        progress: show a bar.

    Example:
        >>> from spikecam_env.sensor import SensorModel
        >>> campaign = write_flats("camera", SensorModel.preset("scsim"), levels=(0.0, 0.2), frames=100, shape=(4, 8))
        >>> [recording.name for recording in campaign.recordings]
        ['dark-00', 'flat-01']
    """
    levels = [float(level) for level in levels]
    lengths = [frames] * len(levels) if isinstance(frames, int) else list(frames)
    if len(lengths) != len(levels) or not levels:
        raise InputError(f"{len(lengths)} lengths for {len(levels)} levels; give one each, or one for all")
    voltages = [own_v_d(model)] if second_v_d is None else [own_v_d(model), second_v_d]
    takes = []
    for v_d in voltages:
        at = "" if v_d == voltages[0] else f"-at-{v_d:g}V"
        for i, (level, length) in enumerate(zip(levels, lengths, strict=True)):
            takes.append(
                PlannedRecording(f"{'flat' if level else 'dark'}-{i:02d}{at}", even_light(level), length, v_d=v_d)
            )
    return record_takes(folder, model, takes, shape=shape, seed=seed, engine=engine, progress=progress)


def even_light(radiance: float) -> Keyframes:
    """The same light on all pixels at all times, (1, 1, 1)."""
    return Keyframes(np.zeros(1), np.full((1, 1, 1), radiance, np.float32))
