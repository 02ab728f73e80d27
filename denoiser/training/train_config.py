"""Options of every training and their checks, the sources by mode, the record in a file of weights."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any, get_type_hints

from denoiser.ground.captured import checked_compiler
from denoiser.networks.reconstructor_recipe import LEARNED, reconstructor_recipe
from denoiser.networks.spk2imgnet import WINDOW
from denoiser.passes.recipe import MODES, PictureRecipe, checked_channels
from denoiser.training.interval_training import IntervalWindows
from denoiser.training.lessons import SelfTaught, Supervised
from denoiser.training.picture_training import PictureLessons
from denoiser.training.rollout import Rollouts
from denoiser.training.training_source import TrainingSource
from denoiser.weights import AnyRecipe
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.numbers import MOST_WORKERS, Range, WholeRange
from spikecam_env.sensor.engines.gpu import checked_device

SOURCES: dict[str, type[TrainingSource]] = {
    "best": Rollouts,
    "fast": Rollouts,
    "paper": IntervalWindows,
    "picture": PictureLessons,
    "spk2img-clean": Supervised,
    "spk2img-noisy": Supervised,
    "ssml": SelfTaught,
}
"""By mode."""

OF_MODE: Any = None
"""Stands for the mode's own default."""


@dataclass(frozen=True)
class TrainConfig:
    """Options of a training; the run ends after `steps`, or `minutes` where that is given.

    Options that the mode does not have are left out, as are those that are to be the mode's own.

    Raises:
        InputError: an option is unusable, or not of the mode.
    """

    mode: str = "best"
    """Of a denoiser: "best", "fast", "paper" or "picture"; of a reconstructor: "spk2img-clean", "spk2img-noisy" or
    "ssml"."""
    out: Annotated[Path, _folder] = Path("training")
    """Folder."""
    steps: Annotated[int, WholeRange(1, 10**9).check] = 20_000
    batch: Annotated[int, WholeRange(1, 65_536).check] = OF_MODE
    """Streams a step: 16, of `picture` 8, of reconstructors 64."""
    seed: Annotated[int, WholeRange(0, 2**62).check] = 0
    """The seed of a validation is above it."""
    threads: Annotated[int, WholeRange(1, MOST_WORKERS).check] = 1
    """Of the processor."""
    resume: Annotated[bool, _flag] = True
    """Go on from out/last.pt."""
    minutes: Annotated[float | None, Range(0, 1e6, above=True).check] = None
    """Of the whole training, with the drawing of textures and compilation."""
    patch: int = 64
    """Side of the streams [pixels]."""
    lr: Annotated[float, Range(0, 1, above=True).check] = 1e-3
    """Highest rate of learning."""
    save_every_s: Annotated[float, Range(0, 1e9, above=True).check] = 60.0
    validate_every: Annotated[int, WholeRange(1, 10**9).check] = OF_MODE
    """Steps between validations: 1000, of reconstructors 500."""
    device: str = "cpu"
    """Of streams and network; a GPU wants larger batches."""
    compiled: Annotated[bool, _flag] = False
    """The simulated light by `torch.compile`, on a processor too; a GPU always does."""
    refine: Annotated[bool, _flag] = True
    """`paper` with its refine module or, for the ablation, without."""
    channels: tuple[int, ...] | None = None
    """Of `best` and `fast`, as `stream_network.StreamDnSS` has them, of `picture`, as `picture_network.PictureDnSS`:
    fewer are faster, and less accurate.  None: the mode's."""
    validate_passes: Annotated[int, WholeRange(1, 10**6).check] = OF_MODE
    """Passes of each validation of a denoiser along its streams: 24."""
    start: Annotated[str | None, _weights] = None
    """Weights of the same mode of a denoiser to begin from: a file of this training, or a mode's name for those that
    ship.  A network with more channels, or with the refine module, is made smaller (`smaller`)."""
    teacher: Annotated[str | None, _weights] = None
    """Of `best` and `fast`: weights whose rates the network is to learn instead of the light, a file or "best"."""
    layers: Annotated[str, _layers] = OF_MODE
    """Of `best` and `fast`: those that learn, "all" or "last" (`stream_network.LAST`)."""
    seams: Annotated[float, Range(0, 1000).check] = OF_MODE
    """Of `best` and `fast`: weight of steps from pass to pass in the loss (`rollout`), 0 without the option."""
    panned: Annotated[float, Range(0, 1).check] = OF_MODE
    """Of `best` and `fast`: share of the scenes before a camera that pans."""
    weak: Annotated[float, Range(0, 1).check] = OF_MODE
    """Of `best` and `fast`: share of the layers of scenes whose texture is weak."""
    width: Annotated[int | None, _width] = None
    """Channels of a reconstructor; None: the recipe's."""
    recordings: Annotated[tuple[str, ...], _recordings] = ()
    """.h5 recordings with a clean twin, and folders of datasets, whose streams are learnt instead of simulated ones."""
    frames_a_step: Annotated[int, WholeRange(1, WINDOW).check] = OF_MODE
    """Frames by which the streams of a reconstructor go on: 12."""

    def __post_init__(self) -> None:
        if self.mode not in [*SOURCES]:
            raise unknown_name("mode", self.mode, SOURCES)
        source, hints = self.source, get_type_hints(type(self), include_extras=True)
        for field in fields(self):
            name, value = field.name, getattr(self, field.name)
            if value is field.default:
                value = source.options.get(name, value)
            else:
                _refuse_other_modes(name, self.mode)
                for check in getattr(hints[name], "__metadata__", ()):
                    value = check(value, name)
            object.__setattr__(self, name, value)
        if self.channels is not None:
            object.__setattr__(self, "channels", self.recipe.channels)  # type: ignore[union-attr]
        if WholeRange(source.sides[0], source.sides[-1]).check(self.patch, "patch") not in source.sides:
            raise InputError(f"patch is {self.patch}; it must be a multiple of {source.sides.step}")
        if self.layers == "last" and self.start is None:
            raise InputError("layers is 'last'; say from which weights the other layers come with start, e.g. best")
        checked_device(self.device, "train with --device cpu")
        if self.compiled:
            checked_compiler(self.device)

    @property
    def recipe(self) -> AnyRecipe:
        """Of the network to train."""
        if self.mode in LEARNED:
            return reconstructor_recipe(self.mode, self.width)
        recipe = MODES[self.mode]
        channels: Any = recipe.channels
        if self.channels is not None:
            channels = checked_channels(self.channels, recipe.channels)
        if isinstance(recipe, PictureRecipe):
            return replace(recipe, channels=channels)
        return replace(recipe, refine=self.refine, channels=channels)

    @property
    def source(self) -> type[TrainingSource]:
        """The streams from which the network learns."""
        return SOURCES[self.mode]


def _flag(value: Any, name: str) -> bool:
    if not isinstance(value, bool):
        raise InputError(f"{name} is {value!r}; it must be True or False")
    return value


def _folder(value: Any, name: str) -> Path:
    if not isinstance(value, str | os.PathLike):
        raise InputError(f"{name} is {value!r}; it must be the path of a folder")
    return Path(value)


def _weights(value: Any, name: str) -> str:
    if not isinstance(value, str):
        raise InputError(f"{name} is {value!r}; it must be the path of weights, or a mode's name")
    return value


def _recordings(value: Any, name: str) -> tuple[str, ...]:
    if isinstance(value, str | os.PathLike) or not all(isinstance(path, str | os.PathLike) for path in value):
        raise InputError(f"{name} is {value!r}; it must be a list of paths")
    return tuple(map(str, value))


def _layers(value: Any, _: str) -> str:
    if value not in ("all", "last"):
        raise unknown_name("layers", value, ("all", "last"))
    return str(value)


def _width(value: Any, _: str) -> int:
    return reconstructor_recipe("ssml", value).width


OF_SOME = {name for source in SOURCES.values() for name in source.options}
"""Options that not every mode has alike."""


def _refuse_other_modes(name: str, mode: str) -> None:
    """InputError for an option that the mode does not have."""
    if name in OF_SOME and name not in SOURCES[mode].options:
        modes = sorted(other for other, source in SOURCES.items() if name in source.options)
        raise InputError(f"--{name.replace('_', '-')} is for {', '.join(modes)}; leave it out for {mode}")


NOT_RECORDED = ("out", "resume", "save_every_s")
"""Options that change nothing in the weights."""


def training_record(config: TrainConfig, steps: int, seconds: float, resumed_at: list[int]) -> dict[str, Any]:
    """The command, its options and its course, as plain values for a file of weights."""
    try:
        package = version("spikecam-env")
    except PackageNotFoundError:
        package = "not installed"
    return {
        "command": command(config),
        "options": {name: getattr(config, name) for name in _defaults(config)},
        "steps": steps,
        "minutes": round(seconds / 60, 1),
        "resumed_at": resumed_at,
        "package": package,
    }


def command(config: TrainConfig) -> str:
    """The command line that trains so; OUT stands for the folder."""
    defaults = _defaults(config)
    given = {name: value for name, value in vars(config).items() if name in defaults and value != defaults[name]}
    if config.minutes is not None:
        given.pop("steps", None)  # it ends no such run
    options = (_option(name, value) for name, value in given.items() if name != "mode")
    return " ".join(["spikecam train", f"--mode {config.mode}", "--out OUT", *options])


def _defaults(config: TrainConfig) -> dict[str, Any]:
    """Of the options that are recorded, by name."""
    own = config.source.options
    names = [f.name for f in fields(config) if f.name in own or f.name not in (*OF_SOME, *NOT_RECORDED)]
    return {name: own.get(name, getattr(TrainConfig, name)) for name in names}


def _option(name: str, value: Any) -> str:
    option = name.replace("_", "-")
    if isinstance(value, bool):
        return f"--{option}" if value else f"--no-{option}"
    return " ".join([f"--{option}", *map(str, value if isinstance(value, tuple) else (value,))])
