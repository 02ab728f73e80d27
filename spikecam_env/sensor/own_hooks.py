"""Hooks of effects that are not of the package: their values are checked, and their errors name effect and frame.

`guard` replaces the hooks of a class once, when the class is made: every caller gets checked hooks, and the package's
own effects pay nothing.  A hook gets read-only arrays: it cannot write into the camera.  Numpy's warnings
are off within it, since each returned value is checked.
"""

from __future__ import annotations

import inspect
import math
import operator
import pickle
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from functools import wraps
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError, OwnCodeError, shown
from spikecam_env.numbers import as_number
from spikecam_env.own_code import line_in, own_code
from spikecam_env.sensor.effects.base import (
    NEW_CLASS_CHECKS,
    PACKAGE,
    Charge,
    Effect,
    ExposureBlock,
    Feedback,
    Few,
    Shift,
)
from spikecam_env.sensor.ranges import check_parameters
from spikecam_env.sensor.unit import UNIT_RANGES, PixelArray
from spikecam_env.types import Masks, Pictures

MOST = 1e9
"""Largest charge [thresholds], factor or voltage [mV] that a hook may return.  Engines end the charge of a frame at 128
thresholds; products of such numbers stay finite."""

MOST_LEAD = 2.0
"""Time from a row's read-out to the end of the array's frame, below so many frames: a row has light of two frames
(`readout_skew`)."""

_ANY = (-MOST, MOST)
_FROM_ZERO = (0.0, MOST)
_CAPACITANCE_FF = (1e-6, MOST)


@dataclass(frozen=True)
class Call:
    """One call of a hook, for the text of errors."""

    effect: Effect
    hook: str
    given: tuple[Any, ...]
    """The arguments after `self`."""

    @property
    def now(self) -> ExposureBlock | None:
        """The frames of the call, None for a hook without."""
        return next((value for value in self.given if isinstance(value, ExposureBlock)), None)

    def frames(self) -> tuple[int, int]:
        """Number of the camera's first frame of the call, and how many there are; (0, 0) where none is known."""
        now = self.now
        return (0, 0) if now is None else (math.floor((now.origin + now.number) * now.length + 1e-9), now.frames)

    def place(self, index: int | None = None) -> str:
        """Effect, hook and frames in words, or the one frame of this index within the call."""
        first, count = self.frames()
        name = f"effect {self.effect.name}, {self.hook}"
        if count == 0:
            return name
        if index is not None or count == 1:
            return f"{name}, frame {first + (index or 0)}"
        return f"{name}, frames {first} to {first + count - 1}"

    def error(self, fault: str, index: int | None = None) -> OwnCodeError:
        """The error of a returned value."""
        return OwnCodeError(f"{self.place(index)}: {fault}")


Check = Callable[[Call, Any], Any]
"""A returned value in the types that engines compute in, or an OwnCodeError."""


def guard(effect: type[Effect]) -> None:
    """Replace the hooks of an effect's class by checked ones, unless the class is the package's or they are already."""
    if effect.__module__.startswith(PACKAGE):
        return
    for name in (*CHECKS, "__post_init__"):
        law = inspect.getattr_static(effect, name)
        if effect.overrides(name) and not hasattr(law, "unchecked"):
            setattr(effect, name, _checked_hook(name, law, CHECKS[name]) if name in CHECKS else _checked_making(law))


def _checked_hook(hook: str, law: Any, check: Check) -> Callable[..., Any]:
    @wraps(getattr(law, "__func__", law))
    def checked(self: Effect, *given: Any, **named: Any) -> Any:
        call = Call(self, hook, (*given, *named.values()))
        handed = [_read_only(value) for value in given]
        with own_code(lambda: _place_of_failure(call)), np.errstate(all="ignore"):
            value = _bound(law, self)(*handed, **{name: _read_only(value) for name, value in named.items()})
            return check(call, _as_given(value, handed, given))

    checked.unchecked = law  # type: ignore[attr-defined]
    return checked


def _checked_making(made: Any) -> Callable[[Effect], None]:
    """`__post_init__` of a user's own: parameters are held to their ranges even where it leaves that out."""

    @wraps(made)
    def checked(self: Effect) -> None:
        with own_code(f"effect {self.name}, __post_init__", passing=(InputError,)):
            _bound(made, self)()
        check_parameters(self, self.name)

    checked.unchecked = made  # type: ignore[attr-defined]
    return checked


def _bound(law: Any, effect: Effect) -> Any:
    return law.__get__(effect, type(effect)) if hasattr(law, "__get__") else law


def _place_of_failure(call: Call) -> str:
    error, module = sys.exc_info()[1], sys.modules.get(type(call.effect).__module__)
    line = None if error is None else line_in(str(getattr(module, "__file__", "")), error)
    return call.place() if line is None else f"{call.place()} (line {line})"


def _read_only(value: Any) -> Any:
    """The value with arrays that cannot be written to; memory and generators as they are."""
    if isinstance(value, np.ndarray):
        view = value.view()
        view.flags.writeable = False
        return view
    if isinstance(value, Few):
        return Few(*map(_read_only, value))
    if isinstance(value, Charge | PixelArray):
        return replace(value, **{f.name: _read_only(getattr(value, f.name)) for f in fields(value)})
    return value


def _as_given(found: Any, handed: Iterable[Any], given: Iterable[Any]) -> Any:
    """Read-only arguments that a hook returns as they are become the arguments themselves again."""
    pairs = list(zip(handed, given, strict=True))

    def original(value: Any) -> Any:
        return next((ours for theirs, ours in pairs if theirs is value), value)

    return tuple(map(original, found)) if type(found) is tuple else original(found)


def _numbers(call: Call, value: Any, name: str, shape: tuple[int, ...], kind: str = "fiu") -> NDArray[Any]:
    """An array of real numbers, or of numpy's letters `kind`; each axis is as long as in `shape`, or 1."""
    array = np.asarray(value)
    if np.ma.is_masked(value):
        raise call.error(f"{name} is an array with masked values; each must be a number, and not masked")
    if array.dtype.kind not in kind:
        wanted = "true and false" if kind == "b" else "real numbers"
        raise call.error(f"{name} is {_kind(value, array)}; it must be an array of {wanted}")
    allowed = all(n in (1, whole) for n, whole in zip(array.shape, shape, strict=False))
    if array.ndim != len(shape) or not allowed:
        raise call.error(f"{name} has shape {array.shape}; it must be {shape}, or 1 along axes where all are alike")
    return array


def _kind(value: Any, array: NDArray[Any]) -> str:
    plain = array.dtype.kind in "OSUb" and not isinstance(value, np.ndarray)
    return f"a {type(value).__name__}" if plain else f"{array.dtype}"


def _within(call: Call, array: NDArray[Any], name: str, bounds: tuple[float, float]) -> NDArray[Any]:
    """The array, in float32 where it is, else in float64; raises where a value is NaN or out of range."""
    low, high = bounds
    array = array if array.dtype in (np.float32, np.float64) else array.astype(np.float64)
    if array.size and not (low <= array.min() and array.max() <= high):
        bad = tuple(int(n) for n in np.argwhere(~((array >= low) & (array <= high)))[0])
        frame = bad[0] if array.ndim == 3 and len(array) > 1 else None
        where = ", ".join(map(str, bad[1:] if array.ndim == 3 else bad))
        raise call.error(f"{name} is {array[bad]:g} at ({where}); it must be a number from {low:g} to {high:g}", frame)
    return array


def _field(call: Call, value: Any, name: str, shape: tuple[int, ...], bounds: tuple[float, float]) -> NDArray[Any]:
    return _within(call, _numbers(call, value, name, shape), name, bounds)


def _whole(call: Call, value: Any, name: str, shape: tuple[int, ...], bounds: tuple[float, float]) -> NDArray[Any]:
    """An array of exactly this shape."""
    array = _field(call, value, name, shape, bounds)
    if array.shape != shape:
        raise call.error(f"{name} has shape {array.shape}; it must be {shape}")
    return array


def _number(call: Call, value: Any, name: str, bounds: tuple[float, float]) -> float:
    number = as_number(value)
    if not bounds[0] <= number <= bounds[1]:
        raise call.error(f"{name} is {shown(value)}; it must be a number from {bounds[0]:g} to {bounds[1]:g}")
    return number


def _number_or_field(
    call: Call, value: Any, name: str, shape: tuple[int, ...], bounds: tuple[float, float] = _ANY
) -> Any:
    if np.ndim(value) == 0:
        return _number(call, value.item() if isinstance(value, np.ndarray) else value, name, bounds)
    return _field(call, value, name, shape, bounds)


def _tuple(call: Call, found: Any, names: str) -> tuple[Any, ...]:
    count = names.count(",") + 1
    if not isinstance(found, tuple) or len(found) != count:
        what = f"{len(found)} values" if isinstance(found, tuple) else f"a {type(found).__name__}"
        raise call.error(f"it returned {what}; it must return ({names})")
    return found


def _instance(call: Call, value: Any, name: str, kind: type) -> Any:
    if not isinstance(value, kind):
        raise call.error(f"{name} is a {type(value).__name__}; it must be a {kind.__name__}")
    return value


def _block(call: Call) -> tuple[int, int, int]:
    """Frames, rows and columns of the call."""
    assert call.now is not None
    return (call.now.frames, *call.now.shape)


def _charge(call: Call, value: Any, name: str) -> Charge:
    charge: Charge = _instance(call, value, name, Charge)
    if any(charge is given for given in call.given):
        return charge
    frames, rows, columns = _block(call)
    pixels = _field(call, charge.pixels, f"pixels of {name}", (frames, rows, columns), _ANY)
    if pixels.shape[1:] != (rows, columns):
        raise call.error(f"pixels of {name} have shape {pixels.shape}; they must be ({frames} or 1, {rows}, {columns})")
    return Charge(
        pixels,
        _number_or_field(call, charge.factor, f"factor of {name}", (frames, rows, 1)),
        _number_or_field(call, charge.rise, f"rise of {name}", (frames, rows, columns)),
        None if charge.few is None else _few(call, charge.few, f"few of {name}"),
        _number_or_field(call, charge.tilt, f"tilt of {name}", (frames, rows, 1)),
    )


def _few(call: Call, value: Any, name: str) -> Few:
    few: Few = _instance(call, value, name, Few)
    frames, rows, columns = _block(call)
    pixels = np.asarray(few.pixels)
    if pixels.dtype.kind not in "iu" or pixels.ndim != 1 or np.any(np.diff(pixels.astype(np.int64)) <= 0):
        raise call.error(f"{name}: pixels are {shown(pixels)}; they must be flat indices, whole and ascending")
    if pixels.size and not (pixels[0] >= 0 and pixels[-1] < rows * columns):
        raise call.error(f"{name}: pixels are {pixels[0]} to {pixels[-1]}; they must be from 0 to {rows * columns - 1}")
    charge = _whole(call, few.charge, f"{name}: charge", (frames, pixels.size), _ANY)
    return Few(pixels.astype(np.intp, copy=False), charge)


def _shift(call: Call, value: Any, factor: tuple[int, ...], millivolts: tuple[int, ...]) -> Shift:
    shift: Shift = _instance(call, value, "the shift", Shift)
    return Shift(
        _number_or_field(call, shift.factor, "factor", factor),
        _number_or_field(call, shift.millivolts, "millivolts", millivolts),
    )


def _imprint(call: Call, found: Any) -> PixelArray:
    before: PixelArray = call.given[0]
    after: PixelArray = _instance(call, found, "the value", PixelArray)
    if after.circuit is not before.circuit or after.frame_rate_hz != before.frame_rate_hz:
        raise call.error("it changed the circuit or the frame rate; leave them as they are")
    ranges = {
        "gain": UNIT_RANGES["gain"],
        "dark_current_pA": UNIT_RANGES["dark"],
        "capacitance_fF": _CAPACITANCE_FF,
        "swing_V": UNIT_RANGES["swing_V"],
    }
    values: dict[str, Any] = {
        name: _whole(call, getattr(after, name), name, before.gain.shape, bounds).astype(np.float64, copy=False)
        for name, bounds in ranges.items()
    }
    spreads = ("reset_noise_mV", "swing_spread_V", "capacitance_spread_fF")
    values |= {name: _number(call, getattr(after, name), name, _FROM_ZERO) for name in spreads}
    values["quanta"] = _number(call, after.quanta, "quanta", (0.0, UNIT_RANGES["electrons"][1]))
    if not isinstance(after.dark_is_noisy, bool | np.bool_):
        raise call.error(f"dark_is_noisy is {shown(after.dark_is_noisy)}; it must be True or False")
    return replace(after, **values)


def _image(call: Call, found: Any) -> Pictures:
    picture = call.given[0]
    most = float(np.finfo(np.float32).max)
    least = 0.0 if not picture.size or picture.min() >= 0.0 else -most  # a rise within a frame may be negative
    return np.array(_whole(call, found, "the picture", picture.shape, (least, most)), dtype=np.float32)


def _begin(call: Call, found: Any) -> Any:
    try:
        pickle.dumps(found)
    except Exception as error:
        raise call.error(
            f"the memory, a {type(found).__name__}, cannot be pickled; keep numbers, arrays, generators"
        ) from error
    return found


def _collect(call: Call, found: Any) -> tuple[Charge, Charge, Any]:
    light, dark, memory = _tuple(call, found, "light, dark, memory")
    return _charge(call, light, "light"), _charge(call, dark, "dark"), memory


def _compare(call: Call, found: Any) -> tuple[Shift, Any]:
    shift, memory = _tuple(call, found, "shift, memory")
    frames, rows, columns = _block(call)
    return _shift(call, shift, (frames, rows, 1), (frames, rows, columns)), memory


def _sway(call: Call, found: Any) -> Shift:
    moments = call.given[1].shape[1]
    shape = (*_block(call)[:2], moments)
    return _shift(call, found, shape, shape)


def _parts(call: Call, found: Any) -> int:
    parts = operator.index(found)
    if parts < 0:
        raise call.error(f"parts are {parts}; they must be a whole number, 0 or more")
    return parts


def _kinks(call: Call, found: Any) -> tuple[float, ...]:
    kinks = tuple(_number(call, phase, "a kink", (0.0, 1.0)) for phase in found)
    if 1.0 in kinks:
        raise call.error("a kink is 1; it must be a phase from 0, and below 1")
    return kinks


def _lead(call: Call, found: Any) -> Any:
    return _number_or_field(call, found, "the lead", (_block(call)[1], 1), (0.0, math.nextafter(MOST_LEAD, 0.0)))


def _off_the_line(call: Call, found: Any) -> Any:
    return _number_or_field(call, found, "the charge", _block(call)[1:], _FROM_ZERO)


def _read_out(call: Call, found: Any) -> tuple[Masks, Any]:
    spikes, memory = _tuple(call, found, "spikes, memory")
    bits = _numbers(call, spikes, "spikes", _block(call), "b")
    if bits.shape != _block(call):
        raise call.error(f"spikes have shape {bits.shape}; it must be {_block(call)}")
    return bits, memory


def _react(call: Call, found: Any) -> NDArray[Any]:
    return _whole(call, found, "the thresholds", call.given[0].shape, _ANY)


def _after_reset(call: Call, found: Any) -> NDArray[Any]:
    return _whole(call, found, "the charge", call.given[0].shape, _ANY)


def _spiked(call: Call, found: Any) -> tuple[NDArray[Any], Any]:
    charge, memory = _tuple(call, found, "charge, memory")
    return _whole(call, charge, "the charge", call.given[0].shape, _ANY), memory


def _feedback(call: Call, found: Any) -> Feedback:
    feedback: Feedback = _instance(call, found, "the value", Feedback)
    checked = Feedback(**{name: _number(call, value, name, _ANY) for name, value in feedback._asdict().items()})
    if checked.left_tau <= 0.0:
        raise call.error(f"left_tau is {checked.left_tau:g}; it must be above 0 frames")
    return checked


CHECKS: dict[str, Check] = {
    "imprint": _imprint,
    "image": _image,
    "begin": _begin,
    "collect": _collect,
    "compare": _compare,
    "parts": _parts,
    "kinks": _kinks,
    "sway": _sway,
    "lead": _lead,
    "off_the_line": _off_the_line,
    "read_out": _read_out,
    "react": _react,
    "after_reset": _after_reset,
    "spiked": _spiked,
    "feedback": _feedback,
}
"""Check of each hook's value."""

NEW_CLASS_CHECKS.append(guard)
