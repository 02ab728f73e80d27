"""The `spikecam` command: one dataclass of options a subcommand, in a file of its own."""

from __future__ import annotations

import os
import signal
import sys
from typing import Annotated, Any, Union

import tyro

from spikecam_env.cli.bench import Bench
from spikecam_env.cli.blind_trial import BlindTrial
from spikecam_env.cli.calibrate import Calibrate
from spikecam_env.cli.campaign import Campaign
from spikecam_env.cli.dataset import Dataset
from spikecam_env.cli.demo import Demo
from spikecam_env.cli.denoise import Denoise
from spikecam_env.cli.diagnose import Diagnose
from spikecam_env.cli.effects import Effects
from spikecam_env.cli.evaluate import Evaluate
from spikecam_env.cli.film_to_spikes import Film
from spikecam_env.cli.ladder import Ladder
from spikecam_env.cli.record import Record
from spikecam_env.cli.scenes import Scenes
from spikecam_env.cli.train import Train
from spikecam_env.errors import InputError

DESCRIPTION = """The spike camera you can step: simulate it, record it, denoise it online.

examples:
  spikecam demo
  spikecam record --frames 4000 --out disk.h5
  spikecam denoise disk.h5 --out denoised
  spikecam COMMAND --help
"""

COMMANDS: dict[str, Any] = {
    "demo": Demo,
    "record": Record,
    "film": Film,
    "scenes": Scenes,
    "dataset": Dataset,
    "denoise": Denoise,
    "train": Train,
    "evaluate": Evaluate,
    "calibrate": Calibrate,
    "campaign": Campaign,
    "diagnose": Diagnose,
    "ladder": Ladder,
    "blind-trial": BlindTrial,
    "effects": Effects,
    "bench": Bench,
}


def main(args: list[str] | None = None) -> None:
    """Run a subcommand; unusable input ends in one line on standard error and exit code 2."""
    # Torch's threads spin long while they wait; beside other work on the same cores that can cost a factor of seven.
    os.environ.setdefault("GOMP_SPINCOUNT", "10000")
    # Asked to stop, clean up as after an interrupt: no half-written file, no simulation left running.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    sys.exit(run(args))


def run(args: list[str] | None = None) -> int:
    """Parse and run; returns the exit code."""
    union: Any = None
    for name, options in COMMANDS.items():
        command_type: Any = Annotated[options, tyro.conf.subcommand(name)]  # type: ignore[valid-type]
        union = command_type if union is None else Union[union, command_type]  # noqa: UP007
    command = tyro.cli(union, prog="spikecam", description=DESCRIPTION, args=args, config=(tyro.conf.OmitArgPrefixes,))
    try:
        command.run()
    except InputError as error:
        print(f"spikecam: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        return 0
    except KeyboardInterrupt:
        print("spikecam: stopped", file=sys.stderr)
        return 130
    return 0
