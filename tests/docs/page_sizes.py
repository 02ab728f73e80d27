"""Small sizes for the tests of pages, and stand-ins for files that a reader brings."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from spikecam_env.cli.main import run
from spikecam_env.cli.screen.film import write_film, write_picture

SIZE = "--size 24 40"
SMALL = {
    "demo": "--size 48 80 --frames 250 --no-open",
    "record": f"{SIZE} --frames 400",
    "film": SIZE,
    "scenes": f"{SIZE} --frames 320",
    "live": "--frames 128 --size 48 80",
    "play": "--film played.mp4 --episodes 1 --slow 4",
    "view": f"{SIZE} --frames 80 --save viewed.rrd",
    "dataset spift-n": f"{SIZE} --train 1 --test 1 --frames 320",
    "dataset films": SIZE,
    "dataset phm-n": f"{SIZE} --scenes disk --frames 320",
    "campaign simulate": "--shape 16 16 --frames 400",
    "train": "--steps 2 --batch 2 --patch 32 --validate-every 2 --validate-passes 1",
    "train-agent": "--steps 2 --environments 2",
    "evaluate tasks": "--tasks Catch-v1 --episodes 1",
    "evaluate agents": "--tasks Catch-v1 --observations tracker --seeds 1 --episodes 1 --steps 2 --size 32 32",
}
"""Options that are added to a command, where the line does not give them."""

ONLY_READ = {
    "bench": "measures a machine for minutes",
    "evaluate quick": "evaluates for minutes",
    "evaluate table1": "evaluates for minutes",
    "evaluate table2": "evaluates for minutes",
    "evaluate table3": "evaluates for minutes",
    "evaluate table4": "evaluates for minutes",
    "evaluate still": "evaluates for minutes",
    "evaluate flow": "evaluates for minutes",
    "evaluate truth": "evaluates for minutes",
    "evaluate spikezoo": "evaluates for minutes",
    "diagnose": "diagnoses for minutes",
    "ladder": "diagnoses for minutes",
    **({} if find_spec("rerun") else {"view": "rerun is not installed"}),
}
"""Commands that are not run, and why: their lines are read by their parser.  A size that a page gives has them run."""


def _film(path: Path) -> None:
    write_film(path, np.random.default_rng(0).integers(0, 255, (9, 48, 80, 3), dtype=np.uint8))


def _pictures(folder: Path) -> None:
    folder.mkdir()
    for i in range(4):
        write_picture(folder / f"img{i}.png", np.full((24, 40), 40 * i, np.uint8))


def _times(table: Path) -> None:
    _pictures(table.parent)
    rows = (f"{picture.name},{i / 1000}" for i, picture in enumerate(sorted(table.parent.iterdir())))
    table.write_text("\n".join(["name,time_s", *rows]), encoding="utf-8")


def _light(path: Path) -> None:
    np.save(path, np.random.default_rng(0).random((9, 24, 40), np.float32))


def _recording(path: Path) -> None:
    spikes = np.random.default_rng(0).random((128, 250, 400)) < 0.2
    path.write_bytes(np.packbits(spikes.reshape(128, -1), axis=1, bitorder="little").tobytes())


def _films(folder: Path) -> None:
    folder.mkdir()
    for name in ("000", "001"):
        np.save(folder / f"{name}.npy", np.random.default_rng(0).random((14, 32, 48), np.float32))


def _campaign(folder: Path) -> None:
    levels = [word for level in ("0.1", "0.2", "0.4") for word in ("--recording", f"flat:radiance={level}")]
    simulate = ["campaign", "simulate", str(folder), "--shape", "16", "16", "--frames", "800"]
    assert run([*simulate, "--recording", "dark", *levels]) == 0


def _picture(path: Path) -> None:
    write_picture(path, np.random.default_rng(0).integers(0, 255, (24, 40, 3), dtype=np.uint8))


def _mesh(path: Path) -> None:
    import trimesh

    trimesh.creation.icosphere(1).export(path)


def _robot(path: Path) -> None:
    arm = '<body><joint axis="0 1 0"/><geom type="capsule" size=".05" fromto="0 0 0 .4 0 0"/></body>'
    camera = '<camera pos="0 -2 0" xyaxes="1 0 0 0 0 1"/><light pos="0 -1 2"/>'
    wall = '<geom type="box" size="5 .1 5" pos="0 3 0"/>'
    path.write_text(f"<mujoco><worldbody>{camera}{wall}{arm}</worldbody></mujoco>", encoding="utf-8")


def _calibrated(folder: Path) -> None:
    _campaign(folder.with_name("flats-of-it"))
    assert run(["calibrate", "flats-of-it", "--out", str(folder)]) == 0


BROUGHT: dict[str, Callable[[Path], None]] = {
    "clip.mp4": _film,
    "street.mp4": _film,
    "pictures": _pictures,
    "shots/times.csv": _times,
    "light.npy": _light,
    "val_sharp": _films,
    "recording.dat": _recording,
    "wood.jpg": _picture,
    "kitchen.jpg": _picture,
    "teapot.obj": _mesh,
    "robot.xml": _robot,
    "CAMPAIGN": _campaign,
    "camera-17": _campaign,
    "calibrated": _calibrated,
}
"""Files that a reader brings, by the names that pages give them; made where a block names it."""
