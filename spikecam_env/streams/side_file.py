"""The geometry of a headerless file: the caller's, else a side file's, else the usual.

    recording.dat.json  or  recording.json    {"height": 250, "width": 416, "crop_width": 400, "flip": true,
                                               "bit_order": "little", "frame_rate_hz": 20000}

Every entry but height and width may be left out.  `recording.dat.json` is always taken for a side file, and
`recording.json` if it has a height or a width.  Where the caller and the side file disagree the caller's value counts,
with a warning.
"""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from spikecam_env.checked import checked_shape, checked_whole
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.renamed import old_names
from spikecam_env.streams.packing import BitOrder, check_bit_order
from spikecam_env.untrusted import Count, Declared, Positive, declared, read_json
from spikecam_env.whole import write_text_whole

Layout = Literal["bits", "packets"]


class SideFile(Declared):
    """Entries of a side file."""

    height: Count
    width: Count
    flip: bool | None = None
    bit_order: BitOrder | None = None
    crop_width: Count | None = None
    layout: Layout | None = None
    frame_rate_hz: Positive | None = None


@dataclass(frozen=True)
class FrameLayout:
    """How frames lie in a file."""

    height: int
    width: int
    flip: bool
    bit_order: BitOrder
    crop_width: int | None
    layout: Layout
    frame_rate_hz: float | None
    source: str
    """Where it is from: "given", a side file's name, or "usual"."""

    @property
    def shape(self) -> tuple[int, int]:
        return self.height, self.width

    def attributes(self) -> dict[str, Any]:
        """As attributes of a recording; without the frame rate where it is unknown."""
        taken = {name: value for name, value in vars(self).items() if value is not None and name != "source"}
        return {**taken, "geometry_from": self.source}


def read_side_file(path: Path) -> tuple[SideFile, Path] | None:
    """Entries and path of the side file of a recording; None where there is none."""
    own = side_path(path)
    if own.is_file():
        return declared(SideFile, read_json(own), str(own)), own
    shared = path.with_suffix(".json")
    if shared.is_file():
        entries = read_json(shared)
        if isinstance(entries, dict) and {"height", "width"} & set(entries):
            return declared(SideFile, entries, str(shared)), shared
    return None


def side_path(path: Path) -> Path:
    """`recording.dat.json`, beside a recording."""
    return path.with_name(f"{path.name}.json")


def write_side_file(path: Path, entries: dict[str, Any]) -> None:
    """Write `recording.dat.json` beside a recording; raises InputError for entries that no side file has."""
    side = side_path(path)
    stated = {name: value for name, value in entries.items() if value is not None}
    declared(SideFile, stated, str(side))
    write_text_whole(side, json.dumps(stated, indent=1) + "\n")


def geometry(path: Path, given: dict[str, Any], usual: dict[str, Any]) -> FrameLayout:
    """The geometry of a recording.

    Args:
        path: of the recording.
        given: the caller's options; None where he leaves them open.
        usual: values where neither caller nor side file has one.

    Raises:
        InputError: values out of range, a wrong side file, or no height or width.
    """
    beside = read_side_file(path)
    side = {} if beside is None else {k: v for k, v in beside[0].model_dump().items() if v is not None}
    stated = {name: value for name, value in given.items() if value is not None}
    against = [f"{k}={stated[k]!r}, not {side[k]!r}" for k in sorted(stated.keys() & side) if stated[k] != side[k]]
    if beside is not None and against:
        warnings.warn(f"{path} is read with {', '.join(against)} as {beside[1].name} says", UserWarning, stacklevel=4)
    taken = {"flip": False, "bit_order": "little", **usual, **side, **stated}
    missing = [name for name in ("height", "width") if name not in taken]
    if missing:
        raise InputError(
            f"{path} does not say its size; give {' and '.join(missing)}, or a file {path.name}.json with them"
        )
    height, width = checked_shape((taken["height"], taken["width"]), f"{path}: (height, width)")
    crop = taken.get("crop_width")
    if crop is not None and not 1 <= checked_whole(crop, "crop_width") <= width:
        raise InputError(f"crop_width is {crop}; it must be 1 to {width}, the width of the file")
    if not isinstance(taken["flip"], bool):
        raise InputError(f"flip is {taken['flip']!r}; it must be True or False")
    if taken.get("layout", "bits") not in ("bits", "packets"):
        raise unknown_name("layout", taken["layout"], ("bits", "packets"))
    return FrameLayout(
        height,
        width,
        taken["flip"],
        check_bit_order(taken["bit_order"]),
        crop,
        taken.get("layout", "bits"),
        taken.get("frame_rate_hz"),
        "given" if {"height", "width"} <= stated.keys() else beside[1].name if beside is not None else "usual",
    )


__getattr__ = old_names(__name__, {"Geometry": "FrameLayout"})
