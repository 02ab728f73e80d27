"""Many cameras stepped at once, on a GPU: for training agents and for large sets of simulated data."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from spikecam_env.checked import checked_count, checked_seed, checked_shape, checked_whole
from spikecam_env.errors import InputError, shown
from spikecam_env.sensor.engines import gpu
from spikecam_env.sensor.imaging import Imaging
from spikecam_env.sensor.light import (
    MAX_SEGMENT,
    Keyframes,
    Segment,
    as_light,
    check_radiance,
    light_values,
    segments,
    warn_outside,
)
from spikecam_env.sensor.model import SensorModel, generator
from spikecam_env.types import Floats, Masks, Pictures


@dataclass(frozen=True)
class SensorBatchState:
    """A batch mid-stream: its cameras and their pixels.  Picklable.

    Example:
        >>> cameras, light = SpikeSensorBatch("scsim", shape=(4, 4), seeds=[0, 1], device="cpu"), np.full((4, 4), 0.3)
        >>> state = cameras.state()
        >>> spikes = cameras.step(light, frames=16)
        >>> cameras.restore(state)
        >>> bool((cameras.step(light, frames=16) == spikes).all())
        True
    """

    models: tuple[SensorModel, ...]
    seeds: tuple[int, ...]
    frame: NDArray[np.int64]
    """Each camera's next (B,)."""
    phase: Floats
    """(B, H, W)."""
    pixels: gpu.BatchState


class SpikeSensorBatch:
    """B spike cameras, each of which gives the bits of SpikeSensor(engine="fast").

    Attribute `frame` (B,) int64 is the absolute index of each camera's next frame.

    Args:
        models: one model for all (SensorModel, preset's name or TOML path), or B of them.
        shape: (rows, columns) of pixels.
        seeds: B whole numbers, one a camera; see SpikeSensor.
        device: "cuda", "cuda:1" or "cpu".  On CUDA the Triton kernel runs where Triton is installed, else plain torch;
            attribute `kernel` names it.  The processor runs plain torch: made for tests, many times slower than "fast".

    Raises:
        InputError: for a missing device, an effect that the engine does not carry, and bad arguments.

    Example:
        >>> cameras = SpikeSensorBatch("ideal", shape=(2, 2), seeds=[0, 1], device="cpu")
        >>> cameras.step(np.full((2, 2), 0.25, np.float32), frames=8).sum(dim=1).tolist()
        [[[2, 2], [2, 2]], [[2, 2], [2, 2]]]
    """

    def __init__(
        self,
        models: SensorModel | str | Sequence[SensorModel | str] = "scsim",
        shape: tuple[int, int] = (250, 400),
        seeds: Sequence[int] = (0,),
        device: str | torch.device = "cuda",
    ) -> None:
        self.device = gpu.checked_device(device)
        self.kernel = gpu.kernel_on(self.device)
        self.shape = checked_shape(shape)
        self.seeds = _checked_seeds(seeds)
        self.models = _checked_models(models, len(self.seeds))
        self._alike = all(model == self.models[0] for model in self.models)
        self._imaging = [Imaging(model.effects, self.shape) for model in self.models]
        self.frame = np.zeros(len(self.seeds), dtype=np.int64)
        self.phase = np.stack([generator(seed, "phase").random(self.shape) for seed in self.seeds])
        self._pixels = self._started(range(len(self.seeds)))

    _films: Sequence[Keyframes | Pictures] = ()
    """Those of the last step: see `SpikeSensor`."""

    def __len__(self) -> int:
        return len(self.seeds)

    def step(
        self, radiance: Keyframes | Sequence[Keyframes] | torch.Tensor | ArrayLike, frames: int = 1
    ) -> torch.Tensor:
        """Expose the next frames of every camera.

        Optics (blur, vignetting) act on the host: a tensor on the GPU is copied there and back.

        Args:
            radiance: (H, W) or (B, H, W) held throughout, as an array or a tensor; Keyframes for all cameras, or a list
                of B, on each camera's own absolute frame numbers; their light may lie on the device
                (`PlanarScene.radiance`).
            frames: how many.

        Returns:
            Spikes (B, frames, H, W) uint8, 0 or 1, on the device.

        Raises:
            InputError: as SpikeSensor.step does.
        """
        frames = checked_count(frames)
        pieces = self._pieces(radiance, frames)
        spikes = torch.empty((len(self), frames, self._pixels.pixels), dtype=torch.uint8, device=self.device)
        done = 0
        for piece in pieces:
            gpu.run(self._pixels, piece, spikes[:, done : done + piece.count])
            done += piece.count
        self.frame += frames
        return spikes.reshape(len(self), frames, *self.shape)

    def reset(self, seeds: Sequence[int] | None = None, mask: ArrayLike | None = None) -> None:
        """Back to frame 0: all cameras, or those where mask (B,) is True; with B seeds, those become other units."""
        chosen = np.arange(len(self)) if mask is None else np.flatnonzero(_checked_mask(mask, len(self)))
        new = self.seeds if seeds is None else _checked_seeds(seeds)
        if len(new) != len(self):
            raise InputError(f"{len(new)} seeds for {len(self)} cameras; give one a camera, also where mask is False")
        if not chosen.size:
            return
        self.seeds = tuple(new[b] if b in chosen else seed for b, seed in enumerate(self.seeds))
        self.phase = self.phase.copy()
        for b in chosen:
            self.phase[b] = generator(self.seeds[b], "phase").random(self.shape)
        self._pixels = self._pixels.replaced(chosen, self._started(chosen))
        self.frame[chosen] = 0

    def exchange(self, cameras: Sequence[int], others: SpikeSensorBatch) -> None:
        """Put the cameras of another batch, mid-stream, in the place of some of these.

        Args:
            cameras: numbers of those that go, each once.
            others: as many, of the same shape, models and device; they are not to be stepped any more.

        Raises:
            InputError: for numbers of no camera or of one twice, and for others that do not fit in their places.

        Example:
            >>> cameras, others = (SpikeSensorBatch("ideal", (2, 2), seeds, "cpu") for seeds in ([0, 1], [7]))
            >>> cameras.exchange([1], others)
            >>> cameras.seeds
            (0, 7)
        """
        chosen = np.array([checked_whole(b, "camera", 0, len(self) - 1) for b in cameras], np.int64)
        models = tuple(self.models[b] for b in chosen)
        if len(set(chosen.tolist())) < len(chosen):
            raise InputError(f"cameras = {shown(list(cameras))}; give each number once")
        if (others.shape, others.device, others.models) != (self.shape, self.device, models):
            raise InputError(
                f"the other batch has {len(others)} cameras of {others.shape} on {others.device}; it must have "
                f"{len(chosen)} of {self.shape} on {self.device}, of the models of those that go"
            )
        seeds = dict(zip(chosen.tolist(), others.seeds, strict=True))
        self.seeds = tuple(seeds.get(b, seed) for b, seed in enumerate(self.seeds))
        self.phase, self.frame = self.phase.copy(), self.frame.copy()
        self.phase[chosen], self.frame[chosen] = others.phase, others.frame
        self._pixels = self._pixels.replaced(chosen, others._pixels)

    def state(self) -> SensorBatchState:
        """A copy of everything that the next step depends on."""
        return SensorBatchState(
            self.models, self.seeds, self.frame.copy(), self.phase.copy(), copy.deepcopy(self._pixels)
        )

    def restore(self, state: SensorBatchState) -> None:
        """Go on from a saved state, of any device; InputError for other models, another number or shape."""
        if not isinstance(state, SensorBatchState):
            raise InputError(f"state is a {type(state).__name__}; give one of SpikeSensorBatch.state()")
        if state.phase.shape != (len(self), *self.shape):
            raise InputError(
                f"this state is of (cameras, rows, columns) = {state.phase.shape}; this batch is "
                f"{(len(self), *self.shape)}"
            )
        if state.models != self.models:
            raise InputError("this state is of cameras of other models; build the batch with those (state.models)")
        self.seeds, self.frame, self.phase = state.seeds, state.frame.copy(), state.phase.copy()
        self._pixels = copy.deepcopy(state.pixels).to(self.device)

    def clean_twin(self) -> SpikeSensorBatch:
        """Noise-free cameras at frame 0 with these ones' initial phases: on the same scenes they give clean streams."""
        models = [model.noise_free() for model in self.models]
        twin = SpikeSensorBatch(models, self.shape, self.seeds, self.device)
        twin.phase = self.phase.copy()
        twin._pixels = twin._started(range(len(twin)))
        return twin

    def _started(self, cameras: Sequence[int] | NDArray[np.int64]) -> gpu.BatchState:
        units = [self.models[b].draw_unit(self.shape, self.seeds[b]) for b in cameras]
        phases = [self.phase[b].reshape(-1) for b in cameras]
        return gpu.start(units, phases, [self.seeds[b] for b in cameras], self.device)

    def _pieces(self, radiance: Any, frames: int) -> Iterator[gpu.BatchSegment]:
        """The light of the next frames, checked before any is exposed, cut into segments of one kernel call."""
        if isinstance(radiance, Keyframes) and self._alike and np.all(self.frame == self.frame[0]):
            return self._moving([as_light(radiance, self.shape)], frames)
        if isinstance(radiance, Keyframes):
            radiance = [radiance] * len(self)
        if isinstance(radiance, (list, tuple)) and any(isinstance(light, Keyframes) for light in radiance):
            if len(radiance) != len(self):
                raise InputError(f"{len(radiance)} lights for {len(self)} cameras; give one a camera, or one for all")
            return self._moving([as_light(light, self.shape) for light in radiance], frames)
        return self._still(self._checked_pictures(radiance), frames)

    def _moving(self, lights: Sequence[Keyframes | Pictures], frames: int) -> Iterator[gpu.BatchSegment]:
        for light, at in zip(lights, self.frame, strict=False):
            if not any(light is film for film in self._films):
                warn_outside(light, int(at), frames)
        self._films = lights
        films = [segments(light, int(self.frame[b]), frames) for b, light in enumerate(lights)]
        for cut in cut_alike(films):
            images = [
                imaging.segment_image(_on_host(s)) if imaging else s
                for imaging, s in zip(self._imaging, cut, strict=False)
            ]
            yield gpu.BatchSegment.of(images, self.device)

    def _still(self, pictures: torch.Tensor, frames: int) -> Iterator[gpu.BatchSegment]:
        """Segments of held light (B, H, W) or (1, H, W)."""
        light = pictures.reshape(len(pictures), -1)
        if any(self._imaging):
            light = torch.from_numpy(self._images(light.cpu().numpy()))
        light = light.to(self.device)
        for done in range(0, frames, MAX_SEGMENT):
            yield gpu.BatchSegment.held(light, min(MAX_SEGMENT, frames - done))

    def _images(self, light: Pictures) -> Pictures:
        """Held light (B, P) or (1, P) through each camera's optics."""
        if not self._alike:
            light = np.broadcast_to(light, (len(self), light.shape[1]))
        return np.stack([self._imaging[b].image(picture) for b, picture in enumerate(light)])

    def _checked_pictures(self, radiance: Any) -> torch.Tensor:
        if isinstance(radiance, torch.Tensor):
            if not radiance.dtype.is_floating_point:
                raise InputError(f"radiance is {radiance.dtype}; it must be floating point, 1.0 = one spike a frame")
            pictures = radiance.detach().to(torch.float32)
        else:
            pictures = torch.from_numpy(light_values(radiance).copy())
        if pictures.shape == self.shape:
            pictures = pictures[None]
        if pictures.shape not in ((1, *self.shape), (len(self), *self.shape)):
            raise InputError(
                f"radiance has shape {tuple(pictures.shape)}, the batch is {(len(self), *self.shape)}; give (H, W) or "
                "(B, H, W) to hold, Keyframes, or a list of them"
            )
        check_radiance(torch.stack(torch.aminmax(pictures)).cpu().numpy())
        return pictures.contiguous()


def cut_alike(films: Sequence[Iterator[Segment]]) -> Iterator[list[Segment]]:
    """Segments of several films of as many frames, cut so that each step has one count for all: no bit changes."""
    rest: list[Segment | None] = [next(film, None) for film in films]
    while all(rest):
        now = [segment for segment in rest if segment is not None]
        count = min(segment.count for segment in now)
        yield [replace(segment, count=count) for segment in now]
        rest = [
            replace(segment, first=segment.first + count, count=segment.count - count)
            if segment.count > count
            else next(film, None)
            for segment, film in zip(now, films, strict=True)
        ]


def _on_host(segment: Segment) -> Segment:
    """The segment with its light in arrays."""
    if not isinstance(segment.radiance0, torch.Tensor):
        return segment
    start = segment.radiance0.cpu().numpy()
    stop = start if segment.radiance1 is segment.radiance0 else segment.radiance1.cpu().numpy()
    return replace(segment, radiance0=start, radiance1=stop)


def _checked_seeds(seeds: Any) -> tuple[int, ...]:
    try:
        checked = tuple(checked_seed(seed) for seed in seeds)
    except TypeError:
        checked = ()
    if not checked:
        raise InputError(f"seeds = {seeds!r}; give a list of whole numbers, one a camera")
    return checked


def _checked_models(models: Any, cameras: int) -> tuple[SensorModel, ...]:
    given = [models] * cameras if isinstance(models, (SensorModel, str)) else list(models)
    if len(given) != cameras:
        raise InputError(f"{len(given)} models for {cameras} seeds; give one model a seed, or one for all")
    loaded = tuple(model if isinstance(model, SensorModel) else SensorModel.load(model) for model in given)
    for model in loaded:
        missing = gpu.missing(model.effects)
        if missing:
            raise InputError(f"the cuda engine does not carry {', '.join(missing)}; use SpikeSensor, engine='auto'")
    return loaded


def _checked_mask(mask: ArrayLike, cameras: int) -> Masks:
    checked = np.asarray(mask)
    if checked.shape != (cameras,) or checked.dtype != bool:
        raise InputError(f"mask is {checked.dtype} {checked.shape}; it must be bool, one a camera: ({cameras},)")
    return checked
