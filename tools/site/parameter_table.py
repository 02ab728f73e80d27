"""The table of a class's parameters, from their declarations."""

from __future__ import annotations

from dataclasses import fields
from pkgutil import resolve_name

from spikecam_env.sensor.ranges import range_text


def page(place: str) -> str:
    """A row a parameter, Markdown.

    Args:
        place: of the class, e.g. `spikecam_env.sensor.EventPixel`.
    """
    rows = [
        f"| `{f.name}` | {f.default:g} | {f.metadata['unit']} | {range_text(f)} | {f.metadata['doc']} |"
        for f in fields(resolve_name(place))
    ]
    return "\n".join(["| parameter | default | unit | range | meaning |", "|---|---|---|---|---|", *rows, ""])
