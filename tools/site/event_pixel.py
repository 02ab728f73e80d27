"""The table of an event camera's parameters, from their declarations."""

from __future__ import annotations

from dataclasses import fields

from spikecam_env.sensor import EventPixel
from spikecam_env.sensor.ranges import range_text


def page() -> str:
    """A row a parameter, Markdown."""
    rows = [
        f"| `{f.name}` | {f.default:g} | {f.metadata['unit']} | {range_text(f)} | {f.metadata['doc']} |"
        for f in fields(EventPixel)
    ]
    return "\n".join(["| parameter | default | unit | range | meaning |", "|---|---|---|---|---|", *rows, ""])
