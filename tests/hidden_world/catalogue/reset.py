"""The reset and the comparator before it; what a spike does to its neighbours."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tests.hidden_world.catalogue.drawing import RESET_SUBSTEPS, frames_of, log_uniform, shape, some_pixels, whole
from tests.hidden_world.integrator import Physics
from tests.hidden_world.mechanism import Law, Mechanism, Parameters, Rng
from tests.hidden_world.unit import Camera

Act = Callable[[Physics, Camera, int, Parameters, Rng], None]


def _timed(change: Act) -> Act:
    """With frames cut into pieces, as it matters when in a frame a pixel was reset."""

    def act(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        ph.substeps = max(ph.substeps, RESET_SUBSTEPS)
        change(ph, camera, frames, p, rng)

    return act


@_timed
def _dead(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.dead = frames_of(p["tau_us"])


@_timed
def _dead_along_rows(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.dead = frames_of(p["tau_us"])
    ph.reset_share = np.tile(2.0 * np.arange(camera.shape[1]) / (camera.shape[1] - 1), camera.shape[0])


@_timed
def _dead_against_light(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.dead, ph.dead_by_light = frames_of(p["tau_us"]), 1.0


def _delay(power: float) -> Act:
    @_timed
    def delay(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        ph.delay, ph.delay_power = frames_of(p["delay_us"]), power

    return delay


@_timed
def _clears(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.hold_loss = p["fraction"]


@_timed
def _flags(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.hold_loss, ph.hold_chance = 1.0, p["fraction"]


@_timed
def _clears_some_pixels(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.hold_loss, ph.reset_share = 1.0, np.zeros(camera.gain.size)
    ph.reset_share[some_pixels(camera, p["fraction"], np.random.default_rng(int(p["which"])))] = 1.0


@_timed
def _left_rises(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.left_fraction, ph.left_tau = p["fraction"], frames_of(p["tau_us"])


@_timed
def _left_falls(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.left_always, ph.left_fraction, ph.left_tau = p["fraction"], -p["fraction"], frames_of(p["tau_us"])


_FOUR = ((-1, 0), (1, 0), (0, -1), (0, 1))


def _kicks(to: tuple[tuple[int, int], ...] = _FOUR, times: float = 1.0, at_spike: bool = True) -> Act:
    """To the pixels so many rows and columns away; at the spike, or as if they took notice at the frame's end."""

    def kick(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        ph.kick, ph.kick_to, ph.kick_at_spike = times * p["kick"], to, at_spike

    return kick


_JOHNS = "Johns & Martin, Analog Integrated Circuit Design"

MECHANISMS = (
    Mechanism(
        "dead_time",
        "T = 1/x + tau",
        physics=_dead,
        far=(
            Law("along the row", "tau rises along the row from 0 to 2 tau", physics=_dead_along_rows,
                source="Rabaey, Digital Integrated Circuits: a reset line of resistance and capacitance"),
            Law("against the light", "T = 1/x + tau (1 + x)", physics=_dead_against_light,
                source="C dV/dt = I_switch - I_photo, to first order"),
        ),
    ),
    Mechanism(
        "comparator_delay",
        "T = 1/x + c / sqrt(x)",
        physics=_delay(0.5),
        far=(
            Law("two stages", "T = 1/x + c / x^(1/3)", physics=_delay(1 / 3),
                source=f"{_JOHNS}: n stages answer a ramp with t^(n + 1)"),
        ),
    ),
    Mechanism(
        "synchronous_reset",
        "charge between crossing and read-out lost",
        physics=_clears,
        far=(
            Law("flag", "a share of the resets waits for the read-out: all that comes until then is lost",
                physics=_flags, source="Dally & Poulton, Digital Systems Engineering: a latch that misses its moment"),
            Law("some pixels", "a share of the pixels is cleared at the read-out, the others at once",
                shape(which=whole(0, 2**31)), physics=_clears_some_pixels, source="a switch that does not close"),
        ),
    ),
    Mechanism(
        "incomplete_reset",
        "charge f (1 - exp(-T/tau)) left by a reset",
        shape(tau_us=log_uniform(100.0, 1000.0)),
        physics=_left_rises,
        far=(
            Law("falling", "charge f exp(-T/tau) left: the longer the interval, the less",
                shape(tau_us=log_uniform(100.0, 1000.0)), physics=_left_falls,
                source="Nakamura (ed.), Image Sensors (2006): charge that relaxes away"),
        ),
    ),
    Mechanism(
        "crosstalk",
        "a spike kicks its four neighbours, at once",
        physics=_kicks(),
        far=(
            Law("late", "at the end of the frame", physics=_kicks(at_spike=False),
                source="a coupling through the read-out, once a frame"),
            Law("along the row", "the two beside it in its row, twice as much", physics=_kicks(((0, -1), (0, 1)), 2.0),
                source="Dally & Poulton, Digital Systems Engineering: parallel column wires"),
        ),
    ),
)  # fmt: skip
