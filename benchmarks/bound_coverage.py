"""Whether upper bounds hold: the share of campaigns with an effect at its bound that state a smaller bound.

    python -m benchmarks.bound_coverage --trials 20 --jobs 2 --out table.json
    python -m benchmarks.bound_coverage --kind linear --trials 5 --out linear.json
    python -m benchmarks.bound_coverage --kind linear --trials 5 --camera 4000 --only afterpulsing --out others.json

A campaign with nothing hidden states a bound of every candidate.  Then each effect is hidden at its bound in TRIALS
campaigns of other cameras, and each states its own bound.  A bound covers if it is no smaller, if there is none, or if
the alarm rings: a diagnosis then searches for the fault, and states no bound.

Linear bounds rest on templates of the standard case, 64 x 64 pixels and 8000 frames: their size on these recordings is
scaled.  They are compared with the simulated ones of the same campaign.  The factor SAFETY was chosen on cameras
from 2000 on, and SAFETY_OF_CHANCE on those from 1000 on: other cameras judge it.

Trials in the file are not repeated; it is written after every trial.  The limit is 95 % of all trials, and 90 % of each
effect's (of 20 trials, 18).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tyro
from tqdm import tqdm

from spikecam_env.cli.table import table
from spikecam_env.gap import Bars, Dark, Flat, Step
from spikecam_env.gap.baseline.alarm import is_discrepant
from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.candidates.strength import bounded, with_effect
from spikecam_env.gap.candidates.table import candidate, chosen, testable
from spikecam_env.gap.compare.prediction import Null, values_of
from spikecam_env.gap.fit.problem import values_to_fit
from spikecam_env.gap.observe.conditions import planned_conditions
from spikecam_env.gap.observe.observation import observe
from spikecam_env.gap.result import Bound
from spikecam_env.gap.screen.templates import Templates, shipped_templates
from spikecam_env.gap.twins.case import Case, case_of
from spikecam_env.gap.twins.simulate import with_random_phases
from spikecam_env.gap.verdict.bounds import bounds
from spikecam_env.pool import spread
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.streams import pack_frames
from spikecam_env.whole import write_text_whole

SHAPE, FRAMES = (24, 32), 1000
DESIGN = (Dark(), *(Flat(radiance=x) for x in (0.05, 0.1, 0.2, 0.4, 0.6)), Step(), Bars(high=1.4))
MODEL = SensorModel.preset("scsim")
TWINS = 12
CAMERA = 1000
"""Seed of the first camera with an effect."""

CLEAN = 999
"""Seed of the camera without."""


@dataclass(frozen=True)
class BoundTrial:
    """One campaign with an effect hidden."""

    name: str
    number: int
    below: float | None
    """The bound that it states; None without one."""
    alarm: bool
    """Whether the alarm rings."""


def recorded(model: SensorModel, camera: int) -> Case:
    """A campaign of one camera, its waves at phases of their own."""
    conditions = planned_conditions(DESIGN, SHAPE, FRAMES)
    seen = []
    for take, c in enumerate(conditions):
        sensor = SpikeSensor(with_random_phases(model, camera, take), SHAPE, seed=camera, take=take, threads=1)
        assert c.light is not None
        spikes = sensor.step(c.light if c.moves else c.light.radiance[0], FRAMES)
        seen.append(observe(pack_frames(spikes), SHAPE, film=c.moves))
    return case_of(SHAPE, conditions, seen, seed=camera)


def judged(case: Case) -> tuple[Null, np.ndarray]:
    """The prediction of the model without the effect, and the campaign's statistics."""
    null = model_null(case, MODEL, TWINS)
    return null, values_of(case.bank, null.keys)


def stated(kind: str) -> list[Bound]:
    """The bounds of a campaign with nothing hidden."""
    case = recorded(MODEL, CLEAN)
    null, values = judged(case)
    names, _ = testable(chosen(MODEL, None, ()), case.conditions)
    return bounds(case, MODEL, null, values, names, shipped_templates(), kind)[0]


def trial(bound: Bound, number: int, first: int = CAMERA) -> BoundTrial:
    """One campaign of a camera that has the effect at its bound; of either sign, in every second one the other.

    Args:
        number: of the trial.
        first: seed of the camera of trial 0.
    """
    sign = -1 if number % 2 and candidate(bound.name).may_be_negative else 1
    hidden = bounded(bound.name, {**bound.at, bound.parameter: sign * bound.below})
    case = recorded(with_effect(MODEL, bound.name, hidden), first + number)
    null, values = judged(case)
    alarm = is_discrepant(null, values) or is_discrepant(null, values_to_fit(case, null, values))
    found, _ = bounds(case, MODEL, null, values, [bound.name], _of_shape(bound), bound.kind)
    return BoundTrial(bound.name, number, found[0].below if found else None, alarm)


def _of_shape(bound: Bound) -> Templates:
    """The templates, of the effect those of the bound's shape alone."""
    shipped = shipped_templates()
    alike = [
        e for e in shipped.weakest if e.name == bound.name and all(e.parameters[k] == v for k, v in bound.at.items())
    ]
    return replace(shipped, entries=tuple(alike))


def rows(found: Sequence[Bound], done: Sequence[BoundTrial], simulated: Sequence[Bound]) -> Iterator[dict[str, Any]]:
    """A row an effect: its bound, how many of its trials it covers, and how many ring the alarm.

    Args:
        found: the bounds.
        done: the trials.
        simulated: the simulated bounds of the same campaign, which others are compared with.
    """
    below = {b.name: b.below for b in simulated}
    for b in found:
        own = [t for t in done if t.name == b.name]
        covered = sum(covers(b, t) for t in own)
        low, high = wilson(covered, len(own))
        yield {
            "effect": b.name,
            "parameter": b.parameter,
            "unit": b.unit,
            "bound": f"{b.below:.3g}",
            **({"over simulated": f"{b.below / below.get(b.name, np.nan):.2f}"} if simulated else {}),
            "at": ", ".join(f"{k} {v:g}" for k, v in b.at.items()),
            "covered": f"{covered} of {len(own)}",
            "bounds alone": sum(covers(b, replace(t, alarm=False)) for t in own),
            "95 % interval": f"{100 * low:.0f} to {100 * high:.0f} %",
            "alarm": f"{sum(t.alarm for t in own)} of {len(own)}",
        }


def covers(bound: Bound, told: BoundTrial) -> bool:
    """Whether a campaign does not exclude the effect that is hidden in it."""
    return told.alarm or told.below is None or told.below >= bound.below * (1 - 1e-9)


def wilson(successes: int, trials: int, z: float = 1.96) -> tuple[float, float]:
    """95 % interval of a share (Wilson 1927)."""
    if not trials:
        return 0.0, 1.0
    p, n = successes / trials, trials
    middle, half = p + z * z / (2 * n), z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return float((middle - half) / (1 + z * z / n)), float((middle + half) / (1 + z * z / n))


def _trial(job: tuple[Bound, int, int]) -> BoundTrial:
    return trial(*job)


def main(
    out: Path,
    kind: Literal["linear", "simulated"] = "simulated",
    trials: int = 20,
    jobs: int = 1,
    only: tuple[str, ...] = (),
    camera: int = CAMERA,
) -> None:
    """Write and print the table.

    Args:
        out: file (.json) of the trials.
        kind: of the bounds.
        trials: trials of each effect.
        jobs: trials at once.
        only: effects; default all.
        camera: seed of the first camera with an effect.
    """
    kept = json.loads(out.read_text(encoding="utf-8")) if out.exists() else {"bounds": [], "trials": []}
    known = [Bound(**b) for b in kept["bounds"]] or stated(kind)
    simulated = [Bound(**b) for b in kept.get("simulated", [])] or (stated("simulated") if kind == "linear" else [])
    done = [BoundTrial(**t) for t in kept["trials"]]
    have = {(t.name, t.number) for t in done}
    todo = [b for b in known if not only or b.name in only]
    left = [(b, n, camera) for n in range(trials) for b in todo if (b.name, n) not in have]
    for one in tqdm(spread(_trial, left, jobs), "trials", len(left)):
        done.append(one)
        parts: dict[str, list[Any]] = {"bounds": known, "simulated": simulated, "trials": done}
        write_text_whole(out, json.dumps({k: [asdict(each) for each in v] for k, v in parts.items()}, indent=1))
    print(table(list(rows(known, done, simulated))))
    if done:
        of = {b.name: b for b in known}
        covered = sum(covers(of[t.name], t) for t in done)
        alone = sum(covers(of[t.name], replace(t, alarm=False)) for t in done)
        low, high = wilson(covered, len(done))
        print(f"together {covered} of {len(done)}: {100 * low:.1f} to {100 * high:.1f} %; bounds alone {alone}")


if __name__ == "__main__":
    tyro.cli(main)
