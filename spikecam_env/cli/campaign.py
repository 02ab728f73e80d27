"""`spikecam campaign`: measured-data campaigns, simulated or from a real camera's files."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from spikecam_env.cli.camera import CameraOptions
from spikecam_env.cli.options import Size
from spikecam_env.cli.reading import ReadingOptions
from spikecam_env.numbers import Count, Positive, Seed, Whole

if TYPE_CHECKING:
    from spikecam_env.campaign import Campaign

Repeated = tyro.conf.UseAppendAction[tuple[str, ...]]


@dataclass
class Simulate:
    """Record one simulated unit: dark, flats, a step, moving bars, a turning disk.  Goes on where it was stopped.

    example:  spikecam campaign simulate late --effect dead_time:tau_us=0.2 --frames 8000 --seed 3
    """

    out: tyro.conf.Positional[Path]
    """Folder for the campaign."""
    camera: CameraOptions = field(default_factory=CameraOptions)
    shape: Size = (64, 64)
    """Rows and columns."""
    frames: Count = 8000
    """Frames of each recording; 40 000 are a second."""
    seed: Seed = 0
    """Seed of the unit: its fixed pattern, and the noise of all recordings."""
    recording: Annotated[Repeated, tyro.conf.arg(metavar="KIND[:PARAM=VALUE,...]")] = ()
    """A recording, in place of the standard design (dark, nine flats, step, bars, disk; name `standard` to add to it).
    Kinds: dark, flat, step, bars, disk or masked_rows, e.g. flat:radiance=0.3,use=holdout; may be repeated."""
    second_v_d: float | None = None
    """Record the dark and flats to fit at this V_D - V_ref too, in volts."""

    def run(self) -> None:
        from spikecam_env.cli.named import named
        from spikecam_env.gap import KINDS, second_voltage, standard_design, write_campaign

        planned = tuple(
            recording
            for text in self.recording or ("standard",)
            for recording in (standard_design() if text == "standard" else (named(text, KINDS, "recording"),))
        )
        if self.second_v_d is not None:
            planned = second_voltage(planned, self.second_v_d)
        model = self.camera.load()
        report(
            write_campaign(
                self.out,
                model,
                shape=self.shape,
                frames=self.frames,
                recordings=planned,
                seed=self.seed,
                progress=True,
            )
        )


@dataclass
class Import:
    """Make a campaign of a real camera's files: recordings in any format, rates, flat maps.

    example:  spikecam campaign import recordings wall --label wall.npz=unknown --frame-rate-hz 40000
    """

    folder: tyro.conf.Positional[Path]
    """Folder of the recordings."""
    out: tyro.conf.Positional[Path]
    """Folder for the campaign; new or empty."""
    table: Path | None = None
    """CSV table of labels: file, radiance; name, use, v_d, temperature_k, note and options of reading if wanted."""
    label: Annotated[Repeated, tyro.conf.arg(metavar="FILE=RADIANCE")] = ()
    """The light of a recording: a radiance (0 is dark), an .npz of light over time, `unknown` for a static scene, or
    `relative` for flat maps; may be repeated."""
    frame_rate_hz: Positive | None = None
    """Frames a second; needed where the files do not say."""
    rows: tuple[Whole, Whole] | None = None
    """First row to keep, and the row after the last."""
    columns: tuple[Whole, Whole] | None = None
    """First column to keep, and the column after the last."""
    holdout_share: float = 0.0
    """Share of each recording, at its end, to hold out for judging the result."""
    radiance_per_unit: Positive = 1.0
    """Radiance of a label of 1, for labels in lux or another unit."""
    reading: ReadingOptions = field(default_factory=ReadingOptions)
    outside: bool = False
    """Also read labelled files that lie outside the folder."""

    def run(self) -> None:
        from spikecam_env.gap import import_campaign, label_from_text, labels_from_table

        labels = labels_from_table(self.table) if self.table else ()
        report(
            import_campaign(
                self.folder,
                self.out,
                (*labels, *(label_from_text(text) for text in self.label)),
                frame_rate_hz=self.frame_rate_hz,
                rows=self.rows,
                columns=self.columns,
                holdout_share=self.holdout_share,
                radiance_per_unit=self.radiance_per_unit,
                outside=self.outside,
                progress=True,
                **self.reading.options(),
            )
        )


@dataclass
class Campaigns:
    """Measured-data campaigns (format spikecam-campaign/1): simulate one, or import a real camera's recordings.

    example:  spikecam campaign simulate late --effect dead_time:tau_us=0.2
    """

    action: (
        Annotated[Simulate, tyro.conf.subcommand("simulate", prefix_name=False)]
        | Annotated[Import, tyro.conf.subcommand("import", prefix_name=False)]
    )

    def run(self) -> None:
        self.action.run()


def report(campaign: Campaign) -> None:
    """Print the recordings of a campaign."""
    from spikecam_env.cli.table import table

    rows = [
        {
            "recording": r.name,
            "use": r.use,
            "frames": r.frames,
            "spikes/frame": float((r.rate() if r.spikes is None else r.load()).mean()),
            "light": "unknown" if r.radiance is None else "known",
            "v_d": r.v_d,
        }
        for r in campaign.recordings
    ]
    print(table(rows))
    print(f"wrote {len(rows)} recordings of {campaign.shape[0]} x {campaign.shape[1]} pixels in {campaign.folder}")
