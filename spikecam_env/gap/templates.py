"""What each candidate does to the statistics bank, simulated beforehand on the standard design: to screen by.

    python -m spikecam_env.gap.templates          rebuilds them (resumable)

A template is a direction, in noise, at a strength that shows clearly; as statistics bend where an effect is severe,
there are others of TIMES as much.  Screening scales the one that suits best to what was measured; the fit that follows
simulates the campaign at hand and rests on no template.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import resources
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from numpy.typing import NDArray
from tqdm import tqdm

from spikecam_env.gap.candidates import CANDIDATES, NOISE_OF_A_RESET, candidate, is_pattern, of_motion
from spikecam_env.gap.case import Case, case_of, settled, twins
from spikecam_env.gap.compare import TOLERANCE, Null, misfit, null_of, of_a_pair, pooled, scale_of, values_of
from spikecam_env.gap.fit import UNITS, bounded, predict, with_effect, with_pattern
from spikecam_env.gap.refit import within
from spikecam_env.gap.result import Bound
from spikecam_env.gap.statistics import Key
from spikecam_env.gap.twin import simulate
from spikecam_env.gap.units import drawn_banks
from spikecam_env.gap.world import Shown
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.whole import whole_file

Array = NDArray[np.float64]

SHAPE, FRAMES, SEED = (64, 64), 8000, 20
MODEL = "scsim"
SHOWS = 8.0
"""Noises that a template has to show on the recordings at hand to bound its effect."""

PEAK = 40.0
"""Templates are taken where the statistic that shows the effect best is this many noises off."""

TIMES = (8.0, 50.0)
"""Times as strong that severe effects are simulated."""

REFITTED = 3
"""Twins that say what a model without the effect gives, refitted to a severe one."""

FILE = "templates.npz"


@dataclass(frozen=True)
class Template:
    """parameters: at which `shift` (S,), in noise, was simulated.  times: the strength, over the weakest of its shape.

    white: s^2 of the unit, over what it is refitted as: a severe noise is first taken for the unit's own.
    """

    name: str
    parameters: dict[str, float]
    shift: Array
    times: float = 1.0
    white: float = 1.0

    @property
    def shape(self) -> tuple[str, frozenset[Any]]:
        """Name and all parameters but the strength."""
        strength = CATALOGUE[self.name].strength
        return self.name, frozenset((key, value) for key, value in self.parameters.items() if key != strength)


@dataclass(frozen=True)
class Templates:
    """keys: (S,) of the standard design's statistics; noise: (S,) theirs, of which `shift` is so many.

    levels: radiance of its recordings by name; kinds: of them.
    """

    keys: tuple[Key, ...]
    noise: Array
    levels: dict[str, float]
    kinds: dict[str, str]
    entries: tuple[Template, ...]

    @property
    def weakest(self) -> tuple[Template, ...]:
        """Those whose statistics are in proportion to the strength, and to less."""
        return tuple(e for e in self.entries if e.times == 1.0)


@dataclass(frozen=True)
class Screened:
    """A candidate as its template sees it.  start: parameters to fit from.  misfit: what it would leave.

    expected: (S,) change of the statistics there.  white: s^2 of the unit there, over the refit's.
    """

    name: str
    start: dict[str, float]
    misfit: float
    expected: Array
    white: float = 1.0


def load() -> Templates:
    """The shipped templates."""
    with resources.as_file(resources.files("spikecam_env.gap") / FILE) as path, np.load(path) as file:
        about = json.loads(str(file["about"]))
        shifts, noise = file["shift"].astype(np.float64), file["noise"].astype(np.float64)
    entries = tuple(Template(**e, shift=s) for e, s in zip(about["entries"], shifts, strict=True))
    return Templates(tuple(Key(*k) for k in about["keys"]), noise, about["levels"], about["kinds"], entries)


def screen(
    templates: Templates,
    conditions: Sequence[Shown],
    null: Null,
    measured: Array,
    names: Sequence[str],
    line_hz: float | None = None,
) -> list[Screened]:
    """Candidates by what their best template of each shape, scaled, would leave unexplained; least first.

    line_hz: frequency of the strongest line of the measured spectra, to start periodic candidates from.
    """
    at = _places(templates, conditions, null.keys)
    d = np.nan_to_num((measured - null.mean) / null.noise)
    best: dict[tuple[str, frozenset[Any]], Screened] = {}
    for entry in templates.entries:
        if entry.name not in names:
            continue
        shift = np.where((at >= 0) & np.isfinite(measured), (entry.shift * templates.noise)[at] / null.noise, 0.0)
        now = (
            _scattered(entry, null, d, shift)
            if candidate(entry.name).wanders
            else _in_proportion(entry, null, d, shift)
        )
        if now is None and of_motion(entry.name):
            now = Screened(entry.name, dict(entry.parameters), misfit(d, null.weight), shift * null.noise)
        if now is None:
            continue
        if line_hz and "frequency_hz" in entry.parameters:
            now = replace(now, start=bounded(entry.name, {**now.start, "frequency_hz": line_hz}))
        if entry.shape not in best or now.misfit < best[entry.shape].misfit:
            best[entry.shape] = now
    return sorted(best.values(), key=lambda s: s.misfit)


def _in_proportion(entry: Template, null: Null, d: Array, shift: Array) -> Screened | None:
    """A template scaled to the measured distances `d`, in noise; None where only a wrong sign would do."""
    own2 = of_a_pair(null.keys) ** 2 * (shift != 0)
    scale, _ = scale_of(d, shift, np.ones_like(d), own2, 2 * TOLERANCE)
    if scale <= 0 and not _signed(entry.name):
        return None
    strength, power = CATALOGUE[entry.name].strength, candidate(entry.name).power
    rho = (d - scale * shift) / np.sqrt(1.0 + scale**2 * own2 + (2 * TOLERANCE * scale * shift) ** 2)
    there = entry.parameters[strength] * np.sign(scale) * abs(scale) ** (1 / power)
    start = bounded(entry.name, {**entry.parameters, strength: there})
    white = 1.0 / (1.0 + abs(scale) * (1.0 / entry.white - 1.0))
    return Screened(entry.name, start, misfit(rho, null.weight), scale * shift * null.noise, white)


def _scattered(entry: Template, null: Null, d: Array, shift: Array) -> Screened:
    """A template of what wanders: its size alone, over all recordings, is by how much statistics scatter."""
    strength, power = CATALOGUE[entry.name].strength, candidate(entry.name).power
    size2 = pooled(null.keys, shift**2)
    tried = []
    for factor in np.geomspace(1e-3, 1e3, 100):
        wider = 1.0 + factor * size2
        price = float(np.sum(null.weight * np.log(wider) * (d != 0)))
        tried.append((misfit(d / np.sqrt(wider), null.weight) + price, factor))
    left, factor = min(tried)
    start = bounded(entry.name, {**entry.parameters, strength: entry.parameters[strength] * factor ** (1 / power)})
    return Screened(entry.name, start, left, np.sqrt(factor * size2) * null.noise)


def bounds(
    templates: Templates, conditions: Sequence[Shown], null: Null, measured: Array, names: Sequence[str]
) -> list[Bound]:
    """Upper bounds (about 95 %) of effects that were not found: the strength whose template would have been seen.

    Statistics count as independent, but for the pattern's: every recording shows the same one.
    """
    at = _places(templates, conditions, null.keys)
    d = np.nan_to_num((measured - null.mean) / null.noise)
    one = np.ones_like(d)
    found: dict[str, Bound] = {}
    for entry in templates.weakest:
        if entry.name not in names:
            continue
        shift = np.where(at >= 0, (entry.shift * templates.noise)[at] / null.noise, 0.0)
        if float(np.abs(shift).max()) < SHOWS:
            continue
        scale, sd = scale_of(d, shift, one, 0.0 * one, 2 * TOLERANCE)
        sd *= np.sqrt(len(conditions)) if is_pattern(entry.name) else 1.0
        key = CATALOGUE[entry.name].strength
        power = candidate(entry.name).power
        below = abs(entry.parameters[key]) * (abs(scale) + 1.645 * sd) ** (1 / power)
        if entry.name not in found or below > found[entry.name].below:
            unit = CATALOGUE[entry.name].__dataclass_fields__[key].metadata["unit"]
            found[entry.name] = Bound(entry.name, key, unit, float(below))
    return [found[name] for name in sorted(found)]


def _signed(name: str) -> bool:
    f = CATALOGUE[name].__dataclass_fields__[CATALOGUE[name].strength]
    return bool(f.metadata["bounds"] and f.metadata["bounds"][0] < 0)


def _places(templates: Templates, conditions: Sequence[Shown], keys: Sequence[Key]) -> NDArray[np.int64]:
    """Where in the templates each statistic stands: on the recording of its kind whose level is nearest; -1 nowhere."""
    nearest: dict[str, str] = {}
    for c in conditions:
        kind = "flat" if c.kind in ("picture", "unknown") else c.kind
        same = [n for n, k in templates.kinds.items() if k == kind]
        if not same:
            continue
        level = c.level if c.level > 0 else 0.1
        byname = [n for n in same if n == c.name]
        nearest[c.name] = (byname or [min(same, key=lambda n: abs(np.log(max(templates.levels[n], 1e-6) / level)))])[0]
    index = {k: i for i, k in enumerate(templates.keys)}
    return np.array([index.get(Key(k.group, nearest.get(k.recording, ""), k.name), -1) for k in keys])


def build(folder: Path, *, jobs: int = 1, only: Sequence[str] | None = None) -> Templates:
    """Simulate every template; one small file an entry in `folder`, so that a build that was stopped goes on."""
    folder.mkdir(parents=True, exist_ok=True)
    case, model, null = standard_case(jobs)
    entries = []
    todo = [(n, p) for n in CATALOGUE if n in (only or CATALOGUE) for p in starts(n)]
    for name, parameters in tqdm(todo, "templates", unit="template"):
        label = "-".join([name, *(f"{k}={v:g}" for k, v in parameters.items() if k != CATALOGUE[name].strength)])
        weak = _kept(folder / f"{label}.npz", partial(simulated, case, model, null, name, parameters))
        entries.append(weak)
        strength = CATALOGUE[name].strength
        for times in TIMES:
            stronger = bounded(name, {**weak.parameters, strength: times * weak.parameters[strength]})
            if stronger != entries[-1].parameters:
                path = folder / f"{label}-x{times:g}.npz"
                entries.append(_kept(path, partial(severe, case, model, null, name, stronger, times)))
    levels = {c.name: c.level for c in case.conditions}
    kinds = {c.name: c.kind for c in case.conditions}
    return Templates(null.keys, null.noise, levels, kinds, tuple(entries))


def _kept(path: Path, make: Callable[[], Template]) -> Template:
    """The template in a file, made and written if there is none."""
    if not path.exists():
        entry = make()
        with whole_file(path) as beside, beside.open("wb") as file:
            np.savez(file, about=json.dumps(_about(entry)), shift=entry.shift)
    with np.load(path) as made:
        return Template(**json.loads(str(made["about"])), shift=made["shift"])


def _about(entry: Template) -> dict[str, Any]:
    return {"name": entry.name, "parameters": entry.parameters, "times": entry.times, "white": entry.white}


def save(templates: Templates, path: Path) -> None:
    """Write them whole, in half precision."""
    about: dict[str, Any] = {
        "keys": templates.keys,
        "levels": templates.levels,
        "kinds": templates.kinds,
        "entries": [_about(e) for e in templates.entries],
    }
    shift = np.clip([e.shift for e in templates.entries], -6e4, 6e4).astype(np.float16)
    with whole_file(path) as beside, beside.open("wb") as file:
        np.savez_compressed(file, about=json.dumps(about), shift=shift, noise=templates.noise.astype(np.float32))


def standard_case(jobs: int = 1, seed: int = SEED, count: int = 12) -> tuple[Case, SensorModel, Null]:
    """A unit of the standard model in the standard design, as a measurement, and what its model predicts."""
    from spikecam_env.gap.campaign import standard_design
    from spikecam_env.gap.world import planned

    model = SensorModel.preset(MODEL)
    conditions = planned(standard_design(), SHAPE, FRAMES)
    unit = model.draw_unit(SHAPE, seed)
    base = unit_as_base(unit)
    case = case_of(SHAPE, conditions, simulate(model, base, conditions, SHAPE, seed), seed, jobs)
    return case, model, model_null(case, model, count)


def unit_as_base(unit: Any) -> Any:
    """A drawn unit in the refit's terms."""
    from spikecam_env.gap.refit import BaseFit

    white = float(np.mean((1 / unit.electrons if unit.shot else 0.0) + unit.kappa**2))
    zero = np.zeros_like(unit.gain)
    return BaseFit(unit.gain, unit.dark, zero, zero, white, np.zeros((0, unit.gain.size)), unit.gain > 0)


def model_null(case: Case, model: SensorModel, count: int) -> Null:
    """What a model predicts for a case: twins of its unit, and drawn units for the pattern."""
    base = within(model, case.base)
    if case.scenes_only:  # too short for the closed law of jitter
        base = settled(model, base, case.base, [t.base for t in twins(case, model, base, range(50, 54)) if t.base])
    drawn = drawn_banks(model, case.base, case.conditions, case.shape, UNITS, case.seed)
    made = twins(case, model, base, range(count))
    banks = [{**t.bank, **d} for t, d in zip(made, drawn, strict=False)]
    null = null_of(banks, list(case.bank), [t.base for t in made if t.base])
    values = np.array([[d.get(k, np.nan) for k in null.keys] for d in drawn])
    of_pattern = np.array([k.group == "pattern" for k in null.keys])
    return replace(
        null,
        mean=np.where(of_pattern, values.mean(axis=0), null.mean),
        sd=np.where(of_pattern, values.std(axis=0, ddof=1), null.sd),
        twins=np.where(of_pattern, UNITS, count),
        weight=np.where(of_pattern, 1.0 / told(null.keys, case.conditions), 1.0),
    )


def told(keys: Sequence[Key], conditions: Sequence[Shown]) -> Array:
    """(S,) how many recordings of use fit tell the same statistic of the pattern: those in the dark, or in light."""
    lit = {c.name: c.kind != "dark" for c in conditions}
    fit = {c.name for c in conditions if c.use == "fit"}
    kind = [(k.name, lit[k.recording]) for k in keys]
    counts = Counter(one for one, k in zip(kind, keys, strict=True) if k.recording in fit)
    return np.array([max(counts[one], 1) for one in kind], dtype=np.float64)


def starts(name: str) -> list[dict[str, float]]:
    """Parameters to take templates at: the default strength, every combination of shapes."""
    if name in NOISE_OF_A_RESET:
        return []
    shapes = candidate(name).shapes
    default = {CATALOGUE[name].strength: CATALOGUE[name]().parameters()[CATALOGUE[name].strength]}
    extra = {k: CATALOGUE[name]().parameters()[k] for k in candidate(name).fitted}
    return [{**extra, **default, **dict(zip(shapes, values, strict=True))} for values in product(*shapes.values())]


def simulated(case: Case, model: SensorModel, null: Null, name: str, parameters: Mapping[str, float]) -> Template:
    """A candidate's template on a campaign, at a strength where it shows clearly."""
    strength = CATALOGUE[name].strength
    power = candidate(name).power
    now = bounded(name, parameters)
    shift = _shift(case, model, null, name, now)
    for _ in range(4):
        peak = float(np.abs(shift).max())
        if 0.5 * PEAK < peak < 2.5 * PEAK:
            break
        factor = np.clip((PEAK / max(peak - 3.0, 0.3)) ** (1 / power), 1e-3, 30.0)
        then = bounded(name, {**now, strength: now[strength] * factor})
        if then == now:
            break
        now = then
        shift = _shift(case, model, null, name, now)
    return Template(name, now, shift)


def severe(
    case: Case, model: SensorModel, null: Null, name: str, parameters: Mapping[str, float], times: float
) -> Template:
    """A candidate's template where the unit's own refit is led astray: its campaign as if it were a measurement."""
    there = with_effect(model, name, parameters)
    if is_pattern(name):
        return Template(name, dict(parameters), _shift(case, model, null, name, parameters), times)
    seed = case.seed * 1000 + 7
    made = simulate(there, within(there, case.base), case.conditions, case.shape, seed)
    seen = case.of(case.conditions, made)
    without = twins(seen, model, within(model, seen.base), range(REFITTED))
    mean = np.mean([values_of(t.bank, null.keys) for t in without], axis=0)
    shift = np.nan_to_num((values_of(seen.bank, null.keys) - mean) / null.noise)
    of_pattern = np.array([k.group == "pattern" for k in null.keys])
    white = float(min(case.base.white / seen.base.white, 1.0))
    return Template(name, dict(parameters), np.where(of_pattern, 0.0, shift), times, white)


def _shift(
    case: Case,
    model: SensorModel,
    null: Null,
    name: str,
    parameters: Mapping[str, float],
) -> Array:
    there = with_effect(model, name, parameters)
    if is_pattern(name):
        made = with_pattern(case, there, null, null.prediction)
    else:
        made = predict(case, there, within(there, case.base), null, 1)
    return np.nan_to_num((made.mean - null.mean) / null.noise)


def rebuild(out: tyro.conf.Positional[Path] = Path("out/templates")) -> None:
    """Simulate every candidate's template; those in the folder `out` are kept."""
    made = build(out)
    save(made, Path(__file__).with_name(FILE))
    print(f"{len(made.entries)} templates of {len(CANDIDATES)} candidates, {len(made.keys)} statistics")


if __name__ == "__main__":
    tyro.cli(rebuild)
