"""The camera you can step: a model, one unit of it, and the state of every pixel."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from importlib import import_module
from itertools import zip_longest
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from spikecam_env.checked import LARGEST_DERIVED_SEED, checked_count, checked_seed, checked_shape
from spikecam_env.errors import InputError, shown, unknown_name
from spikecam_env.sensor import bent_light as bent
from spikecam_env.sensor.drive import wants_pieces
from spikecam_env.sensor.effects.base import ExposureBlock
from spikecam_env.sensor.engines import reference
from spikecam_env.sensor.engines.compiled import ahead, block, fast
from spikecam_env.sensor.imaging import Imaging
from spikecam_env.sensor.light import Keyframes, Segment, as_light, real_numbers, segments, warn_outside
from spikecam_env.sensor.model import SensorModel, generator
from spikecam_env.sensor.unit import UNIT_RANGES, Unit
from spikecam_env.threads import share_out
from spikecam_env.types import Floats, Pictures, Spikes

ENGINES = ("auto", "cuda", "fast", "reference")
BENT_LIGHT = ("refuse", "allow")


@dataclass(frozen=True)
class SensorState:
    """A sensor mid-stream: which unit it is, the next frame, and its pixels.  Picklable.

    Example:
        >>> sensor, light = SpikeSensor(SensorModel.preset("scsim"), shape=(4, 4), seed=0), np.full((4, 4), 0.3)
        >>> state = sensor.state()
        >>> spikes = sensor.step(light, frames=32)
        >>> sensor.restore(state)
        >>> bool((sensor.step(light, frames=32) == spikes).all())
        True
    """

    engine: str
    shape: tuple[int, int]
    model: SensorModel
    unit: str | None
    """Digest of the unit that was given to the sensor, if one was."""
    seed: int
    frame: int
    phase: Floats
    """Read-only."""
    pixels: Any


class SpikeSensor:
    """A spike camera that you can step.

    Args:
        model: kind of camera; a SensorModel, a preset's name or a TOML path.
        shape: (rows, columns) of pixels.
        seed: which unit of it (fixed pattern), its starting phase and its temporal noise; same seed, same bits,
            for any cutting of the stream into steps and any number of threads.
        engine: "fast" (numba; random numbers only per spike), "reference" (numpy; the specification), "cuda" (a GPU,
            bits of fast, no effects from frame to frame; for many cameras at once see SpikeSensorBatch), or "auto"
            (fast where it carries every effect of the model, else reference).
        take: another recording by the same unit: other starting phase, other temporal noise.
        unit: a camera's own firing law, as measured, in place of one drawn from the model.  Optics and effects from
            frame to frame are still the model's; its fixed patterns and noise strengths are not used.
        threads: of the fast engine, default NUMBA_NUM_THREADS; one where several cameras run at once.
        bent_light: "refuse" films with keys inside a frame where an effect of the model would be off by more
            than 1 % of that frame's charge (`bent_light.py`), or "allow" them.

    Raises:
        InputError: for an unknown engine, one that does not carry an effect of the model, or "cuda" without a device;
            for a shape that is not two positive whole numbers and a negative seed; and for a unit of another number of
            pixels or with values that are no firing law.

    Example:
        >>> sensor = SpikeSensor(SensorModel.preset("ideal"), shape=(2, 2), seed=0)
        >>> sensor.step(np.full((2, 2), 0.25, np.float32), frames=8).sum(axis=0).tolist()
        [[2, 2], [2, 2]]
    """

    def __init__(
        self,
        model: SensorModel | str = "scsim",
        shape: tuple[int, int] = (250, 400),
        seed: int = 0,
        engine: str = "fast",
        take: int = 0,
        unit: Unit | None = None,
        *,
        threads: int | None = None,
        bent_light: str = "refuse",
    ) -> None:
        if bent_light not in BENT_LIGHT:
            raise unknown_name("bent_light", bent_light, BENT_LIGHT)
        self.bent_light = bent_light
        self.threads = None if threads is None else checked_count(threads, "threads")
        self.model = model if isinstance(model, SensorModel) else SensorModel.load(model)
        self.shape = checked_shape(shape)
        self.take = checked_seed(take, "take")
        self._given = None if unit is None else (checked_unit(unit, self.shape), _checked(seed))
        self.engine = _chosen_engine(engine, self.model, unit)
        self._imaging = Imaging(self.model.effects, self.shape)
        self._frame_effects = tuple(e for e in self.model.effects if not e.is_fixed())
        self._wants_courses = wants_pieces(self._frame_effects)
        self._start(_checked(seed), phase=None)

    def reset(self, seed: int | None = None) -> None:
        """Back to frame 0; with a seed, as another unit, or as another recording of the unit that was given."""
        self._start(self.seed if seed is None else _checked(seed), phase=None)

    def step(self, radiance: Keyframes | ArrayLike, frames: int = 1, *, out: Spikes | None = None) -> Spikes:
        """Expose the next frames.

        Args:
            radiance: (H, W) held throughout, or Keyframes on the stream's absolute frame numbers; 1.0 makes the nominal
                pixel fire once a frame.
            frames: how many.
            out: array for the spikes, C-contiguous: fresh memory costs as much as the simulation.

        Returns:
            Spikes (frames, H, W) uint8, 0 or 1.

        Raises:
            InputError: for a wrong shape, NaN, infinity, negative light, frames < 1, and, unless allowed, light that
                bends within a frame; the camera is then as it was.
        """
        given = self._step_arguments(radiance, frames, out)
        self._expose(given)
        return self._finish(given)

    def state(self) -> SensorState:
        """A copy of everything that the next step depends on, besides the model."""
        pixels = copy.deepcopy(self._pixels)
        unit = None if self._given is None else self._given[0].digest
        return SensorState(self.engine, self.shape, self.model, unit, self.seed, self.frame, self.phase, pixels)

    def restore(self, state: SensorState) -> None:
        """Go on from a saved state; InputError for that of another engine, shape, model or unit."""
        if not isinstance(state, SensorState):
            raise InputError(f"state is a {type(state).__name__}; give one of SpikeSensor.state()")
        if not all(hasattr(state, f.name) for f in fields(SensorState)):
            raise InputError("this state was saved by another version of spikecam-env; record it again")
        if (state.engine, state.shape) != (self.engine, self.shape):
            raise InputError(
                f"this state is of a {state.engine} sensor of {state.shape}; this one is {self.engine}, {self.shape}"
            )
        theirs, ours = (_frame_effects(model) for model in (state.model, self.model))
        if theirs != ours:
            raise InputError(f"this state is of a model with other frame effects ({theirs}); this one has {ours}")
        difference = state.model.difference(self.model)
        if difference:
            raise InputError(f"this state is of another model; the state's and this sensor's {difference}")
        if state.unit != (None if self._given is None else self._given[0].digest):
            raise InputError("this state is of another unit; give the sensor the unit (unit=...) that the state is of")
        if state.seed != self.seed:
            self._start(state.seed, phase=state.phase)
        self.phase = _read_only(state.phase)
        self.frame = state.frame
        self._pixels = copy.deepcopy(state.pixels)

    def clean_twin(self) -> SpikeSensor:
        """A noise-free camera at frame 0 with this one's initial phase: on the same scene it gives the clean stream."""
        model, bends = self.model.noise_free(), self.bent_light
        twin = SpikeSensor(model, self.shape, self.seed, self.engine, self.take, threads=self.threads, bent_light=bends)
        twin._start(self.seed, phase=self.phase)
        return twin

    _pixels: Any
    _film: Keyframes | None = None
    """Of the last step: a film that has ended may be held on purpose; a new one that has ended gets a warning."""

    def _start(self, seed: int, phase: Floats | None) -> None:
        self.seed = seed
        self.frame = 0
        self.unit, unit_seed = self._given or (self.model.draw_unit(self.shape, seed), seed)
        noise_seed = seed if self.take == 0 else int(generator(seed, f"take {self.take}").integers(1 << 62))
        self.phase = _read_only(generator(noise_seed, "phase").random(self.shape) if phase is None else phase)
        flat = self.phase.reshape(-1)
        refuses = self.bent_light == "refuse"
        self._looks_for_bends = refuses and bent.concerned(self._frame_effects, self._first_exposure())
        if self.engine == "fast" and not self._frame_effects:
            self._pixels = ahead.start(self.unit, flat, noise_seed)
        elif self.engine == "fast":
            self._pixels = block.start(self._first_exposure(), self._frame_effects, flat, noise_seed, unit_seed)
        elif self.engine == "cuda":
            gpu = _gpu()
            self._pixels = gpu.start([self.unit], [flat], [noise_seed], gpu.checked_device("cuda"))
        else:
            self._pixels = reference.start(self._first_exposure(), self._frame_effects, flat, noise_seed, unit_seed)

    def _step_arguments(
        self, radiance: Keyframes | ArrayLike, frames: int, out: Spikes | None = None
    ) -> _StepArguments:
        """The arguments of `step`, checked; nothing is exposed yet."""
        frames = checked_count(frames)
        light = as_light(radiance, self.shape)
        if isinstance(light, Keyframes) and light.on_device:
            raise InputError("radiance is a tensor; SpikeSensor takes arrays, SpikeSensorBatch tensors on its device")
        if isinstance(light, Keyframes) and self._looks_for_bends:
            bent.check_bent(light, self.frame, frames, self._first_exposure(), self._frame_effects, self._imaging.image)
        spikes = _recycled(out, (frames, *self.shape), light).reshape(frames, -1)
        if light is not self._film:
            warn_outside(light, self.frame, frames)
        jumps = self.engine == "fast" and not self._frame_effects
        return _StepArguments(self, light, spikes, jumps and frames > ahead.SHORT_CALL and self._pixels.ready is None)

    def _expose(self, given: _StepArguments) -> None:
        """Expose this camera by itself."""
        light, spikes = given.light, given.spikes
        if given.together:
            for stretch in given.stretches():
                fast.run_together([stretch], threads=self.threads)
            return
        images = map(self._imaging.segment_image, segments(light, self.frame, len(spikes), self._wants_courses))
        if self.engine == "fast" and self._frame_effects:
            block.run(self._first_exposure(), self._frame_effects, self._pixels, images, spikes, threads=self.threads)
            return
        done = 0
        for segment in images:
            self._run(segment, spikes[done : done + segment.count])
            done += segment.count

    def _finish(self, given: _StepArguments) -> Spikes:
        """Count the frames of a finished exposure; returns its spikes (frames, H, W)."""
        self._film = given.light if isinstance(given.light, Keyframes) else None
        self.frame += len(given.spikes)
        return given.spikes.reshape(-1, *self.shape)

    def _run(self, segment: Segment, out: Spikes) -> None:
        if self.engine == "fast":
            ahead.run(self._pixels, segment, out, threads=self.threads)
        elif self.engine == "cuda":
            gpu = _gpu()
            batch = gpu.BatchSegment.of([segment], self._pixels.device)
            out[:] = gpu.run(self._pixels, batch)[0].cpu().numpy()
        else:
            out[:] = reference.run(self._first_exposure(), self._frame_effects, self._pixels, segment)

    def _first_exposure(self) -> ExposureBlock:
        return ExposureBlock(0, self.model.frame_rate_hz, self.shape, self.unit)


@dataclass(frozen=True)
class _StepArguments:
    """The arguments of `step`, checked."""

    sensor: SpikeSensor
    light: Keyframes | Pictures
    spikes: Spikes
    """(frames, P), to be written."""
    together: bool
    """Whether pixels go from spike to spike by themselves, so that many cameras go in one call."""

    def stretches(self) -> Iterator[fast.Stretch]:
        """Work of the fast engine, 64 frames at a time."""
        sensor = self.sensor
        return fast.stretches(sensor._pixels.pixels, self.light, sensor.frame, sensor._imaging, self.spikes)


def step_together(
    sensors: Sequence[SpikeSensor],
    radiances: Sequence[Keyframes | ArrayLike],
    frames: int = 1,
    *,
    outs: Sequence[Spikes | None] | None = None,
    threads: int | None = None,
) -> list[Spikes]:
    """Expose the next frames of every camera, each in its own light, with the bits of each camera by itself.

    Cameras of the fast engine without effects from frame to frame are stepped in one compiled call, whose threads share
    all pixels; others a camera a thread.

    Args:
        sensors: the cameras.
        radiances: as of `SpikeSensor.step`, one a camera.
        frames: how many.
        outs: as of `SpikeSensor.step`, one a camera.
        threads: default NUMBA_NUM_THREADS.

    Returns:
        Spikes (frames, H, W) uint8 of each camera.

    Raises:
        InputError: as `SpikeSensor.step` does; all cameras are then as they were.

    Example:
        >>> cameras = [SpikeSensor(SensorModel.preset("ideal"), shape=(2, 2), seed=seed) for seed in (0, 1)]
        >>> lights = [np.full((2, 2), 0.25), np.full((2, 2), 0.5)]
        >>> [int(spikes.sum()) for spikes in step_together(cameras, lights, frames=8)]
        [8, 16]
    """
    given = [
        sensor._step_arguments(radiance, frames, out)
        for sensor, radiance, out in zip(sensors, radiances, outs or [None] * len(sensors), strict=True)
    ]
    for stretches_now in zip_longest(*(one.stretches() for one in given if one.together)):
        fast.run_together([stretch for stretch in stretches_now if stretch is not None], threads=threads)
    alone = [one for one in given if not one.together]
    share_out(lambda number: alone[number].sensor._expose(alone[number]), len(alone), threads)
    return [one.sensor._finish(one) for one in given]


def _frame_effects(model: SensorModel) -> str:
    """Names of the effects that act from frame to frame."""
    return ", ".join(e.name for e in model.effects if not e.is_fixed()) or "none"


def _read_only(array: Floats) -> Floats:
    """The array, or a copy of one that can be written to; as two sensors may share it."""
    if array.flags.writeable:
        array = array.copy()
        array.flags.writeable = False
    return array


def _recycled(out: Spikes | None, shape: tuple[int, int, int], light: Keyframes | Pictures) -> Spikes:
    if out is None:
        try:
            return np.empty(shape, dtype=np.uint8)
        except (MemoryError, ValueError) as error:
            raise InputError(f"frames = {shown(shape[0])} of {shape[1:]} do not fit in memory; step fewer") from error
    if not isinstance(out, np.ndarray):
        raise InputError(f"out is a {type(out).__name__}; it must be a numpy array, uint8 {shape}")
    if out.shape != shape or out.dtype != np.uint8 or not (out.flags.c_contiguous and out.flags.writeable):
        raise InputError(f"out is {out.dtype} {out.shape}; it must be uint8 {shape}, C-contiguous and writeable")
    if np.may_share_memory(out, light.radiance if isinstance(light, Keyframes) else light):
        raise InputError("out and radiance share memory; give out memory of its own")
    return out


def _checked(seed: Any) -> int:
    return checked_seed(seed, most=LARGEST_DERIVED_SEED)


def checked_unit(unit: Any, shape: tuple[int, int]) -> Unit:
    """The unit, read-only; InputError unless it is a firing law of rows * columns pixels."""
    if not isinstance(unit, Unit):
        raise InputError(f"unit = {type(unit).__name__}; it must be a Unit (spikecam_env.sensor.Unit)")
    for name in ("shot", "dark_is_noisy"):
        if not isinstance(getattr(unit, name), (bool, np.bool_)):
            raise InputError(f"unit.{name} = {shown(getattr(unit, name))}; it must be True or False")
    for name, (low, high) in UNIT_RANGES.items():
        values = real_numbers(getattr(unit, name), f"unit.{name}", "f")
        if values.shape != (shape[0] * shape[1],):
            raise InputError(
                f"unit.{name} is {values.shape}, the sensor is {shape}; it must be one number a pixel, "
                f"({shape[0] * shape[1]},)"
            )
        bad = np.flatnonzero(~((values >= low) & (values <= high)))
        if bad.size:
            raise InputError(
                f"unit.{name} is {values[bad[0]]:g} at pixel {bad[0]}; it must be finite and "
                f"{'0 or more' if low == 0.0 else 'above 0'}: {low:g} .. {high:g}"
            )
    return unit.owned()


def _chosen_engine(engine: str, model: SensorModel, unit: Unit | None) -> str:
    if engine not in ENGINES:
        raise unknown_name("engine", engine, ENGINES)
    if unit is None:
        missing = fast.missing(model.effects) if engine == "cuda" else block.missing(model.effects)
    else:
        acting = [e for e in model.effects if not e.is_fixed()]
        missing = (fast.missing(acting) if engine == "cuda" else block.missing(acting)) + block.missing_of(unit)
    if engine == "auto":
        return "reference" if missing else "fast"
    if engine in ("cuda", "fast") and missing:
        raise InputError(f"the {engine} engine does not carry {', '.join(missing)}; use engine='reference' or 'auto'")
    if engine == "cuda":
        _gpu().checked_device("cuda")
    return engine


def _gpu() -> ModuleType:
    """The module, imported when first needed: torch takes seconds."""
    return import_module("spikecam_env.sensor.engines.gpu")
