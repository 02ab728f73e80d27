"""Campaigns from recordings of a real camera: spikes in any format that `read_recording` knows, rates, flat maps.

The unit of radiance is the labels': 1.0 should make the nominal pixel of the model fire once a frame.  Labels in lux or
in any other unit proportional to light go through `radiance_per_unit`, the radiance that one of them is.

Rates are an npz with `rate` (H, W) [spikes/frame] and `frames` it was counted over.

Flat maps (`campaign.flat_maps`) become recordings of rates, lit and dark, and where its counts are known the one at
153 lux, which is held out.  The radiance of 335 lux is not known, so the lit one is labelled by the camera itself,
`relative`: radiance is the median over pixels of its rate less the dark's.  By this label the median pixel has gain 1;
only the differences between pixels, and the dark, can disagree with a model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from spikecam_env.campaign import Campaign, flat_maps, read_campaign
from spikecam_env.campaign.flats import even_light
from spikecam_env.campaign.labels import READING, RELATIVE, UNKNOWN, Label
from spikecam_env.campaign.reading import USES, read_light, read_rates
from spikecam_env.campaign.writing import finish_campaign, save_light, save_rates, save_spikes
from spikecam_env.checked import checked_number
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.names import file_name, inside
from spikecam_env.sensor import Keyframes
from spikecam_env.sensor.model import FRAME_RATES_HZ
from spikecam_env.streams import read_recording
from spikecam_env.streams.recording import ENDINGS, reading_options
from spikecam_env.untrusted import array_names
from spikecam_env.whole import whole_folder

RADIANCES_PER_UNIT = (1e-12, 1e12)
"""Least and greatest radiance of a label of 1: lux, photons or a lamp's own scale are far within."""

FAINTEST = 1e-12
"""Least radiance of a label that is not 0, dark: a spike in a year."""

_FRAMES_AT_ONCE = 256
"""Frames written at once."""


def import_campaign(
    folder: str | Path,
    out: str | Path,
    labels: Sequence[Label],
    *,
    frame_rate_hz: float | None = None,
    rows: tuple[int, int] | None = None,
    columns: tuple[int, int] | None = None,
    holdout_share: float = 0.0,
    radiance_per_unit: float = 1.0,
    outside: bool = False,
    progress: bool = False,
    **reading: Any,
) -> Campaign:
    """Make a campaign (format spikecam-campaign/1) of labelled recordings of a real camera; it appears whole.

    Args:
        folder: of the recordings.
        out: folder for the campaign, new or empty.
        labels: the files to take, with their light.
        frame_rate_hz: of the camera [Hz]; None where every file states it.
        rows, columns: (first, stop) of the part to keep [pixels].
        holdout_share: share of each recording to fit, at its end, that becomes one held out; 0 up to, not including, 1.
        radiance_per_unit: radiance of a label of 1.
        outside: whether to read files outside the folder too, by `..`, from the root, or over symbolic links.
        progress: whether to show a bar.
        reading: options of `read_recording` for all files that they apply to; a label's own have precedence.

    Returns:
        The campaign, as `read_campaign` reads it.

    Raises:
        InputError: for no labels, missing files, and files of another size or frame rate than the first; for an unknown
            frame rate, a part that is not in the picture, and light of another size; as the readers.

    Example:
        >>> from pathlib import Path
        >>> Path("files").mkdir()
        >>> np.savez("files/screen.npz", spikes=np.random.default_rng(0).integers(0, 2, (100, 6, 8), np.uint8))
        >>> campaign = import_campaign("files", "camera", [Label("screen.npz", 0.5)], frame_rate_hz=40_000, time_axis=0,
        ...                            holdout_share=0.25)
        >>> [(recording.name, recording.use, recording.frames) for recording in campaign.recordings]
        [('screen', 'fit', 75), ('screen-holdout', 'holdout', 25)]
    """
    source = Path(folder)
    if not source.is_dir():
        raise InputError(f"there is no folder {source}; give the folder of the recordings")
    if not labels:
        raise InputError(f"no labels: give the light of each recording, a number or `unknown`; {_listing(source)}")
    if frame_rate_hz is not None:
        frame_rate_hz = checked_number(frame_rate_hz, "frame_rate_hz", *FRAME_RATES_HZ, unit="Hz")
    radiance_per_unit = checked_number(radiance_per_unit, "radiance_per_unit", *RADIANCES_PER_UNIT)
    if not 0.0 <= holdout_share < 1.0:
        raise InputError(f"holdout_share = {holdout_share}; it must be 0 up to, not including, 1")
    for name in reading:
        if name not in READING:
            raise unknown_name("reading option", name, READING)
    part = _Part(rows, columns)
    entries: list[dict[str, Any]] = []
    shape: tuple[int, int] | None = None
    with whole_folder(out) as beside:
        for label in tqdm(labels, desc="import", unit="file", disable=not progress):
            for piece in _pieces(_Source(source, outside), label, reading, part, holdout_share, radiance_per_unit):
                _check_same_size(piece, shape, entries)
                shape = piece.shape
                frame_rate_hz = _agreed_frame_rate(frame_rate_hz, piece)
                entries.append(_write(beside, piece))
        if shape is None or frame_rate_hz is None:
            raise InputError("the files do not say their frame rate; give frame_rate_hz (40000 for a Vidar)")
        finish_campaign(beside, shape, frame_rate_hz, entries)
    return read_campaign(out)


@dataclass(frozen=True)
class _Source:
    """The folder of the recordings."""

    folder: Path
    outside: bool
    """Whether labels may name files beyond it."""

    def file(self, text: str, label: Label) -> Path:
        path = inside(self.folder, text, f"the label of {label.file!r}: file", outside=self.outside)
        if not path.is_file():
            raise InputError(f"there is no file {path} for the label {label.file!r}; {_listing(self.folder)}")
        return path


@dataclass(frozen=True)
class _Part:
    """Rows and columns to keep of every picture."""

    rows: tuple[int, int] | None
    columns: tuple[int, int] | None

    def of(self, array: NDArray[Any], name: str) -> NDArray[Any]:
        """(..., H, W) -> its part; an axis of length 1 is even and stays."""
        for axis, span in ((-2, self.rows), (-1, self.columns)):
            size = array.shape[axis]
            if span is None or size == 1:
                continue
            if not 0 <= span[0] < span[1] <= size:
                lines = "rows" if axis == -2 else "columns"
                raise InputError(f"{lines} {span[0]} to {span[1]} of {name}, which has {size}")
            array = array[..., slice(*span), :] if axis == -2 else array[..., slice(*span)]
        return array


@dataclass(frozen=True)
class _Piece:
    """A recording on its way into the campaign."""

    label: Label
    name: str
    use: str
    light: Keyframes | None
    frames: int
    data: NDArray[Any]
    """Spikes (T, H, W), or rates (H, W) counted over `frames`."""
    frame_rate_hz: float | None = None
    note: str = ""

    @property
    def shape(self) -> tuple[int, int]:
        return self.data.shape[-2], self.data.shape[-1]


def _pieces(
    source: _Source, label: Label, reading: Mapping[str, Any], part: _Part, holdout_share: float, unit: float
) -> list[_Piece]:
    """The recordings that a file becomes."""
    path = source.file(label.file, label)
    if label.use not in USES:
        raise unknown_name(f"use of {label.file}", label.use, USES)
    name = file_name(label.name or path.stem, f"the label of {label.file!r}: name")
    names = array_names(path) if path.suffix.lower() == ".npz" else set()
    if names >= flat_maps.KEYS:
        return _flat_maps(path, label, name, part)
    if label.radiance == RELATIVE:
        raise InputError(
            f"{label.file}: `relative` is for flat maps (D_light, Nd); give a radiance, an npz, or `unknown`"
        )
    light = _light(source, label, part, unit)
    if {"rate", "frames"} <= names:
        rate, frames = read_rates(path, label.file)
        return [_Piece(label, name, label.use, light, frames, part.of(rate, label.file), note=label.note)]
    allowed = reading_options(path)
    recording = read_recording(path, **{k: v for k, v in reading.items() if k in allowed} | dict(label.reading))
    spikes = part.of(recording.spikes, label.file)
    common: dict[str, Any] = {"frame_rate_hz": recording.frame_rate_hz, "note": label.note}
    kept = len(spikes) - int(holdout_share * len(spikes) if label.use == "fit" else 0)
    first = _Piece(label, name, label.use, light, kept, spikes[:kept], **common)
    if kept == len(spikes) and holdout_share > 0.0 and label.use == "fit":
        raise InputError(
            f"holdout_share = {holdout_share:g} holds out no frame of {label.file!r}, which has {len(spikes)}; "
            "give a larger share, or 0"
        )
    if kept == len(spikes):
        return [first]
    rest = _Piece(label, f"{name}-holdout", "holdout", _later(light, kept), len(spikes) - kept, spikes[kept:], **common)
    return [first, rest]


def _flat_maps(path: Path, label: Label, name: str, part: _Part) -> list[_Piece]:
    if label.radiance != RELATIVE:
        raise InputError(f"{label.file} holds flat maps, whose light is known to the camera alone; label it `relative`")
    maps = flat_maps.read_flat_maps(path)
    lit, dark = part.of(maps.lit, label.file), part.of(maps.dark, label.file)
    radiance = float(np.median(lit - dark))
    note = f"{label.note} radiance is relative: 335 lux is the median over pixels of this unit's rate less the dark's"
    pieces = [
        _Piece(label, f"{name}-light", label.use, even_light(radiance), flat_maps.FRAMES, lit, note=note.strip()),
        _Piece(label, f"{name}-dark", label.use, even_light(0.0), flat_maps.FRAMES, dark, note=label.note),
    ]
    if maps.counted.all():
        dim = part.of(maps.dim, label.file)
        light, note = even_light(float(np.median(dim - dark))), note.replace("335", "153")
        pieces.append(_Piece(label, f"{name}-dim", "holdout", light, flat_maps.FRAMES, dim, note=note.strip()))
    return pieces


def _light(source: _Source, label: Label, part: _Part, unit: float) -> Keyframes | None:
    if label.radiance == UNKNOWN:
        return None
    if not isinstance(label.radiance, str):
        least, most = (0.0 if label.radiance == 0.0 else FAINTEST), float(np.finfo(np.float32).max)
        return even_light(checked_number(label.radiance * unit, f"the label of {label.file!r}: radiance", least, most))
    path = source.file(label.radiance, label)
    frame, radiance = read_light(path, f"the label of {label.file!r}")
    if radiance.ndim != 3:
        raise InputError(f"{path} is no light: radiance is {radiance.shape}; it must be (keys, rows, columns)")
    light = Keyframes(frame, part.of(radiance, path.name) * np.float32(unit))
    return _later(light, int(label.reading.get("first", 0)))


def _later(light: Keyframes | None, frames: int) -> Keyframes | None:
    """The light of a recording that begins so many frames later, from the last key before it on: earlier ones may be so
    near each other (`Keyframes.steps`) that far below zero they would be one."""
    if light is None:
        return None
    first = max(int(np.searchsorted(light.frame, frames, side="right")) - 1, 0)
    return Keyframes(light.frame[first:] - frames, light.radiance[first:])


def _write(folder: Path, piece: _Piece) -> dict[str, Any]:
    """Write a piece's files; returns its entry in campaign.json."""
    entry: dict[str, Any] = {"name": piece.name}
    if piece.data.ndim == 3:
        entry |= {"spikes": f"{piece.name}.dat", "frames": piece.frames}
        blocks = (piece.data[i : i + _FRAMES_AT_ONCE] for i in range(0, piece.frames, _FRAMES_AT_ONCE))
        save_spikes(folder / f"{piece.name}.dat", blocks)
    else:
        entry["rates"] = f"{piece.name}-rates.npz"
        save_rates(folder / f"{piece.name}-rates.npz", piece.data, piece.frames)
    entry["radiance"] = None
    if piece.light is not None:
        entry["radiance"] = f"{piece.name}.npz"
        _check_light(piece, piece.light)
        save_light(folder / f"{piece.name}.npz", piece.light)
    label = piece.label
    return entry | {"use": piece.use, "v_d": label.v_d, "temperature_k": label.temperature_k, "note": piece.note}


def _check_light(piece: _Piece, light: Keyframes) -> None:
    size = light.radiance.shape[1:]
    if not all(n in (1, m) for n, m in zip(size, piece.shape, strict=True)):
        raise InputError(
            f"{piece.label.radiance} is light of {size} pixels; recording {piece.name!r} has {piece.shape}"
        )


def _check_same_size(piece: _Piece, shape: tuple[int, int] | None, entries: Sequence[Mapping[str, Any]]) -> None:
    if shape is not None and piece.shape != shape:
        raise InputError(
            f"recording {piece.name!r} has {piece.shape} pixels, {entries[0]['name']!r} has {shape}; a campaign is of "
            "one camera: import them apart, or keep a part of the same size with rows and columns"
        )
    if piece.name in {entry["name"] for entry in entries}:
        raise InputError(f"two recordings would be named {piece.name!r}; give one another name in its label")


def _agreed_frame_rate(frame_rate_hz: float | None, piece: _Piece) -> float | None:
    if frame_rate_hz is None or piece.frame_rate_hz in (None, frame_rate_hz):
        return frame_rate_hz or piece.frame_rate_hz
    raise InputError(
        f"recording {piece.name!r} says {piece.frame_rate_hz:g} frames a second, so far it was {frame_rate_hz:g}; "
        "a campaign has one frame rate"
    )


def _listing(folder: Path) -> str:
    found = sorted(p.name for p in folder.iterdir() if p.suffix.lower() in ENDINGS)
    return f"{folder} holds {', '.join(found) or 'no recordings (' + ', '.join(ENDINGS) + ')'}"
