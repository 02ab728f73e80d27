"""Where the `spikecam` command begins and ends: signals, standard streams, exit codes.

- 0: done;
- 1: an error of this package;
- 2: unusable input, or a fault of the disk, in one line;
- 130, 143, 129: stopped by SIGINT, SIGTERM, SIGHUP (`spikecam_env.stopping`);
- 141: the reader of the output has closed it.
"""

from __future__ import annotations

import os
import select
import sys

from spikecam_env import stopping
from spikecam_env.cli.say import say

UNREAD = 141
"""Exit code of a command that a closed pipe ends, 128 + SIGPIPE."""


def main(args: list[str] | None = None) -> None:
    """Run a subcommand and exit."""
    with stopping.watched():
        # Torch's threads spin long while they wait: beside other work on the same cores that costs a factor of seven.
        os.environ.setdefault("GOMP_SPINCOUNT", "10000")
        code = _with_streams(args)
    stopping.finish(code)


def _with_streams(args: list[str] | None) -> int:
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115 - for as long as the process lives
    if sys.stdout is None:
        say("standard output is closed; give it somewhere to go, e.g. > /dev/null")
        return 2
    from spikecam_env.cli.main import run

    try:
        code = run(args)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BrokenPipeError:
        if not _is_unread():
            raise
        code = UNREAD
    return _flushed(code)


def _is_unread() -> bool:
    """Whether it is our own output that nobody reads any more."""
    if not hasattr(select, "poll"):
        return True
    poll = select.poll()
    for number in (1, 2):
        poll.register(number, select.POLLOUT)
    return any(event & select.POLLERR for _, event in poll.poll(0))


def _flushed(code: int) -> int:
    """Write all printed text; returns the exit code.  Output that nobody takes is dropped."""
    if sys.stdout.closed:  # by a user's code, which the command has refused
        return code
    try:
        sys.stdout.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        if isinstance(error, BrokenPipeError):
            return code or UNREAD
        say(f"cannot write to standard output: {error.strerror}")
        return code or 2
    return code
