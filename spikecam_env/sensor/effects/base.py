"""An effect: a named deviation from the ideal pixel, with parameters, applied in physical order.

An effect is a frozen dataclass in a file of its own; it overrides the hooks that it needs and no others.
Once a camera:

    imprint      the fixed pattern, on the array in circuit units
    image        the image that optics make of a picture: linear, and the same at all times

once a recording:

    begin        memory of the effect from frame to frame; by default a random generator of its own

for a block of frames, whatever fires in it; arrays have a leading axis of time:

    collect      charge expected, from light and in the dark, before shot noise
    compare      how the comparators' reference moves from frame to frame
    sway         how it moves within them; `parts` and `kinks` say how finely
    read_out     bits reported

and frame by frame, for laws that depend on the spikes:

    react        thresholds of a frame, given the spikes before it
    after_reset  charge left on the pixels that fired
    spiked       charge of all pixels at the end of a frame, given its spikes
    feedback     the same three in numbers, for the compiled kernel

Of one hook the effects act by stage (optics, photodiode, integration, threshold, reset, read-out) and, within a stage,
by name.  Hooks are functions of their arguments: they change no array in place, and return the memory for later
frames.  Cuts of a recording into blocks must change no bit: draw frame by frame, arrays of (F, ...) in order of time.
Every strength has a neutral value at which each hook returns its arguments unchanged, so that no bit changes.

The reference calls every hook, a block of one frame at a time.  The fast engine calls those for blocks and takes the
rest from `feedback`; an effect that reacts to spikes and does not declare it, it refuses by name.  An effect with
`imprint` and `image` alone costs nothing a frame.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Sequence
from enum import Enum, IntEnum
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError, unknown_name
from spikecam_env.renamed import old_names
from spikecam_env.sensor.effects.identification import Identification
from spikecam_env.sensor.frame_moments import Moments
from spikecam_env.sensor.ranges import check_parameters
from spikecam_env.sensor.ranges import parameter as parameter
from spikecam_env.sensor.unit import PixelArray, Unit
from spikecam_env.types import Floats, Masks, Pictures

PACKAGE = f"{__package__}."
"""Prefix of the package's own effects; hooks of others are checked (`sensor/own_hooks.py`)."""

NEW_CLASS_CHECKS: list[Callable[[type[Effect]], None]] = []
"""Called with each new class of another package, when the class is made."""

MOST_PARTS = 1024
"""Parts of a frame at most: 32 periods of a sine."""

PARTS_OF_A_CYCLE = 32
"""Parts of a period of a sine that are taken as linear: within (2 pi / 32)^2 / 8, half a per cent of its amplitude."""


class Stage(IntEnum):
    """Where in the pixel an effect acts; the order is the order of application.

    Example:
        >>> [stage.name for stage in Stage][:3]
        ['OPTICS', 'PHOTODIODE', 'INTEGRATION']
    """

    OPTICS = 1
    PHOTODIODE = 2
    INTEGRATION = 3
    THRESHOLD = 4
    RESET = 5
    READOUT = 6


class Acts(Enum):
    """How an effect acts within a frame; its docstring says so in these words, and how far that is exact.

    Example:
        >>> from spikecam_env.sensor import CATALOGUE
        >>> CATALOGUE["dead_time"].acts
        <Acts.CROSSING: 'at the crossing'>
    """

    CONSTANT = "constant in time"
    INTEGRATED = "integrated over the frame"
    CROSSING = "at the crossing"
    END = "at the end of the frame"
    DRAWN = "drawn once a frame"


@dataclasses.dataclass(frozen=True)
class ExposureBlock:
    """A block of frames of one camera: the circumstances of a hook's call.

    Where light bends within a frame, an effect that `wants_rise` gets it piece by piece: a block is then one piece, of
    number 0, with the frame rate of frames as short as it.

    Example:
        >>> from spikecam_env.sensor import SensorModel
        >>> unit = SensorModel.preset("ideal").draw_unit((2, 2), seed=0)
        >>> ExposureBlock(number=40, frame_rate_hz=40_000.0, shape=(2, 2), unit=unit, frames=2).start.ravel().tolist()
        [40.0, 41.0]
    """

    number: int
    """Of its first frame, absolute, from 0."""
    frame_rate_hz: float
    shape: tuple[int, int]
    """(rows, columns)."""
    unit: Unit
    """The firing law of every pixel."""
    frames: int = 1
    """How many, F; one for the hooks that act frame by frame."""
    length: float = 1.0
    """Of a frame, in the camera's frames; of a piece, below 1."""
    origin: float = 0.0
    """Time from the recording's start to a piece, in lengths of the piece."""

    @property
    def start(self) -> Floats:
        """When each frame begins (F, 1, 1) [frames]."""
        return (self.origin + self.number + np.arange(self.frames, dtype=np.float64))[:, None, None]

    @property
    def middle_s(self) -> Floats:
        """Time of the middle of each frame (F, 1, 1) [s]."""
        return (self.start + 0.5) / self.frame_rate_hz

    def piece(self, start: float, length: float) -> ExposureBlock:
        """A piece of one frame, from `start` in it on [frames]."""
        rate, origin = self.frame_rate_hz / length, (self.number + start) / length
        return dataclasses.replace(self, number=0, frame_rate_hz=rate, length=length, origin=origin)

    def charge_of(self, current_pA: float) -> Floats:
        """Charge (H, W) that a current brings in a frame of the camera [thresholds]."""
        return (current_pA * 1e3 / (self.frame_rate_hz * self.length) / self.unit.threshold_fC).reshape(self.shape)


class Few(NamedTuple):
    """Charge of a few pixels.

    Example:
        >>> hot = Few(np.array([1]), np.array([[0.5]]))
        >>> Charge(np.zeros((1, 1, 3))).plus(hot).values.tolist()
        [[[0.0, 0.5, 0.0]]]
    """

    pixels: NDArray[np.intp]
    """Flat indices (n,), ascending."""
    charge: Floats
    """Of each in every frame (F, n) [thresholds]."""


@dataclasses.dataclass(frozen=True)
class Charge:
    """Charge expected of every pixel in every frame of a block [thresholds]: pixels * factor, below zero as zero.

    Its parts keep a number a frame for changes common to all pixels, and no picture for charge of a few.

    Example:
        >>> Charge(np.array([[[0.2, 0.4]]])).scaled(0.5).values.tolist()
        [[[0.1, 0.2]]]
    """

    pixels: Floats
    """(F, H, W), or (1, H, W) where all frames are alike."""
    factor: Floats | float = 1.0
    """(F, 1, 1), (F, H, 1) or a number."""
    rise: Floats | float = 0.0
    """As pixels, or 0: charge at a frame's end minus that at its start, per frame, of the line with its mean and first
    moment.  An effect that changes charge otherwise than by a factor may leave it out."""
    few: Few | None = None
    """More charge of some pixels, before the factor."""
    tilt: Floats | float = 0.0
    """(F, 1, 1) or 0: more rise, pixels * tilt."""

    def scaled(self, factor: Floats | float) -> Charge:
        """This, times a number a frame or a row."""
        return Charge(self.pixels, self.factor * factor, self.rise, self.few, self.tilt * factor)

    def modulated(self, by: Moments) -> Charge:
        """This, times a number that changes within each frame, where charge is linear in the frame."""
        rises = self.rises
        if not rises.any():
            return Charge(self.pixels, self.factor * by.mean, 0.0, self.few, self.factor * by.tilt)
        x = self.values
        return Charge(x * by.mean + rises * (by.tilt / 12.0), 1.0, x * by.tilt + rises * by.square)

    def plus(self, few: Few) -> Charge:
        """This, and more charge of a few pixels."""
        if self._whole and self.few is None:
            return Charge(self.pixels, 1.0, self.rise, few)
        return Charge(self.values, 1.0, self.rises, few)

    @property
    def values(self) -> Floats:
        """Multiplied out: (F, H, W), or (1, H, W) where all frames are alike."""
        pixels = self.pixels if self.few is None else self._with_few(self.few)
        return pixels if self._whole else pixels * self.factor

    def _with_few(self, few: Few) -> Floats:
        frames, (height, width) = len(few.charge), self.pixels.shape[1:]
        all_frames = np.empty((frames, height * width))
        all_frames[:] = self.pixels.reshape(-1, height * width)
        all_frames[:, few.pixels] += few.charge
        return all_frames.reshape(frames, height, width)

    @property
    def rises(self) -> Floats:
        """`rise` and `tilt`, multiplied out."""
        rise = self.rise if self._whole else self.rise * self.factor
        return np.asarray(rise if isinstance(self.tilt, float) else rise + self.pixels * self.tilt)

    @property
    def _whole(self) -> bool:
        return isinstance(self.factor, float) and self.factor == 1.0


@dataclasses.dataclass(frozen=True)
class Shift:
    """How the comparators' reference moves: a pixel fires at its threshold * factor + millivolts over its swing.

    Within frames (`sway`) both are (F, H, n), with 1 for F or H, at the n given moments.  Either may be a number.
    Of several effects the factors multiply and the millivolts add.

    Example:
        >>> Shift(millivolts=2.0)
        Shift(factor=1.0, millivolts=2.0)
    """

    factor: Floats | float = 1.0
    """From frame to frame (`compare`): (F, H, 1), with 1 for F or H where all are alike."""
    millivolts: Floats | Pictures | float = 0.0
    """From frame to frame: (F, H, W), with 1 for F, H or W; in single precision where pixels differ."""


class Feedback(NamedTuple):
    """Actions of spikes on the pixels, in numbers; charge in thresholds, time in frames.

    On a reset, x being the charge of the frame:

        residual <- (residual - lost_per_root_rate sqrt(x) - lost_per_rate x) kept

    At the moment of a spike each of its four neighbours gets `kick_at_once`, and fires where that is enough, but not
    twice at one moment: a kick that would make it fire again is lost.  At the end of the frame every pixel gets `kick`
    for each of its four neighbours that fired.  One that fired gets left (1 - exp(-T/left_tau)), T the interval that
    has ended.  Thresholds of a row are times 1 + droop a, a the share of it that fired in the frame before.

    Example:
        >>> Feedback(lost_per_rate=0.1).lost(np.array([0.0, 0.5])).tolist()
        [0.0, 0.05]
    """

    lost_per_root_rate: float = 0.0
    lost_per_rate: float = 0.0
    kept: float = 1.0
    kick: float = 0.0
    left: float = 0.0
    left_tau: float = 1.0
    droop: float = 0.0
    kick_at_once: float = 0.0

    def lost(self, rate: Floats) -> Floats:
        """Light (n,) that falls while a reset holds the node, of pixels with this charge a frame [thresholds]."""
        return self.lost_per_root_rate * np.sqrt(rate) + self.lost_per_rate * rate


class Bend(NamedTuple):
    """How the charge of a frame with keys inside it comes, every pixel's (H, W) [thresholds], dark current included.

    Example:
        >>> even = Bend(np.full((2, 2), 0.2), *np.zeros((4, 2, 2)))
        >>> float(even.mean.max()), float(even.uneven.max())
        (0.2, 0.0)
    """

    mean: Floats
    """Charge of the frame."""
    uneven: Floats
    """Largest distance of the light at any moment from the mean [thresholds a frame]."""
    moved: Floats
    """Charge that comes at another time than if it came evenly."""
    bent: Floats
    """Largest distance of the light from the straight line with its mean and first moment [thresholds a frame]."""
    off_line: Floats
    """Integral of that distance."""


@dataclasses.dataclass(frozen=True)
class Effect:
    """Base of all effects; every hook here does nothing.  Charge is in thresholds of each pixel.

    Example:
        >>> from spikecam_env.sensor import CATALOGUE
        >>> effect = CATALOGUE["dead_time"](tau_us=0.2)
        >>> effect.stage.name, effect.parameters(), effect.neutralised()
        ('RESET', {'tau_us': 0.2}, DeadTime(tau_us=0.0))
    """

    stage: ClassVar[Stage]
    acts: ClassVar[Acts | None] = None
    wants_rise: ClassVar[bool] = False
    """Whether `collect` needs the rise of light within a frame.  Effects before the read-out then get light that bends
    piece by piece, as charge of a frame as bright as the piece."""
    name: ClassVar[str] = "effect"
    strength: ClassVar[str]
    """The parameter that is the strength of the effect."""
    neutral: ClassVar[float] = 0.0
    """The strength at which no bit changes."""
    identification: ClassVar[Identification] = Identification()
    """How a diagnosis finds it in recordings."""

    def __init_subclass__(cls) -> None:
        cls.name = effect_name(cls.__name__)
        if not cls.__module__.startswith(PACKAGE):
            for check in NEW_CLASS_CHECKS:
                check(cls)

    def __post_init__(self) -> None:
        check_parameters(self, self.name)

    @classmethod
    def neutralised(cls) -> Effect:
        """This effect at the strength that changes no bit."""
        return cls(**{cls.strength: cls.neutral})

    @classmethod
    def overrides(cls, hook: str) -> bool:
        """Whether this effect has a hook of its own of that name."""
        return getattr(cls, hook) is not getattr(Effect, hook)

    @classmethod
    def is_fixed(cls) -> bool:
        """Whether this effect does nothing from frame to frame, so that every engine carries it."""
        return not any(cls.overrides(hook) for hook in FRAME_HOOKS)

    @classmethod
    def is_compiled(cls) -> bool:
        """Whether the fast engine carries this effect: it does not depend on spikes, or declares how."""
        return cls.overrides("feedback") or not any(cls.overrides(hook) for hook in SPIKE_HOOKS)

    def parameters(self) -> dict[str, Any]:
        """Parameter values by name."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        """Leave the fixed pattern (and constant strengths) on the array."""
        return pixels

    def image(self, radiance: Pictures) -> Pictures:
        """The picture (H, W) that reaches the pixels; linear in `radiance`."""
        return radiance

    def begin(self, first: ExposureBlock, pattern: np.random.Generator, rng: np.random.Generator) -> Any:
        """Memory of the effect at frame 0; picklable.

        Args:
            first: the first frame.
            pattern: generator of this effect for properties of the unit, the same in all its recordings.
            rng: generator of this effect for this recording.
        """
        return rng

    def collect(self, light: Charge, dark: Charge, now: ExposureBlock, memory: Any) -> tuple[Charge, Charge, Any]:
        """Charge expected in these frames from light (at most two thresholds) and in the dark, and the memory."""
        return light, dark, memory

    def compare(self, now: ExposureBlock, memory: Any) -> tuple[Shift, Any]:
        """How the comparators' reference moves in these frames, and the memory."""
        return Shift(), memory

    def parts(self, frame_rate_hz: float) -> int:
        """Parts of a frame in each of which the reference moves linearly by `sway`, MOST_PARTS at most; 0 for none."""
        return 0

    def kinks(self, first: ExposureBlock) -> tuple[float, ...]:
        """Phases of the array's clock [frames], in [0, 1), at which `sway` jumps."""
        return ()

    def sway(self, now: ExposureBlock, phase: Floats, beside: Floats) -> Shift:
        """How the reference moves within these frames, at moments (H or 1, n) of each.

        Args:
            now: the frames.
            phase: of the array's clock at those moments [frames]: 0 at the start of the frame, below 0 in the rows
                that are read before its end.
            beside: a phase near it between the same two kinks.  A jump of the reference has two moments of the same
                phase, one on either side.
        """
        return Shift()

    def lead(self, first: ExposureBlock) -> Floats | float:
        """Time from each row's read-out to the end of the array's frame (H, 1) [frames]."""
        return 0.0

    def off_the_line(self, bend: Bend, now: ExposureBlock) -> Floats | float:
        """Largest error of `collect` in a frame whose light bends (H, W) [thresholds], beside `sway` and `feedback`."""
        return 0.0

    def read_out(self, spikes: Masks, now: ExposureBlock, memory: Any) -> tuple[Masks, Any]:
        """The bits reported (F, H, W), and the memory."""
        return spikes, memory

    def react(self, threshold: Floats, now: ExposureBlock, memory: Any) -> Floats:
        """Thresholds of this frame (H, W), given the memory of spikes."""
        return threshold

    def after_reset(self, residual: Floats, rate: Floats, now: ExposureBlock) -> Floats:
        """Charge left on the pixels that fired (n,), given that over their threshold and their charge a frame."""
        return residual

    def spiked(
        self, charge: Floats, spikes: Masks, rate: Floats, now: ExposureBlock, memory: Any
    ) -> tuple[Floats, Any]:
        """Charge at the end of the frame (H, W), given its spikes and the charge a frame, and the memory."""
        return charge, memory

    def feedback(self, first: ExposureBlock) -> Feedback:
        """The numbers of `react`, `after_reset` and `spiked`."""
        return Feedback()


BLOCK_HOOKS = ("collect", "compare", "sway", "read_out")
SPIKE_HOOKS = ("react", "after_reset", "spiked")
FRAME_HOOKS = ("begin", *BLOCK_HOOKS, *SPIKE_HOOKS)


def effect_name(class_name: str) -> str:
    """The name of an effect by that of its class.

    Example:
        >>> effect_name("DeadTime")
        'dead_time'
    """
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", class_name).lower()


def having(hook: str, effects: Sequence[Effect]) -> list[Effect]:
    """The effects with a hook of their own of that name.

    Example:
        >>> from spikecam_env.sensor import CATALOGUE
        >>> [effect.name for effect in having("image", [CATALOGUE["optical_blur"](), CATALOGUE["dead_time"]()])]
        ['optical_blur']
    """
    return [effect for effect in effects if effect.overrides(hook)]


def neighbour_sum(values: Floats) -> Floats:
    """Sum over each pixel's four neighbours (..., H, W), zero beyond the edge.

    Example:
        >>> neighbour_sum(np.ones((3, 3))).tolist()
        [[2.0, 3.0, 2.0], [3.0, 4.0, 3.0], [2.0, 3.0, 2.0]]
    """
    total = np.zeros_like(values)
    total[..., 1:, :] += values[..., :-1, :]
    total[..., :-1, :] += values[..., 1:, :]
    total[..., :, 1:] += values[..., :, :-1]
    total[..., :, :-1] += values[..., :, 1:]
    return total


def check_parts(effects: Sequence[Effect], frame_rate_hz: float) -> None:
    """Raise InputError for a reference that moves too fast within a frame.

    Example:
        >>> from spikecam_env.sensor import CATALOGUE
        >>> check_parts([CATALOGUE["supply_ripple"](frequency_hz=50.0)], frame_rate_hz=40_000.0)  # slow: no error
    """
    for effect in effects:
        parts = effect.parts(frame_rate_hz)
        if parts > MOST_PARTS:
            raise InputError(
                f"{effect.name} moves the reference too fast: a frame of {1e6 / frame_rate_hz:g} us would be cut into "
                f"{parts} parts; at most {MOST_PARTS} are allowed (32 periods of a sine); lower its frequency, "
                "lengthen its time constant, or raise frame_rate_hz"
            )


def build(catalogue: dict[str, type[Effect]], name: str, parameters: dict[str, Any]) -> Effect:
    """Make an effect from its name and parameters; InputError for an unknown one.

    Example:
        >>> from spikecam_env.sensor import CATALOGUE
        >>> build(CATALOGUE, "dead_time", {"tau_us": 0.2})
        DeadTime(tau_us=0.2)
    """
    if name not in catalogue:
        raise unknown_name("effect", name, catalogue)
    allowed = {f.name for f in dataclasses.fields(catalogue[name])}
    for key in parameters:
        if key not in allowed:
            raise unknown_name(f"parameter of {name}", key, allowed)
    return catalogue[name](**parameters)


__getattr__ = old_names(__name__, {"Array": "Floats", "Exposure": "ExposureBlock", "Spikes": "Masks"})
