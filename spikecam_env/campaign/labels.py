"""Labels: the light of recordings of a real camera, from code, a CSV table or the command line.

0.2                 even, steady light of that radiance; 0 is dark

unknown             a static scene of unknown light

steps.npz           light over time, `frame` (K,) and `radiance` (K, H, W) or broadcastable, as in a campaign

relative            (flat maps only) the unit itself is the light meter, see `real_files`
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from spikecam_env.errors import InputError, shown
from spikecam_env.numbers import LARGEST_COUNT
from spikecam_env.untrusted import read_table

UNKNOWN, RELATIVE = "unknown", "relative"

READING = (
    *("height", "width", "flip", "bit_order", "crop_width", "layout"),
    *("key", "item", "batch_axis", "time_axis", "first", "count"),
)
"""Options of `read_recording`, here also columns of a table."""

_COLUMNS = ("file", "radiance", "name", "use", "v_d", "temperature_k", "note", *READING)


@dataclass(frozen=True)
class Label:
    """One file of a real camera, its light and its conditions.

    Example:
        >>> Label("screen.dat", 0.2, name="screen", reading={"flip": True}).use
        'fit'
    """

    file: str
    """Its path in the folder of the recordings."""
    radiance: float | str
    """Of even, steady light, 1.0 makes the nominal pixel fire once a frame; or `unknown`, `relative`, or an npz of
    light over time."""
    name: str = ""
    """Of the recording; default the file's."""
    use: str = "fit"
    """`fit` or `holdout`."""
    v_d: float | None = None
    """V_D - V_ref [V]."""
    temperature_k: float | None = None
    """[K]."""
    note: str = ""
    """Free text."""
    reading: Mapping[str, Any] = field(default_factory=dict)
    """Options of `read_recording` for this file."""


def labels_from_table(path: str | Path) -> tuple[Label, ...]:
    """Labels from a CSV table.

    Args:
        path: of a table with the columns file and radiance, and any of name, use, v_d, temperature_k, note and the
            options of reading a file.

    Returns:
        A label a line.

    Raises:
        InputError: for an unknown or missing column, an empty label, and a cell that is not a number, with its line.

    Example:
        >>> from pathlib import Path
        >>> lines = ["file,       radiance, use", "cap-on.dat, 0,        fit", "street.dat, unknown,  holdout"]
        >>> _ = Path("labels.csv").write_text("\\n".join(lines))
        >>> [(label.file, label.radiance, label.use) for label in labels_from_table("labels.csv")]
        [('cap-on.dat', 0.0, 'fit'), ('street.dat', 'unknown', 'holdout')]
    """
    rows = read_table(path, _COLUMNS, ("file", "radiance"))
    labels = tuple(_label(row, f"{path}, line {line}") for line, row in rows)
    if not labels:
        raise InputError(f"{path} lists no recordings; give one a line below the columns' names")
    return labels


def label_from_text(text: str) -> Label:
    """A label written as FILE=RADIANCE, e.g. `wall.npz=unknown`.

    Raises:
        InputError: for text of another form.

    Example:
        >>> label_from_text("flat.dat=0.2").radiance
        0.2
    """
    file, equals, radiance = text.rpartition("=")
    if not equals or not file:
        raise InputError(f"label {shown(text)} is not of the form FILE=RADIANCE, e.g. wall.npz=unknown or flat.dat=0.2")
    return Label(file, parse_radiance(radiance, f"label {shown(text)}"))


def parse_radiance(text: str, where: str) -> float | str:
    """A radiance as written: a number, `unknown`, `relative`, or the name of an npz."""
    if text in (UNKNOWN, RELATIVE) or text.endswith(".npz"):
        return text
    if not text:
        raise InputError(f"{where}: the radiance is missing; give a number (0 is dark), an npz, or `unknown`")
    return _parsed_number(text, f"{where}: radiance", " (0 is dark), an npz, or `unknown`")


def _label(row: Mapping[str, str], where: str) -> Label:
    cells = {name: text for name, text in row.items() if text}
    if "file" not in cells:
        raise InputError(f"{where}: the file's name is missing")
    reading = {name: _reading_cell(name, cells[name], where) for name in READING if name in cells}
    numbers = {
        name: _parsed_number(cells[name], f"{where}: {name}") for name in ("v_d", "temperature_k") if name in cells
    }
    texts = {name: cells[name] for name in ("name", "use", "note") if name in cells}
    radiance = parse_radiance(cells.get("radiance", ""), where)
    return Label(cells["file"], radiance, reading=reading, **numbers, **texts)  # type: ignore[arg-type]


def _reading_cell(name: str, text: str, where: str) -> Any:
    if name in ("bit_order", "layout", "key"):
        return text
    if name == "flip":
        if text.lower() not in ("true", "false", "0", "1"):
            raise InputError(f"{where}: flip is {text!r}; it must be true or false")
        return text.lower() in ("true", "1")
    value = _parsed_number(text, f"{where}: {name}")
    if value != int(value) or value > LARGEST_COUNT:
        raise InputError(f"{where}: {name} is {shown(text)}; it must be a whole number, at most {LARGEST_COUNT}")
    return int(value)


def _parsed_number(text: str, what: str, otherwise: str = "") -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not 0 <= value < np.inf:
        raise InputError(f"{what} is {shown(text)}; it must be a number, 0 or more{otherwise}")
    return value
