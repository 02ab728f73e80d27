"""The rows of evaluations: rates and spikes from a noisy stream.

A source gives rates or spikes of the judged frames; a decoder makes spikes of rates.  Rows of one source are made in
one go, so that a network runs once for MUS and accumulation.

    noisy, clean       spikes as they are
    TFP, SSML, ...     the paper's pipelines: every frame reconstructed, then spikes by the noise-free camera, which is
                       `denoiser.decoders.accumulate`
    paper, best, ...   rate planes of an `OnlineDnSS`, from the stream's first frame on
    picture            of every frame the picture that a stream of pictures shows of it, each TYPICAL_STEP frames
    light              the true light through a decoder: the score of a perfect network
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from denoiser.decoders import accumulate, held, mus
from denoiser.decoders.brightness import brightened
from denoiser.evaluate.case import ExposedStreams, Planes, StreamCase
from denoiser.evaluate.held_out import calibrated
from denoiser.ground.plain_torch import read_plain
from denoiser.networks.reconstructor_recipe import LEARNED
from denoiser.online import OnlineDnSS, pieces_of
from denoiser.reconstruct import reconstruct_many
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.types import Spikes
from spikecam_env.untrusted import existing_file

MODES = ("best", "fast", "paper")
"""Denoisers that give spikes and rates of every frame."""
DECODERS: dict[str, Any] = {"held": held, "mus": mus, "accumulate": accumulate}


@dataclass(frozen=True)
class Row:
    """A row of an evaluation."""

    title: str
    """In the table."""
    source: str
    decoder: str = ""
    """Of the source's rates, "" where it gives spikes."""
    shows_planes: bool = False
    """Its rate planes are judged too."""
    brightness: float = 1.0
    """Spikes are made of the source's rates times this."""


@dataclass(frozen=True)
class RowStreams:
    """A row of a case, made: the judged frames."""

    row: str
    spikes: Spikes
    """(T, H, W)."""
    planes: Planes | None
    """(T, H, W) rates of which the spikes are made [spikes/frame]; None where there are none, or they are not shown."""


ROWS: dict[str, Row] = {
    "noisy": Row("noisy", "noisy"),
    "tfp": Row("TFP 41, then spikes", "tfp41", "accumulate"),
    "ssml": Row("SSML, then spikes", "ssml", "accumulate"),
    "spk2img-clean": Row("Spk2ImgNet (clean), then spikes", "spk2img-clean", "accumulate"),
    "spk2img-noisy": Row("Spk2ImgNet (noisy), then spikes", "spk2img-noisy", "accumulate"),
    "baseline-held": Row("no refine, intervals kept", "paper-no-refine", "held"),
    "baseline-mus": Row("no refine, MUS", "paper-no-refine", "mus"),
    "baseline": Row("no refine, accumulated", "paper-no-refine", "accumulate", True),
    "paper-held": Row("paper, intervals kept", "paper", "held"),
    "paper-mus": Row("paper, MUS", "paper", "mus"),
    "paper": Row("paper, accumulated", "paper", "accumulate", True),
    "best": Row("best", "best", "accumulate", True),
    "fast": Row("fast", "fast", "accumulate", True),
    "best-bright": Row("best, spikes 4 times brighter", "best", "accumulate", brightness=4.0),
    "fast-bright": Row("fast, spikes 4 times brighter", "fast", "accumulate", brightness=4.0),
    "picture": Row("picture", "picture", "accumulate", True),
    "best-overlap": Row("best, passes overlapped", "best-overlap", "accumulate", True),
    "best-eased": Row("best, passes eased", "best-eased", "accumulate", True),
    "best-map": Row("best with calibration", "best-map", "accumulate", True),
    "picture-map": Row("picture with calibration", "picture-map", "accumulate", True),
    "clean": Row("clean twin", "clean"),
    "light-held": Row("true light, intervals kept", "light", "held"),
    "light-mus": Row("true light, MUS", "light", "mus"),
    "light": Row("true light, accumulated", "light", "accumulate"),
}
JOINED: dict[str, dict[str, Any]] = {"best-overlap": {"overlap": True}, "best-eased": {"ease": True}}
"""Sources whose passes are joined: options of `OnlineDnSS`."""
WeightFiles = Mapping[str, str | os.PathLike[str]]
"""Checkpoint by mode, instead of the shipped ones."""


@dataclass(frozen=True)
class Weights:
    """Files of weights by name, instead of those that are shipped."""

    files: Mapping[str, Path] = field(default_factory=dict)

    @classmethod
    def of_modes(cls, modes: Sequence[str], files: WeightFiles | None, known: Sequence[str] = MODES) -> Weights:
        """The files by mode; InputError for a mode that is not known, and for weights of one that cannot be read."""
        weights = cls({mode: Path(path) for mode, path in (files or {}).items()})
        weights.check()
        for mode in modes:
            if mode not in known:
                raise unknown_name("denoiser mode", mode, known)
            if why := why_not(mode, weights):
                raise InputError(why)
        return weights

    @classmethod
    def found(cls, folder: Path | None, files: Mapping[str, Path]) -> Weights:
        """The files, and of names that have none NAME.pt in a folder, where it exists."""
        names = {source.weights for source in SOURCES.values() if source.weights}
        here = {} if folder is None else {n: folder / f"{n}.pt" for n in names if (folder / f"{n}.pt").is_file()}
        return cls(here | dict(files))

    def path(self, name: str) -> Path:
        """Where weights of a name are, or would be."""
        return self.files.get(name) or Path(str(resources.files("denoiser") / "weights" / f"{name}.pt"))

    def check(self) -> None:
        """InputError for a given file that does not exist."""
        for path in self.files.values():
            existing_file(path)

    def missing(self, name: str) -> str:
        """Why there are none, or ""."""
        return "" if self.path(name).is_file() else f"no weights are shipped under this name: {self.path(name).name}"

    def digest(self, name: str) -> str | None:
        """SHA-256 of the file; None where there is none."""
        path = self.path(name)
        return _sha256(*_version(path)) if path.is_file() else None


def _version(path: Path) -> tuple[Path, int]:
    """A file and the time of its last change [ns], by which results from it are kept."""
    return path, path.stat().st_mtime_ns


@lru_cache(maxsize=64)
def _sha256(path: Path, _: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def weights_of(source: str) -> str | None:
    """Name of the weights that a source needs; None where it needs none."""
    return SOURCES[source].weights if source in SOURCES else None


def why_not(source: str, weights: Weights) -> str:
    """Why a source cannot be had, or ""; InputError for a given file that cannot be read."""
    name = weights_of(source)
    if name is None or (why := weights.missing(name)):
        return "" if name is None else why
    try:
        planes_a_pass(source, weights)
    except InputError as error:
        if name in weights.files:
            raise
        return str(error)
    return ""


def streams(
    source: str, rows: list[str], case: StreamCase, exposed: ExposedStreams, weights: Weights
) -> list[RowStreams]:
    """The rows of a source."""
    if source in ("noisy", "clean"):
        whole = exposed.noisy if source == "noisy" else exposed.clean
        assert whole is not None
        return [RowStreams(row, exposed.judged(whole), None) for row in rows]
    planes = SOURCES[source].make(case, exposed, weights.path(weights_of(source) or source))
    return [
        RowStreams(
            row,
            decoded(brightened(planes, ROWS[row].brightness), ROWS[row].decoder),
            planes if ROWS[row].shows_planes else None,
        )
        for row in rows
    ]


def decoded(planes: Planes, decoder: str) -> Spikes:
    """(T, H, W) rates to spikes by a decoder of `DECODERS`."""
    chosen = DECODERS[decoder]
    return chosen.step(planes, chosen.start(planes.shape[1:]))[0]  # type: ignore[no-any-return]


class Restored(NamedTuple):
    """A denoised stream."""

    spikes: NDArray[np.uint8]
    """(T, H, W)."""
    rates: NDArray[np.float32]
    """(T, H, W) [spikes/frame]."""
    whole: int
    """Frames, from the first, that came out before the stream's end was known."""


def restored(online: OnlineDnSS, spikes: NDArray[np.uint8], title: str | None = None) -> Restored:
    """(T, H, W) spikes through a denoiser from its first frame; a title has a bar of progress."""
    stream = online.another("both")
    fired, rates, whole = np.empty_like(spikes), np.empty(spikes.shape, np.float32), 0
    for whole, piece in pieces_of(stream, spikes, title=title):
        part = slice(whole, whole + len(piece[0]))
        fired[part], rates[part] = piece
    return Restored(fired, rates, whole)


def denoiser(source: str, weights: Weights) -> OnlineDnSS:
    """The denoiser of a mode, or of a source of JOINED; InputError as `OnlineDnSS`."""
    return _online(*_version(weights.path(weights_of(source) or source)), **JOINED.get(source, {}))


def planes_a_pass(source: str, weights: Weights) -> int:
    """Rate planes that the source's network gives at once; 1 where there is none."""
    name = weights_of(source)
    return 1 if name is None or name in LEARNED else denoiser(name, weights).engine.recipe.layout.planes


def parameters(source: str, weights: Weights) -> int | None:
    """How many weights a source's network has; None for a source without one."""
    name = weights_of(source)
    return None if name is None else _count(*_version(weights.path(name)))


@lru_cache(maxsize=16)
def _count(path: Path, _: int) -> int:
    return sum(tensor.numel() for tensor in read_plain(path)["state_dict"].values())


@lru_cache(maxsize=4)
def _online(path: Path, _: int, **options: Any) -> OnlineDnSS:
    return OnlineDnSS.from_file(path, **options)


def _judged_planes(online: OnlineDnSS, exposed: ExposedStreams) -> Planes:
    """Later frames than the judged ones need are not pushed."""
    return restored(online, exposed.noisy[: exposed.stop + online.latency]).rates[exposed.first : exposed.stop]


def _denoised(case: StreamCase, exposed: ExposedStreams, path: Path, **options: Any) -> Planes:
    return _judged_planes(_online(*_version(path), **options), exposed)


def _calibrated(case: StreamCase, exposed: ExposedStreams, path: Path) -> Planes:
    return _judged_planes(OnlineDnSS.from_file(path, unit=calibrated(case)), exposed)


def _pictured(case: StreamCase, exposed: ExposedStreams, path: Path, *, mapped: bool = False) -> Planes:
    """As many streams as a step has frames, each a frame later: every frame is shown by one of them.  The first frames
    are shown by streams that end before a step is full."""
    planes = np.empty((exposed.stop - exposed.first, *exposed.noisy.shape[1:]), np.float32)
    like = OnlineDnSS.from_file(path, unit=calibrated(case) if mapped else None)
    step, late = like.engine.step, like.latency + 1
    for phase in range(step):
        begins = exposed.first + late + phase  # the end of a step, from which this stream's steps follow
        stream = exposed.noisy[begins % step : exposed.stop + late]
        pictures = like.another().push(stream)
        for number, picture in enumerate(np.asarray(pictures)):
            frame = begins % step + (number + 1) * step - late
            if exposed.first <= frame < exposed.stop:
                planes[frame - exposed.first] = picture
    for frame in range(exposed.first, min(step - late, exposed.stop)):
        young = like.another()
        young.push(exposed.noisy[: frame + late])
        planes[frame - exposed.first] = np.asarray(young.flush())[0]
    return planes


def _pipeline(name: str) -> Callable[[StreamCase, ExposedStreams, Path], Planes]:
    return lambda case, exposed, path: reconstruct_many(
        name, exposed.noisy, range(exposed.first, exposed.stop), weights=path
    )


def _light(case: StreamCase, exposed: ExposedStreams, path: Path) -> Planes:
    assert exposed.light is not None
    return np.ascontiguousarray(exposed.light)


class RowSource(NamedTuple):
    """The planes of some rows."""

    make: Callable[[StreamCase, ExposedStreams, Path], Planes]
    """(case, its streams, file of weights) -> rates of the judged frames."""
    weights: str | None = None
    """Name of those that it needs."""


SOURCES = {
    **{name: RowSource(_denoised, name) for name in (*MODES, "paper-no-refine")},
    **{name: RowSource(partial(_denoised, **options), "best") for name, options in JOINED.items()},
    "best-map": RowSource(_calibrated, "best"),
    "picture": RowSource(_pictured, "picture"),
    "picture-map": RowSource(partial(_pictured, mapped=True), "picture"),
    **{name: RowSource(_pipeline(name), name) for name in LEARNED},
    "tfp41": RowSource(_pipeline("tfp41")),
    "light": RowSource(_light),
}
