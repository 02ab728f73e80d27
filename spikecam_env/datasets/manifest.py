"""`dataset.json`: a dataset's settings and scenes, with size and SHA-256 of every file that is done.

A file counts only when it is listed here; so a run after one that was killed makes the others.  Nothing in it
says when, where or by how many processes the dataset was made.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from scenes.catalogue import make_scene
from scenes.protocol import Scene
from spikecam_env.datasets.plan import AT_REST, Plan, panned
from spikecam_env.datasets.renderer import renderer_of_process
from spikecam_env.datasets.write import Written
from spikecam_env.errors import InputError
from spikecam_env.names import distinct, inside
from spikecam_env.untrusted import (
    Count,
    Declared,
    Name,
    Positive,
    Seed,
    Side,
    Whole,
    checked_format,
    declared,
    parse_toml,
    read_json,
)
from spikecam_env.version import __version__
from spikecam_env.whole import write_text_whole

NAME = "dataset.json"
FORMAT = "spikecam-dataset/1"
_STATE = {"bytes", "sha256"}


class _Films(Declared):
    """See `FilmFolder`."""

    film_rate_hz: Positive | None
    transfer: Name | None
    interpolation: Name
    white: Positive


class _Settings(Declared):
    """Settings that the scenes of a dataset share, see `Plan`."""

    package_version: str
    kind: str
    shape: list[Side] = Field(min_length=2, max_length=2)
    frames: Count
    seed: Seed
    truth_every: Whole
    mean_interval: Positive | None = None
    model: str
    renderer: str | None = None
    pan: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    films: _Films | None = None


class _File(Declared):
    """An entry of a dataset, see `PlannedScene`; bytes and sha256 are null until its file is done."""

    path: Name
    scene: Name
    scene_seed: Whole
    unit_seed: Whole
    bytes: Whole | None
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")] | None

    @model_validator(mode="after")
    def _is_done_or_not(self) -> _File:
        if (self.bytes is None) != (self.sha256 is None):
            raise ValueError("bytes and sha256 come together, or neither")
        return self


class _DatasetFile(Declared):
    format: str
    settings: _Settings
    files: list[_File]


@dataclass(frozen=True)
class Manifest:
    """Settings and files of a dataset."""

    settings: dict[str, Any]
    """Settings that the scenes share."""
    files: tuple[dict[str, Any], ...]
    """One a scene; `bytes` and `sha256` are None until it is done."""

    @classmethod
    def of(cls, plan: Plan) -> Manifest:
        """The manifest of a new dataset."""
        settings = {"package_version": __version__, **plan.settings()}
        return cls(settings, tuple({**asdict(entry), "bytes": None, "sha256": None} for entry in plan.entries))

    @classmethod
    def read(cls, folder: Path, *, outside: bool = False) -> Manifest:
        """The manifest of a folder.

        Args:
            folder: of the dataset.
            outside: whether files may lie outside of the folder.

        Raises:
            InputError: where it is missing or damaged, or names files outside of the folder.
        """
        path = folder / NAME
        if not path.is_file():
            raise InputError(f"{folder} is no dataset: there is no {NAME} in it")
        try:
            data = checked_format(read_json(path), FORMAT, NAME)
            file = declared(_DatasetFile, data, NAME)
        except InputError as error:
            raise InputError(f"{path} is damaged ({error}); make the dataset again in an empty folder") from error
        for entry in file.files:
            inside(folder, entry.path, f"{path}: file", outside=outside)
        distinct((entry.path for entry in file.files), "file")
        return cls(data["settings"], tuple(data["files"]))

    def scene(self, file: dict[str, Any]) -> Scene:
        """The scene of one of its files, as the camera saw it."""
        rows, columns = self.settings["shape"]
        rate = parse_toml(self.settings["model"], f"{NAME}: model").get("frame_rate_hz", 0.0)
        interval, renderer = self.settings["mean_interval"], renderer_of_process(self.settings["renderer"])
        scene = make_scene(file["scene"], (rows, columns), file["scene_seed"], interval, rate, renderer)
        return panned(scene, self.pan, self.settings["frames"])

    @property
    def pan(self) -> tuple[float, float]:
        """Velocity of the camera's gaze [pixels/frame]."""
        right, down = self.settings.get("pan") or AT_REST
        return right, down

    def write(self, folder: Path) -> None:
        """The file appears whole."""
        data = {"format": FORMAT, "settings": self.settings, "files": self.files}
        write_text_whole(folder / NAME, json.dumps(data, indent=1) + "\n")

    def with_file(self, written: Written) -> Manifest:
        """With a file that is done."""
        done = {"bytes": written.size, "sha256": written.sha256}
        files = (file | done if file["path"] == written.entry.path else file for file in self.files)
        return Manifest(self.settings, tuple(files))

    def without_lost(self, folder: Path) -> Manifest:
        """Files that have gone, or have another size than when they were done, are not done."""
        lost = {"bytes": None, "sha256": None}
        return Manifest(self.settings, tuple(f if _is_kept(folder, f) else f | lost for f in self.files))

    def differences(self, other: Manifest) -> list[str]:
        """Where settings and scenes differ, as "frames 1000 (asked: 500)"."""
        ours, theirs = self._wanted(), other._wanted()
        return [
            name if name in ("model", "scenes") else f"{name} {ours.get(name)} (asked: {theirs[name]})"
            for name in theirs
            if ours.get(name) != theirs[name]
        ]

    def _wanted(self) -> dict[str, Any]:
        scenes = [{k: v for k, v in file.items() if k not in _STATE} for file in self.files]
        return {**self.settings, "scenes": scenes}


def _is_kept(folder: Path, file: dict[str, Any]) -> bool:
    path = folder / file["path"]
    return file["sha256"] is not None and path.is_file() and path.stat().st_size == file["bytes"]
