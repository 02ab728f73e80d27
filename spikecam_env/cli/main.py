"""The `spikecam` command: one dataclass of options a subcommand, in a file of its own."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Annotated, Any, Union

import tyro

from spikecam_env.cli.bench import Bench
from spikecam_env.cli.calibrate import Calibrate
from spikecam_env.cli.campaign import Campaigns
from spikecam_env.cli.dataset import Dataset
from spikecam_env.cli.demo import Demo
from spikecam_env.cli.denoise import Denoise
from spikecam_env.cli.diagnose import Diagnose
from spikecam_env.cli.effect_files import effects_of
from spikecam_env.cli.effects import Effects
from spikecam_env.cli.evaluate import Evaluate
from spikecam_env.cli.export import Export
from spikecam_env.cli.film_to_spikes import FilmToSpikes
from spikecam_env.cli.first_words import START, check_words
from spikecam_env.cli.ladder import LadderCommand
from spikecam_env.cli.live_stream import Live
from spikecam_env.cli.options import check_options
from spikecam_env.cli.play import Play
from spikecam_env.cli.record import Record
from spikecam_env.cli.say import say, warnings_as_lines
from spikecam_env.cli.scenes import Scenes
from spikecam_env.cli.train import Train
from spikecam_env.cli.train_agent import TrainAgent
from spikecam_env.cli.view import ViewCommand
from spikecam_env.cli.without_effect import refuse_without_effect
from spikecam_env.errors import InputError
from spikecam_env.stopping import Stopped
from spikecam_env.version import __version__
from spikecam_env.whole import reason

DESCRIPTION = """The spike camera you can step: simulate it, record it, denoise it online.

examples:
  spikecam demo
  spikecam record --frames 4000 --out disk.h5
  spikecam denoise disk.h5 --out denoised
  spikecam COMMAND --help
  spikecam --version
"""

COMMANDS: dict[str, Any] = {
    "demo": Demo,
    "record": Record,
    "film": FilmToSpikes,
    "scenes": Scenes,
    "play": Play,
    "view": ViewCommand,
    "dataset": Dataset,
    "export": Export,
    "denoise": Denoise,
    "live": Live,
    "train": Train,
    "train-agent": TrainAgent,
    "evaluate": Evaluate,
    "calibrate": Calibrate,
    "campaign": Campaigns,
    "diagnose": Diagnose,
    "ladder": LadderCommand,
    "effects": Effects,
    "bench": Bench,
}


def run(args: list[str] | None = None) -> int:
    """Parse and run; returns the exit code.  Without a word it prints three commands to begin with."""
    words = sys.argv[1:] if args is None else args
    if not words:
        print(START)
        return 0
    if words == ["--version"]:
        print(f"spikecam-env {__version__}")
        return 0
    return run_parsed(lambda: understood(words))


def understood(words: list[str]) -> Any:
    """The command of a line, an instance of one of COMMANDS, not run yet; exits where there is none.

    Raises:
        InputError: wrong words, or an option that has no effect beside the others.
    """
    given = check_words(words, COMMANDS)
    union: Any = None
    for name, options in COMMANDS.items():
        command_type: Any = Annotated[options, tyro.conf.subcommand(name)]
        union = command_type if union is None else Union[union, command_type]  # noqa: UP007
    command = tyro.cli(union, prog="spikecam", description=DESCRIPTION, args=words, config=(tyro.conf.OmitArgPrefixes,))
    refuse_without_effect(command, given)
    return command


def run_parsed(parse: Callable[[], Any]) -> int:
    """Run the command that `parse` returns; returns the exit code.

    Unusable input and faults of the disk end in one line and code 2.
    """
    try:
        with warnings_as_lines():
            command = parse()
            check_options(command)
            with effects_of(command):
                command.run()
    except InputError as error:
        say(str(error))
    except MemoryError as error:
        say(f"out of memory ({error}); give a smaller --size or fewer --frames" if str(error) else "out of memory")
    except BrokenPipeError:
        raise
    except OSError as error:
        say(f"{reason(error)}: {error.filename}" if error.filename is not None else f"cannot write: {reason(error)}")
    except Stopped:
        raise
    except KeyboardInterrupt:
        say("stopped")
        return 130
    else:
        return 0
    return 2
