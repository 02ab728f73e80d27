"""Every way in which a command writes, as a table; where the work before is long, something short stands in for it."""

from __future__ import annotations

import importlib
import json
import resource
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, reduce
from pathlib import Path
from types import SimpleNamespace

import made_up
import numpy as np
import pytest
from pytest import MonkeyPatch

from denoiser.live.session import Session
from scenes import VideoScene
from scenes.catalogue import make_scene
from spikecam_env.calibration import calibrate
from spikecam_env.cli.main import run
from spikecam_env.datasets.spikezoo import write_clip
from spikecam_env.gap.ladder import Ladder, Rung
from spikecam_env.sensor import SensorModel

SMALL = ("--size", "24", "40")
Work = dict[str, Callable[..., object]]
"""Stand-ins for work: `module:name` -> function."""
EndsInALine = Callable[[Callable[..., int], Path], str]
"""The fixture of that name: (`Writing.run` or `refused`, a place) -> the line."""


@dataclass(frozen=True)
class Writing:
    """A command line, in which {out}, {recording} and {campaign} are filled in."""

    args: str
    out: str
    """Name of its file or folder."""
    work: Work
    """Stand-ins; `refused` lets none of it begin."""
    resumes: bool = False
    """Whether it has its folder to itself, and goes on there where it was stopped."""

    @property
    def is_file(self) -> bool:
        """Whether it writes one file, not a folder."""
        return "." in self.out

    def run(self, out: Path, inputs: dict[str, Path], patch: MonkeyPatch, work: Work | None = None) -> int:
        """Its exit code."""
        for place, function in (self.work if work is None else work).items():
            module, _, name = place.partition(":")
            *classes, name = name.split(".")
            patch.setattr(reduce(getattr, classes, importlib.import_module(module)), name, function)
        return run([word.format(out=out, **inputs) for word in self.args.split()])

    def refused(self, out: Path, inputs: dict[str, Path], patch: MonkeyPatch) -> int:
        """Its exit code, where the work must not begin."""

        def begun(*_: object, **__: object) -> object:
            raise AssertionError("the work was begun")

        return self.run(out, inputs, patch, dict.fromkeys(self.work, begun))


@cache
def _bank(*_: object, **__: object) -> object:
    """A texture and an ideal unit: nothing is drawn."""
    import torch

    from denoiser.training.simulated import TEXTURE_SIZE, UNIT_SHAPE, Bank
    from spikecam_env.sensor.light import GRAINS

    nothing = torch.zeros(1, *UNIT_SHAPE)
    return Bank(torch.rand(1, TEXTURE_SIZE, TEXTURE_SIZE), nothing + GRAINS, nothing, nothing, torch.zeros(1, 8))


def _result(*_: object, **__: object) -> dict[str, object]:
    return {"figures": list(range(3000))}


def _film(*_: object) -> list[np.ndarray]:
    return [np.random.default_rng(i).integers(0, 255, (48, 80, 3), dtype=np.uint8) for i in range(12)]


def _watched(*given: object) -> list[object]:
    *_, end = given
    for picture in _film():
        end.show(picture, 0.04)
    return []


def _streamed(**_: object) -> SimpleNamespace:
    return SimpleNamespace(
        noisy=np.zeros(10), frame_rate_hz=4e4, camera_s=1.0, seconds=1.0, times_real=1.0, latency=31, shown=range(12)
    )


SCENE: Work = {"scenes.catalogue:make_scene": make_scene}
FILM: Work = {"scenes:VideoScene": VideoScene}
MODEL = SensorModel.preset("scsim")
DEMO: Work = {
    "spikecam_env.cli.showcase:stream": _streamed,
    "spikecam_env.cli.showcase:picture": lambda _, frame: _film()[frame],
    "spikecam_env.cli.showcase:comparison": lambda _: [{"stream": "noisy"}],
}
TRAINING: Work = {"denoiser.training.simulated:Bank.drawn": _bank}
EVALUATION: Work = {
    "denoiser.evaluate.quick:held_out_tables": _result,
    "denoiser.evaluate.quick:report": lambda _: "figures\n" * 200,
    "denoiser.evaluate:report": lambda _: "figures\n" * 200,
}
SPIKEZOO: Work = {
    "denoiser.evaluate.spikezoo:evaluated": lambda *_, **__: [],
    "denoiser.evaluate.spikezoo:report": lambda _: "figures\n" * 2000,
}
TRUTH: Work = {
    "denoiser.evaluate.truth:evaluate_simulated_pattern": _result,
    "denoiser.evaluate.truth:held_out_tables": _result,
    "denoiser.evaluate.truth:report": lambda _: "figures\n" * 200,
}
TASKS: Work = {"spikecam_env.envs.score:baselines": lambda *_, **__: [{"task": "x" * 9000}]}
LIVE: Work = {"denoiser.live.session:Session": Session}
PLAYED: Work = {"spikecam_env.cli.live.filming:watch": _watched}
VIEWED: Work = {"spikecam_env.cli.live.rerun_log:recorded": lambda *_: bytes(9000)}
CALIBRATION: Work = {"spikecam_env.calibration:calibrate": cache(calibrate)}
DIAGNOSIS: Work = {"spikecam_env.gap.diagnose:diagnose": lambda *_, **__: made_up._plain("none", "No gap.")}
LADDER: Work = {
    "spikecam_env.gap.ladder:ladder": lambda *_, **__: Ladder(
        "camera", 0, 3, (Rung(MODEL, None, 0.0, (), 3.0, {"rates": 2.0}, 1), Rung(MODEL, None, 0.0, (), 1.0, {}, 0))
    )
}
BENCH: Work = {"spikecam_env.bench.sensor:bench_sensor": lambda: [{"engine": "fast", "note": "x" * 9000}]}

WRITINGS: dict[str, Writing] = {
    "record h5": Writing(f"record --out {{out}} --frames 320 {' '.join(SMALL)}", "disk.h5", {}),
    "record dat": Writing(f"record --out {{out}} --frames 320 {' '.join(SMALL)}", "disk.dat", {}),
    "record npz": Writing(f"record --out {{out}} --frames 320 {' '.join(SMALL)}", "disk.npz", {}),
    "film": Writing(
        f"film {{film}} --out {{out}} --film-rate 1000 --transfer linear {' '.join(SMALL)}", "film.h5", FILM
    ),
    "denoise": Writing("denoise {recording} --out {out}", "denoised", {}),
    "demo": Writing("demo --out {out}", "demo", DEMO),
    "demo --quick": Writing("demo --quick --out {out}", "demo", DEMO),
    "scenes mp4": Writing(f"scenes disk --film {{out}} --frames 640 {' '.join(SMALL)}", "disk.mp4", SCENE),
    "scenes gif": Writing(f"scenes disk --film {{out}} --frames 640 {' '.join(SMALL)}", "disk.gif", SCENE),
    "scenes png": Writing(f"scenes disk --out {{out}} {' '.join(SMALL)}", "disk.png", SCENE),
    "live": Writing("live {recording} --film {out}", "live.mp4", LIVE),
    "play": Writing("play Catch-v1 --film {out}", "catch.mp4", PLAYED),
    "view": Writing("view Catch-v1 --frames 80 --save {out}", "catch.rrd", VIEWED),
    "dataset": Writing(
        f"dataset phm-n --out {{out}} --frames 64 --scenes disk {' '.join(SMALL)}", "spift", {}, resumes=True
    ),
    "dataset films": Writing(
        f"dataset films {{films}} --out {{out}} --frames 64 {' '.join(SMALL)}", "cuts", {}, resumes=True
    ),
    "train": Writing("train --out {out} --steps 1 --batch 1 --patch 16", "run", TRAINING, resumes=True),
    "train ssml": Writing(
        "train --mode ssml --out {out} --steps 1 --batch 1 --patch 16 --width 12", "run", TRAINING, resumes=True
    ),
    "evaluate": Writing("evaluate quick --out {out}", "evaluation", EVALUATION, resumes=True),
    "evaluate table": Writing(
        f"evaluate table1 --out {{out}} --rows noisy --scenes disk --seeds 1 --frames 200 {' '.join(SMALL)}",
        "table",
        {},
        resumes=True,
    ),
    "evaluate flow": Writing(
        f"evaluate flow --out {{out}} --rows noisy --scenes disk --frames 200 {' '.join(SMALL)}",
        "flow",
        {},
        resumes=True,
    ),
    "evaluate spikezoo": Writing("evaluate spikezoo {clips} --out {out}", "evaluation", SPIKEZOO, resumes=True),
    "evaluate tasks": Writing("evaluate tasks --tasks Catch-v1 --episodes 1 --json {out}", "tasks.json", TASKS),
    "train-agent": Writing("train-agent Catch-v1 --out {out} --steps 2 --environments 2", "agent", {}, resumes=True),
    "evaluate agents": Writing(
        "evaluate agents --tasks Catch-v1 --observations tracker --seeds 1 --episodes 1 --out {out}",
        "study",
        {},
        resumes=True,
    ),
    "evaluate truth": Writing("evaluate truth --out {out}", "evaluation", TRUTH, resumes=True),
    "export": Writing("export {recording} --frames 33 --out {out}", "exported", {}),
    "calibrate": Writing("calibrate {campaign} --out {out}", "calibrated", CALIBRATION),
    "campaign simulate": Writing(
        "campaign simulate {out} --shape 16 16 --frames 400 --recording flat:radiance=0.3", "campaign", {}, resumes=True
    ),
    "campaign import": Writing(
        "campaign import {recordings} {out} --label disk.h5=unknown --frame-rate-hz 40000", "imported", {}
    ),
    "diagnose": Writing("diagnose {campaign} --out {out}", "diagnosed", DIAGNOSIS),
    "ladder": Writing("ladder {campaign} --out {out}", "ladder", LADDER),
    "effects new": Writing("effects new my_effect --out {out}", "mine", {}),
    "bench": Writing("bench sensor --out {out}", "speed.json", BENCH),
}


def inputs_in(folder: Path) -> dict[str, Path]:
    """A recording, the folder that it is in, a campaign of flats, a film in a folder, a clip in Spike-Zoo's layout."""
    recordings = folder / "recordings"
    recordings.mkdir()
    made = {"recording": recordings / "disk.h5", "recordings": recordings, "campaign": folder / "campaign"}
    made |= {"film": folder / "films" / "film.npy", "clips": folder / "clips", "films": folder / "films"}
    made["films"].mkdir()
    write_clip(made["clips"], "a", np.ones((64, 16, 24), np.uint8), np.ones((16, 24)))
    np.save(made["film"], np.random.default_rng(0).integers(0, 255, (9, 24, 40), dtype=np.uint8))
    assert run(["record", "--out", str(made["recording"]), "--frames", "64", "--truth-every", "16", *SMALL]) == 0
    levels = [word for level in ("0.1", "0.2", "0.4") for word in ("--recording", f"flat:radiance={level}")]
    simulate = ["campaign", "simulate", str(made["campaign"]), "--shape", "16", "16", "--frames", "800"]
    assert run([*simulate, "--recording", "dark", *levels]) == 0
    assert json.loads((made["campaign"] / "campaign.json").read_text())["recordings"]
    return made


def tree(folder: Path) -> set[str]:
    """Everything that is in a folder, hidden files too."""
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


@contextmanager
def files_up_to(size: int) -> Iterator[None]:
    """As `ulimit -f` does, in bytes.

    Python keeps no compiled modules meanwhile, nor in processes that start: it would keep their first bytes.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONDONTWRITEBYTECODE", "1")
        patch.setattr(sys, "dont_write_bytecode", True)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def python(code: str) -> list[str]:
    """The command line of a script."""
    return [sys.executable, "-c", code]
