"""Every figure of a GPU in one run of at most eight minutes, set-up included.

python -m benchmarks.gpu --out gpu.json    # on a machine with a GPU
python -m benchmarks.gpu --cpu --quick     # a dry run on the processor, small: that it works, and no figure of a GPU

Parts, the most wanted first: one camera from scene to denoised rates, in three lights, and where its time goes; one
frame a call; vector environments; the denoiser by streams and engines; its network alone, and from windows of the host;
batches of cameras (`benchmarks.bench_cuda`); training pairs and steps.  A part that would begin too late is left out,
one that fails says why, and the others go on.  Tables are printed, and the file is written, after each part.
"""

from __future__ import annotations

import time
from argparse import ArgumentParser
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch

import spikecam_env.envs  # noqa: F401 - registers
from benchmarks import bench_cuda
from denoiser.ground.captured import captured
from denoiser.many import ManyDnSS
from denoiser.networks.stream_network import CARRY, StreamDnSS
from denoiser.online import OnlineDnSS
from denoiser.passes import infer
from denoiser.passes.window import RollingWindow
from denoiser.training.rollout import Rollouts
from denoiser.training.simulated import Bank
from denoiser.weights import load_weights, pretrained_path
from scenes.flat.disk import RotatingDisk
from scenes.flat.planes_on_device import PlanePainter
from spikecam_env.bench.machine import FRAME_RATE_HZ, SHAPE, machine
from spikecam_env.cli.files import write_json
from spikecam_env.cli.table import table
from spikecam_env.sensor import SensorModel, SpikeSensorBatch
from spikecam_env.sensor.engines import gpu
from spikecam_env.sensor.light import segments
from spikecam_env.sensor.model import generator
from spikecam_env.whole import check_file

MINUTES = 8.0
"""Of the whole run, set-up included."""

TO_SPARE_S = 60.0
"""Time that a part may take: none begins later than this before the end."""

SECONDS, RUNS = 2.0, 3
"""Of each measurement, after two runs that compile: as long, and as many runs, at least."""

BLOCK = 64
"""Frames taken through the loop at a time."""

EVERY_FRAME = 1e-3
"""Motion from key to key [pixels] by which light is new in every frame."""

Rows = list[dict[str, Any]]


@dataclass(frozen=True)
class Sizes:
    """shape: of frames.  lights: of the disk, over its own.  streams: of a pass.  cameras, intervals: of the camera.
    patches: of a training step, of `side` pixels.  textures, units: of the bank that training streams are drawn from.
    environments: of a vector, of `view` pixels."""

    shape: tuple[int, int]
    lights: tuple[float, ...]
    streams: tuple[int, ...]
    cameras: tuple[int, ...]
    intervals: tuple[float, ...]
    patches: int
    side: int
    textures: int
    units: int
    environments: int
    view: tuple[int, int]


FULL = Sizes(SHAPE, (1.0, 0.5, 0.1), (1, 4, 16), (1, 16, 64), (20.0,), 64, 64, 384, 96, 64, (64, 64))
DRY = Sizes((20, 24), (0.5,), (1, 2), (1,), (20.0,), 2, 16, 4, 3, 2, (16, 16))


class RecordedCamera:
    """A scene of one look before a camera, light new in every frame: a block of BLOCK frames is recorded once and
    replayed, light and camera in one.  The bits are those of `SpikeSensorBatch` in the scene's light on the device."""

    def __init__(self, scene: RotatingDisk, device: torch.device, model: str = "scsim", seed: int = 0) -> None:
        self._scene, self._at = scene, 0
        first = scene.plane(0, BLOCK)
        self._painter = PlanePainter(first, device)
        self._numbers = torch.from_numpy(self._painter.numbers([first])).to(device)
        unit = SensorModel.preset(model).draw_unit(scene.shape, seed)
        phase = generator(seed, "phase").random(scene.shape[0] * scene.shape[1])
        self._pixels = gpu.start([unit], [phase], [seed], device)
        fresh = [tensor.clone() for tensor in self._pixels.tensors]
        self._out = torch.empty((1, BLOCK, phase.size), dtype=torch.uint8, device=device)
        self._block = captured(self._exposed, device)
        for tensor, before in zip(self._pixels.tensors, fresh, strict=True):
            tensor.copy_(before)  # a recording also runs its calls

    def step(self) -> torch.Tensor:
        """(BLOCK, H, W) the next frames."""
        numbers = self._painter.numbers([self._scene.plane(self._at, self._at + BLOCK)])
        self._numbers.copy_(torch.from_numpy(numbers))
        self._at += BLOCK
        return self._block()[0].reshape(BLOCK, *self._scene.shape)

    def _exposed(self) -> torch.Tensor:
        light = self._painter.paint(self._numbers, still=True).reshape(BLOCK + 1, 1, -1)
        for k in range(BLOCK):
            timing = gpu.BatchSegment.held(light[k], 1)  # of one frame
            segment = gpu.BatchSegment(light[k], light[k + 1], timing.timing, timing.per_twice, 1)
            gpu.run(self._pixels, segment, self._out[:, k : k + 1])
        return self._out


def loop(sizes: Sizes, device: torch.device) -> Rows:
    """One camera: a rotating disk, its light new in every frame -> noisy spikes -> rates of `best`, all on the device.

    frames/s: of the whole, without waiting between stages.  latency: of a block's frames, those that the network looks
    ahead, and the computation.
    """
    rows = []
    for light in sizes.lights:
        scene = _disk(sizes.shape, light)
        for way, make in WAYS.items():
            whole = make(scene, device)
            seconds = _seconds(whole.run, device)
            ahead = BLOCK + whole.denoiser.latency
            latency = 1e3 * (ahead / FRAME_RATE_HZ + seconds)
            rate = {"frames/s": BLOCK / seconds, "x real time": BLOCK / seconds / FRAME_RATE_HZ}
            rows.append({"light": light, "way": way} | rate | {"latency, ms": latency})
    return rows


def where(sizes: Sizes, device: torch.device) -> Rows:
    """Stages of the loop, each waited for."""
    rows = []
    for way, make in WAYS.items():
        whole = make(_disk(sizes.shape, 1.0), device)
        found = {stage: _seconds(work, device) for stage, work in whole.stages().items()}
        total = sum(found.values())
        for stage, seconds in found.items():
            of_frame = {"us a frame": 1e6 * seconds / BLOCK, "frames/s": BLOCK / seconds}
            rows.append({"way": way, "stage": stage} | of_frame | {"of the whole, %": 100 * seconds / total})
    return rows


class Stepwise:
    """The loop by calls that anybody may make."""

    def __init__(self, scene: RotatingDisk, device: torch.device) -> None:
        self._scene, self._device, self._at = scene, device, 0
        self._camera = SpikeSensorBatch("scsim", scene.shape, (0,), device)
        self.denoiser = OnlineDnSS.pretrained("best", output="rate", device=device)

    def stages(self) -> dict[str, Callable[[], Any]]:
        """By name; each may be called again and again."""
        light = self._light()
        spikes = self._camera.step(light, BLOCK)[0]

        def camera() -> Any:
            self._camera.frame[:] = 0  # in the same light again
            return self._camera.step(light, BLOCK)

        return {"light": self._light, "camera": camera, "denoiser": lambda: self.denoiser.push(spikes)}

    def run(self) -> Any:
        """A block."""
        light = self._light()
        self._at += BLOCK
        return self.denoiser.push(self._camera.step(light, BLOCK)[0])

    def _light(self) -> Any:
        return self._scene.radiance(self._at, self._at + BLOCK, device=self._device)


class Recorded:
    """The loop by two recordings: light and camera, and a pass of the denoiser."""

    def __init__(self, scene: RotatingDisk, device: torch.device) -> None:
        self._camera = RecordedCamera(scene, device)
        self.denoiser = OnlineDnSS.pretrained("best", output="rate", device=device, engine="captured")

    def stages(self) -> dict[str, Callable[[], Any]]:
        """By name."""
        spikes = self._camera.step()
        return {"light and camera": self._camera.step, "denoiser": lambda: self.denoiser.push(spikes)}

    def run(self) -> Any:
        """A block."""
        return self.denoiser.push(self._camera.step())


WAYS: dict[str, Callable[[RotatingDisk, torch.device], Any]] = {"step by step": Stepwise, "recorded": Recorded}


def one_frame(sizes: Sizes, device: torch.device) -> Rows:
    """One camera, one frame a call: by `step` in light that stays and that is new each time, and recorded."""
    frames, model = BLOCK, SensorModel.preset("scsim")
    light = _disk(sizes.shape, 1.0).radiance(0, frames, device=device)
    sensors = SpikeSensorBatch(model, sizes.shape, (0,), device)
    picture: Any = light.radiance[0].contiguous()

    def moving() -> None:
        sensors.frame[:] %= frames
        sensors.step(light)

    phase = generator(0, "phase").random(picture.numel())
    pixels = gpu.start([model.draw_unit(sizes.shape, 0)], [phase], [0], device)
    segment = gpu.BatchSegment.of(list(segments(light, 0, 1)), device)
    out = torch.empty((1, 1, picture.numel()), dtype=torch.uint8, device=device)
    ways = {
        "step, light that stays": lambda: sensors.step(picture),
        "step, light new in each frame": moving,
        "kernel": lambda: gpu.run(pixels, segment, out),
        "kernel, recorded": captured(lambda: gpu.run(pixels, segment, out), device),
    }
    found = {way: _seconds(work, device) for way, work in ways.items()}
    return [{"way": way, "us a frame": 1e6 * seconds, "frames/s": 1 / seconds} for way, seconds in found.items()]


def environments(sizes: Sizes, device: torch.device) -> Rows:
    """Vectors of `Track`, 40 frames a step: env-steps/s, and ms a step of light, camera and observation.

    Each part is waited for; the rest is the host's.
    """
    rows = []
    for obs in ("tfp", "rate"):
        env: Any = gymnasium.make_vec(
            "spikecam_env/Track-v1", sizes.environments, "vector_entry_point", shape=sizes.view, obs=obs, device=device
        )
        actions = torch.zeros(env.action_space.shape, device=device)
        env.reset(seed=0)
        whole = _seconds(partial(env.step, actions), device)
        spent = dict.fromkeys(("light", "camera", "seen"), 0.0)
        _clock(env.unwrapped, spent, device)
        steps = 5
        for _ in range(steps):
            env.step(actions)
        env.close()
        of_step = {f"{stage}, ms": 1e3 * seconds / steps for stage, seconds in spent.items()}
        steps_s = sizes.environments / whole
        of_whole: dict[str, Any] = {"env-steps/s": steps_s, "frames/s": 40 * steps_s, "ms a step": 1e3 * whole}
        rows.append({"obs": obs, "environments": sizes.environments} | of_whole | of_step)
    return rows


def _clock(env: Any, spent: dict[str, float], device: torch.device) -> None:
    """Have the stages of a vector environment add the time that they take."""

    def clocked(stage: str, work: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*arguments: Any) -> Any:
            _wait(device)
            begin = time.perf_counter()
            result = work(*arguments)
            _wait(device)
            spent[stage] += time.perf_counter() - begin
            return result

        return timed

    cameras, law = env._cameras, env.observation
    cameras._light = clocked("light", cameras._light)
    cameras._batch.step = clocked("camera", cameras._batch.step)
    object.__setattr__(law, "step", clocked("seen", law.step))  # a frozen dataclass


def denoiser(sizes: Sizes, device: torch.device) -> Rows:
    """`ManyDnSS` of blocks of BLOCK frames on the device; and one stream of packed bits of the host."""
    rows = []
    packed = np.random.default_rng(0).integers(0, 256, (BLOCK, -(-sizes.shape[0] * sizes.shape[1] // 8)), np.uint8)
    for engine in ("torch", "captured"):
        one = OnlineDnSS.pretrained("best", output="rate", device=device, engine=engine)
        for streams in sizes.streams:
            many = ManyDnSS(one, streams, sizes.shape)
            spikes = (torch.rand((streams, BLOCK, *sizes.shape), device=device) < 0.1).byte()
            seconds = _seconds(partial(many.push, spikes), device)
            rows.append({"engine": engine, "from": "tensors", "streams": streams} | _frames(seconds, streams * BLOCK))
        bits = _seconds(partial(one.push_packed, packed, sizes.shape), device)
        rows.append({"engine": engine, "from": "packed, of the host", "streams": 1} | _frames(bits, BLOCK))
    return rows


def camera(sizes: Sizes, device: torch.device) -> Rows:
    """As `benchmarks.bench_cuda`."""
    batches = [(interval, cameras) for interval in sizes.intervals for cameras in sizes.cameras]
    return [row for batch in batches for row in bench_cuda.rows(*batch, device, sizes.shape)]


def network(sizes: Sizes, device: torch.device) -> Rows:
    """Passes of `best` in bfloat16 whose input lies on the device."""
    recipe, its = _best(device)
    layout, (height, width) = recipe.layout, sizes.shape
    rows = []
    for streams in sizes.streams:
        channels = layout.span + layout.layers + 1
        seen = _channels_last(torch.rand(streams, channels, height, width, device=device))
        hidden = _channels_last(torch.rand(streams, CARRY, height // 2, width // 2, device=device))
        beside = seen[:, layout.span :]

        def once(seen: Any = seen, beside: Any = beside, hidden: Any = hidden) -> None:
            with torch.inference_mode(), torch.autocast(device.type, torch.bfloat16):
                its.passed(seen, beside, hidden, None)

        rows.append({"streams": streams} | _frames(_seconds(once, device), streams * layout.planes))
    return rows


def passes(sizes: Sizes, device: torch.device) -> Rows:
    """The same from windows of the host: their planes are made, moved, passed, and the rates moved back."""
    recipe, its = _best(device)
    rng = np.random.default_rng(0)
    rows = []
    for streams in sizes.streams:
        rolling = [RollingWindow(recipe.layout, sizes.shape) for _ in range(streams)]
        new = (rng.random((recipe.layout.planes, *sizes.shape)) < 0.1).astype(np.uint8)
        for window in rolling:
            list(window.push(np.concatenate([new] * 3)))

        def once(rolling: Any = rolling, new: Any = new, streams: int = streams) -> None:
            windows = [next(window.push(new)) for window in rolling]
            infer.rates_of_many(its, windows, torch.bfloat16, [()] * streams)

        rows.append({"streams": streams} | _frames(_seconds(once, device), streams * recipe.layout.planes))
    return rows


def training(sizes: Sizes, device: torch.device) -> Rows:
    """Training pairs (scene, camera, twin), and steps of `best` of three passes, forward and backward."""
    recipe, its = _best(device)
    its = its.float().requires_grad_(True).train()
    bank = Bank.drawn(0, device, textures=sizes.textures, units=sizes.units)
    rollouts = Rollouts(recipe, taken=sizes.patches, patch=sizes.side, device=device, seed=0, pool=2, bank=bank)
    rows = torch.arange(sizes.patches, device=device)
    pairs = _seconds(lambda: rollouts.streams.advance(recipe.layout.planes, rows), device)
    step = _seconds(lambda: rollouts.loss(its, 3).backward(), device)
    frames = sizes.patches * recipe.layout.planes
    size = {"patches": sizes.patches, "side": sizes.side}
    return [
        {"what": "pairs", **size, "a second": 1 / pairs, "frames/s": frames / pairs},
        {"what": "steps of three passes", **size, "a second": 1 / step, "frames/s": 3 * frames / step},
    ]


PARTS: dict[str, Callable[[Sizes, torch.device], Rows]] = {
    "loop: scene to denoised rates, one camera": loop,
    "loop: where the time goes": where,
    "camera: one frame a call": one_frame,
    "environments": environments,
    "denoiser": denoiser,
    "denoiser: network alone": network,
    "denoiser: windows of the host": passes,
    "camera": camera,
    "training": training,
}


def measured(
    sizes: Sizes, device: torch.device, minutes: float = MINUTES, shown: Callable[[dict[str, Rows]], object] = len
) -> dict[str, Rows]:
    """Tables by title; of a part that had no time left, or that failed, one row that says so.

    shown: is given the tables so far, after each part.
    """
    begin, tables = time.perf_counter(), {}
    for title, part in PARTS.items():
        late = time.perf_counter() - begin > 60 * minutes - TO_SPARE_S
        tables[title] = [{"left out": f"{minutes:g} minutes were nearly over"}] if late else _tried(part, sizes, device)
        shown(tables)
    return tables


def _tried(part: Callable[[Sizes, torch.device], Rows], sizes: Sizes, device: torch.device) -> Rows:
    """Its rows, with the most memory that it took on a GPU; or why it failed."""
    try:
        if device.type != "cuda":
            return part(sizes, device)
        torch.cuda.empty_cache()
        torch.cuda.reset_peak_memory_stats(device)
        rows = part(sizes, device)
        peak = torch.cuda.max_memory_allocated(device) / 2**30
        return [row | {"most memory of the part, GiB": peak} for row in rows]
    except Exception as error:  # whatever it is, the others are to be measured
        return [{"failed": f"{type(error).__name__}: {error}"}]


def _disk(shape: tuple[int, int], light: float) -> RotatingDisk:
    return RotatingDisk(shape, motion_per_key=EVERY_FRAME).lit(light)


def _best(device: torch.device) -> tuple[Any, StreamDnSS]:
    recipe, its, _ = load_weights(pretrained_path("best"))
    ready = infer.prepared(its, torch.bfloat16).to(device)
    assert isinstance(ready, StreamDnSS)
    return recipe, ready


def _channels_last(tensor: torch.Tensor) -> torch.Tensor:
    return tensor.to(torch.bfloat16).contiguous(memory_format=torch.channels_last)


def _frames(seconds: float, frames: int) -> dict[str, float]:
    """ms a pass, frames/s of all streams together, and of one over the camera's."""
    return {"ms a pass": 1e3 * seconds, "frames/s": frames / seconds, "x real time": frames / seconds / FRAME_RATE_HZ}


def _seconds(run: Callable[[], object], device: torch.device) -> float:
    """Of one run: the median."""
    spent: list[float] = []
    until = np.inf
    while len(spent) < 2 + RUNS or time.perf_counter() < until:
        begin = time.perf_counter()
        run()
        _wait(device)
        spent.append(time.perf_counter() - begin)
        if len(spent) == 2:
            until = time.perf_counter() + SECONDS
    return float(np.median(spent[2:]))


def _wait(device: torch.device) -> None:
    """Wait until the device is idle."""
    if device.type == "cuda":
        torch.cuda.synchronize(device)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print and write."""
    global SECONDS, RUNS
    parser = ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, help="where to write the figures as JSON")
    parser.add_argument("--cpu", action="store_true", help="a dry run on the processor, small")
    parser.add_argument("--quick", action="store_true", help="a few runs of each: that it works, and no figures")
    chosen = parser.parse_args(arguments)
    if chosen.out is not None:
        check_file(chosen.out)
    if not chosen.cpu and not torch.cuda.is_available():
        raise SystemExit("no GPU here; --cpu makes a dry run")
    if chosen.quick:
        SECONDS = bench_cuda.SECONDS = 0.0
        RUNS = 1
    device, sizes = (torch.device("cpu"), DRY) if chosen.cpu else (torch.device("cuda"), FULL)
    name = "none: a dry run on the processor" if chosen.cpu else torch.cuda.get_device_name()
    print(f"{machine()}\nGPU: {name}, torch {torch.__version__}")

    begin = time.perf_counter()

    def shown(tables: dict[str, Rows]) -> None:
        title, rows = list(tables.items())[-1]
        print(f"\n{title} (after {time.perf_counter() - begin:.0f} s)\n{table(rows)}", flush=True)
        if chosen.out is not None:
            write_json(chosen.out, {"machine": machine(), "GPU": name, "tables": tables})

    measured(sizes, device, shown=shown)


if __name__ == "__main__":
    main()
