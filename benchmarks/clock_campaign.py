"""Would flats near whole intervals measure the disturbance c(v) by the array's clock?  Tried on hidden units.

    python -m benchmarks.clock_campaign --png c.png

A unit is the published camera (`scsim` at 20 kHz) with an edge a frame and rows read one after another, all
parameters drawn at random.  The campaign (`benchmarks/clock/campaign.py`) is recorded by the project's sensor; what
is estimated (`benchmarks/clock/measure.py`) comes from spikes and lights alone, by a law of phases
(`benchmarks/clock/phases.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tyro
from matplotlib.figure import Figure
from tqdm import tqdm

from benchmarks.clock.campaign import Flats, record
from benchmarks.clock.measure import Measured, measure
from benchmarks.clock.phases import edge
from spikecam_env.sensor import SensorModel
from spikecam_env.sensor.effects.clock_feedthrough import ClockFeedthrough
from spikecam_env.sensor.effects.readout_skew import ReadoutSkew
from spikecam_env.whole import check_file, whole_file

FRAME_RATE_HZ = 20_000.0
NAMES = ("amplitude [mV]", "phase [frames]", "tau [frames]", "span [frames]")
AIM = 0.1
"""Largest error that is aimed at: of amplitude, tau and span relative, of the phase in frames."""


@dataclass(frozen=True)
class Hidden:
    """A unit's hidden parameters: of `ClockFeedthrough` and `ReadoutSkew`, tau in frames."""

    amplitude_mV: float
    phase: float
    tau: float
    span: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Hidden:
        """5 to 20 mV, falling or rising, any phase, tau 0.08 to 0.4 frames, span 0.4 to 1.2 frames of either sign."""
        signs = rng.choice((-1.0, 1.0), 2)
        size, phase, tau, span = rng.uniform((5.0, 0.0, 0.08, 0.4), (20.0, 1.0, 0.4, 1.2))
        return cls(float(signs[0] * size), float(phase), float(tau), float(signs[1] * span))

    def model(self) -> SensorModel:
        law = ClockFeedthrough(self.amplitude_mV, self.phase, self.tau / FRAME_RATE_HZ * 1e6)
        plain = replace(SensorModel.preset("scsim"), frame_rate_hz=FRAME_RATE_HZ)
        return plain.with_effect(law).with_effect(ReadoutSkew(self.span))


@dataclass(frozen=True)
class Outcome:
    """One unit: true, estimated, standard errors (4,) in the order of NAMES; off: errors as AIM counts them."""

    hidden: Hidden
    found: Measured
    swing_mV: float

    @property
    def true(self) -> np.ndarray:
        return np.array([self.hidden.amplitude_mV, self.hidden.phase, self.hidden.tau, self.hidden.span])

    @property
    def estimated(self) -> np.ndarray:
        f = self.found
        return np.array([f.amplitude * self.swing_mV, f.moment, f.tau, f.span])

    @property
    def errors(self) -> np.ndarray:
        e = self.found.errors
        return np.array([e[0] * self.swing_mV, e[1], e[2], e[4]])

    @property
    def off(self) -> np.ndarray:
        off = self.estimated / self.true - 1.0
        off[1] = (self.found.moment - self.hidden.phase + 0.5) % 1.0 - 0.5
        return np.asarray(off)

    @property
    def curve_true(self) -> np.ndarray:
        """c(v) [mV] at the estimated curve's phases."""
        return edge(self.found.phases, self.hidden.amplitude_mV, self.hidden.phase, self.hidden.tau)


def main(units: int = 6, seed: int = 0, rows: int = 64, columns: int = 64, png: Path | None = None) -> None:
    """Record and measure `units` hidden units; print true, estimated, error.

    Args:
        rows: rows of the array; each is a sample of phase.
        png: where to draw c(v), estimated and true.
    """
    if png is not None:
        check_file(png)
    outcomes = []
    for unit in tqdm(range(units), desc="units", unit="unit"):
        hidden = Hidden.drawn(np.random.default_rng([seed, unit]))
        model = hidden.model()
        steps = record(model, (rows, columns), Flats(), seed=1000 * seed + unit)
        swing = 1e3 * model.circuit.swing_V
        outcomes.append(Outcome(hidden, measure(steps), swing))
        print(_lines(unit, outcomes[-1]), flush=True)
    worst = np.max([np.abs(o.off) for o in outcomes], axis=0)
    print(
        f"\nlargest error of {units} units: "
        + ", ".join(f"{n.split(' ')[0]} {w:.1%}" for n, w in zip(NAMES, worst, strict=True))
    )
    print(
        f"units with all four within {AIM:.0%}: {sum(bool(np.all(np.abs(o.off) < AIM)) for o in outcomes)} of {units}"
    )
    if png is not None:
        with whole_file(png) as place:
            _drawn(outcomes).savefig(place, dpi=110, format="png")
        print(f"drawn: {png}")


def _lines(unit: int, outcome: Outcome) -> str:
    """The table of a unit: its parameters, and its curve."""
    lines = [f"\nunit {unit}: noise {outcome.found.noise:.5f} thresholds, mean square left {outcome.found.left:.2f}"]
    lines.append("".ljust(16) + "true".rjust(10) + "estimated".rjust(20) + "error".rjust(9))
    for name, true, value, sd, off in zip(
        NAMES, outcome.true, outcome.estimated, outcome.errors, outcome.off, strict=True
    ):
        lines.append(f"{name:16s}{true:10.4f}{value:12.4f} ± {sd:.4f}{off:+9.1%}")
    lines.append("c(v) [mV]".ljust(16) + "true".rjust(10) + "estimated".rjust(18) + "z".rjust(9))
    scale = outcome.swing_mV
    for v, true, value, sd in zip(
        outcome.found.phases,
        outcome.curve_true,
        scale * outcome.found.curve,
        scale * outcome.found.curve_errors,
        strict=True,
    ):
        lines.append(f"{v:9.3f}       {true:10.2f}{value:11.2f} ± {sd:4.2f}{(value - true) / sd:+9.1f}")
    return "\n".join(lines)


def _drawn(outcomes: list[Outcome]) -> Figure:
    columns = min(len(outcomes), 3)
    rows = -(-len(outcomes) // columns)
    figure = Figure((4.0 * columns, 2.8 * rows), layout="constrained")
    phases = np.linspace(0.0, 1.0, 1001)
    for place, outcome in zip(figure.subplots(rows, columns, squeeze=False).flat, outcomes, strict=False):
        hidden, found = outcome.hidden, outcome.found
        place.plot(phases, edge(phases, hidden.amplitude_mV, hidden.phase, hidden.tau), color="0.6", label="true")
        scale = outcome.swing_mV
        place.errorbar(
            found.phases, scale * found.curve, 2 * scale * found.curve_errors, fmt=".", label="estimated, ±2 se"
        )
        place.set_title(f"span {hidden.span:+.2f} frames, estimated {found.span:+.3f}", fontsize=9)
        place.set_xlabel("phase v of the array's clock [frames]")
        place.set_ylabel("c(v) [mV]")
        place.legend(fontsize=7)
    return figure


if __name__ == "__main__":
    tyro.cli(main)
