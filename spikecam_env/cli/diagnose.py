"""`spikecam diagnose`: where a model and measured recordings disagree, and which effect is missing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from spikecam_env.cli.effect_files import EffectFiles
from spikecam_env.numbers import Effort, Seed, Workers

if TYPE_CHECKING:
    from spikecam_env.gap.result import Diagnosis


@dataclass
class Diagnose:
    """Find where a model and recordings disagree, name the effect and add it: diagnosis.json, model.toml, report.html.

    example:  spikecam diagnose camera-17 --model scsim --out diagnosed
    """

    campaign: tyro.conf.Positional[Path]
    """Folder with a campaign.json (format spikecam-campaign/1)."""
    out: Path
    """Folder for the results."""
    model: str = "scsim"
    """A preset's name, or a model file (.toml)."""
    candidates: tuple[str, ...] | None = None
    """Effects to try; default: all of the catalogue."""
    exclude: tuple[str, ...] = ()
    """Effects not to try."""
    effect_file: EffectFiles = ()
    """A Python file of your own effects, to try them too.  The file is run: give only files that you trust.  May be
    repeated."""
    seed: Seed = 0
    """Seed of every simulation; the same seed gives the same result."""
    jobs: Workers = 1
    """Simulations to run at the same time; the result does not depend on it."""
    effort: Effort = 200.0
    """Budget: how often the campaign may be simulated before optional steps are skipped; inf for no limit."""
    static_only: bool = False
    """In unknown scenes with motion, use only the pixels in which nothing moves."""
    bounds: Literal["linear", "simulated", "none"] = "linear"
    """Upper bounds of the effects that were not found: by linear response, at no simulation; simulated, by some 200
    campaigns more; or none."""
    settings: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Tuned numbers other than the defaults, a TOML file of lines such as `deviance.tie = 8.0`; all of them stand in
    docs/reference/diagnosis_settings.md."""
    outside: bool = False
    """Also read files of the campaign that lie outside its folder."""

    def run(self) -> None:
        from spikecam_env.campaign import read_campaign
        from spikecam_env.cli.files import out_folder
        from spikecam_env.sensor import SensorModel

        SensorModel.load(self.model)
        self._known_effects()
        settings = None
        if self.settings is not None:
            from spikecam_env.gap.settings import DiagnosisSettings

            settings = DiagnosisSettings.from_toml(self.settings)
        campaign = read_campaign(self.campaign, outside=True) if self.outside else self.campaign
        from spikecam_env.gap.diagnose import diagnose
        from spikecam_env.gap.report.page import write_report

        with out_folder(self.out) as folder:
            diagnosis = diagnose(
                campaign,
                self.model,
                candidates=self.candidates,
                exclude=self.exclude,
                seed=self.seed,
                jobs=self.jobs,
                effort=self.effort,
                static_only=self.static_only,
                bounds=self.bounds,
                settings=settings,
                progress=True,
            )
            diagnosis.write(folder)
            write_report(diagnosis, folder / "report.html")
        print(summary(diagnosis))
        print(f"\nthe page: {self.out / 'report.html'}   the model: {self.out / 'model.toml'}")

    def _known_effects(self) -> None:
        from spikecam_env.errors import unknown_name
        from spikecam_env.sensor import CATALOGUE

        for name in (*(self.candidates or ()), *self.exclude):
            if name not in CATALOGUE:
                raise unknown_name("effect", name, CATALOGUE)


def summary(diagnosis: Diagnosis) -> str:
    """The verdict, effects with their parameters, and the gap, for a terminal."""
    from spikecam_env.cli.table import table
    from spikecam_env.gap.report.sentence import gap_line

    parts = [f"{diagnosis.verdict}: {diagnosis.sentence}"]
    rows = _rows(diagnosis)
    if rows:
        parts += ["", table(rows)]
    if diagnosis.not_bounded and diagnosis.verdict == "none":
        parts += [f"no bound from these recordings: {', '.join(name for name, _ in diagnosis.not_bounded)}"]
    if diagnosis.class_ and diagnosis.class_.get("experiment"):
        parts += ["", f"to separate them: {diagnosis.class_['experiment']}"]
    parts += [f"note: {line}" for line in diagnosis.data]
    if diagnosis.gap:
        parts += ["", gap_line(diagnosis.gap)]
    return "\n".join(parts)


def _rows(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """A row a parameter: of effects, of present parameters that are off, or of bounds where nothing was found."""
    from spikecam_env.gap.report.quantities import at_most, bound_heading, bounded_parameter, interval, quantity
    from spikecam_env.gap.report.words import bare, parameter_unit

    rows = [
        {
            "effect": e.name,
            "confidence": f"{e.confidence:.2f}",
            "parameter": bare(e.name, name),
            "value": quantity(estimate.value, parameter_unit(e.name, name), estimate.sd),
            "90 %": interval(estimate, parameter_unit(e.name, name)),
        }
        for e in diagnosis.effects
        for name, estimate in e.parameters.items()
    ]
    if rows:
        return rows
    if diagnosis.parameters:
        return [{"parameter": name, **values} for name, values in diagnosis.parameters.items()]
    if diagnosis.verdict == "none":
        head = bound_heading(diagnosis.bounds)
        return [{"effect": b.name, "parameter": bounded_parameter(b), head: at_most(b)} for b in diagnosis.bounds]
    return []
