"""Options out of their range, of every subcommand: one line, code 2, nothing left behind, before any work begins."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tally import each

from scenes import RotatingDisk
from scenes.catalogue import make_scene
from scenes.flat.sliding import SlidingTexture
from scenes.protocol import Gaze
from spikecam_env.cli.main import COMMANDS
from spikecam_env.errors import InputError

EVERY_SEED = (-1, 2**63, 2**64, 10**30)
EVERY_COUNT = (0, -3, 10**16, 10**30)
EVERY_NUMBER_OF_WORKERS = (0, -1, 10**6, 2**64)
EVERY_SIZE = ((0, 8), (8, -3), (10**9, 10**9), (2**63, 1), (1, 10**9))
EVERY_FLOAT = ("nan", "inf", "-inf", "-1", "0", "1e400")
"""All that may be wrong: of `record`, `film` and `diagnose`."""
ENDS = ("1e300", "1.7976931348623157e308", "1e-300", "5e-324", "-0.0", "-1e-300")
"""Numbers at the ends of a float."""
SEEDS = (-1, 2**63)
COUNTS = (0, 10**16)
WORKERS = (0, 10**6)
SIZES = ((0, 8), (1, 10**9))
FLOATS = ("nan", "inf", "0")
"""Values nearest beyond either end, of every other command: options are checked in one place (`cli/options.py`)."""
SIZE_8 = ("--size", 8, 8)
EFFECT_FILES = ("", "{here}", "{here}/none.py", "{here}/a.dat", "{here}/a.dat/x.py", "\x00.py", "/dev/null")

COMMAND_LINES: dict[str, tuple[tuple[Any, ...], dict[str, tuple[Any, ...]]]] = {
    "record": (
        ("record", "--out", "{out}.h5", *SIZE_8, "--frames", 2),
        {
            "--seed": EVERY_SEED,
            "--frames": (*EVERY_COUNT, 10**15),
            "--size": EVERY_SIZE,
            "--rpm": ("nan", "inf", "-inf", "1e308", "-1e308", "1e10", "1e400"),
            "--effect": (
                "dead_time:tau_us=nan",
                "dead_time:tau_us=inf",
                "dead_time:tau_us=-1",
                "dead_time:tau_us=1e400",
                f"dead_time:tau_us={'9' * 400}",
                "dead_time:tau_us=",
                "dead_time:=1",
                "dead_time:tau_us",
                "dead_time:tau_us=0x1",
                "dead_time:tau=1",
                ":",
                "",
                "dead_time,",
                "shot_noise:dark_is_noisy=1",
                "shot_noise:quanta=nan",
                "afterpulsing:delay_frames=1.5",
                f"afterpulsing:delay_frames={'9' * 5000}",
                "afterpulsing:delay_frames=-1",
            ),
            "--without": ("", "shot", "\x00"),
            "--effect-file": EFFECT_FILES,
            "--model": ("", "scs", "..", "/", "\x00.toml", "x" * 300 + ".toml", "/dev/null.toml"),
            "--scene": ("", "disks", "\x00"),
            "--truth-every": (-1, 10**16, 10**30),
            "--out": ("{here}/x", "{here}/x.avi", "{here}/none/x.h5"),
        },
    ),
    "film": (
        ("film", "{here}/film.npy", "--out", "{out}.h5", "--film-rate", 1000, "--transfer", "linear", *SIZE_8),
        {
            "--seed": EVERY_SEED,
            "--frames": (*EVERY_COUNT, 10**15),
            "--seconds": (*EVERY_FLOAT, *ENDS, "1e9"),
            "--size": EVERY_SIZE,
            "--film-rate": (*EVERY_FLOAT, *ENDS),
            "--frame-rate": (*EVERY_FLOAT, *ENDS),
            "--slow": (*EVERY_FLOAT, "2"),
            "--mean-interval": (*EVERY_FLOAT, *ENDS, "0.5"),
            "--transfer": ("", "log", "gamma0", "gammanan", "gamma1e308"),
            "--truth-every": (-1, 10**16, 10**30),
            "--out": ("{here}/x", "{here}/x.avi", "{here}/none/x.h5"),
        },
    ),
    "film clean": (
        ("film", "{here}/film.npy", "--clean", "--film-rate", 1000, "--transfer", "linear", *SIZE_8),
        {"--out": ("{here}/x", "{here}/x.npz", "{here}/x.dat", "{here}/none/x.h5")},
    ),
    "demo": (
        ("demo", "--out", "{out}", *SIZE_8),
        {"--seed": SEEDS, "--frames": (*COUNTS, 499), "--size": SIZES, "--rpm": ("nan", "inf", "1e308")},
    ),
    "scenes": (
        ("scenes", "disk", "--film", "{out}.mp4", "--frames", 1, "--size", 16, 16),
        {
            "--seed": SEEDS,
            "--frames": (*COUNTS, 10**15),
            "--every": COUNTS[:2],
            "--size": SIZES,
            "--film": ("{here}/x.avi", "{here}/x"),
        },
    ),
    "play": (
        ("play", "Catch-v1", "--film", "{out}.mp4", "--size", 16, 16),
        {
            "--policy": ("", "oracl", "\x00", "keyboard", "{here}/none.pt", "{here}/a.dat"),
            "--film": ("{here}/x.avi", "{here}/x", "{here}/none/x.mp4"),
            "--episodes": (*COUNTS, 1001),
            "--slow": (*FLOATS, "0.5", "1e5"),
            "--seed": SEEDS,
            "--size": SIZES,
            "--model": ("scs", "", "{here}/none.toml"),
        },
    ),
    "play ID": (("play", "--film", "{out}.mp4"), {"": ("Cath-v1", "\x00", "x" * 1000, "spikecam_env/", "CartPole-v1")}),
    "view": (
        ("view", "disk", "--save", "{out}.rrd", "--frames", 2, *SIZE_8),
        {
            "--save": ("{here}/x.mp4", "{here}/x", "{here}/none/x.rrd"),
            "--pixels": ("", "1", "1,2,3", "8,0", "0,8", "-1,0", "nan,1", f"{'9' * 5000},1", "\x00"),
            "--frames": (*COUNTS, 10**15),
            "--every": COUNTS,
            "--seed": SEEDS,
            "--size": SIZES,
            "--model": ("scs", "", "{here}/none.toml"),
        },
    ),
    "view ID": (("view", "Catch-v1", "--save", "{out}.rrd"), {"--policy": ("", "oracl", "\x00", "{here}/a.dat")}),
    "view WHAT": (
        ("view", "--save", "{out}.rrd"),
        {"": ("disks", "Cath-v1", "\x00", "x" * 1000, "{here}", "{here}/none.h5", "{here}/x.avi", "{here}/a.dat.h5")},
    ),
    "campaign simulate": (
        ("campaign", "simulate", "{out}", "--shape", 8, 8, "--frames", 2),
        {
            "--seed": SEEDS,
            "--frames": (*COUNTS, 10**15),
            "--shape": SIZES,
            "--second-v-d": ("nan", "inf", "-5", "1e308"),
            "--recording": (
                "flat",
                "flat:radiance=nan",
                "flat:radiance=-1",
                "flat:radiance=1e308",
                "flat:radiance=text",
                "flat:radiance=0.1,frames=0",
                f"flat:radiance=0.1,frames={10**15}",
                "flat:radiance=0.1,name=../../evil",
                "flat:radiance=0.1,name=/etc/evil",
                "flat:radiance=0.1,name=..",
                "flat:radiance=0.1,name=a/b",
                "flat:radiance=0.1,name=nul",
                "flat:radiance=0.1,name=x.",
                f"flat:radiance=0.1,name={'x' * 300}",
                "flat:radiance=0.1,use=train",
                "flat:radiance=0.1,v_d=nan",
                "step:half_period=1",
                "step:half_period=-5",
                "step:low=nan",
                "bars:speed=1e-308",
                "bars:speed=nan",
                "bars:period=nan",
                "bars:period=1e308",
                "disk:rim_speed=1e308",
                "disk:seed=-1",
                "masked_rows:band=0",
                "masked_rows:band=100",
                "flats:radiance=1",
            ),
        },
    ),
    "campaign import": (
        ("campaign", "import", "{here}", "{out}", "--label", "a.dat=0.3", "--frame-rate-hz", 40000, "--height", 8,
         "--width", 8),
        {
            "--frame-rate-hz": FLOATS,
            "--radiance-per-unit": FLOATS,
            "--holdout-share": ("nan", "inf", "-1", "1"),
            "--height": COUNTS,
            "--width": COUNTS,
            "--crop-width": (*COUNTS, 9),
            "--rows": ((-1, 3), (3, 1), (0, 10**30), (0, 9)),
            "--columns": ((-1, 3), (3, 3), (0, 100)),
            "--label": ("a.dat=nan", "a.dat=-1", "a.dat=1e400", "a.dat=", "=1", "a.dat", "../a.dat=1", "/etc/passwd=1",
                        "a.dat=../x.npz", "\x00=1", "x" * 300 + "=1", "a.dat=relative", ".=1", "..=1"),
            "--table": ("{here}/none.csv", "{here}", "{here}/a.dat"),
        },
    ),
    "calibrate": (("calibrate", "{here}", "--out", "{out}"), {"--reset-noise-mv": FLOATS}),
    "diagnose": (
        ("diagnose", "{here}", "--out", "{out}"),
        {
            "--seed": EVERY_SEED,
            "--jobs": EVERY_NUMBER_OF_WORKERS,
            "--effort": ("nan", "-1", "0", "-inf"),
            "--candidates": ("", "lag"),
            "--exclude": ("", "lag"),
            "--effect-file": EFFECT_FILES,
            "--settings": ("", "{here}", "{here}/none.toml", "{here}/a.dat", "{here}/a.dat/x.toml", "\x00.toml"),
            "--model": ("scs", "", "{here}/none.toml"),
        },
    ),
    "ladder": (
        ("ladder", "{here}", "--out", "{out}"),
        {"--seed": SEEDS, "--jobs": WORKERS, "--model": ("scs",), "--effect-file": EFFECT_FILES},
    ),
    "dataset spift-n": (
        ("dataset", "spift-n", "--out", "{out}", *SIZE_8, "--frames", 2, "--train", 1, "--test", 0),
        {
            "--seed": SEEDS,
            "--frames": (*COUNTS, 10**15),
            "--size": SIZES,
            "--truth-every": (-1, 10**30),
            "--mean-interval": (*FLOATS, "1e308", "0.5"),
            "--jobs": WORKERS,
            "--train": (-1, 10**12, 10**30),
            "--test": (-1, 10**12, 10**30),
        },
    ),
    "dataset phm-n": (
        ("dataset", "phm-n", "--out", "{out}", *SIZE_8, "--frames", 2),
        {"--seed": SEEDS, "--scenes": ("", "balls", "\x00")},
    ),
    "dataset verify": (("dataset", "verify", "{here}"), {"--jobs": WORKERS}),
    "denoise": (
        ("denoise", "{here}/a.dat", "--out", "{out}", "--height", 8, "--width", 8),
        {
            "--window": (*COUNTS, 4, 101),
            "--height": COUNTS,
            "--width": (*COUNTS, 10**9),
            "--crop-width": (*COUNTS, 9),
            "--first": (-1, 100, 10**30),
            "--count": (*COUNTS, 10**9),
            "--weights": ("{here}/none.pt", "{here}/a.dat", "", "\x00"),
        },
    ),
    "live": (
        ("live", "{here}/a.dat", "--height", 8, "--width", 8, "--film", "{out}.mp4"),
        {
            "--film": ("{here}/x.avi", "{here}/x", "{here}/none/x.mp4"),
            "--frames": COUNTS,
            "--seconds": FLOATS,
            "--speed": (*FLOATS, *ENDS),
            "--pictures": (*FLOATS, "1e4"),
            "--passes": COUNTS,
            "--weights": ("{here}/none.pt", "{here}/a.dat", "\x00"),
            "--calibration": ("{here}/none", "{here}/a.dat", "\x00"),
            "--height": COUNTS,
            "--width": (*COUNTS, 10**9),
            "--crop-width": (*COUNTS, 9),
            "--seed": SEEDS,
            "--size": SIZES,
            "--rpm": ("nan", "inf", "1e308"),
        },
    ),
    "live SOURCE": (
        ("live", "--film", "{out}.mp4"),
        {
            "": (
                "",
                "disks",
                "\x00",
                "x" * 1000,
                "{here}",
                "{here}/none.h5",
                "{here}/x.avi",
                "tcp://",
                "tcp://here",
                "tcp://127.0.0.1:0",
                "tcp://127.0.0.1:99999",
                "tcp://127.0.0.1:1",
                "tcp://[::1",
                "unix://",
                "unix://{here}",
                "unix://{here}/none",
                "unix://" + "x" * 300,
            ),
        },
    ),
    "live disk": (("live", "disk", "--film", "{out}.mp4", *SIZE_8), {"--model": ("scs", "", "{here}/none.toml")}),
    "train": (
        ("train", "--out", "{out}", "--steps", 1),
        {
            "--seed": SEEDS,
            "--steps": COUNTS,
            "--minutes": FLOATS,
            "--batch": (*COUNTS, 10**9),
            "--lr": (*FLOATS, "1e308"),
            "--threads": WORKERS,
            "--validate-every": COUNTS,
            "--validate-passes": COUNTS,
            "--patch": (*COUNTS, 40, 144),
            "--device": ("", "gpu", "cuda:99", "\x00"),
            "--start": ("", "worst", "{here}/a.dat", "\x00"),
            "--teacher": ("", "paper", "{here}/a.dat", "\x00"),
            "--channels": ((0, 0, 0), (257, 1, 1)),
            "--width": (12,),
            "--frames-a-step": (12,),
            "--recordings": ("{here}/none.h5", "{here}/a.dat", "{here}", "", "\x00"),
            "--no-refine": ((),),
        },
    ),
    "train ssml": (
        ("train", "--mode", "ssml", "--out", "{out}", "--steps", 1),
        {
            "--seed": SEEDS,
            "--batch": (*COUNTS, 10**9),
            "--threads": WORKERS,
            "--device": ("", "gpu", "cuda:99", "\x00"),
            "--width": (*COUNTS, 13, 264),
            "--frames-a-step": (*COUNTS, 42),
            "--patch": (*COUNTS, 193),
            "--no-refine": ((),),
        },
    ),
    "train-agent": (
        ("train-agent", "--out", "{out}", "--steps", 1),
        {"": ("", "Cath-v1", "Fan-v0", "\x00")},
    ),
    "train-agent Catch-v1": (
        ("train-agent", "Catch-v1", "--out", "{out}", "--steps", 1),
        {
            "--obs": ("", "tpf", "\x00"),
            "--seed": SEEDS,
            "--steps": COUNTS,
            "--environments": (*COUNTS, 1025),
        },
    ),
    "evaluate quick": (
        ("evaluate", "quick", "--out", "{out}"),
        {"--seed": SEEDS, "--scenes": COUNTS, "--best": ("{here}/a.dat",)},
    ),
    "evaluate table1": (
        ("evaluate", "table1", "--out", "{out}", "--rows", "noisy", "--scenes", "disk"),
        {
            "--rows": ("", "bests", "\x00"),
            "--scenes": ("", "disks", "\x00"),
            "--size": SIZES,
            "--seeds": COUNTS,
            "--intervals": (*FLOATS, "0.5", "1e5", ("10", "nan")),
            "--speeds": ("nan", "inf", "-inf", "-1", "1e400", "1e3"),
            "--frames": (*COUNTS, 199),
            "--jobs": WORKERS,
            "--paper": ("{here}/none.pt",),
            "--weights": ("{here}/none", "\x00"),
            "--data": ("{here}", "{here}/none"),
        },
    ),
    "evaluate table2": (
        ("evaluate", "table2", "--out", "{out}"),
        {"--rows": ("clean", "light"), "--jobs": WORKERS, "--best": ("{here}/none.pt",)},
    ),
    "evaluate still": (
        ("evaluate", "still", "--out", "{out}", "--rows", "noisy"),
        {"--scenes": COUNTS, "--size": SIZES, "--seeds": COUNTS, "--frames": (*COUNTS, 10**15), "--jobs": WORKERS},
    ),
    "evaluate spikezoo": (
        ("evaluate", "spikezoo", "{here}", "--out", "{out}"),
        {"--rate": FLOATS, "--best": ("{here}/a.dat",)},
    ),
    "evaluate tasks": (
        ("evaluate", "tasks", "--json", "{out}.json", "--tasks", "Catch-v1", "--episodes", 1),
        {"--tasks": ("", "Cath-v1", "\x00"), "--episodes": (*COUNTS, 1001), "--seed": SEEDS, "--size": SIZES},
    ),
    "evaluate agents": (
        ("evaluate", "agents", "--out", "{out}", "--steps", 1, "--episodes", 1),
        {
            "--tasks": ("", "Cath-v1", "\x00"),
            "--observations": ("", "tpf", "\x00"),
            "--intervals": FLOATS,
            "--trained": (("2", "nan"), ("20", "10")),
            "--size": SIZES,
            "--seeds": COUNTS,
            "--first-seed": SEEDS,
            "--steps": COUNTS,
            "--episodes": (*COUNTS, 1001),
            "--jobs": WORKERS,
        },
    ),
    "evaluate truth": (
        ("evaluate", "truth", "--out", "{out}"),
        {
            "--seed": SEEDS,
            "--scenes": COUNTS,
            "--static": ("{here}/none.npz", "{here}/a.dat", "\x00.npz", ""),
            "--moving": ("{here}/none.npz", "{here}/a.dat", "\x00.npz", ""),
            "--best": ("{here}/a.dat",),
        },
    ),
    "export": (
        ("export", "{here}/none.h5", "--out", "{out}"),
        {
            "--frames": (*COUNTS, 300),
            "--clips": COUNTS,
            "--first": (-1, 10**30),
            "--count": COUNTS,
            "--rate": FLOATS,
            "--out": ("{here}/none/x", "{here}/a.dat"),
        },
    ),
    "effects show": (("effects", "show"), {"": ("dead_tim", "..", "\x00", "x" * 1000)}),
    "effects list": (("effects", "list"), {"--effect-file": EFFECT_FILES}),
    "effects new": (
        ("effects", "new", "--out", "{out}"),
        {"": ("", "..", "../mine", "/etc/mine", "\x00", "x" * 1000, "dead_time", "DeadTime", "mine.py", "my-effect",
              "a_b", "effect", "stage", "2nd", "_mine", "mütze", "con")},
    ),
    "effects new mine": (("effects", "new", "mine", "--out", "{out}"), {"--out": ("{here}/a.dat", "\x00")}),
    "bench": (("bench", "sensor", "--out", "{here}/none/x.json"), {}),
}  # fmt: skip


@pytest.mark.parametrize("name", COMMAND_LINES)
def test_an_option_out_of_range_is_refused_by_name(name: str, tmp_path: Path, meets) -> None:
    """Of a command every option in turn, with every value of the table; values that are not refused are named."""
    (tmp_path / "a.dat").write_bytes(bytes(range(256)) * 2)
    np.save(tmp_path / "film.npy", np.full((5, 8, 8), 100, np.uint8))
    places = {"here": tmp_path, "out": tmp_path / "out"}

    def refused(words: list[Any]) -> None:
        assert meets(f"options of {name}", *(_filled(word, places) for word in words)) == 2

    each(lines_with(*COMMAND_LINES[name]), refused)


def lines_with(line: tuple[Any, ...], options: dict[str, tuple[Any, ...]]) -> Iterator[tuple[str, list[Any]]]:
    """(fault, the words) for a good command line and values of its options."""
    for option, values in options.items():
        for value in values:
            words = value if isinstance(value, tuple) else (value,)
            yield f"{option} {' '.join(map(repr, words))}", _with(line, option, words)


def _with(line: tuple[Any, ...], option: str, words: tuple[Any, ...]) -> list[Any]:
    """The words of a line whose option is another; without an option, the words come last."""
    given = [*line]
    if option in given:
        at = given.index(option)
        after = next((i for i in range(at + 1, len(given)) if str(given[i]).startswith("--")), len(given))
        del given[at:after]
    if len(words) == 1 and option:
        return [*given, f"{option}={words[0]}"]
    return [*given, *filter(None, [option]), *words]


def _filled(word: Any, places: dict[str, Path]) -> Any:
    for place, path in places.items():
        word = word.replace(f"{{{place}}}", str(path)) if isinstance(word, str) else word
    return word


def test_every_command_is_in_the_table() -> None:
    assert {name.split()[0] for name in COMMAND_LINES} >= set(COMMANDS)


BAD = {
    "NaN": np.nan,
    "inf": np.inf,
    "-inf": -np.inf,
    "1e308": 1e308,
    "-1e308": -1e308,
    "400 digits": 10**400,
    "text": "1",
    "true": True,
    "a list": [1.0],
}


@pytest.mark.parametrize("value", BAD.values(), ids=BAD)
@pytest.mark.parametrize("name", ["rpm", "angle", "motion_per_key", "frame_rate_hz", "radius"])
def test_a_number_that_no_disk_has_is_refused(name: str, value: Any) -> None:
    """rpm 1e308 was an index that is NaN in compiled code: a segmentation fault."""
    with pytest.raises(InputError, match=name):
        RotatingDisk((16, 16), **{name: value})


@pytest.mark.parametrize("value", BAD.values(), ids=BAD)
def test_a_place_that_no_scene_has_is_refused(value: Any) -> None:
    disk = RotatingDisk((16, 16))
    for make in (
        lambda: disk.placed((value, 0.0)),
        lambda: disk.placed((0.0, 0.0), drift_px_s=(0.0, value)),
        lambda: Gaze.fixed(value, 0.0),
        lambda: Gaze((0.0, 0.0), (0.0, 0.0), (0.0, value)),
        lambda: SlidingTexture((16, 16), velocity_px_s=(value, 0.0)),
        lambda: make_scene("disk", (16, 16), frame_rate_hz=value),
        lambda: make_scene("disk", (16, 16), mean_interval=value),
    ):
        with pytest.raises(InputError):
            make()


def test_a_disk_that_has_drifted_far_away_is_out_of_sight() -> None:
    disk = RotatingDisk((16, 16), drift_px_s=(1e9, -1e9), background=0.1)
    assert np.all(disk.truth(4e15).radiance == np.float32(0.1))
    assert disk.radiance(2**52, 2**52 + 4).radiance.max() == np.float32(0.1)
