"""Which error to raise.

- `InputError`: a value, file or option from the user is unusable.  The message names the value, the allowed ones, and
  a remedy; the command line prints it in one line and exits with code 2.
- `WriteError`: an `InputError` of a file that cannot be written: a full disk, a read-only folder.
- `OwnCodeError`: an `InputError` of a user's own code, an effect for one, that failed or returned an unusable value.
- `NotReadyError`: a call came before the one it needs (stepping before reset).

All are subclasses of the built-in a caller would expect, so `except ValueError` or `OSError` keeps working.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class InputError(ValueError):
    """An unusable value: names it, the allowed ones, and a remedy.

    Example:
        >>> from spikecam_env.sensor import Circuit
        >>> Circuit(reset_V=50.0)
        Traceback (most recent call last):
            ...
        spikecam_env.errors.InputError: circuit.reset_V = 50.0; it must be a number from -20 to 20 V
    """


class WriteError(InputError, OSError):
    """A file or folder that cannot be written: says which and why.

    Example:
        >>> from spikecam_env.sensor import SensorModel
        >>> SensorModel.preset("ideal").to_toml("nowhere/model.toml")
        Traceback (most recent call last):
            ...
        spikecam_env.errors.WriteError: cannot write nowhere/model.toml: there is no folder nowhere; make it first
    """


class OwnCodeError(InputError):
    """A user's own code that failed or returned an unusable value: says where and why; `__cause__` is its exception.

    Example:
        >>> from spikecam_env.own_code import own_code
        >>> with own_code("effect threshold_sag, compare, frame 7"):
        ...     1 / 0
        Traceback (most recent call last):
            ...
        spikecam_env.errors.OwnCodeError: effect threshold_sag, compare, frame 7: ZeroDivisionError: division by zero
    """


class NotReadyError(RuntimeError):
    """A call in the wrong order: says which call has to come first.

    Example:
        >>> from spikecam_env.envs.rotating_disk import RotatingDiskEnv
        >>> RotatingDiskEnv(shape=(16, 24)).step([0.0, 0.0])
        Traceback (most recent call last):
            ...
        spikecam_env.errors.NotReadyError: the environment has no scene yet; call reset first
    """


def unknown_name(kind: str, name: object, allowed: Iterable[str]) -> InputError:
    """Error for a name that is not in a list: `unknown scene 'fun'; choose one of ball, fan, train (fan?)`.

    Example:
        >>> unknown_name("scene", "fun", ["ball", "fan"])
        InputError("unknown scene 'fun'; choose one of ball, fan (fan?)")
    """
    names = sorted(allowed)
    nearest = "".join(f" ({near}?)" for near in get_close_matches(shown(name).strip("'"), names, n=1))
    return InputError(f"unknown {kind} {shown(name)}; choose one of {', '.join(names)}{nearest}")


def shown(value: object) -> str:
    """A value in an error's text: one line of at most 60 characters.

    Args:
        value: Any; also one whose text has several lines, or which has none.

    Returns:
        Its text.

    Example:
        >>> len(shown("a" * 1000))
        60
    """
    try:
        text = " ".join(line.strip() for line in repr(value).splitlines())
    except Exception:  # whole numbers of more than 4300 digits, and objects of users whose own code raises
        return f"a {type(value).__name__}"
    return text if len(text) <= 60 else f"{text[:57]}..."
