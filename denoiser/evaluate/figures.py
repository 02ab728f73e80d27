"""The figures that the project promised, and those of the paper, beside what a table found.

Each has a name, what is wanted, what was found, and whether it holds; None where the table lacks a row or column.
The paper's: Hu et al., tables 1 and 3 (27.70 / 0.698 noisy, 29.61 / 0.847 DnSS; baselines 28.67, 29.13, 29.11).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from denoiser.evaluate.judge import COLUMNS, PLANE, RowResult
from denoiser.evaluate.table_summary import best_picture

Figure = dict[str, Any]
Group = dict[str, Any]

OWN = (10.0, 0.0)
"""Mean interval [frames] and speed (the scenes' own) that the promises of table 1 are about; in other light and motion
the promise is to be no worse than noisy."""
PAPER_GAIN_DB, PAPER_GAIN_SSIM = 1.9, 0.15
PAPER_MUS_DB, PAPER_REFINE_DB = 0.5, 0.45
LEARNED = ("spk2img-clean", "spk2img-noisy")
SPIKES_OF_BEST = {"spk2img-clean": 0.7, "spk2img-noisy": 0.0}
"""Least mean gain of `best` spikes over noisy [dB]."""
PAPER_NIQE = {"paper-mus": -0.31}
"""Of DnSS over noisy: 3.76 and 4.07, table 2."""
PAPER_MUS_NIQE = {"paper": -0.04, "baseline": -0.01}
PAPER_REFINE_NIQE = {"held": -0.35, "mus": -0.38}
"""Table 4: 4.15 without both, 4.14 with MUS, 3.80 with the refine module, 3.76 with both."""
GAP = 0.85
PLANES_DB, PLANES_SSIM = 34.0, 0.970
"""Mean of `best`'s rate planes on PHM_N, at mean interval 10."""
MOST_BIAS, MOST_FLICKER, LEAST_TEXTURE = 0.005, 1.1, 0.75
STILL_DB = 40.0
"""Of the mean of 400 frames, with a calibration."""
GAIN_DB, STILL_GAIN_DB = 1.2, 1.5
"""Of the rate planes over those of earlier weights, on PHM_N and at rest."""


def figures(table: str, groups: Sequence[Group], records: Sequence[RowResult]) -> list[Figure]:
    """The figures that a table can show."""
    makers: dict[str, list[Callable[[Group, Sequence[RowResult]], list[Figure]]]] = {
        "table1": [_never_below],
        "table3": [_ablation],
        "table2": [_naturalness],
        "table4": [_natural_ablation],
        "still": [_at_rest, _planes_at_rest],
    }
    found = []
    for group in groups:
        own = [r for r in records if (r.interval, r.speed) == (group["interval"], group["speed"])]
        at_own = table == "table1" and (group["interval"], group["speed"]) == OWN
        for make in [*(_AT_OWN if at_own else ()), *makers.get(table, [])]:
            found += [{"interval": group["interval"], "speed": group["speed"], **f} for f in make(group, own)]
    return found


def _figure(what: str, wanted: str, found: float | None, holds: bool | None, digits: int = 2) -> Figure:
    return {"what": what, "wanted": wanted, "found": None if found is None else round(found, digits), "holds": holds}


def _gain(group: Group, row: str, column: str, name: str = "gain_db") -> float | None:
    return _score(group, row, column).get(name)


def _score(group: Group, row: str, column: str) -> dict[str, Any]:
    found: dict[str, Any] = group["rows"].get(row, {}).get("pictures", {}).get(column, {})
    return found


def _gains_of_paper(group: Group, _: Sequence[RowResult]) -> list[Figure]:
    found = []
    for column in LEARNED:
        for row in ("paper-mus", "paper", "best"):
            db, ssim = _gain(group, row, column), _gain(group, row, column, "gain_ssim")
            where = f"{row}, {COLUMNS[column]}: over noisy"
            wanted_db, wanted_ssim = f"paper {PAPER_GAIN_DB:+}", f"paper {PAPER_GAIN_SSIM:+}"
            found.append(_figure(f"{where} [dB]", wanted_db, db, _least(db, PAPER_GAIN_DB)))
            found.append(_figure(f"{where}, SSIM", wanted_ssim, ssim, _least(ssim, PAPER_GAIN_SSIM), 3))
    return found


def _spikes_of_best(group: Group, records: Sequence[RowResult]) -> list[Figure]:
    found = []
    for column, least in SPIKES_OF_BEST.items():
        gain = _gain(group, "best", column)
        what = f"best, {COLUMNS[column]}: mean over noisy [dB]"
        found.append(_figure(what, f">= {least}", gain, _least(gain, least)))
    for column in (*LEARNED, "tfi"):
        worst = _worst(records, "best", column)
        what = f"best, {COLUMNS[column]}: least over noisy of any scene [dB]"
        found.append(_figure(what, "> 0", worst, None if worst is None else worst > 0))
    for column in ("tfp21", "tfp41"):
        gap = _score(group, "best", column).get("gap_closed")
        found.append(_figure(f"best, {COLUMNS[column]}: share of the gap closed", f">= {GAP}", gap, _least(gap, GAP)))
    return found


def _spikes_of_paper(group: Group, _: Sequence[RowResult]) -> list[Figure]:
    gains = {column: _gain(group, "paper", column) for column in COLUMNS}
    return [
        _figure(f"paper, {COLUMNS[column]}: mean over noisy [dB]", "> 0", gain, None if gain is None else gain > 0)
        for column, gain in gains.items()
    ]


def _planes(group: Group, _: Sequence[RowResult]) -> list[Figure]:
    best = group["rows"].get("best", {})
    db, ssim = (best.get("mean_plane", {}).get(name) for name in ("db", "ssim"))
    return [
        _figure("best, rate planes: mean [dB]", f">= {PLANES_DB}", db, _least(db, PLANES_DB)),
        _figure("best, rate planes: mean SSIM", f">= {PLANES_SSIM}", ssim, _least(ssim, PLANES_SSIM), 3),
        *_over_before(group, "mean_plane", GAIN_DB),
        *_faithful(best),
    ]


def _faithful(best: dict[str, Any]) -> list[Figure]:
    size, flicker, texture = best.get("bias"), best.get("flicker"), best.get("texture")
    return [
        _figure("best: bias", f"within {MOST_BIAS}", size, None if size is None else abs(size) <= MOST_BIAS, 4),
        _figure(
            "best: frame-to-frame error across passes / within", f"<= {MOST_FLICKER}", flicker,
            None if flicker is None else flicker <= MOST_FLICKER,
        ),
        _figure("best: slope of low-contrast texture", f">= {LEAST_TEXTURE}", texture, _least(texture, LEAST_TEXTURE)),
    ]  # fmt: skip


_AT_OWN = (_gains_of_paper, _spikes_of_best, _spikes_of_paper, _planes)


def _never_below(group: Group, records: Sequence[RowResult]) -> list[Figure]:
    """`best` under its best picture, against noisy under the picture that is best for noisy."""
    noisy, best = (group["rows"].get(row) for row in ("noisy", "best"))
    theirs, ours = (best_picture(row) if row else None for row in (noisy, best))
    if theirs is None or ours is None:
        return []
    worst = _worst(records, "best", ours[0], theirs[0])
    return [
        _figure(f"best ({_title(ours[0])}) over noisy ({_title(theirs[0])}), mean [dB]", "> 0", ours[1] - theirs[1],
                ours[1] > theirs[1]),
        _figure("the same, of the worst scene [dB]", ">= 0", worst, None if worst is None else worst >= 0),
    ]  # fmt: skip


def _ablation(group: Group, _: Sequence[RowResult]) -> list[Figure]:
    """The paper's two parts, each with and without the other; then what accumulation does in the place of MUS, and both
    decoders on the true light, where no network errs."""
    found = []
    for column in ("tfi", *LEARNED):
        db = {row: _score(group, row, column).get("db") for row in group["rows"]}
        for what, row, over, paper in STEPS:
            gain = _less(db.get(row), db.get(over))
            wanted, holds = ("-", None) if paper is None else (f"paper {paper:+}", _least(gain, paper))
            found.append(_figure(f"{COLUMNS[column]}: {what} [dB]", wanted, gain, holds))
    return found


STEPS = (
    ("MUS over intervals kept, with refine", "paper-mus", "paper-held", PAPER_MUS_DB),
    ("MUS over intervals kept, without refine", "baseline-mus", "baseline-held", PAPER_MUS_DB),
    ("refine over none, with MUS", "paper-mus", "baseline-mus", PAPER_REFINE_DB),
    ("refine over none, intervals kept", "paper-held", "baseline-held", PAPER_REFINE_DB),
    ("accumulation over MUS, with refine", "paper", "paper-mus", None),
    ("MUS over intervals kept, of the true light", "light-mus", "light-held", None),
    ("accumulation over MUS, of the true light", "light", "light-mus", None),
)
"""What, row, row it is compared with, the paper's gain [dB] (table 3)."""


def _naturalness(group: Group, _: Sequence[RowResult]) -> list[Figure]:
    """Lower is better."""
    return [
        _niqe_figure(group, f"{row} over noisy", row, "noisy", column, PAPER_NIQE.get(row))
        for column in ("tfi", *LEARNED)
        for row in ("paper-mus", "paper", "best")
    ]


def _natural_ablation(group: Group, _: Sequence[RowResult]) -> list[Figure]:
    return [
        *(
            _niqe_figure(group, f"MUS over intervals kept, {row}", f"{row}-mus", f"{row}-held", column, paper)
            for column in ("tfi", *LEARNED)
            for row, paper in PAPER_MUS_NIQE.items()
        ),
        *(
            _niqe_figure(
                group, f"refine over none, {decoder}", f"paper-{decoder}", f"baseline-{decoder}", column, paper
            )
            for column in ("tfi", *LEARNED)
            for decoder, paper in PAPER_REFINE_NIQE.items()
        ),
    ]


def _niqe_figure(group: Group, what: str, row: str, over: str, column: str, paper: float | None) -> Figure:
    less = _less(_score(group, row, column).get("niqe"), _score(group, over, column).get("niqe"))
    wanted = "< 0" if paper is None else f"paper {paper:+}"
    holds = None if less is None else less <= (0.0 if paper is None else paper)
    return _figure(f"{COLUMNS[column]}: {what} [NIQE]", wanted, less, holds)


def _over_before(group: Group, measure: str, wanted: float) -> list[Figure]:
    """What `best` gains over earlier weights; nothing where none were given."""
    found = [group["rows"].get(row, {}).get(measure) for row in ("best", "before")]
    if None in found:
        return []
    ours, theirs = (f["db"] if isinstance(f, dict) else f for f in found)
    gain = _less(ours, theirs)
    return [_figure("best, rate planes: over earlier weights [dB]", f">= {wanted}", gain, _least(gain, wanted))]


def _at_rest(group: Group, _: Sequence[RowResult]) -> list[Figure]:
    noisy, best, mapped = (group["rows"].get(row, {}).get("mean_db") for row in ("noisy", "best", "best-map"))
    return [
        _figure("best over noisy, mean of all frames [dB]", "> 0", _less(best, noisy), _least(_less(best, noisy), 0)),
        *_over_before(group, "mean_db", STILL_GAIN_DB),
        _figure("best with calibration, mean of all frames [dB]", f">= {STILL_DB}", mapped, _least(mapped, STILL_DB)),
    ]


def _planes_at_rest(group: Group, _: Sequence[RowResult]) -> list[Figure]:
    return _faithful(group["rows"].get("best", {}))


def _worst(records: Sequence[RowResult], row: str, column: str, column_of_noisy: str | None = None) -> float | None:
    """Least mean gain over noisy of any scene, over seeds [dB]."""
    gains: dict[str, list[float]] = {}
    noisy = {(r.scene, r.seed): r.pictures.get(column_of_noisy or column) for r in records if r.row == "noisy"}
    for r in records:
        ours, theirs = r.pictures.get(column), noisy.get((r.scene, r.seed))
        if r.row == row and ours is not None and theirs is not None and ours.db is not None and theirs.db is not None:
            gains.setdefault(r.scene, []).append(ours.db - theirs.db)
    return min((float(np.mean(g)) for g in gains.values()), default=None)


def _least(found: float | None, wanted: float) -> bool | None:
    return None if found is None else found >= wanted


def _less(one: float | None, other: float | None) -> float | None:
    return None if one is None or other is None else one - other


def _title(column: str) -> str:
    return "rate plane" if column == PLANE else COLUMNS[column]
