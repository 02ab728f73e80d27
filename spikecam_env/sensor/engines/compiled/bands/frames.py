"""The compiled loop of the block kernel: frame by frame, as `reference` has it, a band of lines at a time.

    charge += max(light light_factor, 0) + max(dark dark_factor, 0)
    while charge >= limit = (threshold factor + grains_per_mV (common + field)) (1 + droop activity):
        spike;  residual = (charge - limit - loss of the reset) kept;  threshold = GRAINS (1 + s z)

The same operations in the same order, in float64, so that without noise the bits are the reference's.  With noise the
electrons still to come are drawn once a spike, as in the jump kernel (`fast`).  No fastmath.

Where references move within the frame, limits are their least, and pixels above these are looked at again
(`within_frame`).  Where spikes kick neighbours at once, a frame's spikes are taken in turn (`in_turn`).  Where nothing
moves from frame to frame but charge of single pixels, a pixel goes from event to event (`events`).  Charge is held on a
grid (`on_grid`) on which sums are exact: many frames at once give the bits of one by one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.sensor.effects.base import Feedback
from spikecam_env.sensor.engines.compiled.bands.arguments import (
    BlockFrames,
    BlockLight,
    BlockPixels,
    BlockReferences,
    Plan,
    SpikeLaw,
    differ,
    sway_of,
)
from spikecam_env.sensor.engines.compiled.bands.events import FEWEST_FRAMES, SPARSE, charge_of_few, pass_events
from spikecam_env.sensor.engines.compiled.bands.in_turn import empty_turns, fire_in_turn
from spikecam_env.sensor.engines.compiled.bands.left_charge import add_left_charge, end_of_frame
from spikecam_env.sensor.engines.compiled.bands.lines import (
    FewPlaces,
    Lines,
    bands_together,
    cut,
    lay_out,
    load_lines,
    number_few,
    place_few,
    store_lines,
)
from spikecam_env.sensor.engines.compiled.bands.resets import fire, wake
from spikecam_env.sensor.engines.compiled.bands.rows import (
    ARRIVES,
    BAND,
    FACTOR,
    GROUP,
    HELD,
    LIMIT,
    LOAD,
    MOVED,
    ONE,
    PHI,
    SCRATCH,
    STANDS,
    Bytes,
    Places,
    Views,
    copy,
    find_live,
    frame_charge,
    limit_of,
    list_all,
    views,
)
from spikecam_env.sensor.engines.compiled.bands.within_frame import fire_within
from spikecam_env.sensor.engines.compiled.queue import next_piece
from spikecam_env.sensor.ground.intrinsics import borrowed
from spikecam_env.types import Floats, Pictures

bands_of = njit(inline="always")(bands_together)

# Columns of what a line had in its last frame.
_LIGHT_FACTOR, _DARK_FACTOR, _FACTOR, _COMMON, _LOAD = range(5)


def pieces_of_work(rows: int, columns: int, feedback: Feedback) -> int:
    """Number of pieces into which a block is cut, for threads."""
    return bands_together(rows, columns, _acts_on_all(feedback), feedback.droop != 0.0)[-1]


def _acts_on_all(feedback: Feedback) -> bool:
    return feedback.kick != 0.0 or feedback.kick_at_once != 0.0


acts_on_all = njit(inline="always")(_acts_on_all)


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def advance(
    worker: int,
    tickets: NDArray[np.int64],
    light: BlockLight,
    references: BlockReferences,
    law: SpikeLaw,
    pixels: BlockPixels,
    frames: BlockFrames,
) -> None:
    """Pass all frames of a block, for the bands that this thread gets hold of."""
    light, references, pixels, law = borrowed(light), borrowed(references), borrowed(pixels), borrowed(law)
    frames, columns, rows = borrowed(frames), frames.columns, pixels.activity.size
    plan = plan_of(light, references, law, frames, rows)
    pieces = bands_of(rows, columns, acts_on_all(law.feedback), law.feedback.droop != 0.0)[4]
    at_once = plan.together * plan.lines
    layout = lay_out(rows, columns, plan)
    of_few = place_few(layout, light, columns, plan)
    rooms = np.zeros((plan.together, SCRATCH)), np.empty((at_once, 5)), np.empty(BAND // GROUP, np.int64)
    all_lines, few = borrowed(layout), borrowed(of_few)
    scratch, stood, live = borrowed(rooms)
    scratch[:, LIMIT : LIMIT + BAND] = np.inf  # beyond a line nothing fires
    piece, share = next_piece(tickets, worker, worker, pieces)
    while piece >= 0:
        lines = cut(all_lines, piece * at_once, (piece + 1) * at_once)
        own = FewPlaces(few.begin[piece * plan.together :], few.place, few.row)
        stood[:] = np.nan
        load_lines(scratch, lines, pixels)
        pass_frames(scratch, stood, live, lines, own, plan, light, references, law, pixels, frames)
        store_lines(scratch, lines, pixels)
        piece, share = next_piece(tickets, share, worker, pieces)
    layout.row[0], of_few.begin[0], rooms[2][0] = 0, 0, 0  # kept until here


@njit(inline="always")
def plan_of(light: BlockLight, references: BlockReferences, law: SpikeLaw, frames: BlockFrames, rows: int) -> Plan:
    """What moves in the block, and how its lines lie."""
    feedback, count = law.feedback, frames.spikes.shape[0]
    light_moves, dark_moves, field_moves = len(light.light) > 1, len(light.dark) > 1, len(references.field) > 1
    moves = light_moves or dark_moves or field_moves or feedback.droop != 0.0
    moves = moves or differ(light.light_factor) or differ(light.dark_factor)
    moves = moves or differ(references.factor) or differ(references.common)
    sways = references.at.shape[1] > 0
    alone = not moves and not sways and feedback.kick == 0.0 and count >= FEWEST_FRAMES
    pieces, pitch, lines, together, _ = bands_of(rows, frames.columns, acts_on_all(feedback), feedback.droop != 0.0)
    return Plan(light_moves, dark_moves, field_moves, moves, sways, alone, pieces, pitch, lines, together)


@njit(inline="always")
def pass_frames(
    scratch: Floats,
    stood: Floats,
    live: Places,
    lines: Lines,
    few: FewPlaces,
    plan: Plan,
    light: BlockLight,
    references: BlockReferences,
    law: SpikeLaw,
    pixels: BlockPixels,
    frames: BlockFrames,
) -> None:
    """Pass all frames of these lines, whose pixels are in the scratch.

    Args:
        scratch: of the bands (B, SCRATCH).
        stood: numbers of each line in the last frame (L, 5), NaN before the first.
        live: room for a band's groups.
    """
    feedback, columns, activity = law.feedback, frames.columns, pixels.activity
    bands = lines.band[-1] + 1
    at_once = feedback.kick_at_once != 0.0
    for t in range(len(frames.spikes)):
        bits = frames.spikes[t]
        for b in range(bands):
            band = views(scratch[b])
            x = band.x
            begin, end = b * plan.lines, min((b + 1) * plan.lines, lines.row.size)
            arrived = update_band(x, stood, lines, begin, end, plan, light, references, feedback.droop, activity, t)
            update_few(x, few, b, light, columns, t, arrived)
            used = (end - begin) * plan.pitch
            if plan.alone and t == 0 and is_sparse(x, used):
                jump_band(band, live, lines, few, plan.pitch, light, law, frames)
                return
            groups = collect(band, used, live)
            if at_once:
                if t == 0:
                    groups = (used + GROUP - 1) // GROUP
                    list_all(groups, live)
                    wake(band, live, groups, law)
                continue
            if groups:
                wake(band, live, groups, law)
                if plan.sways:
                    sway = sway_of(references, feedback.droop, activity, columns, t)
                    fire_within(band, live, groups, lines, begin, end, sway, law)
                else:
                    fire(band, live, groups, law)
            copy_bits(band.hit, lines, begin, end, bits)
        if at_once:
            sway = sway_of(references, feedback.droop, activity, columns, t)
            if t == 0:
                turns = empty_turns(scratch, lines, bits.size, feedback.kick_at_once)
            fire_in_turn(scratch, bits, lines, turns, sway, law)
        if feedback.kick != 0.0:
            kick_lines(scratch, lines, bits, columns, feedback.kick)
        if feedback.left != 0.0:
            for b in range(bands):
                band = views(scratch[b])
                groups = find_live(band.hit, BAND // GROUP, live)
                end_of_frame(band, live, groups, t + 1.0)
                add_left_charge(band, live, groups, frames.number, not plan.sways and not at_once, law)
        if feedback.droop != 0.0:
            for r in range(lines.row[0], lines.row[-1] + 1):
                activity[r] = bits[r * columns : (r + 1) * columns].sum() / columns


@njit(inline="always")
def update_band(
    x: Floats,
    stood: Floats,
    lines: Lines,
    begin: int,
    end: int,
    plan: Plan,
    light: BlockLight,
    references: BlockReferences,
    droop: float,
    activity: Floats,
    t: int,
) -> bool:
    """Charge and limits of the lines of a band in frame t, where they are others than before; whether any charge is."""
    lights, darks = light.light[t * plan.light_moves], light.dark[t * plan.dark_moves]
    fields = references.field[t * plan.field_moves]
    arrived = False
    for line in range(begin, end if t == 0 or plan.moves else begin):
        r, p0, n, h0 = lines.row[line], lines.pixel[line], lines.width[line], lines.slot[line]
        a, d = light.light_factor[t, r], light.dark_factor[t, r]
        f, m, load = references.factor[t, r], references.common[t, r], 1.0 + droop * activity[r]
        was = stood[line]
        if plan.light_moves or plan.dark_moves or a != was[_LIGHT_FACTOR] or d != was[_DARK_FACTOR]:
            was[_LIGHT_FACTOR], was[_DARK_FACTOR], arrived = a, d, True
            arrives = x[ARRIVES + h0 : ARRIVES + h0 + n]
            of_light, of_dark = lights[p0 : p0 + n], darks[p0 : p0 + n]
            for j in range(n):
                arrives[j] = frame_charge(of_light[j] * a, of_dark[j] * d)
        if f != was[_FACTOR] or load != was[_LOAD]:
            x[FACTOR + h0 : FACTOR + h0 + n] = f
            x[LOAD + h0 : LOAD + h0 + n] = load
        if plan.field_moves or f != was[_FACTOR] or m != was[_COMMON] or load != was[_LOAD]:
            was[_FACTOR], was[_COMMON], was[_LOAD] = f, m, load
            compare(x, h0, n, references.grains_per_mV[p0 : p0 + n], fields[p0 : p0 + n], f, m, load)
    return arrived


@njit(inline="always")
def compare(
    x: Floats,
    h0: int,
    n: int,
    grains_per_mV: Floats,
    field: Pictures,
    factor: float,
    common: float,
    load: float,
) -> None:
    """Of a line in one frame [grains]: shifts of the references, their levels at a reset, and limits of the pixels."""
    moved, stands = x[MOVED + h0 : MOVED + h0 + n], x[STANDS + h0 : STANDS + h0 + n]
    limit, phi = x[LIMIT + h0 : LIMIT + h0 + n], x[PHI + h0 : PHI + h0 + n]
    for j in range(n):
        moved[j] = grains_per_mV[j] * (common + field[j])
    for j in range(n):
        stands[j] = (ONE * factor + moved[j]) * load
    for j in range(n):
        limit[j] = limit_of(phi[j], factor, moved[j], load)


@njit(inline="always")
def update_few(x: Floats, few: FewPlaces, b: int, light: BlockLight, columns: int, t: int, arrived: bool) -> None:
    """Charge of the pixels of band b with extra dark charge, where it is another than in the frame before."""
    extra = light.extra
    for i in range(few.begin[b], few.begin[b + 1]):
        if arrived or extra[t, i] != extra[t - 1, i]:
            x[ARRIVES + few.place[i]] = charge_of_few(light, columns, i, t, t)


@njit(inline="always")
def is_sparse(x: Floats, used: int) -> bool:
    """Whether so few spikes come that going from event to event is faster."""
    return bool(x[ARRIVES : ARRIVES + used].sum() < SPARSE * ONE * used)


@njit(inline="always")
def jump_band(
    band: Views,
    live: Places,
    lines: Lines,
    few: FewPlaces,
    pitch: int,
    light: BlockLight,
    law: SpikeLaw,
    frames: BlockFrames,
) -> None:
    """Pass all frames of the one band of these lines from event to event."""
    x, used = band.x, lines.row.size * pitch
    groups = (used + GROUP - 1) // GROUP
    list_all(groups, live)
    x[LIMIT + used : LIMIT + groups * GROUP] = np.inf
    for line in range(lines.row.size):
        p0, n, h0 = lines.pixel[line], lines.width[line], lines.slot[line]
        x[LIMIT + h0 + n : LIMIT + h0 + pitch] = np.inf
        frames.spikes[:, p0 : p0 + n] = 0
    number_few(band.words, few, 0)
    wake(band, live, groups, law)
    pass_events(band, live, groups, light, frames.columns, frames.number, law, frames.spikes)


@njit(inline="always")
def collect(band: Views, used: int, live: Places) -> int:
    """Add one frame's charge; lists the groups in which a pixel is at its limit, row HIT, and returns their number."""
    x, hit = band.x, band.hit
    for j in range(used):
        c = x[HELD + j] + x[ARRIVES + j]
        x[HELD + j] = c
        hit[j] = c >= x[LIMIT + j]
    return find_live(hit, (used + GROUP - 1) // GROUP, live)


@njit(inline="always")
def copy_bits(hit: Bytes, lines: Lines, begin: int, end: int, bits: Bytes) -> None:
    """Spikes of the lines of a band in one frame (P,)."""
    for line in range(begin, end):
        p0, n, h0 = lines.pixel[line], lines.width[line], lines.slot[line]
        copy(hit[h0 : h0 + n], bits[p0 : p0 + n])


@njit(inline="always")
def kick_lines(scratch: Floats, lines: Lines, bits: Bytes, columns: int, kick: float) -> None:
    """At the end of a frame, give every pixel a kick [thresholds] for each neighbour that fired."""
    around = np.empty(columns, np.uint8)
    for line in range(lines.row.size):
        r, p0, n = lines.row[line], lines.pixel[line], lines.width[line]
        if p0 == r * columns:
            count_neighbours(bits, r, columns, around)
        held = scratch[lines.band[line], HELD + lines.slot[line] : HELD + lines.slot[line] + n]
        of_line = around[p0 - r * columns :]
        for j in range(n):
            held[j] = (held[j] / ONE + kick * of_line[j]) * ONE


@njit(inline="always")
def count_neighbours(bits: Bytes, row: int, columns: int, around: Bytes) -> None:
    """How many of the four neighbours of each pixel of a row fired: around (columns,), overwritten."""
    here = bits[row * columns : (row + 1) * columns]
    around[:] = 0
    add(here[:-1], around[1:])
    add(here[1:], around[:-1])
    if row > 0:
        add(bits[(row - 1) * columns : row * columns], around)
    if (row + 1) * columns < bits.size:
        add(bits[(row + 1) * columns : (row + 2) * columns], around)


@njit(inline="always")
def add(values: Bytes, out: Bytes) -> None:
    """Values to those of `out`."""
    for j in range(values.size):
        out[j] += values[j]
