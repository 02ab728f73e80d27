"""A timeline in rerun: as the bytes of a .rrd file, or in its viewer.

Rerun is an optional package (`pip install spikecam-env[view]`), imported when first asked for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

from spikecam_env.cli.live.timeline import TimelineEntry
from spikecam_env.errors import InputError


def rerun() -> ModuleType:
    """The package; raises InputError where it is not installed."""
    try:
        return import_module("rerun")
    except ImportError as error:
        raise InputError("rerun is not installed; pip install 'spikecam-env[view]'") from error


def recorded(title: str, frame_rate_hz: float, entries: Iterable[TimelineEntry]) -> bytes:
    """A whole .rrd file: rerun ends every part that it gives away with an index."""
    recording = _recording(title)
    stream = recording.binary_stream()
    _send(recording, frame_rate_hz, entries)
    content: bytes = stream.read()
    return content


def watched(title: str, frame_rate_hz: float, entries: Iterable[TimelineEntry]) -> None:
    """Open the viewer, and fill it."""
    recording = _recording(title)
    try:
        recording.spawn()
    except RuntimeError as error:
        raise InputError(f"rerun's viewer cannot be started ({error}); write a file with --save") from error
    _send(recording, frame_rate_hz, entries)
    recording.flush()


def _recording(title: str) -> Any:
    package = rerun()
    recording = package.RecordingStream("spikecam view", send_properties=False)
    recording.set_log_time_enabled(False)
    recording.set_log_tick_enabled(False)
    recording.send_recording_name(title)
    return recording


def _send(recording: Any, frame_rate_hz: float, entries: Iterable[TimelineEntry]) -> None:
    """Log each entry, on the timelines `time` [s] and `frame`; a new one gets its name, and its place on the page."""
    package, known = rerun(), set[str]()
    pictures: list[str] = []
    plots: dict[str, int] = {}
    for entry in entries:
        if entry.path not in known:
            known.add(entry.path)
            if isinstance(entry.value, np.ndarray):
                pictures.append(entry.path)
            elif isinstance(entry.value, float):
                room, _, name = entry.path.partition("/")
                plots[room] = plots.get(room, 0) + 1
                recording.log(_path(entry), package.SeriesLines(names=name), static=True)
            recording.send_blueprint(_layout(pictures, plots))
        recording.set_time("time", duration=entry.frame / frame_rate_hz)
        recording.set_time("frame", sequence=entry.frame)
        recording.log(_path(entry), _shown(package, entry))


def _shown(package: ModuleType, entry: TimelineEntry) -> Any:
    if isinstance(entry.value, np.ndarray):
        return package.Image(entry.value)
    if isinstance(entry.value, tuple):
        return package.Points2D([[each + 0.5 for each in entry.value]], radii=1.0, colors=[[90, 200, 250]])
    return package.Scalars(entry.value)


def _path(entry: TimelineEntry) -> list[str]:
    """As rerun has it, with every character allowed."""
    return entry.path.split("/")


def _layout(pictures: Sequence[str], plots: Mapping[str, int]) -> Any:
    """Pictures on the left, by their paths; plots on the right, a legend where a room has several lines."""
    part, package = import_module("rerun.blueprint"), rerun()
    left = [part.Spatial2DView(origin=f"/{path}", name=path.rpartition("/")[2]) for path in pictures]
    right = [
        part.TimeSeriesView(
            origin=package.new_entity_path([room]), name=room, plot_legend=part.PlotLegend(visible=lines > 1)
        )
        for room, lines in plots.items()
    ]
    return part.Blueprint(
        part.Horizontal(part.Vertical(*left), part.Grid(*right, grid_columns=2), column_shares=[1, 2]),
        part.TimePanel(timeline="time", state="collapsed"),
        part.BlueprintPanel(state="collapsed"),
        part.SelectionPanel(state="collapsed"),
        auto_layout=False,
        auto_views=False,
    )
