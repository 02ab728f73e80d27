"""A template on another campaign: the change of its statistics by an effect of any strength, without a simulation.

Statistics respond in five ways.  s is the strength over the template's, n is `Candidate.power`, m is 1 for single
events and 2 for amplitudes and noise.

    mean    s^n D                                     D: change by the template
    power   log(1 + s^m S / B)                        S: power of the effect, B: power that is there without it
    rms     log(1 + s^m S / B) / 2
    line    log(s^m S / B), at least 0                one line above the strongest of chance
    count   2 sqrt(C + s^m E) - 2 sqrt(C)             E: events of the effect, C: count without it

B and C follow from the mean of the campaign's null model, S and E from the template and the mean of its null model.  S
and E grow with the array and with the length of a recording (RESPONSES).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.prediction import Null, pair_noise_share
from spikecam_env.gap.compare.step import is_clear
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.screen.screen import places
from spikecam_env.gap.screen.templates import Template, Templates
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.statistics.spectrum import bands
from spikecam_env.sensor import CATALOGUE
from spikecam_env.types import Floats, Masks


class Response(NamedTuple):
    """The response of a statistic to an effect."""

    way: str
    """mean, power, rms, line or count; course: a mean over a part of the recording; none: not known."""
    rows: float = 0.0
    """Exponent of the array's rows with which the effect's change, power or events grow."""
    columns: float = 0.0
    """Exponent of its columns."""
    frames: float = 0.0
    """Exponent of the recording's length."""


MEAN = Response("mean")

RESPONSES = {
    ("rates", "scatter"): Response("rms"),
    ("noise", "tail"): Response("none"),
    ("intervals", ""): Response("count", rows=1, columns=1, frames=1),
    ("drift", "trend"): Response("course", frames=1),
    ("drift", "bend"): Response("course", frames=1),
    ("drift", "late"): Response("course"),
    ("drift", "wander"): Response("power", frames=1),
    ("drift", "pixels"): Response("power", frames=2),
    ("drift", "pixel tail"): Response("none"),
    ("spectrum", "band"): Response("power"),
    ("spectrum", "line"): Response("line", rows=1, columns=1, frames=1),
    ("timing", "late"): Response("power", rows=1, columns=1),
    ("timing", "next"): Response("mean", rows=1, columns=1),
    ("rows", "row"): Response("power", columns=2),
    ("rows", "column"): Response("power", rows=2),
    ("moving", "left"): Response("rms"),
    ("pattern", "width"): Response("rms"),
    ("pattern", "over"): Response("count", rows=1, columns=1),
    ("pattern", "silent"): Response("count", rows=1, columns=1),
    ("pattern", "top"): Response("none"),
    ("pattern", "patch"): Response("none"),
    ("pattern", "rows"): Response("power", columns=1),
    ("pattern", "columns"): Response("power", rows=1),
}
"""By group and start of the name; all others are means.  Source: the statistics' own definitions.  A row's spikes are
of all its columns.  A line is one bin, beside the noise of independent pixels.  A tail, or the furthest, is of a few
pixels, and grows in no known way.
"""

SAME_COURSE = 2.0
"""Factor by which two recordings may differ in length for the course of an effect to be alike; a choice."""

LEAST_POWER = 0.01
"""Share of a power that an effect leaves at least; its logarithm has no end."""


@dataclass(frozen=True)
class RescaledTemplate:
    """A template on the statistics of a campaign."""

    name: str
    strength: float
    """Of the template."""
    way: NDArray[np.str_]
    """(S,) `Response.way`."""
    size: Floats
    """(S,) D, S / B or E at the template's strength; 0 where the template does not clearly show."""
    of_campaign: Floats
    """(S,) mean of the campaign's null model."""

    def change(self, strength: float) -> Floats:
        """(S,) change of the statistics by the effect at a strength."""
        known, times = candidate(self.name), abs(strength / self.strength)
        mean = np.sign(strength / self.strength) * times**known.power * self.size
        counted = known.share is not None and known.share[0] == known.strength
        more = times ** (1.0 if counted else 2.0) * self.size
        power = np.log(np.maximum(1.0 + more, LEAST_POWER))
        count = 2.0 * np.sqrt(np.maximum((self.of_campaign / 2.0) ** 2 + more, 0.0)) - np.abs(self.of_campaign)
        ways = {"power": power, "rms": power / 2, "line": np.log(np.maximum(more, 1.0)), "count": count}
        return np.where(self.size == 0, 0.0, np.select([self.way == w for w in ways], list(ways.values()), mean))


def rescaled(
    templates: Templates, entry: Template, null: Null, conditions: Sequence[Condition], shape: tuple[int, int]
) -> RescaledTemplate:
    """A template on a campaign.

    Args:
        templates: the bank that it is of.
        entry: the template.
        null: the null model's prediction of the campaign.
        conditions: of the campaign's recordings.
        shape: (rows, columns) of its array.
    """
    frames, of_units = {c.name: c.frames for c in conditions}, candidate(entry.name).is_pattern
    own2 = pair_noise_share(templates.keys) ** 2 / (null.settings.twins.drawn_units if of_units else 1)
    clear = np.where(is_clear(entry.shift, own2), entry.shift, 0.0) * templates.noise
    at = same_bands(templates, null.keys, places(templates, conditions, null.keys), frames)
    at = np.where(alike(templates, null.keys, conditions), at, -1)
    size = np.zeros(len(at))
    for i in np.flatnonzero((at >= 0) & (clear[at] != 0) & np.isfinite(null.mean)):
        key = templates.keys[at[i]]
        grown = np.array([*shape, frames[null.keys[i].recording]]) / [*templates.shape, templates.frames[key.recording]]
        size[i] = size_of(entry.name, response_of(key), clear[at[i]], templates.mean[at[i]], null.mean[i], grown)
    way = np.array([response_of(k).way for k in null.keys])
    return RescaledTemplate(entry.name, entry.parameters[CATALOGUE[entry.name].strength], way, size, null.mean)


@cache
def response_of(key: StatisticKey) -> Response:
    """The response of a statistic, by the longest start of its name that is listed."""
    of = [(len(name), r) for (group, name), r in RESPONSES.items() if key.group == group and key.name.startswith(name)]
    return max(of, key=lambda r: r[0])[1] if of else MEAN


def size_of(
    name: str, response: Response, change: float, of_template: float, of_campaign: float, grown: Floats
) -> float:
    """`RescaledTemplate.size` of one statistic.

    Args:
        name: of the effect.
        response: of the statistic.
        change: by the template, on its own campaign.
        of_template: mean of the template's null model.
        of_campaign: mean of the campaign's null model.
        grown: (3,) rows, columns and frames of the campaign over the template's.
    """
    factor = float(np.prod(grown ** np.array(response[1:])))
    if response.way == "course":
        if candidate(name).random_course:
            return change * float(np.sqrt(factor))
        return change if 1 / SAME_COURSE < grown[2] < SAME_COURSE else 0.0
    if response.way == "count":
        return factor * (((of_template + change) / 2) ** 2 - (of_template / 2) ** 2)
    if response.way in ("power", "rms", "line"):
        root = 2.0 if response.way == "rms" else 1.0
        return factor * float(np.expm1(root * change) * np.exp(root * (of_template - of_campaign)))
    return factor * change if response.way == "mean" else 0.0


def alike(templates: Templates, keys: Sequence[StatisticKey], conditions: Sequence[Condition]) -> Masks:
    """(S,) whether statistics are of light as of the templates: dark, even, a step, or motion of the same name."""
    kinds = {c.name: c.kind for c in conditions}
    return np.array(
        [
            k.recording in templates.kinds if k.group == "moving" else kinds[k.recording] in templates.kinds.values()
            for k in keys
        ]
    )


def same_bands(
    templates: Templates, keys: Sequence[StatisticKey], at: NDArray[np.int64], frames: dict[str, int]
) -> NDArray[np.int64]:
    """(S,) index of each statistic in the templates, where a band of a spectrum is that of the nearest frequency."""
    index, places_of_bands = {k: i for i, k in enumerate(templates.keys)}, at.copy()
    for i, key in enumerate(keys):
        if at[i] >= 0 and key.group == "spectrum" and key.name.startswith("band"):
            other = templates.keys[at[i]]
            of_campaign, of_template = (
                log_middles(frames[key.recording]),
                log_middles(templates.frames[other.recording]),
            )
            nearest = int(np.argmin(np.abs(of_template - of_campaign[int(key.name.split()[1])])))
            places_of_bands[i] = index.get(other._replace(name=f"band {nearest}"), -1)
    return np.asarray(places_of_bands)


@cache
def log_middles(frames: int) -> Floats:
    """Logarithm of the middle [cycles a frame] of each band of a spectrum."""
    edges = bands(frames)
    return np.asarray(np.log(np.sqrt(edges[1:] * edges[:-1]) / frames))
