"""The ladder: from a model that lacks nearly everything to one that leaves nothing, an effect a rung.

Effects that the free refit shows and the model lacks (`missing_from_refit`) are added one after another, each time the
one that takes away most; then the search for effects goes on as in a diagnosis.  Every rung is judged on the same
held-out statistics, in the noise of the last.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from spikecam_env.campaign.reading import Campaign, read_campaign
from spikecam_env.gap.baseline.missing_from_refit import Missing
from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.candidates.table import chosen
from spikecam_env.gap.compare.distance import adjusted
from spikecam_env.gap.diagnose import DiagnosisRequest, comparison_of, read_case, searched
from spikecam_env.gap.fit.hypothesis import Fit, Hypothesis
from spikecam_env.gap.fit.standard_templates import templates_of
from spikecam_env.gap.report import plots
from spikecam_env.gap.report.quantities import quantity
from spikecam_env.gap.report.words import human, parameter_unit
from spikecam_env.gap.result import SIGNIFICANT
from spikecam_env.gap.search.round import adding
from spikecam_env.gap.stages import Stages
from spikecam_env.gap.twins.workers import sums_in_one_order
from spikecam_env.gap.unit.label_unit import label_unit_note
from spikecam_env.gap.verdict.comparison import Comparison, aligned_mean
from spikecam_env.sensor import Effect, SensorModel
from spikecam_env.types import Floats
from spikecam_env.whole import whole_folder, write_text_whole

LADDER_FORMAT = "spikecam-ladder/1"


@dataclass(frozen=True)
class Rung:
    """A model on the way."""

    model: SensorModel
    added: Effect | None
    """Its newest effect; None for the first rung."""
    sd: float
    """Of its strength."""
    also: tuple[str, ...]
    """Names that are tied with it."""
    gap: float
    """Mean square of held-out statistics, in noise; 1 is chance."""
    groups: dict[str, float]
    """The same of each group of statistics, over all recordings."""
    off: int
    """Statistics of p < 0.05."""


@dataclass(frozen=True)
class Ladder:
    """Models from simple to sufficient."""

    campaign: str
    seed: int
    statistics: int
    """Number of statistics by which every rung is judged."""
    rungs: tuple[Rung, ...]
    """First to last."""
    notes: tuple[str, ...] = ()
    """On the labels."""

    def to_json(self) -> dict[str, Any]:
        """The documented format."""
        rungs = [
            {
                "added": r.added and r.added.name,
                "parameters": r.added.parameters() if r.added else {},
                "sd": r.sd,
                "also": list(r.also),
                "gap": r.gap,
                "groups": r.groups,
                "off": r.off,
            }
            for r in self.rungs
        ]
        return {"format": LADDER_FORMAT, "campaign": self.campaign, "seed": self.seed, "statistics": self.statistics,
                "rungs": rungs}  # fmt: skip

    def write(self, folder: Path) -> None:
        """Write ladder.json, ladder.png and the last rung's model.toml into a folder, made if needed: all or none."""
        with whole_folder(folder, replace=True) as beside:
            self.rungs[-1].model.to_toml(beside / "model.toml")
            ladder_figure(self).savefig(beside / "ladder.png", format="png", dpi=130)
            write_text_whole(beside / "ladder.json", json.dumps(self.to_json(), indent=1))


@sums_in_one_order
def ladder(
    campaign: Campaign | str | Path,
    model: SensorModel | str = "ideal",
    *,
    seed: int = 0,
    jobs: int = 1,
    twin_count: int = 12,
    progress: bool = False,
) -> Ladder:
    """Climb from a simple model to one that explains a campaign, an effect a rung.

    Args:
        campaign: read already, or its folder (format spikecam-campaign/1).
        model: the first rung: a SensorModel, a preset's name or a TOML path.
        seed: of all simulations; the same seed gives the same answer.
        jobs: threads; they change no bit.
        twin_count: simulations of the campaign under the last model.
        progress: whether to show a bar.

    Returns:
        The rungs, first to last; `write` saves them.

    Raises:
        InputError: as `diagnose` does.

    Example:
        >>> flats = [Dark(), *(Flat(radiance=level) for level in (0.1, 0.3))]
        >>> campaign = write_campaign("camera", "scsim", shape=(8, 8), frames=400, recordings=flats)
        >>> rungs = ladder(campaign, "ideal", twin_count=4).rungs
        >>> sorted(rung.added.name for rung in rungs if rung.added)
        ['conversion_gain_spread', 'dark_current', 'dark_current_spread', 'shot_noise']
    """
    measured = campaign if isinstance(campaign, Campaign) else read_campaign(campaign)
    first = model if isinstance(model, SensorModel) else SensorModel.load(model)
    case, stages = read_case(measured, seed, jobs), Stages(progress)
    request = DiagnosisRequest(tuple(chosen(first, None, ())), seed, jobs, math.inf, twin_count)
    comparison = comparison_of(case, first, request, stages)
    with stages.timed("rungs"):
        rungs = climbed(comparison)
    with stages.timed("candidates"):
        rungs += [rung_of(comparison, *step) for step in search_steps(comparison)]
    notes = tuple(label_unit_note(case.nominal_per_label, case.base))
    return Ladder(str(measured.folder), seed, len(comparison.values), tuple(rungs), notes)


def rung_of(comparison: Comparison, model: SensorModel, mean: Floats, newest: Missing | None) -> Rung:
    """A model as a rung, with its predictions (S,) and its newest effect: judged in the noise of the null model."""
    null, off = comparison.null, comparison.values - mean
    square = np.nan_to_num(off / null.noise) ** 2
    group = np.array([k.group for k in null.keys])
    return Rung(
        model,
        newest.effect if newest else None,
        newest.sd if newest else np.nan,
        newest.also if newest else (),
        float(square[comparison.case.held_out(null.keys)].mean()),
        {g: float(square[group == g].mean()) for g in dict.fromkeys(group.tolist())},
        int((adjusted(np.sign(off) * np.sqrt(square)) < SIGNIFICANT).sum()),
    )


def climbed(comparison: Comparison) -> list[Rung]:
    """The first model, then effects that the refit shows, one after another: each time the one that takes away most."""
    case, null, left = comparison.case, comparison.null, list(comparison.missing)
    few = case.settings.twins.to_confirm  # the distance is large beside their error
    rungs = [rung_of(comparison, comparison.tested, comparison.given, None)]
    while len(left) > 1:
        models = [rungs[-1].model.with_effect(m.effect) for m in left]
        means = [aligned_mean(model_null(case, model, few), null) for model in models]
        tried = [rung_of(comparison, *one) for one in zip(models, means, left, strict=True)]
        best = min(range(len(left)), key=lambda i: tried[i].gap)
        rungs.append(tried[best])
        left.pop(best)
    return rungs + [rung_of(comparison, comparison.model, null.mean, m) for m in left]


def search_steps(comparison: Comparison) -> list[tuple[SensorModel, Floats, Missing]]:
    """Models of a search with their predictions (S,) and newest effects, where the null model still differs."""
    if not comparison.disagrees:
        return []
    rounds = searched(comparison, templates_of(comparison.names, jobs=comparison.case.jobs))
    return [
        (end.start.model, end.start.prediction.mean, as_missing(turn.fits[0], end.start))
        for turn, end in adding(rounds)
    ]


def as_missing(fit: Fit, at: Hypothesis) -> Missing:
    """The effect of a fit as a hypothesis has it, with the error of its strength."""
    effect = next(e for e in at.model.effects if e.name == fit.name)
    return Missing(effect, next(iter(fit.sd.values()), np.nan))


def rung_line(rung: Rung) -> str:
    """A rung in a line: its effect and how large it is."""
    if rung.added is None:
        return rung.model.name
    key = type(rung.added).strength
    size = quantity(rung.added.parameters()[key], parameter_unit(rung.added.name, key), rung.sd)
    return f"+ {human(rung.added.name)}, {size}"


def ladder_figure(made: Ladder) -> Figure:
    """The gap at every rung, and of the groups of statistics that it falls in."""
    return plots.rungs([rung_line(r) for r in made.rungs], [r.gap for r in made.rungs], [r.groups for r in made.rungs])


def rung_rows(made: Ladder) -> list[dict[str, Any]]:
    """A row a rung."""
    return [
        {"rung": rung_line(r), "gap": r.gap, "statistics off": r.off, "or": ", ".join(r.also) or "-"}
        for r in made.rungs
    ]
