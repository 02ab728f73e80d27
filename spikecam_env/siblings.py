"""The packages that are installed beside this one, `scenes` and `denoiser`: whether they are this distribution's.

Their names are common words.  Where another distribution has one of them, Python finds the first on its path, or the
one that was installed last; parts of both would run together.  Each of ours is marked in its `__init__.py`.
"""

from __future__ import annotations

import sys
from importlib.machinery import ModuleSpec
from importlib.util import find_spec

from spikecam_env.stopping import is_command

SIBLINGS = ("scenes", "denoiser")
MARK = 'DISTRIBUTION = "spikecam-env"'
"""The line by which ours are known; it is read, not run: importing them takes torch."""


def check_siblings() -> None:
    """Raises ImportError if a sibling that Python finds is another distribution's.

    The `spikecam` command ends in one line and code 2.
    """
    for name in SIBLINGS:
        spec = find_spec(name)
        if spec is not None and not _is_ours(spec):
            where = spec.origin or ", ".join(spec.submodule_search_locations or ())
            text = (
                f"the package {name!r} that Python finds, {where}, is not that of spikecam-env; "
                "install spikecam-env into an environment without it, or take its folder off PYTHONPATH"
            )
            if is_command():
                print(f"spikecam: {text}", file=sys.stderr)
                raise SystemExit(2)
            raise ImportError(text, name=name, path=spec.origin)


def _is_ours(spec: ModuleSpec) -> bool:
    """Whether its source has the mark; of a package that comes without sources nothing can be said against it."""
    get_source = getattr(spec.loader, "get_source", None)
    if get_source is None:  # a folder without an __init__.py
        return False
    source = get_source(spec.name)
    return source is None or MARK in source.splitlines()
