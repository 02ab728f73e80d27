"""`spikecam dataset`: SPIFT_N, PHM_N and cuts of films, made and verified."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import tyro

from spikecam_env.cli.camera import CameraOptions
from spikecam_env.cli.options import Size
from spikecam_env.cli.without_effect import WithoutEffect
from spikecam_env.numbers import Count, Positive, Seed, Whole, Workers

if TYPE_CHECKING:
    from spikecam_env.datasets import Plan


@dataclass
class DatasetOptions:
    """Options of every dataset."""

    out: Path
    """Folder for the dataset; a run that was stopped goes on in it."""
    frames: Count = 1000
    """Spike frames of each scene; 40 000 are a second."""
    size: Size = (250, 400)
    """Rows and columns; 500 800 is the other size in use."""
    seed: Seed = 0
    """Seed of the scenes and the cameras; the same seed gives the same bytes."""
    truth_every: Whole = 100
    """Frames between ground truths (radiance, flow, object number, depth, poses); 0: none."""
    camera: CameraOptions = field(default_factory=CameraOptions)
    jobs: Workers = 1
    """Worker processes on this machine, or workers of a local Ray cluster."""
    ray: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS")] = None
    """Work on a Ray cluster: its address, e.g. auto or ray-head:6379; `local` starts one of --jobs workers here."""

    without_effect: ClassVar = (
        WithoutEffect(("jobs",), lambda c: c.ray not in (None, "local"), "the cluster {ray} has its own workers"),
    )

    def settings(self) -> dict[str, Any]:
        """As fields of a `Plan`."""
        return {
            "frames": self.frames,
            "shape": self.size,
            "seed": self.seed,
            "truth_every": self.truth_every,
            "model": self.camera.load(),
        }

    def make(self, plan: Plan) -> None:
        """Make the dataset, and print the number of its scenes."""
        from spikecam_env.datasets import build

        built = build(plan, self.out, jobs=self.jobs, ray=self.ray, progress=True)
        size = f"{built.bytes / 1e9:.3g} GB"
        drawn = "" if plan.films is not None else f" (renderer: {built.renderer})"
        print(f"{self.out}: {built.made} scenes made, {built.kept} were there, {size}{drawn}")
        if built.seconds:
            spent = ", ".join(f"{what} {s:.3g}" for what, s in sorted(built.seconds.items(), key=lambda i: -i[1]))
            print(f"seconds over all workers: {spent}")


@dataclass
class DrawnOptions(DatasetOptions):
    """Options of datasets of the catalogue's scenes."""

    mean_interval: float = 10.0
    """Exposure: frames between spikes, on average over the picture."""
    pan: tuple[float, float] = (0.0, 0.0)
    """Speed of the camera's gaze to the right and down [pixels/frame]; then everything moves."""
    renderer: Literal["auto", "egl-hardware", "egl-software", "osmesa", "embree"] = "auto"
    """Back-end that draws; auto: the best that works here, and the same one when a run is continued."""

    def settings(self) -> dict[str, Any]:
        """As fields of a `Plan`."""
        drawn = {"mean_interval": self.mean_interval, "pan": self.pan, "renderer": self.renderer}
        return super().settings() | drawn


@dataclass
class SpiftN(DrawnOptions):
    """Random scenes: 100 to train on and 10 to test, as in the paper, each with a camera of its own.

    example:  spikecam dataset spift-n --out spift --jobs 2
    """

    train: Whole = 100
    """Scenes to train on."""
    test: Whole = 10
    """Scenes to test."""

    def run(self) -> None:
        from spikecam_env.datasets import spift_n

        self.make(spift_n(train=self.train, test=self.test, **self.settings()))


@dataclass
class PhmN(DrawnOptions):
    """The ten well-designed scenes: ball, cook, dice, doll, fan, fly, hand, jump, poker, top.

    example:  spikecam dataset phm-n --out phm --jobs 2
    """

    scenes: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME...", help_behavior_hint="(default: the ten)")] = ()
    """Other scenes of the catalogue; `spikecam scenes` lists them."""

    def run(self) -> None:
        from spikecam_env.datasets import PHM, phm_n

        self.make(phm_n(scenes=self.scenes or PHM, **self.settings()))


@dataclass(kw_only=True)
class Films(DatasetOptions):
    """Cuts of films: the pixels of a part of each picture, from the film's first picture on.

    The defaults are those of REDS-SPK, DAVIS-SPK and GoPro-SPK (docs/datasets.md).

    example:  spikecam dataset films val_sharp --out reds-spk --model ideal
              spikecam export reds-spk --frames 41 --clips 10 --out reds-zoo
    """

    folder: tyro.conf.Positional[Path]
    """Folder of films, as `spikecam film` takes them: videos, folders of pictures, .csv lists, .npy arrays."""
    frames: Count = 221
    """Spike frames of each cut, from the film's first picture on."""
    size: Size = (256, 256)
    """Rows and columns of each cut; the film is not made smaller."""
    truth_every: Whole = 20
    """Frames between ground truths (the film's light); 0: none."""
    cuts: Count = 1
    """Cuts from each film, at places that the seed draws, each with a camera of its own."""
    split: Literal["train", "test"] = "test"
    """Folder of the recordings."""
    film_rate: Positive | None = 2000.0
    """Pictures a second; 2000 are 20 spike frames a picture.  None: by the films' time stamps."""
    transfer: str | None = "linear"
    """From values to light: linear, srgb, bt709, gamma2.2 (or another power); None: that of the files."""
    interpolation: Literal["motion", "linear", "hold"] = "motion"
    """Light between two pictures: carried along the motion found between them, a straight line, or the earlier picture
    held until the next."""
    white: Positive = 0.6
    """Light of the films' full scale [spikes/frame]; 0.6 in Spike-Zoo's REDS clips."""

    def run(self) -> None:
        from spikecam_env.datasets import FilmFolder, film_cuts

        films = FilmFolder(self.folder, self.film_rate, self.transfer, self.interpolation, self.white)
        self.make(film_cuts(films, cuts=self.cuts, split=self.split, **self.settings()))


@dataclass
class Verify:
    """Find files that are truncated, edited, missing, or do not belong; exit code 1 where there are any.

    example:  spikecam dataset verify spift --jobs 2
    """

    folder: tyro.conf.Positional[Path]
    """Folder of the dataset."""
    jobs: Workers = 1
    """Files to read at the same time."""
    outside: bool = False
    """Also read files that the dataset keeps outside its folder."""

    def run(self) -> None:
        from spikecam_env.datasets import verify

        faults = verify(self.folder, jobs=self.jobs, outside=self.outside, progress=True)
        print("\n".join(faults) if faults else f"{self.folder}: every file is there and as it was written")
        if faults:
            raise SystemExit(1)


@dataclass
class Dataset:
    """Datasets of noisy and clean spikes with ground truth (docs/datasets.md).

    example:  spikecam dataset spift-n --out spift --jobs 2
    """

    action: (
        Annotated[SpiftN, tyro.conf.subcommand("spift-n", prefix_name=False)]
        | Annotated[PhmN, tyro.conf.subcommand("phm-n", prefix_name=False)]
        | Annotated[Films, tyro.conf.subcommand("films", prefix_name=False)]
        | Annotated[Verify, tyro.conf.subcommand("verify", prefix_name=False)]
    )

    def run(self) -> None:
        self.action.run()
