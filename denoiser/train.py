"""Training: minimise the error of the rate on simulated pairs, resumable at any minute.

    paper   L = mean (ISI_dn - ISI_clean)^2                 paper (22), on normalised intervals
    best    L = mean (rate - light)^2 / (light + 0.05)      light weighs as its count noise does, so dim scenes count

Adam; the rate of learning warms up over 100 steps and falls as a cosine to nothing at the end.  Everything follows from
the seed and the number of steps; a run limited by `minutes` ends where the clock says.

`best` sees the pixel's gain as it found it itself earlier in the stream (`denoiser.window`).  So every `refresh_every`
steps the network of the moment is written down, and the clips simulated from then on are denoised by it from their
first frame to give that gain; until the first refresh the gain is 1, and the first network, which learned without, is
not shown the gain it finds.  (A resumed run draws its clips again, with the last network written down.)

In `out` the run keeps `<mode>.pt` (weights), `last.pt` (to resume), `rollout-<step>.pt` (the network that found the
gain), `curve.json` and `curve.png` (validation).
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import torch
from pydantic import Field
from torch import Tensor, nn
from tqdm import tqdm

from denoiser import infer
from denoiser.pairs import CLIP_SHAPE, ClipFeed, draw_clip
from denoiser.plain_torch import read_plain, tensors_like
from denoiser.pool import Batch, SamplePool
from denoiser.recipe import Recipe, recipe_of
from denoiser.weights import save_weights, write_whole
from denoiser.window import Window
from spikecam_env.errors import InputError
from spikecam_env.sensor.kernels.cuda import checked_device
from spikecam_env.untrusted import Declared, Name, Whole, declared
from spikecam_env.whole import whole_file, write_text_whole

POOL_CLIPS = 160
FIRST_CLIPS = 24
VALIDATION_CLIPS = 10
VALIDATION_SEED = 1_000_003  # added to the seed: other scenes, other units, other textures of the same kinds
WARM_UP_STEPS = 100


_COUNTS = {
    "steps": (1, 10**9),
    "batch": (1, 65_536),
    "seed": (0, 2**62),
    "threads": (1, 1024),
    "patch": (4, CLIP_SHAPE[0]),
    "steps_per_clip": (1, 10**9),
    "refresh_every": (1, 10**9),
    "workers": (1, 1024),
}
"""Options that are whole numbers, with the least and the most."""

_AMOUNTS = {"lr": 1.0, "minutes": 1e6, "save_every_s": 1e9}
"""Options that are numbers above 0, with the most."""


@dataclass(frozen=True)
class TrainConfig:
    """mode: "best" | "paper".  out: folder.  The run ends after `steps`, or `minutes` where that is given.

    batch: patches a step.  patch: their side [pixels].  lr: highest rate of learning.  steps_per_clip: steps between
    new clips.  refresh_every: steps between validations, and between new networks for the gain.  threads: for the
    network.  device: where it is, and the pool; a GPU wants larger batches.  workers: processes that simulate; how many
    there are decides how far ahead of a new network clips are begun.  resume: go on from out/last.pt.
    """

    mode: str = "best"
    out: Path = Path("training")
    steps: int = 20_000
    batch: int = 16
    seed: int = 0
    threads: int = 1
    resume: bool = True
    minutes: float | None = None
    patch: int = 64
    lr: float = 1e-3
    steps_per_clip: int = 8
    save_every_s: float = 60.0
    refresh_every: int = 1000
    device: str = "cpu"
    workers: int = 1

    def __post_init__(self) -> None:
        recipe_of(self.mode)
        for name, (least, most) in _COUNTS.items():
            value = getattr(self, name)
            if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
                raise InputError(f"{name} is {value!r}; it must be a whole number from {least} to {most}")
        for name, highest in _AMOUNTS.items():
            amount = getattr(self, name)
            if name == "minutes" and amount is None:
                continue
            if not isinstance(amount, int | float) or isinstance(amount, bool) or not 0 < amount <= highest:
                raise InputError(f"{name} is {amount!r}; it must be a number above 0, at most {highest:g}")
        if not isinstance(self.resume, bool):
            raise InputError(f"resume is {self.resume!r}; it must be True or False")
        if not isinstance(self.out, str | os.PathLike):
            raise InputError(f"out is {self.out!r}; it must be the path of a folder")
        object.__setattr__(self, "out", Path(self.out))
        checked_device(self.device, "train with --device cpu")


def train(config: TrainConfig, *, progress: bool = True) -> Path:
    """Train, or go on training; returns the path of the weights."""
    torch.set_num_threads(config.threads)
    torch.manual_seed(config.seed)
    config.out.mkdir(parents=True, exist_ok=True)
    recipe = recipe_of(config.mode)
    run = _Run.begin(config, recipe)
    if config.resume and (config.out / "last.pt").exists():
        run.load(config.out / "last.pt")
    newest = FIRST_CLIPS + run.step // config.steps_per_clip
    pool = SamplePool(POOL_CLIPS, config.device)
    first, rollout = max(0, newest - POOL_CLIPS), _rollout(config, recipe, run.step)
    feed = ClipFeed(recipe, config.seed, first, rollout, workers=config.workers)
    try:
        for _ in range(min(newest, POOL_CLIPS)):
            pool.add(next(feed))
        return _loop(config, recipe, run, pool, feed, progress)
    finally:
        feed.close()


@dataclass
class _Run:
    """What a resumed run needs."""

    network: nn.Module
    optimiser: torch.optim.Optimizer
    rng: np.random.Generator
    step: int
    seconds: float
    curve: list[dict[str, float]]
    resumed_at: list[int]

    @classmethod
    def begin(cls, config: TrainConfig, recipe: Recipe) -> _Run:
        network = recipe.network().to(config.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        optimiser = torch.optim.Adam(network.parameters(), config.lr)
        return cls(network, optimiser, np.random.default_rng([config.seed, 1]), 0, 0.0, [], [])

    def save(self, path: Path) -> None:
        write_whole(
            path,
            {
                "network": self.network.state_dict(),
                "optimiser": self.optimiser.state_dict(),
                "rng": json.dumps(self.rng.bit_generator.state),
                "step": self.step,
                "seconds": self.seconds,
                "curve": self.curve,
                "resumed_at": self.resumed_at,
            },
        )

    def load(self, path: Path) -> None:
        data = read_plain(path)
        try:
            parts = {name: data.pop(name) for name in ("network", "optimiser", "rng")}
            generator = json.loads(parts["rng"])
        except (KeyError, TypeError, AttributeError, ValueError, RecursionError) as error:
            raise InputError(f"{path} is not a run; give another --out, or resume=False") from error
        try:
            progress = declared(_Progress, data, str(path))
            draws = declared(_Generator, generator, f"{path}: rng")
            tensors_like(self.network.state_dict(), parts["network"], str(path))
            _refuse_other_moments(parts["optimiser"], self.optimiser, str(path))
        except InputError as error:
            raise InputError(f"{error}; it is not a run of this mode: give another --out, or resume=False") from error
        self.network.load_state_dict(parts["network"])
        self.optimiser.load_state_dict(parts["optimiser"])
        self.rng.bit_generator.state = draws.model_dump()
        self.step, self.seconds, self.curve = progress.step, progress.seconds, [dict(p) for p in progress.curve]
        self.resumed_at = [*progress.resumed_at, self.step]


class _Progress(Declared):
    """Where a run is, besides network, optimiser and generator."""

    step: Whole
    seconds: Annotated[float, Field(ge=0)]
    curve: list[dict[Name, float]]
    resumed_at: list[Whole]


class _Words(Declared):
    state: Annotated[int, Field(ge=0, lt=2**128)]
    inc: Annotated[int, Field(ge=0, lt=2**128)]


class _Generator(Declared):
    """numpy's PCG64."""

    bit_generator: Literal["PCG64"]
    state: _Words
    has_uint32: Literal[0, 1]
    uinteger: Annotated[int, Field(ge=0, lt=2**32)]


def _refuse_other_moments(found: Any, optimiser: torch.optim.Optimizer, where: str) -> None:
    """Raises InputError unless `found` is the state of an Adam of the same parameters."""
    ours = optimiser.state_dict()["param_groups"]
    groups = found.get("param_groups") if isinstance(found, dict) else None
    settings = [{name: v for name, v in group.items() if name != "lr"} for group in ours]
    if not isinstance(groups, list) or not all(isinstance(group, dict) for group in groups):
        raise InputError(f"{where}: the optimiser's groups are missing")
    if [{name: v for name, v in group.items() if name != "lr"} for group in groups] != settings:
        raise InputError(f"{where}: the optimiser has other settings or parameters")
    if any(not isinstance(g.get("lr"), float) or not 0 <= g["lr"] <= _AMOUNTS["lr"] for g in groups):
        raise InputError(f"{where}: the optimiser's rate of learning is out of range")
    weights = [p for group in optimiser.param_groups for p in group["params"]]
    moments = found.get("state")
    if not isinstance(moments, dict) or set(moments) not in (set(), set(range(len(weights)))):
        raise InputError(f"{where}: the optimiser has no moments of these parameters")
    for number, moment in moments.items():
        like = weights[number].detach()
        tensors_like({"step": torch.zeros(()), "exp_avg": like, "exp_avg_sq": like}, moment, f"{where}: optimiser")


def _loop(
    config: TrainConfig,
    recipe: Recipe,
    run: _Run,
    pool: SamplePool,
    feed: ClipFeed,
    progress: bool,
) -> Path:
    loss_of = _clean_interval_loss if recipe.target == "clean_inverse_interval" else _light_loss
    before, began, saved = run.seconds, time.monotonic(), time.monotonic()
    bar = tqdm(total=config.steps, initial=run.step, disable=not progress, mininterval=5.0, desc=config.mode)
    losses: list[Tensor] = []
    while (done := _done(config, run)) < 1.0:
        if run.step and run.step % config.steps_per_clip == 0:
            pool.add(next(feed))
        _set_rate(run.optimiser, config.lr, run.step, done)
        losses.append(_step(run, pool.batch(run.rng, config.batch, config.patch), loss_of))
        run.step += 1
        run.seconds = before + time.monotonic() - began
        bar.update()
        if run.step % config.refresh_every == 0:
            knows_gain = run.step > config.refresh_every
            scores = validate(recipe, run.network, config.seed + VALIDATION_SEED, knows_gain)
            loss = float(torch.stack(losses).mean())
            run.curve.append({"step": run.step, "seconds": run.seconds, "loss": loss, **scores})
            losses.clear()
            bar.set_postfix(loss=loss, light_db=scores["network_vs_light_db"])
            feed.weights = _refresh(config, recipe, run)
            _save(config, recipe, run)
            saved = time.monotonic()
        elif time.monotonic() - saved > config.save_every_s:
            _save(config, recipe, run)
            saved = time.monotonic()
    bar.close()
    return _save(config, recipe, run)


def _done(config: TrainConfig, run: _Run) -> float:
    """Share of the run that is over, by the clock where it is limited by minutes."""
    return run.step / config.steps if config.minutes is None else run.seconds / (60 * config.minutes)


def _set_rate(optimiser: torch.optim.Optimizer, lr: float, step: int, done: float) -> None:
    rate = lr * min(1.0, (step + 1) / WARM_UP_STEPS) * 0.5 * (1 + math.cos(math.pi * done))
    for group in optimiser.param_groups:
        group["lr"] = rate


def _step(run: _Run, batch: Batch, loss_of: Callable[[Tensor, Tensor], Tensor]) -> Tensor:
    """One step of the network; its loss, which a GPU need not have worked out yet."""
    with torch.autocast(batch.spikes.device.type, torch.bfloat16):
        predicted = run.network(batch.spikes.to(torch.bfloat16), batch.planes.float())
    loss = loss_of(predicted.float(), batch.target.float())
    run.optimiser.zero_grad(set_to_none=True)
    loss.backward()
    nn.utils.clip_grad_norm_(run.network.parameters(), 1.0)
    run.optimiser.step()
    return loss.detach()


def _clean_interval_loss(predicted: Tensor, target: Tensor) -> Tensor:
    return (predicted - target).square().mean()


def _light_loss(predicted: Tensor, target: Tensor) -> Tensor:
    return ((predicted - target).square() / (target + 0.05)).mean()


def validate(recipe: Recipe, network: nn.Module, seed: int, knows_gain: bool = True) -> dict[str, float]:
    """Error over held-out windows, as PSNR [dB] against light 1.0: network, noisy 1/ISI and the window's mean rate.

    Against the true light in each covered frame, and against what the network is taught.  The network runs over each
    clip from its start, as online.
    """
    network.eval()
    guide = network if knows_gain and recipe.layout.gain_memory else None
    sums: dict[str, float] = {}
    for number in range(VALIDATION_CLIPS):
        for sample in draw_clip(recipe, seed, number, guide)[:3]:
            window = Window(0, len(sample.light), sample.spikes, sample.planes.astype(np.float32))
            guesses = {
                "network": infer.rates(network, window, torch.bfloat16),
                "interval": window.planes[: window.count],
                "mean": window.spikes.mean(axis=0, keepdims=True, dtype=np.float32),
            }
            for name, guess in guesses.items():
                for reference in ("light", "target"):
                    error = np.square(guess - getattr(sample, reference).astype(np.float32)).mean()
                    sums[f"{name}_vs_{reference}_db"] = sums.get(f"{name}_vs_{reference}_db", 0.0) + float(error)
    network.train()
    return {name: round(-10 * float(np.log10(total / (3 * VALIDATION_CLIPS))), 3) for name, total in sums.items()}


def _rollout(config: TrainConfig, recipe: Recipe, step: int) -> Path | None:
    """The network written down last, if there is one."""
    path = config.out / f"rollout-{step // config.refresh_every * config.refresh_every}.pt"
    return path if recipe.layout.gain_memory and path.exists() else None


def _refresh(config: TrainConfig, recipe: Recipe, run: _Run) -> Path | None:
    """Write the network down for the clips to come; older ones go."""
    if not recipe.layout.gain_memory:
        return None
    path = config.out / f"rollout-{run.step}.pt"
    save_weights(path, config.mode, recipe, run.network, {"knows_gain": run.step > config.refresh_every})
    for old in sorted(config.out.glob("rollout-*.pt"), key=os.path.getmtime)[:-2]:
        old.unlink()
    return path


def _save(config: TrainConfig, recipe: Recipe, run: _Run) -> Path:
    weights = config.out / f"{config.mode}.pt"
    save_weights(weights, config.mode, recipe, run.network, _training_record(config, run))
    run.save(config.out / "last.pt")
    write_text_whole(config.out / "curve.json", json.dumps(run.curve, indent=1))
    if run.curve:
        _plot(run.curve, config.out / "curve.png")
    return weights


def _training_record(config: TrainConfig, run: _Run) -> dict[str, Any]:
    from importlib.metadata import PackageNotFoundError, version

    try:
        package = version("spikecam-env")
    except PackageNotFoundError:
        package = "not installed"
    options = {k: v for k, v in asdict(config).items() if k not in ("out", "resume", "save_every_s")}
    return {
        "command": _command(config),
        "options": options,
        "steps": run.step,
        "minutes": round(run.seconds / 60, 1),
        "resumed_at": run.resumed_at,
        "package": package,
    }


def _command(config: TrainConfig) -> str:
    """What to type to train so."""
    given = [f for f in fields(config) if f.name != "out" and getattr(config, f.name) != f.default]
    options = " ".join(f"--{f.name.replace('_', '-')} {getattr(config, f.name)}" for f in given)
    return f"spikecam train --out OUT {options}".rstrip()


def _plot(curve: list[dict[str, float]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 4))
    axes = figure.subplots()
    for name in ("network", "interval", "mean"):
        axes.plot([p["step"] for p in curve], [p[f"{name}_vs_light_db"] for p in curve], label=name)
    axes.set(xlabel="step", ylabel="PSNR against the true light [dB]")
    axes.legend()
    with whole_file(path) as beside:
        figure.savefig(beside, dpi=120)


def main() -> None:
    """`python -m denoiser.train`: the options of TrainConfig."""
    import tyro

    print(train(tyro.cli(TrainConfig)))


if __name__ == "__main__":
    main()
