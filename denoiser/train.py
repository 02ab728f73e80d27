"""Training: minimise the error of the rate along simulated streams, resumable at any minute.

    paper   L = mean (ISI_dn - ISI_clean)^2                 paper (22), on normalised intervals (`interval_training`)
    best    L = mean (rate - light)^2 / (rate + 0.02) + ..  light weighs as its count noise does (`rollout`)

Adam; the rate of learning warms up over 100 steps and falls as a cosine to nothing at the end.  Everything follows from
the seed and the number of steps; a run limited by `minutes` ends where the clock says.  A resumed run draws other
streams.  On a GPU streams, windows and network are all there.

In `out` the run keeps `<mode>.pt` (weights), `last.pt` (to resume), `curve.json` and `curve.png` (validation).
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Protocol

import torch
from pydantic import Field
from torch import Tensor, nn
from tqdm import tqdm

from denoiser.captured import captured
from denoiser.interval_training import IntervalWindows
from denoiser.plain_torch import read_plain, tensors_like
from denoiser.recipe import Recipe, recipe_of
from denoiser.rollout import Rollouts
from denoiser.simulated import Bank, SimulatedStreams
from denoiser.training_record import training_record
from denoiser.weights import save_weights, write_whole
from spikecam_env.errors import InputError
from spikecam_env.sensor.kernels.cuda import checked_device
from spikecam_env.untrusted import Declared, Name, Whole, declared
from spikecam_env.whole import whole_file, write_text_whole

VALIDATION_SEED = 1_000_003  # added to the seed: other scenes, other units, other textures of the same kinds
VALIDATION_STREAMS = 8
VALIDATION_PASSES = 24
WARM_UP_STEPS = 100
PASSES = {"best": 3, "paper": 1}
"""Passes of each stream that a step takes."""

_COUNTS = {
    "steps": (1, 10**9),
    "batch": (1, 65_536),
    "seed": (0, 2**62),
    "threads": (1, 1024),
    "patch": (16, 128),
    "validate_every": (1, 10**9),
}
"""Options that are whole numbers, with the least and the most."""

_AMOUNTS = {"lr": 1.0, "minutes": 1e6, "save_every_s": 1e9}
"""Options that are numbers above 0, with the most."""


@dataclass(frozen=True)
class TrainConfig:
    """mode: "best" | "paper".  out: folder.  The run ends after `steps`, or `minutes` where that is given.

    batch: streams a step.  patch: their side [pixels], a multiple of 16.  lr: highest rate of learning.
    validate_every: steps between validations.  threads: of the processor.  device: where streams and network are; a
    GPU wants larger batches.  refine: `paper` with its refine module or, for the ablation, without.
    resume: go on from out/last.pt.
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
    refine: bool = True
    save_every_s: float = 60.0
    validate_every: int = 1000
    device: str = "cpu"

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
        for name in ("resume", "refine"):
            if not isinstance(getattr(self, name), bool):
                raise InputError(f"{name} is {getattr(self, name)!r}; it must be True or False")
        if self.patch % 16:
            raise InputError(f"patch is {self.patch}; it must be a multiple of 16")
        if not isinstance(self.out, str | os.PathLike):
            raise InputError(f"out is {self.out!r}; it must be the path of a folder")
        object.__setattr__(self, "out", Path(self.out))
        checked_device(self.device, "train with --device cpu")


def train(config: TrainConfig, *, progress: bool = True) -> Path:
    """Train, or go on training; returns the path of the weights.

    Raises InputError where `out` holds the run of another mode, or a damaged one.
    """
    torch.set_num_threads(config.threads)
    torch.manual_seed(config.seed)
    config.out.mkdir(parents=True, exist_ok=True)
    recipe = replace(recipe_of(config.mode), refine=config.refine)
    run = _Run.begin(config, recipe)
    if config.resume and (config.out / "last.pt").exists():
        run.load(config.out / "last.pt")
    return _loop(config, recipe, run, progress)


class Source(Protocol):
    """What a network learns from and is judged by."""

    streams: SimulatedStreams

    def loss(self, network: nn.Module, passes: int) -> Tensor:
        """The loss of one step, with gradients."""

    def errors(self, network: nn.Module, passes: int) -> dict[str, float]:
        """Mean squared errors against the light, by what guessed it."""


def source(recipe: Recipe, *, seed: int, **options: Any) -> Source:
    """Streams for a recipe: `Rollouts` for the light, `IntervalWindows` for the clean interval."""
    kind = IntervalWindows if recipe.target == "clean_inverse_interval" else Rollouts
    return kind(recipe.layout, seed=seed, **options)


@dataclass
class _Run:
    """What a resumed run needs."""

    network: nn.Module
    optimiser: torch.optim.Optimizer
    step: int
    seconds: float  # spent so far
    curve: list[dict[str, float]]  # the validations
    resumed_at: list[int]

    @classmethod
    def begin(cls, config: TrainConfig, recipe: Recipe) -> _Run:
        network = recipe.network().to(config.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        on_gpu = torch.device(config.device).type == "cuda"
        lr = torch.tensor(config.lr, device=config.device) if on_gpu else config.lr  # replayed steps read tensors
        optimiser = torch.optim.Adam(network.parameters(), lr, capturable=on_gpu)
        return cls(network, optimiser, 0, 0.0, [], [])

    def save(self, path: Path) -> None:
        write_whole(
            path,
            {
                "network": self.network.state_dict(),
                "optimiser": _plain_groups(self.optimiser.state_dict()),
                "step": self.step,
                "seconds": self.seconds,
                "curve": self.curve,
                "resumed_at": self.resumed_at,
            },
        )

    def load(self, path: Path) -> None:
        data = read_plain(path)
        try:
            parts = {name: data.pop(name) for name in ("network", "optimiser")}
        except (KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{path} is not a run; give another --out, or resume=False") from error
        try:
            progress = declared(_Progress, data, str(path))
            tensors_like(self.network.state_dict(), parts["network"], str(path))
            _refuse_other_moments(parts["optimiser"], self.optimiser, str(path))
        except InputError as error:
            raise InputError(f"{error}; it is not a run of this mode: give another --out, or resume=False") from error
        self.network.load_state_dict(parts["network"])
        groups = [dict(group) for group in self.optimiser.state_dict()["param_groups"]]
        self.optimiser.load_state_dict({**parts["optimiser"], "param_groups": groups})
        self.step, self.seconds, self.curve = progress.step, progress.seconds, [dict(p) for p in progress.curve]
        self.resumed_at = [*progress.resumed_at, self.step]


def _plain_groups(state: dict[str, Any]) -> dict[str, Any]:
    """An optimiser's state with its rates of learning as numbers, as on a processor."""
    groups = [{**group, "lr": float(group["lr"]), "capturable": False} for group in state["param_groups"]]
    return {**state, "param_groups": groups}


class _Progress(Declared):
    """Where a run is, besides network and optimiser."""

    step: Whole
    seconds: Annotated[float, Field(ge=0)]
    curve: list[dict[Name, float]]
    resumed_at: list[Whole]


def _refuse_other_moments(found: Any, optimiser: torch.optim.Optimizer, where: str) -> None:
    """Raises InputError unless `found` is the state of an Adam of the same parameters."""
    ours = _plain_groups(optimiser.state_dict())["param_groups"]
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


def _loop(config: TrainConfig, recipe: Recipe, run: _Run, progress: bool) -> Path:
    device = torch.device(config.device)
    compiled = device.type == "cuda"
    seed = config.seed + run.step  # a resumed run meets other streams
    torch.backends.cudnn.benchmark = True
    bank = Bank.drawn(config.seed, device, progress=progress)
    streams = source(
        recipe, seed=seed, taken=config.batch, patch=config.patch, device=device, bank=bank, compiled=compiled
    )
    judge = Judge(recipe, config.seed + VALIDATION_SEED, device)
    before, began, saved = run.seconds, time.monotonic(), time.monotonic()
    bar = tqdm(total=config.steps, initial=run.step, disable=not progress, mininterval=5.0, desc=config.mode)
    losses: list[Tensor] = []
    step = stepper(run, streams, PASSES[config.mode])
    while (done := _done(config, run)) < 1.0:
        _set_rate(run.optimiser, config.lr, run.step, done)
        losses.append(step())
        run.step += 1
        run.seconds = before + time.monotonic() - began
        bar.update()
        if run.step % config.validate_every == 0:
            scores = judge.scores(run.network)
            loss = float(torch.stack(losses).mean())
            run.curve.append({"step": run.step, "seconds": run.seconds, "loss": loss, **scores})
            losses.clear()
            bar.set_postfix(loss=loss, network_db=scores["network_db"])
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
        if isinstance(group["lr"], Tensor):
            group["lr"].fill_(rate)
        else:
            group["lr"] = rate


def stepper(run: _Run, streams: Source, passes: int) -> Callable[[], Tensor]:
    """A function that takes one step and returns its loss, which a GPU need not have worked out yet."""

    def step() -> Tensor:
        run.optimiser.zero_grad(set_to_none=True)
        loss = streams.loss(run.network, passes)
        loss.backward()
        nn.utils.clip_grad_norm_(run.network.parameters(), 1.0)
        run.optimiser.step()
        return loss.detach()

    return captured(step, streams.streams.device, streams.streams.rng)


class Judge:
    """Held-out streams, the same at every validation."""

    def __init__(self, recipe: Recipe, seed: int, device: torch.device) -> None:
        self._recipe, self._seed, self._device = recipe, seed, device
        self._bank = Bank.drawn(seed, device, textures=32, units=16)

    def scores(self, network: nn.Module) -> dict[str, float]:
        """PSNR against light 1.0 [dB] of the network and what it is compared with, each along whole streams."""
        network.eval()
        streams = source(
            self._recipe,
            seed=self._seed,
            taken=VALIDATION_STREAMS,
            pool=1,
            patch=64,
            device=self._device,
            bank=self._bank,
        )
        errors = streams.errors(network, VALIDATION_PASSES)
        network.train()
        return {f"{name}_db": round(-10 * math.log10(max(error, 1e-12)), 3) for name, error in errors.items()}


def _save(config: TrainConfig, recipe: Recipe, run: _Run) -> Path:
    weights = config.out / f"{config.mode}.pt"
    record = training_record(config, run.step, run.seconds, run.resumed_at)
    save_weights(weights, config.mode, recipe, run.network, record)
    run.save(config.out / "last.pt")
    write_text_whole(config.out / "curve.json", json.dumps(run.curve, indent=1))
    if run.curve:
        _plot(run.curve, config.out / "curve.png")
    return weights


def _plot(curve: list[dict[str, float]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 4))
    axes = figure.subplots()
    for name in sorted({key for point in curve for key in point if key.endswith("_db")}):
        axes.plot([p["step"] for p in curve], [p[name] for p in curve], label=name.removesuffix("_db"))
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
