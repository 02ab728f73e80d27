"""Cases of the trial: the hidden mechanisms, the labels for the diagnosis, the right answers.

Groups of no or one effect: `none`, `strong` (3 to 10 times the limit), `weak` (1 to 3), `severe` (30 to 100).  Groups
of special cases: `base` (the base model's own effects, told `ideal`), `outside`, `left_out` (a catalogue effect, its
name withheld), `tricky`.  Groups of several effects: `pair` (3 to 10 each), `strong_pair` and `triple` (5 to 100 each,
of different families).

The sets `quick` and `full` hide effects by their near laws only; `laws` by near and far ones.  `small` is as `laws`, of
small cameras that are recorded for less long: an eighth of the data, and effects as many limits of that strong.  No two
parts or sets share a seed; `tune` shares no outside mechanism with the others.  Cases of
`report` have been looked at since, to find faults; `verify` is as `report`, of other seeds.
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from tests.hidden_world.catalogue import BASE_EFFECTS, CATALOGUE
from tests.hidden_world.mechanism import Hidden, Mechanism, draw, limits, with_less_data
from tests.hidden_world.outside import OUTSIDE, REPORT, TUNE
from tests.hidden_world.score import family_of
from tests.hidden_world.world import MECHANISMS, Recipe, stream

SETS = ("quick", "full", "laws", "small")
PARTS = ("tune", "report", "verify")
GROUPS = (
    "none", "strong", "weak", "base", "outside", "left_out", "pair", "tricky", "severe", "strong_pair", "triple",
)  # fmt: skip
BASE_CAMERAS = ("scsim", "physical")


@dataclass(frozen=True)
class Answer:
    """A predicate on a diagnosis: one of these verdicts, all these names among its effects, and further conditions.

    place: an effect or the description says where (`where`, `region`) or when (`when`).
    not_testable: a name listed so.
    """

    verdicts: tuple[str, ...]
    names: tuple[str, ...] = ()
    place: bool = False
    not_testable: str = ""


@dataclass(frozen=True)
class Case:
    """One campaign and its key.

    id: opaque, of all that the case is: another case has another.  truth: names hidden.  accept: any of these is
    right; where empty, the truth decides.
    """

    id: str
    group: str
    what: str
    recipe: Recipe
    model: str
    truth: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    accept: tuple[Answer, ...] = ()


@dataclass(frozen=True)
class Counts:
    """How many of each; per mechanism where it says so."""

    none: int
    strong_each: int
    weak_each: int
    base_each: int
    outside_each: int
    left_out_each: int
    pairs: int
    clock_pairs: int
    tricky_each: int
    severe_each: int


COUNTS = {"full": Counts(60, 3, 2, 2, 3, 1, 30, 6, 2, 1), "quick": Counts(6, 1, 1, 1, 1, 1, 4, 1, 1, 1)}
QUICK_SHARE = 4
"""Of the groups that go through mechanisms, `quick` takes every fourth."""

MILLION = {
    ("quick", "tune"): 1,
    ("quick", "report"): 2,
    ("full", "tune"): 3,
    ("full", "report"): 4,
    ("quick", "verify"): 11,
    ("full", "verify"): 12,
    ("laws", "tune"): 21,
    ("laws", "report"): 22,
    ("laws", "verify"): 23,
    ("small", "tune"): 31,
    ("small", "report"): 32,
    ("small", "verify"): 46,
}
"""Where the seeds of a set and part begin, in millions; `verify` goes on to others once its cases were looked at,
or the code has changed."""

BENDS = ("dead_time", "photo_response_nonlinearity", "synchronous_reset", "ir_drop")
"""At the strengths drawn all take x^2 off the rate, see `score.INSEPARABLE`."""

WITHHELD_TOO = {
    **{name: tuple(other for other in BENDS if other != name) for name in BENDS},
    "hot_pixels": ("dark_current_tail",),
}
"""Names that these recordings do not tell apart; they are withheld with their twin."""

NOT_LEFT_OUT = ("excess_threshold_noise",)
"""Without its name it is a wrong parameter (reset_noise), not something unknown."""

SAME_TO_THE_EYE = (
    {
        "dead_time",
        "comparator_delay",
        "photo_response_nonlinearity",
        "ir_drop",
        "incomplete_reset",
        "synchronous_reset",
    },
    {"hot_pixels", "dark_current_tail", "random_telegraph_noise"},
    {"excess_threshold_noise", "frame_threshold_noise", "threshold_flicker_noise"},
    {"common_threshold_noise", "clock_jitter"},
    {"light_flicker", "supply_ripple"},
)
"""Pairs are not drawn from within one of these: the second would hide in the error of the first."""


SINGLES = {"strong": (3.0, 10.0), "weak": (1.0, 3.0), "severe": (30.0, 100.0)}
"""Groups of one effect, and its strength over the detection limit."""

SMALL_SHAPE, SMALL_FRAMES = (32, 32), 4000
"""A recording of the set `small`: an eighth of the pixel-steps of the others, and less time to diagnose."""

TOGETHER = (5.0, 100.0)
"""Strength of each effect of a strong pair or a triple, over its detection limit; see `_top`."""


def cases(which: str, part: str) -> list[Case]:
    """All cases of a set and part, group by group."""
    seeds = itertools.count(1_000_000 * MILLION[which, part])
    if which == "small":
        return [_smaller(case) for case in _by_laws(part, seeds)]
    return _by_laws(part, seeds) if which == "laws" else _by_near_laws(which, part, seeds)


def _by_laws(part: str, seeds: Iterator[int]) -> list[Case]:
    """Each mechanism by its near law and by a far one; strong pairs and triples, each effect by either."""
    both, outside = ("near", "far"), TUNE if part == "tune" else REPORT
    made = [_nothing(next(seeds)) for _ in range(30)]
    for group, (low, high) in SINGLES.items():
        for name, law in itertools.product(CATALOGUE, both):
            top = _top(name, low, high) if group == "severe" else high
            made += [_single(group, name, next(seeds), low, top, law)] if _has(name, law) else []
    made += [_base(name, next(seeds), law) for name in BASE_EFFECTS for law in both if _has(name, law)]
    made += [_single("outside", name, next(seeds), 4, 10) for name in outside for _ in range(2)]
    made += _together("strong_pair", 2, 36, seeds)
    made += _together("triple", 3, 12, seeds)
    return made


def _by_near_laws(which: str, part: str, seeds: Iterator[int]) -> list[Case]:
    counts = COUNTS[which]
    every = QUICK_SHARE if which == "quick" else 1
    shift = 0 if part == "tune" else 1
    known = list(CATALOGUE)[shift % every :: every]
    outside = list(TUNE if part == "tune" else REPORT)[:: max(1, every // 2)]
    left_out = [name for name in known if name not in NOT_LEFT_OUT]
    made: list[Case] = []
    made += [_nothing(next(seeds)) for _ in range(counts.none)]
    made += [
        _single("strong", name, next(seeds), *SINGLES["strong"]) for name in known for _ in range(counts.strong_each)
    ]
    made += [_single("weak", name, next(seeds), *SINGLES["weak"]) for name in known for _ in range(counts.weak_each)]
    made += [_base(name, next(seeds)) for name in list(BASE_EFFECTS)[::every] for _ in range(counts.base_each)]
    made += [_ladder(next(seeds)) for _ in range(counts.base_each)]
    made += [_single("outside", name, next(seeds), 4, 10) for name in outside for _ in range(counts.outside_each)]
    made += [_left_out(name, next(seeds)) for name in left_out for _ in range(counts.left_out_each)]
    made += [_pair(next(seeds)) for _ in range(counts.pairs)]
    made += [_clock_by_rows(next(seeds)) for _ in range(counts.clock_pairs)]
    made += [trick(next(seeds)) for trick in TRICKY[:: max(1, every // 2)] for _ in range(counts.tricky_each)]
    made += [
        _single("severe", name, next(seeds), *SINGLES["severe"]) for name in known for _ in range(counts.severe_each)
    ]
    return made


def _case(group: str, what: str, recipe: Recipe, **rest: object) -> Case:
    model = rest.pop("model", recipe.base)
    return _with_id(Case("", group, what, recipe, model, **rest))  # type: ignore[arg-type]


def _with_id(case: Case) -> Case:
    """The case with the id of all that it is."""
    content = json.dumps(asdict(replace(case, id="")), sort_keys=True)
    return replace(case, id=hashlib.sha256(content.encode()).hexdigest()[:12])


def _smaller(case: Case) -> Case:
    """The same case in a small camera, its effects as many of that camera's detection limits strong."""
    recipe = replace(case.recipe, shape=SMALL_SHAPE, frames=SMALL_FRAMES)
    share = recipe.pixel_steps / case.recipe.pixel_steps
    hidden = tuple(with_less_data(h, share) for h in recipe.hidden)
    return _with_id(replace(case, recipe=replace(recipe, hidden=hidden)))


def _camera_kind(name: str, rng: np.random.Generator) -> str:
    """Noise beside 6.36 mV of reset noise that nobody knows cannot be told from it; kT/C is known."""
    return "physical" if name == "excess_threshold_noise" else str(rng.choice(BASE_CAMERAS))


def _top(name: str, low: float, high: float) -> float:
    """Up to `high` limits: no further than the mechanism goes, but as far as it goes in a poor camera."""
    limit = limits()[name]
    return max(min(high, max(low, limit.furthest)), limit.poor / limit.limit)


def _has(name: str, law: str) -> bool:
    return law == "near" or bool(MECHANISMS[name].far)


def _law(name: str, law: str, rng: np.random.Generator) -> str:
    """`near`; `far`: one of them; `either`: near in every other case."""
    far = MECHANISMS[name].far
    if law == "near" or not far or (law == "either" and rng.random() < 0.5):
        return ""
    return str(rng.choice([other.name for other in far]))


def _drawn(name: str, low: float, high: float, rng: np.random.Generator, law: str = "near") -> Hidden:
    mechanism: Mechanism = MECHANISMS[name]
    by = _law(name, law, rng)
    return draw(mechanism, float(np.exp(rng.uniform(np.log(low), np.log(high)))), rng, by)


def _nothing(seed: int) -> Case:
    base = str(stream(seed, "case").choice(BASE_CAMERAS))
    return _case("none", "nothing", Recipe(seed, base), accept=(Answer(("none",)),))


def _single(group: str, name: str, seed: int, low: float, high: float, law: str = "near") -> Case:
    rng = stream(seed, "case")
    base = _camera_kind(name, rng)
    recipe = Recipe(seed, base, (_drawn(name, low, high, rng, law),))
    if name not in OUTSIDE:
        return _case(group, name, recipe, truth=(name,))
    verdicts = ("unknown", "data") if name == "repeated_frames" else ("unknown",)
    return _case(group, name, recipe, truth=(name,), accept=(Answer(verdicts),))


def _base(name: str, seed: int, law: str = "near") -> Case:
    """An effect of the base model alone, told that the camera is ideal; a spread of the dark needs a dark current."""
    rng = stream(seed, "case")
    hidden = [_drawn(name, 3, 10, rng, law)]
    if name == "dark_current_spread":
        hidden.insert(0, Hidden("dark_current", {"mean_pA": 4.0 * hidden[0].parameters["sigma_pA"]}, 10.0))
    return _case("base", name, Recipe(seed, "ideal", tuple(hidden)), truth=tuple(h.name for h in hidden))


def _ladder(seed: int) -> Case:
    """All of `physical` at once, told that the camera is ideal."""
    return _case("base", "ladder", Recipe(seed, "physical"), model="ideal", truth=tuple(BASE_EFFECTS))


def _left_out(name: str, seed: int) -> Case:
    rng = stream(seed, "case")
    recipe = Recipe(seed, _camera_kind(name, rng), (_drawn(name, 3, 10, rng),))
    exclude = (name, *WITHHELD_TOO.get(name, ()))
    return _case("left_out", name, recipe, truth=(name,), exclude=exclude, accept=(Answer(("unknown",)),))


def _pair(seed: int) -> Case:
    rng = stream(seed, "case")
    while True:
        first, second = (str(name) for name in rng.choice(list(CATALOGUE), 2, replace=False))
        if not any({first, second} <= same for same in SAME_TO_THE_EYE):
            break
    base = "physical" if "excess_threshold_noise" in (first, second) else str(rng.choice(BASE_CAMERAS))
    recipe = Recipe(seed, base, (_drawn(first, 3, 10, rng), _drawn(second, 3, 10, rng)))
    return _case("pair", f"{first} + {second}", recipe, truth=(first, second))


def _clock_by_rows(seed: int) -> Case:
    """One clock, and rows that see it each at another moment of their frame: they are read over most of it."""
    rng = stream(seed, "case")
    span = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.6, 1.0))
    skew = Hidden("readout_skew", {"span": span}, abs(span) / limits()["readout_skew"].limit)
    recipe = Recipe(seed, str(rng.choice(BASE_CAMERAS)), (_drawn("clock_feedthrough", 3, 10, rng), skew))
    return _case("pair", "clock_feedthrough + readout_skew", recipe, truth=("clock_feedthrough", "readout_skew"))


def _together(group: str, size: int, count: int, seeds: Iterator[int]) -> list[Case]:
    """So many cases of so many strong effects, of different families; no two cases hide the same ones."""
    made: dict[tuple[str, ...], Case] = {}
    while len(made) < count:
        seed = next(seeds)
        rng = stream(seed, "case")
        names = _of_different_families(size, rng)
        base = "physical" if "excess_threshold_noise" in names else str(rng.choice(BASE_CAMERAS))
        hidden = tuple(_drawn(name, TOGETHER[0], _top(name, *TOGETHER), rng, "either") for name in names)
        case = _case(group, " + ".join(names), Recipe(seed, base, hidden), truth=names)
        made.setdefault(tuple(sorted(names)), case)
    return list(made.values())


def _of_different_families(size: int, rng: np.random.Generator) -> tuple[str, ...]:
    """Mechanisms that can be so strong, none that would hide in the error of another."""
    names: list[str] = []
    for name in (str(n) for n in rng.permutation([n for n in CATALOGUE if limits()[n].furthest > TOGETHER[0]])):
        hides = any({name, other} <= same for other in names for same in SAME_TO_THE_EYE)
        if not hides and family_of(name) not in {family_of(other) for other in names}:
            names.append(name)
        if len(names) == size:
            break
    return tuple(names)


# ---- tricky


def _label_trick(trick: str, verdicts: Sequence[str]) -> Callable[[int], Case]:
    def make(seed: int) -> Case:
        base = str(stream(seed, "case").choice(BASE_CAMERAS))
        accept = tuple(Answer((v,), place=v == "unknown") for v in verdicts)
        return _case("tricky", trick, Recipe(seed, base, trick=trick), accept=accept)

    return make


def _lamp(name: str) -> Callable[[int], Case]:
    def make(seed: int) -> Case:
        rng = stream(seed, "case")
        recipe = Recipe(seed, str(rng.choice(BASE_CAMERAS)), (_drawn(name, 5, 15, rng),))
        return _case("tricky", f"lamp: {name}", recipe, truth=(name,), accept=(Answer(("named",), (name,)),))

    return make


def _noise_times_three(seed: int) -> Case:
    """Of `scsim`: three times kT/C is a fifth of the shot noise, which units differ by."""
    base = "scsim"
    accept = (Answer(("parameter",), ("reset_noise",)), Answer(("named",), ("excess_threshold_noise",)))
    return _case("tricky", "threshold noise x 3", Recipe(seed, base, reset_noise_times=3.0), accept=accept)


def _in_a_corner(seed: int) -> Case:
    rng = stream(seed, "case")
    name = str(rng.choice(["dead_time", "spurious_spikes", "missed_spikes", "afterpulsing"]))
    drawn = _drawn(name, 15, 40, rng)
    r, c = ((0, 20) if rng.random() < 0.5 else (44, 64) for _ in range(2))
    hidden = Hidden(drawn.name, drawn.parameters, drawn.times_limit, rows=r, columns=c)
    accept = (Answer(("unknown",)), Answer(("named",), (name,), place=True))
    recipe = Recipe(seed, str(rng.choice(BASE_CAMERAS)), (hidden,))
    return _case("tricky", f"in a corner: {name}", recipe, truth=(name,), accept=accept)


def _from_half_way(seed: int) -> Case:
    rng = stream(seed, "case")
    name = str(rng.choice(["light_flicker", "spurious_spikes", "missed_spikes", "dead_time"]))
    drawn = _drawn(name, 10, 30, rng)
    hidden = Hidden(drawn.name, drawn.parameters, drawn.times_limit, since=0.5)
    accept = (Answer(("unknown",)), Answer(("named",), (name,), place=True))
    recipe = Recipe(seed, str(rng.choice(BASE_CAMERAS)), (hidden,))
    return _case("tricky", f"from half-way: {name}", recipe, truth=(name,), accept=accept)


def _skew_unseen(seed: int) -> Case:
    rng = stream(seed, "case")
    recipe = Recipe(seed, str(rng.choice(BASE_CAMERAS)), (_drawn("readout_skew", 5, 15, rng),), trick="no_motion")
    accept = (Answer(("none",), not_testable="readout_skew"),)
    return _case("tricky", "skew without motion", recipe, truth=("readout_skew",), accept=accept)


def _one_hot_pixel(seed: int) -> Case:
    rng = stream(seed, "case")
    hidden = Hidden("hot_pixels", {"fraction": 1 / 4096, "mean_pA": float(rng.uniform(3, 6))}, 1 / 4096 / 5e-4)
    accept = (Answer(("none",)), Answer(("named",), ("hot_pixels",)))
    recipe = Recipe(seed, str(rng.choice(BASE_CAMERAS)), (hidden,))
    return _case("tricky", "one hot pixel", recipe, truth=("hot_pixels",), accept=accept)


def _cancelling(seed: int) -> Case:
    """T = 1/x + tau against x (1 + tau x): the same mean rate to first order in tau, of a tenth of a frame."""
    rng = stream(seed, "case")
    tau_us = float(rng.uniform(1.2, 2.5))
    both = (
        Hidden("dead_time", {"tau_us": tau_us}, tau_us / limits()["dead_time"].limit),
        Hidden("photo_response_nonlinearity", {"beta": -tau_us / 25.0}, 0.0),
    )
    names = tuple(h.name for h in both)
    accept = (Answer(("named", "class"), names),)
    recipe = Recipe(seed, str(rng.choice(BASE_CAMERAS)), both)
    return _case("tricky", "dead time against non-linearity", recipe, truth=names, accept=accept)


TRICKY = (
    _label_trick("wrong_label", ("data",)),
    _label_trick("swapped", ("data",)),
    _label_trick("dropped_frames", ("data", "unknown")),
    _label_trick("reversed_rows", ("data",)),
    _lamp("lamp_drift"),
    _lamp("light_flicker"),
    _noise_times_three,
    _in_a_corner,
    _from_half_way,
    _skew_unseen,
    _one_hot_pixel,
    _cancelling,
)
