"""The score of a diagnosis, given its key.

Rules
- The names of a diagnosis are those of its `effects`; of a `class`, also its members (`class.members`, or where there
  is no such list the alternatives); of these and of a `parameter`, also the keys of `parameters`, which are off.
- A single effect has its right name in two cases.  The verdict is `named` (or `parameter`, see EQUIVALENT), and exactly
  that effect is named.  Or the verdict is `class`, the effect is among its members and the members are INSEPARABLE.
- Its family is right when one effect of its family (FAMILIES) is named and none of another.
- `unknown` where something of the catalogue is hidden is a false unknown.
- A pair: an effect counts as found when it, or an equivalent, is named, or is in such a class; a third is spurious when
  it stands for neither.
- Laws that are far from the law of a name change nothing of this: a name that leaves a remainder is a name.
- A tricky case has its own acceptable answers (`cases.Answer`).
- Intervals beside shares are 90 % binomial ones (Clopper-Pearson).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from scipy.stats import beta

Json: TypeAlias = dict[str, Any]

FAMILIES = {
    "optics": ("vignetting", "optical_blur"),
    "lamp": ("lamp_drift", "light_flicker"),
    "lag": ("photodiode_lag", "incomplete_reset"),
    "saturation": ("dead_time", "comparator_delay", "photo_response_nonlinearity", "synchronous_reset"),
    "coupling": ("crosstalk", "blooming", "ir_drop"),
    "dark": (
        "dark_current", "dark_current_spread", "dark_current_tail", "dark_current_drift", "hot_pixels",
        "random_telegraph_noise",
    ),
    "common noise": (
        "supply_ripple", "clock_feedthrough", "common_threshold_noise", "row_temporal_noise", "clock_jitter",
    ),
    "pixel noise": (
        "shot_noise", "reset_noise", "excess_threshold_noise", "frame_threshold_noise", "threshold_flicker_noise",
    ),
    "pattern": (
        "conversion_gain_spread", "capacitor_spread", "bias_voltage_spread", "row_fixed_pattern",
        "column_fixed_pattern", "dead_pixels",
    ),
    "read-out": ("readout_skew", "missed_spikes", "spurious_spikes", "afterpulsing"),
}  # fmt: skip
"""By the part that an engineer would look at."""

EQUIVALENT = (
    {"shot_noise", "reset_noise", "excess_threshold_noise"},
    {"conversion_gain_spread", "capacitor_spread", "bias_voltage_spread"},
)
"""At one V_d the data hold only the sum of the first (the slope of A_k), only the product of the others (the rate)."""

INSEPARABLE = (*EQUIVALENT, {"photo_response_nonlinearity", "ir_drop", "dead_time", "synchronous_reset"})
"""Sets whose `class` counts as right (DESIGN section 9).  x / (1 + tau x) and x (1 - tau x) differ by (tau x)^2: at the
strengths drawn, some 0.002 frames, by parts in a million, which no recording of this length holds.  Of charge between
crossing and read-out, half a frame's in the mean, a share f is a dead time of f / 2 frames that scatters by 0.3 f."""


NAMELESS = ("outside", "left_out")
"""Groups of cases in which no name of the catalogue is right, or none that is not withheld."""

SHOWN = 1.5
"""A gap of fewer floors has no share above the floor that is more than chance."""


@dataclass(frozen=True)
class Scored:
    """A case and its result.

    laws: of each hidden effect, the name of a far one, empty for the near.  answer: in short.
    spurious: names that stand for nothing hidden; off: those of them that are parameters only.
    degree: how much the named effects explain, as the diagnosis states; empty where it names none.
    """

    id: str
    group: str
    what: str
    truth: tuple[str, ...]
    laws: tuple[str, ...]
    times_limit: float
    answer: str
    right: bool
    family: bool
    found: tuple[str, ...]
    spurious: tuple[str, ...]
    off: tuple[str, ...]
    removed: float | None
    errors: tuple[Json, ...]
    seconds: float
    threads: int = 1
    error: str = ""
    degree: str = ""

    @property
    def is_far(self) -> bool:
        """Whether an effect acts by a far law."""
        return any(self.laws)


def family_of(name: str) -> str:
    """The family of an effect's name; of a name outside the table, the name."""
    return next((family for family, names in FAMILIES.items() if name in names), name)


def names_of(diagnosis: Json) -> tuple[str, ...]:
    """Effects that a diagnosis names, in its order; of a class its members, and those whose parameters are off."""
    effects, verdict = diagnosis.get("effects") or [], diagnosis.get("verdict")
    names = [effect["name"] for effect in effects]
    if verdict == "class":
        members = (diagnosis.get("class") or {}).get("members") or []
        names += members or [other["name"] for effect in effects for other in effect.get("alternatives") or []]
    if verdict in ("named", "class", "parameter"):
        names += list(diagnosis.get("parameters") or {})
    return tuple(dict.fromkeys(names))


def stands_for(name: str, truth: str) -> bool:
    """Whether naming `name` is as good as naming `truth`."""
    return name == truth or any({name, truth} <= same for same in EQUIVALENT)


def score_case(key: Json, result: Json) -> Scored:
    """Compare one diagnosis with its key.  result: as `trial` leaves it, with `diagnosis` or with `error`."""
    diagnosis = result.get("diagnosis") or {"verdict": "error", "effects": []}
    verdict, names, truth = diagnosis.get("verdict", ""), names_of(diagnosis), tuple(key["truth"])
    named = names if verdict in ("named", "class", "parameter") else ()
    hidden = {h["name"]: h for h in key["recipe"]["hidden"]}
    found = tuple(t for t in truth if any(stands_for(name, t) for name in named))
    excused = _class_of_truth(diagnosis, truth)
    spurious = tuple(name for name in named if not any(stands_for(name, t) for t in truth) and name not in excused)
    all_of_it = bool(named) and not spurious and len(found) == len(truth)
    effects = {effect["name"] for effect in diagnosis.get("effects") or []}
    right = _accepted(key["accept"], diagnosis) if key["accept"] else all_of_it
    return Scored(
        id=key["id"],
        group=key["group"],
        what=key["what"],
        truth=truth,
        laws=tuple(h["law"] for h in key["recipe"]["hidden"]),
        times_limit=float(next(iter(hidden.values()))["times_limit"]) if hidden else 0.0,
        answer=_label(verdict, names),
        right=right,
        family=right or (bool(named) and {family_of(n) for n in named} <= {family_of(t) for t in truth}),
        found=found,
        spurious=spurious,
        off=tuple(name for name in spurious if name in (diagnosis.get("parameters") or {}) and name not in effects),
        removed=_removed(diagnosis),
        errors=tuple(_parameter_errors(diagnosis, hidden)),
        seconds=float(result.get("seconds", 0.0)),
        threads=int(result.get("threads", 1)),
        error=str(result.get("error", "")),
        degree=str(diagnosis.get("degree") or ""),
    )


def _class_of_truth(diagnosis: Json, truth: Sequence[str]) -> set[str]:
    """Members of a class that holds a true name, and none that can be told from it."""
    members = set((diagnosis.get("class") or {}).get("members") or [])
    return members if members & set(truth) and any(members <= same for same in INSEPARABLE) else set()


def _accepted(answers: Sequence[Json], diagnosis: Json) -> bool:
    return any(_meets(answer, diagnosis) for answer in answers)


def _meets(answer: Json, diagnosis: Json) -> bool:
    if diagnosis.get("verdict") not in answer["verdicts"]:
        return False
    names = names_of(diagnosis)
    if not all(any(stands_for(n, wanted) for n in names) for wanted in answer["names"]):
        return False
    if answer["place"] and not _says_where_or_when(diagnosis):
        return False
    untestable = [entry["name"] for entry in diagnosis.get("not_testable") or []]
    return not answer["not_testable"] or answer["not_testable"] in untestable


def _says_where_or_when(diagnosis: Json) -> bool:
    described = [diagnosis.get("unknown") or {}, *(diagnosis.get("effects") or [])]
    return any(d.get(key) for d in described if isinstance(d, dict) for key in ("where", "region", "when"))


def _label(verdict: str, names: Sequence[str]) -> str:
    if verdict == "named":
        return " + ".join(sorted(names)) or "named nothing"
    if verdict in ("class", "parameter") and names:
        return f"{verdict}: " + " / ".join(sorted(names))
    return verdict or "no verdict"


def _removed(diagnosis: Json) -> float | None:
    """Share of the gap that is removed, where the recordings held out have one to remove (see `SHOWN`)."""
    gap = diagnosis.get("gap") or {}
    if gap.get("removed") is None or gap["before"] <= SHOWN * gap["floor"]:
        return None
    return float(gap["removed"])


def _parameter_errors(diagnosis: Json, hidden: dict[str, Json]) -> Iterable[Json]:
    """For each effect named by its own name: error and stated uncertainty of each parameter that it states."""
    for effect in diagnosis.get("effects") or []:
        truth = hidden.get(effect["name"])
        if truth is None:
            continue
        for name, stated in (effect.get("parameters") or {}).items():
            if name in truth["parameters"] and stated.get("value") is not None:
                true, value, sd = truth["parameters"][name], float(stated["value"]), stated.get("sd")
                yield {
                    "effect": effect["name"], "parameter": name, "true": true, "value": value,
                    "sd": None if sd is None else float(sd), "interval": stated.get("interval"),
                }  # fmt: skip


# ---- figures


@dataclass(frozen=True)
class Figure:
    """A figure of the acceptance: value, requirement, number of cases.  share: with its 90 % interval."""

    item: str
    what: str
    value: float
    asked: str
    cases: int
    low: float | None = None
    high: float | None = None

    @property
    def met(self) -> bool:
        """Whether the value meets the requirement."""
        sign, number = self.asked.split()[0], self.asked.split()[1]
        if "-" in number:
            low, high = (float(part) for part in number.split("-"))
            return low <= self.value <= high
        return self.value >= float(number) if sign == ">=" else self.value <= float(number)


def binomial_90(hits: int, trials: int) -> tuple[float, float]:
    """Clopper-Pearson interval of a share."""
    low = 0.0 if hits == 0 else float(beta.ppf(0.05, hits, trials - hits + 1))
    high = 1.0 if hits == trials else float(beta.ppf(0.95, hits + 1, trials - hits))
    return low, high


def figures(scored: Sequence[Scored]) -> list[Figure]:
    """Every figure of the acceptance that these cases bear on."""
    made: list[Figure] = []

    def share(item: str, what: str, asked: str, cases: Sequence[Scored], hits: Sequence[bool]) -> None:
        if cases:
            count = sum(hits)
            made.append(Figure(item, what, count / len(cases), asked, len(cases), *binomial_90(count, len(cases))))

    def group(*names: str) -> list[Scored]:
        return [s for s in scored if s.group in names]

    none, strong, weak, base = group("none"), group("strong"), group("weak"), group("base")
    pairs, tricky, severe = group("pair"), group("tricky"), group("severe")
    catalogue = group("strong", "severe", "weak", "pair", "strong_pair", "triple")
    share("1", "false alarms, nothing hidden", "<= 0.03", none, [s.answer != "none" for s in none])
    for far, law in ((False, "near laws"), (True, "far laws")):
        for title, asked, cases in (
            ("strong", ">= 0.90", strong), ("severe", ">= 0.90", severe), ("near the limit", ">= 0.75", weak),
        ):  # fmt: skip
            some = [s for s in cases if s.is_far == far]
            share("2", f"{title}, {law}: right name", asked, some, [s.right for s in some])
    share("2", "strong: right family", ">= 0.97", strong, [s.family for s in strong])
    share("2", "base effects from `ideal`: right name", ">= 0.90", base, [_base_right(s) for s in base])
    for name, title, asked in (
        ("outside", "outside the catalogue", ">= 0.90"), ("left_out", "name withheld", ">= 0.80"),
    ):  # fmt: skip
        cases = group(name)
        share("3", f"{title}: unknown", asked, cases, [s.right for s in cases])
    share("3", "false unknown, catalogue cases", "<= 0.10", catalogue, [s.answer == "unknown" for s in catalogue])
    share("4", "pairs: at least one right", ">= 0.95", pairs, [len(s.found) >= 1 for s in pairs])
    share("4", "pairs: both right", ">= 0.75", pairs, [len(s.found) == len(s.truth) for s in pairs])
    share("4", "pairs: a spurious third", "<= 0.10", pairs, [bool(s.spurious) for s in pairs])
    for name, title in (("strong_pair", "pairs of strong effects"), ("triple", "triples")):
        cases = group(name)
        share("4", f"{title}: all right", ">= 0.90", cases, [len(s.found) == len(s.truth) for s in cases])
        share("4", f"{title}: a spurious effect or parameter", "<= 0.05", cases, [bool(s.spurious) for s in cases])
    made += _gap_figures([s for s in strong + severe + weak if s.right and s.removed is not None and not s.is_far])
    near = [s for s in catalogue if (s.right or s.found) and not s.is_far]
    made += _parameter_figures([e for s in near for e in s.errors])
    share("6", "tricky: right verdict", ">= 0.80", tricky, [s.right for s in tricky])
    for n in sorted({s.threads for s in scored}):
        made += _time_figures([s for s in scored if s.threads == n], n)
    return made


def _time_figures(scored: Sequence[Scored], threads: int) -> list[Figure]:
    seconds = [s.seconds for s in scored]
    return [
        Figure("7", f"median diagnosis [s], threads: {threads}", float(np.median(seconds)), "<= 120", len(scored)),
        Figure("7", f"slowest diagnosis [s], threads: {threads}", max(seconds), "<= 360", len(scored)),
    ]


def _base_right(scored: Scored) -> bool:
    """The ladder is right when it names something and nothing that is not there."""
    return bool(scored.found) and not scored.spurious if scored.what == "ladder" else scored.right


def _gap_figures(right: Sequence[Scored]) -> list[Figure]:
    if not right:
        return []
    removed = np.array([s.removed for s in right], float)
    what = "gap removed, right names with one held out"
    return [
        Figure("5", f"{what}: median", float(np.median(removed)), ">= 0.95", len(right)),
        Figure("5", f"{what}: 10th percentile", float(np.quantile(removed, 0.1)), ">= 0.8", len(right)),
    ]


def _parameter_figures(errors: Sequence[Json]) -> list[Figure]:
    made = []
    stated = [e for e in errors if e["sd"]]
    if errors:
        close = [_is_close(e) for e in errors]
        low, high = binomial_90(sum(close), len(close))
        what = "parameters within 15 % or twice their sd"
        made.append(Figure("5", what, sum(close) / len(close), ">= 0.9", len(close), low, high))
    if stated:
        covered = [is_covered(e) for e in stated]
        low, high = binomial_90(sum(covered), len(covered))
        what = "90 % intervals cover"
        made.append(Figure("5", what, sum(covered) / len(covered), "in 0.80-0.97", len(covered), low, high))
    return made


def is_covered(e: Json) -> bool:
    """Whether the truth is in the interval that is stated (of a phase, through the end of its period where low is above
    high); by its standard deviation where a record has no interval, as earlier ones have none."""
    half = 1.645 * e["sd"]
    low, high = e.get("interval") or (e["value"] - half, e["value"] + half)
    return low <= e["true"] <= high if low <= high else e["true"] >= low or e["true"] <= high


def _is_close(e: Json) -> bool:
    error = abs(e["value"] - e["true"])
    return error <= 0.15 * abs(e["true"]) or (e["sd"] is not None and error <= 2.0 * e["sd"])


def by_category(scored: Sequence[Scored]) -> list[Json]:
    """One row a group and kind of law: right of how many, wrong names, and the time.

    A case with an effect by a far law is `far`.  spurious effects, spurious parameters: counted one by one.
    false alarms: answers other than `none` where nothing is hidden.  Where no name is right, no law is near or far.
    """
    rows = []
    for group in dict.fromkeys(s.group for s in scored):
        for far in (False, True):
            some = [s for s in scored if s.group == group and s.is_far == far]
            if not some:
                continue
            right = sum(s.right for s in some)
            low, high = binomial_90(right, len(some))
            seconds = [s.seconds for s in some]
            names = group not in NAMELESS and any(s.laws for s in some)
            rows.append({
                "category": group,
                "law": ("far" if far else "near") if names else "",
                "right": f"{right}/{len(some)}",
                "90 %": f"{100 * low:.0f} - {100 * high:.0f} %",
                "all found": f"{sum(len(s.found) == len(s.truth) for s in some)}/{len(some)}" if names else "",
                "spurious effects": sum(len(s.spurious) - len(s.off) for s in some),
                "spurious parameters": sum(len(s.off) for s in some),
                "false alarms": sum(s.answer != "none" for s in some) if group == "none" else "",
                "median [s]": f"{np.median(seconds):.0f}",
                "slowest [s]": f"{max(seconds):.0f}",
            })  # fmt: skip
    return rows


def by_degree(scored: Sequence[Scored]) -> list[Json]:
    """One row a degree: how often it is stated, every name is true, and no hidden effect of the catalogue is missing.

    Of `unknown`, which names nothing, names are true where nothing of the catalogue is hidden.
    """
    rows = []
    for degree in dict.fromkeys(s.degree for s in sorted(scored, key=lambda s: s.degree) if s.degree):
        some = [s for s in scored if s.degree == degree]
        named = degree != "unknown"
        true = sum(not s.spurious and s.group not in NAMELESS if named else s.group in NAMELESS for s in some)
        low, high = binomial_90(true, len(some))
        rows.append({
            "degree": degree,
            "cases": len(some),
            "names true": f"{true}/{len(some)}",
            "90 %": f"{100 * low:.0f} - {100 * high:.0f} %",
            "and all of them": f"{sum(s.right for s in some)}/{len(some)}",
        })  # fmt: skip
    return rows


def by_effect(scored: Sequence[Scored]) -> list[Json]:
    """One row an effect: how often it was seen and named, strong and near its limit."""
    singles = [s for s in scored if s.group in ("strong", "severe", "weak", "base", "outside")]
    rows = []
    for name in sorted({s.what for s in singles}):
        cases = [s for s in singles if s.what == name]
        row: Json = {"effect": name}
        for group in ("strong", "severe", "weak", "base", "outside"):
            some = [s for s in cases if s.group == group]
            if some:
                row[group] = f"{sum(s.right for s in some)}/{len(some)}"
        row["strength/limit"] = ", ".join(f"{s.times_limit:.1f}" for s in cases)
        row["answers"] = ", ".join(s.answer for s in cases)
        rows.append(row)
    return rows
