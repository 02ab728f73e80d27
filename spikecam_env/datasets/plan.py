"""The plan of a dataset, from which every byte of it follows.

SPIFT_N: random scenes to train on, and others to test.  PHM_N: the ten well-designed scenes, to test.
Source: the paper, section "Datasets": 100 random scenes, 10 well-designed ones; ours are of our own making.
Films: cuts of a folder of films (`films.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from scenes.catalogue import SCENES, make_scene
from scenes.derived.later import Later
from scenes.exposure import checked_interval
from scenes.protocol import Scene
from scenes.renderers.choose import BACKENDS
from spikecam_env.checked import checked_count, checked_numbers, checked_seed, checked_shape
from spikecam_env.datasets.films import FilmFolder
from spikecam_env.datasets.renderer import AUTO, renderer_of_process
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.sensor import SensorModel

RANDOM = "random"
"""The scene of the catalogue that its seed draws."""

SPLITS = ("train", "test")

DRAWN = ("mean_interval", "renderer")
"""Settings of scenes that are drawn, which cuts of films do not have."""
AT_REST = (0.0, 0.0)
"""Pan of a camera that does not move."""

FASTEST_PAN = 100.0
"""[pixels/frame]; a picture of 400 is crossed in 4 frames."""

MOST_SCENES = 100_000
"""Of a split; the paper has 100."""

PHM = ("ball", "cook", "dice", "doll", "fan", "fly", "hand", "jump", "poker", "top")
"""Scenes of PHM_N, the ten that are designed, by their names in the catalogue."""


@dataclass(frozen=True)
class PlannedScene:
    """One scene, and the camera it is recorded with.

    Example:
        >>> PlannedScene("train/disk.h5", scene="disk", scene_seed=0, unit_seed=7)
        PlannedScene(path='train/disk.h5', scene='disk', scene_seed=0, unit_seed=7)
    """

    path: str
    """Path of its file in the dataset's folder; its first part is the split, "train" or "test"."""
    scene: str
    """Its name in `scenes.catalogue.SCENES`, or that of a film."""
    scene_seed: int
    """Seed of the scene's own draws."""
    unit_seed: int
    """Seed of the camera: its fixed pattern, starting phases and temporal noise."""


@dataclass(frozen=True)
class Plan:
    """A dataset: the scenes, and their common settings.

    Raises:
        InputError: for no entries, an unknown scene, and numbers that are not positive.

    Example:
        >>> plan = Plan("mine", (PlannedScene("train/disk.h5", "disk", 0, 0),), shape=(8, 16), frames=100)
        >>> [entry.scene for entry in plan.entries], plan.mean_interval
        (['disk'], 10.0)
    """

    kind: str
    entries: tuple[PlannedScene, ...]
    shape: tuple[int, int] = (250, 400)
    """(rows, columns)."""
    frames: int = 1000
    """Frames of each recording."""
    seed: int = 0
    truth_every: int = 100
    """Frames between ground truths, at frames 0, truth_every, ...; 0 for none."""
    mean_interval: float = 10.0
    """Mean interval between spikes, over the picture [frames]: the exposure.  Films have their own."""
    model: SensorModel = field(default_factory=SensorModel.preset)
    renderer: str = AUTO
    """Back-end that draws: one of `scenes.renderers.choose.BACKENDS`, or "auto" for the best of the machine."""
    pan: tuple[float, float] = AT_REST
    """Velocity of the camera's gaze, to the right and down [pixels/frame]."""
    films: FilmFolder | None = None
    """Of which the scenes are cut; None: scenes are of the catalogue."""

    def __post_init__(self) -> None:
        if not self.entries:
            raise InputError(f"a {self.kind} dataset of no scenes; ask for 1 or more")
        for entry in self.entries:
            if self.films is None and entry.scene not in SCENES:
                raise unknown_name("scene", entry.scene, SCENES)
        checked_interval(self.mean_interval)
        if self.renderer not in (AUTO, *BACKENDS):
            raise unknown_name("renderer", self.renderer, (AUTO, *BACKENDS))
        checked_seed(self.truth_every, "truth_every")
        checked_seed(self.seed)
        checked_count(self.frames)
        checked_shape(self.shape)
        checked_numbers(self.pan, "pan", 2, -FASTEST_PAN, FASTEST_PAN, unit="pixels/frame")

    def scene(self, entry: PlannedScene) -> Scene:
        """The scene of an entry, as the camera sees it."""
        if self.films is not None:
            return self.films.cut(entry.scene, entry.scene_seed, self.shape, self.frames, self.model.frame_rate_hz)
        scene = make_scene(
            entry.scene,
            shape=self.shape,
            seed=entry.scene_seed,
            mean_interval=self.mean_interval,
            frame_rate_hz=self.model.frame_rate_hz,
            renderer=renderer_of_process(self.renderer),
        )
        return panned(scene, self.pan, self.frames)

    def settings(self) -> dict[str, Any]:
        """Settings that the scenes share, as plain values; `pan` where the camera moves."""
        moving = {} if tuple(self.pan) == AT_REST else {"pan": list(self.pan)}
        plain = {
            "kind": self.kind,
            "shape": list(self.shape),
            "frames": self.frames,
            "seed": self.seed,
            "truth_every": self.truth_every,
            "mean_interval": self.mean_interval,
            "model": self.model.toml(),
            "renderer": self.renderer,
            **moving,
        }
        if self.films is None:
            return plain
        return {n: v for n, v in plain.items() if n not in DRAWN} | {"films": self.films.settings()}


def panned(scene: Scene, pan: tuple[float, float], frames: int) -> Scene:
    """The scene before a camera whose gaze moves evenly, and is at the scene's middle in the middle of so many frames.

    Args:
        scene: of the catalogue.
        pan: velocity of the gaze, to the right and down [pixels/frame].
        frames: of the recording.
    """
    if tuple(pan) == AT_REST:
        return scene
    return Later(scene, offset=(-pan[0] * frames / 2, -pan[1] * frames / 2), drift=(pan[0], pan[1]))


def spift_n(*, train: int = 100, test: int = 10, seed: int = 0, **settings: Any) -> Plan:
    """Random scenes; each follows from the seed, its split and its number.

    Args:
        train: scenes to train on.
        test: other scenes, to test.
        seed: of all scenes.
        settings: fields of `Plan`.

    Example:
        >>> [entry.path for entry in spift_n(train=2, test=1).entries]
        ['train/000.h5', 'train/001.h5', 'test/000.h5']
    """
    counts = {"train": checked_seed(train, "train", MOST_SCENES), "test": checked_seed(test, "test", MOST_SCENES)}
    checked_seed(seed)
    entries = tuple(
        PlannedScene(f"{split}/{number:03}.h5", RANDOM, *_seeds(seed, split, number))
        for split, count in counts.items()
        for number in range(count)
    )
    return Plan("spift-n", entries, seed=seed, **settings)


def phm_n(*, scenes: tuple[str, ...] = PHM, seed: int = 0, **settings: Any) -> Plan:
    """Well-designed scenes, each with a camera of its own.

    Args:
        scenes: names in the catalogue.
        seed: of all scenes.
        settings: fields of `Plan`.

    Example:
        >>> [entry.path for entry in phm_n(scenes=("fan", "train"), frames=100).entries]
        ['test/fan.h5', 'test/train.h5']
    """
    checked_seed(seed)
    for name in scenes:
        if scenes.count(name) > 1:
            raise InputError(f"scene {name!r} is listed {scenes.count(name)} times; list it once")
    entries = tuple(PlannedScene(f"test/{name}.h5", name, seed, _seeds(seed, name, 0)[1]) for name in scenes)
    return Plan("phm-n", entries, seed=seed, **settings)


def film_cuts(films: FilmFolder, *, cuts: int = 1, split: str = "test", seed: int = 0, **settings: Any) -> Plan:
    """Cuts of films, each at a place and with a camera of its own.

    Args:
        films: the folder, and how light is made of its films.
        cuts: from each film.
        split: "train" or "test", the folder of the recordings.
        seed: of all cuts.
        settings: fields of `Plan`.

    Raises:
        InputError: as `FilmFolder.names`, and as `FilmFolder.cut` of the first film; an unknown split.

    Example:
        >>> from pathlib import Path
        >>> Path("films").mkdir()
        >>> np.save("films/wave.npy", np.random.default_rng(0).random((4, 20, 30)))
        >>> [entry.path for entry in film_cuts(FilmFolder(Path("films")), cuts=2, shape=(8, 16), frames=60).entries]
        ['test/wave-0.h5', 'test/wave-1.h5']
    """
    checked_seed(seed)
    if split not in SPLITS:
        raise unknown_name("split", split, SPLITS)
    entries = tuple(
        PlannedScene(f"{split}/{Path(name).stem}-{number}.h5", name, *_seeds(seed, name, number))
        for name in films.names()
        for number in range(checked_count(cuts, "cuts", MOST_SCENES))
    )
    plan = Plan("films", entries, seed=seed, films=films, **settings)
    plan.scene(entries[0])  # options that no film can have are refused before anything is written
    return plan


def _seeds(seed: int, purpose: str, number: int) -> tuple[int, int]:
    """Of a scene and of its camera."""
    rng = np.random.default_rng([seed, *purpose.encode(), number])
    return int(rng.integers(2**31)), int(rng.integers(2**31))
