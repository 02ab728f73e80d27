"""The reset and the comparator before it; the effect of a spike on its neighbours."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tests.hidden_world.catalogue.drawing import RESET_SUBSTEPS, Array, frames_of, log_uniform, shape
from tests.hidden_world.integrator import Physics
from tests.hidden_world.mechanism import Law, Mechanism, OnPhysics, Parameters, Rng
from tests.hidden_world.unit import Camera


def _after_reset(
    laws: Callable[[Parameters], dict[str, float]], share: Callable[[Camera], Array] | None = None
) -> OnPhysics:
    """These laws of a recording, whose frames are cut: it matters when in a frame a pixel was reset.

    share: of the dead time, that is each pixel's.
    """

    def change(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        ph.laws = ph.laws._replace(**laws(p))
        ph.dead_share = share(camera) if share else ph.dead_share
        ph.substeps = max(ph.substeps, RESET_SUBSTEPS)

    return change


def _along_rows(camera: Camera) -> Array:
    """(P,) 0 in the first column, 2 in the last."""
    return np.tile(2.0 * np.arange(camera.shape[1]) / (camera.shape[1] - 1), camera.shape[0])


_FOUR = ((-1, 0), (1, 0), (0, -1), (0, 1))


def _kicks(to: tuple[tuple[int, int], ...] = _FOUR, times: float = 1.0, at_spike: bool = True) -> OnPhysics:
    """To the pixels so many rows and columns away; at the spike, or as if they took notice at the frame's end."""

    def kick(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        ph.kick_to = to
        if at_spike:
            ph.laws = ph.laws._replace(kick=times * p["kick"])
        else:
            ph.late_kick = times * p["kick"]

    return kick


_JOHNS = "Johns & Martin, Analog Integrated Circuit Design"

MECHANISMS = (
    Mechanism(
        "dead_time",
        "T = 1/x + tau",
        physics=_after_reset(lambda p: {"dead": frames_of(p["tau_us"])}),
        far=(
            Law("along the row", "tau rises along the row from 0 to 2 tau",
                physics=_after_reset(lambda p: {"dead": frames_of(p["tau_us"])}, _along_rows),
                source="Rabaey, Digital Integrated Circuits: a reset line of resistance and capacitance"),
            Law("against the light", "T = 1/x + tau (1 + x)",
                physics=_after_reset(lambda p: {"dead": frames_of(p["tau_us"]), "dead_by_light": 1.0}),
                source="C dV/dt = I_switch - I_photo, to first order"),
        ),
    ),
    Mechanism(
        "comparator_delay",
        "T = 1/x + c / sqrt(x)",
        physics=_after_reset(lambda p: {"delay": frames_of(p["delay_us"])}),
        far=(
            Law("two stages", "T = 1/x + c / x^(1/3)",
                physics=_after_reset(lambda p: {"delay": frames_of(p["delay_us"]), "delay_power": 1 / 3}),
                source=f"{_JOHNS}: n stages answer a ramp with t^(n + 1)"),
        ),
    ),
    Mechanism(
        "synchronous_reset",
        "charge between crossing and read-out lost",
        physics=_after_reset(lambda p: {"hold_loss": p["fraction"]}),
        far=(
            Law("flag", "a share of the resets waits for the read-out: all that comes until then is lost",
                physics=_after_reset(lambda p: {"hold_loss": 1.0, "hold_chance": p["fraction"]}),
                source="Dally & Poulton, Digital Systems Engineering: a latch that misses its moment"),
        ),
    ),
    Mechanism(
        "incomplete_reset",
        "charge f (1 - exp(-T/tau)) left by a reset",
        shape(tau_us=log_uniform(100.0, 1000.0)),
        physics=_after_reset(
            lambda p: {"left_fraction": p["fraction"], "left_tau": frames_of(p["tau_us"])}),
        far=(
            Law("falling", "charge f exp(-T/tau) left: the longer the interval, the less",
                physics=_after_reset(
                    lambda p: {"left_always": p["fraction"], "left_fraction": -p["fraction"],
                                       "left_tau": frames_of(p["tau_us"])}),
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
