"""The rows of evaluations: rates and spikes from a noisy stream.

A source gives rates or spikes of the judged frames; a decoder makes spikes of rates.  Rows of one source are made in
one go, so that a network runs once for MUS and accumulation.

    noisy, clean       spikes as they are
    TFP, SSML, ...     the paper's pipelines: every frame reconstructed, then spikes by the noise-free camera, which is
                       `denoiser.decoders.accumulate`
    paper, best, ...   rate planes of an `OnlineDnSS`, from the stream's first frame on
    light              the true light through a decoder: the score of a perfect network
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from denoiser.decoders import accumulate, held, mus
from denoiser.evaluate import still
from denoiser.evaluate.case import ExposedStreams, Planes, StreamCase
from denoiser.evaluate.restored import WeightFiles, restored
from denoiser.ground.plain_torch import read_plain
from denoiser.networks.reconstructor_recipe import LEARNED
from denoiser.online import OnlineDnSS
from denoiser.reconstruct import reconstruct_many
from denoiser.weights import load_weights, pretrained_path
from spikecam_env.errors import InputError
from spikecam_env.types import Spikes
from spikecam_env.untrusted import existing_file

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
    "best-overlap": Row("best, passes overlapped", "best-overlap", "accumulate", True),
    "best-map": Row("best with calibration", "best-map", "accumulate", True),
    "clean": Row("clean twin", "clean"),
    "light-held": Row("true light, intervals kept", "light", "held"),
    "light-mus": Row("true light, MUS", "light", "mus"),
    "light": Row("true light, accumulated", "light", "accumulate"),
}
NETWORKS = {
    "paper": "paper",
    "paper-no-refine": "paper-no-refine",
    "best": "best",
    "fast": "fast",
    "best-overlap": "best",
    "best-map": "best",
}
"""Weights of the sources that are denoisers."""
PIPELINES = ("tfp41", "ssml", "spk2img-clean", "spk2img-noisy")
NAMES = (*dict.fromkeys(NETWORKS.values()), *LEARNED)
"""Of all weights that a table can use."""


@dataclass(frozen=True)
class Weights:
    """Files of weights by name, instead of those that are shipped."""

    files: Mapping[str, Path] = field(default_factory=dict)

    @classmethod
    def of_modes(cls, modes: Sequence[str], files: WeightFiles | None) -> Weights:
        """The files by mode; InputError for an unknown mode, and for weights of one that cannot be read."""
        weights = cls({mode: Path(path) for mode, path in (files or {}).items()})
        weights.check()
        for mode in modes:
            pretrained_path(mode)
            if why := why_not(mode, weights):
                raise InputError(why)
        return weights

    @classmethod
    def found(cls, folder: Path | None, files: Mapping[str, Path]) -> Weights:
        """The files, and of names that have none NAME.pt in a folder, where it exists."""
        here = {} if folder is None else {n: folder / f"{n}.pt" for n in NAMES if (folder / f"{n}.pt").is_file()}
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
    """Name of the weights that a source or a picture needs; None where it needs none."""
    if source in NETWORKS:
        return NETWORKS[source]
    return source if source in LEARNED else None


def why_not(source: str, weights: Weights) -> str:
    """Why a source cannot be had, or ""; InputError for a given file that cannot be read."""
    name = weights_of(source)
    if name is not None and (why := weights.missing(name)):
        return why
    if source in NETWORKS:
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
    planes = _SOURCES[source](case, exposed, weights)
    return [
        RowStreams(row, decoded(planes, ROWS[row].decoder), planes if ROWS[row].shows_planes else None) for row in rows
    ]


def decoded(planes: Planes, decoder: str) -> Spikes:
    """(T, H, W) rates to spikes by a decoder of `DECODERS`."""
    chosen = DECODERS[decoder]
    return chosen.step(planes, chosen.start(planes.shape[1:]))[0]  # type: ignore[no-any-return]


def denoised(online: OnlineDnSS, exposed: ExposedStreams) -> Planes:
    """Rate planes of the judged frames; later frames than they need are not pushed."""
    seen = exposed.noisy[: exposed.stop + online.latency]
    return restored(online, seen, title=None).rates[exposed.first : exposed.stop]


def planes_a_pass(source: str, weights: Weights) -> int:
    """Rate planes that the source's network gives at once; 1 where there is none."""
    return _passes(*_version(weights.path(NETWORKS[source]))) if source in NETWORKS else 1


@lru_cache(maxsize=8)
def _passes(path: Path, _: int) -> int:
    return load_weights(path)[0].layout.planes


def parameters(source: str, weights: Weights) -> int | None:
    """How many weights a source's network has; None for a source without one."""
    name = weights_of(source)
    return None if name is None else _count(*_version(weights.path(name)))


@lru_cache(maxsize=16)
def _count(path: Path, _: int) -> int:
    return sum(tensor.numel() for tensor in read_plain(path)["state_dict"].values())


@lru_cache(maxsize=4)
def _online(path: Path, _: int, overlap: bool) -> OnlineDnSS:
    return OnlineDnSS.from_file(path, output="rate", overlap=overlap)


def _network(name: str, *, overlap: bool = False) -> Callable[[StreamCase, ExposedStreams, Weights], Planes]:
    return lambda case, exposed, weights: denoised(_online(*_version(weights.path(name)), overlap), exposed)


def _calibrated(case: StreamCase, exposed: ExposedStreams, weights: Weights) -> Planes:
    unit = still.calibrated(case)
    return denoised(OnlineDnSS.from_file(weights.path("best"), output="rate", unit=unit), exposed)


def _pipeline(name: str) -> Callable[[StreamCase, ExposedStreams, Weights], Planes]:
    return lambda case, exposed, weights: reconstruct_many(
        name, exposed.noisy, range(exposed.first, exposed.stop), weights=weights.path(name)
    )


def _light(case: StreamCase, exposed: ExposedStreams, weights: Weights) -> Planes:
    assert exposed.light is not None
    return np.ascontiguousarray(exposed.light)


_SOURCES: dict[str, Callable[[StreamCase, ExposedStreams, Weights], Planes]] = {
    **{name: _network(file) for name, file in NETWORKS.items()},
    "best-overlap": _network("best", overlap=True),
    "best-map": _calibrated,
    **{name: _pipeline(name) for name in PIPELINES},
    "light": _light,
}
