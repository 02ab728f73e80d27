"""Pixels that go from event to event through all frames of a block: a spike, or a change of their charge.

So they may where nothing moves from frame to frame but the charge of single pixels.  The law is that of `fire` and
`add_left_charge`.
"""

from __future__ import annotations

import numpy as np

from spikecam_env.compiled import njit
from spikecam_env.sensor.engines.compiled.bands.arguments import BlockLight, SpikeLaw
from spikecam_env.sensor.engines.compiled.bands.left_charge import add_left_charge
from spikecam_env.sensor.engines.compiled.bands.resets import draw_group, reset_group
from spikecam_env.sensor.engines.compiled.bands.rows import (
    AGAIN,
    ARRIVES,
    AT,
    DUE,
    EXTRA,
    GROUP,
    HELD,
    INSIDE,
    LEAST,
    LIMIT,
    NONE,
    PIXEL,
    UNTIL,
    Bytes,
    Places,
    Views,
    frame_charge,
)
from spikecam_env.types import Floats

_U = np.uint32

FEWEST_FRAMES, SPARSE = 4, 0.5
"""Fewest frames of a block, and most spikes a pixel and frame, for which going from spike to spike is faster."""


@njit(nogil=True, error_model="numpy", boundscheck=False)
def pass_events(
    band: Views, live: Places, groups: int, light: BlockLight, columns: int, number: int, law: SpikeLaw, spikes: Bytes
) -> None:
    """All frames of a band.

    Args:
        band: its scratch; row EXTRA has the number of a pixel among the few whose charge changes.
        live, groups: all groups of the band.
        light: held, but for the few.
        columns: pixels of a row.
        number: of the first frame.
        law: of a spike.
        spikes: (F, P), set where a pixel fires.
    """
    x, words, frames = band.x, band.words, spikes.shape[0]
    draws = words.view(np.float32)
    for j in range(groups * GROUP):
        x[AT + j], x[UNTIL + j], words[AGAIN + j] = 0.0, frames, 0
    for j in range(groups * GROUP):
        if words[EXTRA + j] != NONE:
            x[UNTIL + j] = unchanged_until(light.extra, words[EXTRA + j], 0)
    while groups:
        go_on(band, live, groups, frames)
        groups = record_events(band, live, groups, light, columns, spikes)
        for g in range(groups):
            draw_group(words, draws, live[g] & INSIDE, law.polynomial, False)
        for g in range(groups):
            reset_group(x, words, draws, live[g] & INSIDE, law.feedback, False)
        if law.feedback.left != 0.0:
            add_left_charge(band, live, groups, number, True, law)


@njit(inline="always")
def go_on(band: Views, live: Places, groups: int, frames: int) -> None:
    """Let the pixels of live groups pass frames up to their next event; row DUE: whether that is a spike."""
    x, words = band.x, band.words
    for g in range(groups):
        q = live[g] & INSIDE
        for j in range(q, q + GROUP):
            held, more, limit = x[HELD + j], x[ARRIVES + j], x[LIMIT + j]
            n = np.floor(max(min((limit - held) / max(more, LEAST), frames + 1.0), 0.0))
            n = n + 1.0 if held + n * more < limit else n
            n = 0.0 if words[AGAIN + j] != 0 else max(n, 1.0)
            rest = x[UNTIL + j] - x[AT + j]
            words[DUE + j] = n <= rest
            n = min(n, rest)
            x[AT + j] += n
            x[HELD + j] = held + n * more


@njit(nogil=True, error_model="numpy", boundscheck=False)
def record_events(band: Views, live: Places, groups: int, light: BlockLight, columns: int, spikes: Bytes) -> int:
    """Events of the pixels of live groups: a spike where they are due, else another charge from here on.

    Returns:
        Number of groups, listed, in which events may follow.
    """
    x, words = band.x, band.words
    still = 0
    for g in range(groups):
        q = live[g] & INSIDE
        goes_on = False
        for j in range(q, q + GROUP):
            at = np.int64(x[AT + j])
            if words[DUE + j] != 0:
                spikes[at - 1, words[PIXEL + j]] = 1
                goes_on = True
            elif at < spikes.shape[0]:
                i = np.int64(words[EXTRA + j])
                x[ARRIVES + j] = charge_of_few(light, columns, i, at, 0)
                x[UNTIL + j] = unchanged_until(light.extra, i, at)
                goes_on = True
        live[still] = q
        still += goes_on
    return still


@njit(inline="always")
def charge_of_few(light: BlockLight, columns: int, i: int, t: int, of_row: int) -> float:
    """Charge [grains] of the i-th pixel with extra dark charge in frame t, by the factors of frame `of_row`."""
    p = light.few[i]
    r = p // columns
    lights, darks = light.light[t if len(light.light) > 1 else 0], light.dark[t if len(light.dark) > 1 else 0]
    at_light = lights[p] * light.light_factor[of_row, r]
    at_dark = (darks[p] + light.extra[t, i]) * light.dark_factor[of_row, r]
    return frame_charge(at_light, at_dark)


@njit(inline="always")
def unchanged_until(extra: Floats, i: int, at: int) -> int:
    """First frame after `at` with other extra charge (F, n) of pixel i of the few; F if none."""
    until = at + 1
    while until < extra.shape[0] and extra[until, i] == extra[at, i]:
        until += 1
    return until
