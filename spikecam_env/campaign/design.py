"""Campaigns by simulation: designs, and one unit of any model recorded by them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from spikecam_env.campaign import Campaign, PlannedRecording, record_takes
from spikecam_env.campaign.recording_kinds import Bars, Dark, Disk, Flat, Planned, Step
from spikecam_env.checked import checked_count, checked_disk, checked_shape
from spikecam_env.sensor import SensorModel
from spikecam_env.streams.packing import packed_bytes

FIT_LEVELS = (0.01, 0.03, 0.08, 0.2, 0.4, 0.65)
"""Radiance of the flats to fit: even steps of its logarithm, up to below saturation."""

HOLDOUT_LEVELS = (0.05, 0.15, 0.5)
"""Radiance of the flats held out, between those to fit."""

BRIGHT = 1.4
"""Radiance of the bright bars: above one spike a frame, so that blooming shows."""


def write_campaign(
    folder: str | Path,
    model: SensorModel | str,
    *,
    shape: tuple[int, int] = (64, 64),
    frames: int = 8000,
    recordings: Sequence[Planned] | None = None,
    seed: int = 0,
    engine: str = "auto",
    progress: bool = False,
) -> Campaign:
    """Record one simulated unit into a campaign (format spikecam-campaign/1), and read it back.

    Same arguments, same bytes; a run that was stopped goes on where it was.

    Args:
        folder: of the campaign.
        model: a SensorModel, with any effects; a preset's name or a TOML path.
        shape: (rows, columns) [pixels].
        frames: length of recordings that do not state their own [frames].
        recordings: in order; default `standard_design()`.
        seed: of the unit, its fixed pattern and its noise.
        engine: of `SpikeSensor`.
        progress: whether to show a bar.

    Returns:
        The campaign, as `read_campaign` reads it.

    Raises:
        InputError: as `record_takes` does, and for light that a recording cannot have.

    Example:
        >>> planned = [Dark(), Flat(radiance=0.2)]
        >>> campaign = write_campaign("camera", "scsim", shape=(8, 8), frames=200, recordings=planned)
        >>> [recording.name for recording in campaign.recordings]
        ['dark', 'flat-0.2']
    """
    camera = model if isinstance(model, SensorModel) else SensorModel.load(model)
    planned = standard_design() if recordings is None else recordings
    size = checked_shape(shape)
    lengths = [checked_count(frames if p.frames is None else p.frames) for p in planned]
    checked_disk(sum(lengths) * packed_bytes(size), folder, f"{sum(lengths)} frames of {size[0]} x {size[1]} pixels")
    takes = [_take(p, size, length) for p, length in zip(planned, lengths, strict=True)]
    return record_takes(folder, camera, takes, shape=size, seed=seed, engine=engine, progress=progress)


def standard_design() -> tuple[Planned, ...]:
    """Dark, six flats, a step and bars to fit; three flats between them and a disk to judge.

    Example:
        >>> [p.file_name for p in standard_design() if p.use == "holdout"]
        ['flat-0.05', 'flat-0.15', 'flat-0.5', 'disk']
    """
    return (
        Dark(),
        *(Flat(radiance=level) for level in FIT_LEVELS),
        Step(),
        Bars(high=BRIGHT),
        *(Flat(radiance=level, use="holdout") for level in HOLDOUT_LEVELS),
        Disk(use="holdout"),
    )


def second_voltage(recordings: Sequence[Planned], v_d: float) -> tuple[Planned, ...]:
    """The recordings, and once more, at another V_D - V_ref [V], those of dark and flats to fit.

    Example:
        >>> [p.file_name for p in second_voltage([Flat(radiance=0.2), Step()], v_d=0.7)]
        ['flat-0.2', 'step', 'flat-0.2-at-0.7V']
    """
    again = (p for p in recordings if isinstance(p, Dark | Flat) and p.use == "fit")
    return (*recordings, *(replace(p, v_d=v_d, name=p.name and f"{p.name}-at-{v_d:g}V") for p in again))


def _take(planned: Planned, shape: tuple[int, int], frames: int) -> PlannedRecording:
    planned.check()
    return PlannedRecording(
        planned.file_name, planned.light(shape, frames), frames, planned.use, planned.v_d, planned.kind
    )
