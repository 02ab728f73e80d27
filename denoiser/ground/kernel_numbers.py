"""Numbers in compiled code: those of networks, float32 or bfloat16, and fast elementary functions of float32.

A bfloat16 is the upper half of a float32.  numba has no type for it: arrays hold it as uint16.  The functions are
polynomials without branches, so that loops over them become vector instructions; they give the same bits wherever
a number lies in memory, which torch's own functions do not.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from numba import types
from numpy.typing import NDArray
from torch import Tensor

from spikecam_env.compiled import njit
from spikecam_env.sensor.ground.intrinsics import instruction

_LOG2_E, _LN_2 = np.float32(1 / math.log(2)), np.float32(math.log(2))
_SERIES = tuple(np.float32(math.log(2) ** n / math.factorial(n)) for n in range(7))
"""Of 2 ^ r."""
_TO_WHOLE = np.float32(1.5 * 2**23)
"""A float32 of this size has no fraction: adding it rounds, and the lowest bits hold the whole number."""


def as_array(tensor: Tensor) -> NDArray[Any]:
    """The memory of a tensor on the processor for compiled code: float32, or uint16 for bfloat16."""
    return (tensor.view(torch.uint16) if tensor.dtype == torch.bfloat16 else tensor).numpy()


@instruction
def to_float32(typing_context: Any, number: Any) -> Any:
    """A network's number (float32, or uint16 for bfloat16) as float32."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if signature.args[0] == types.float32:
            return arguments[0]
        word = context.get_value_type(types.uint32)
        upper = builder.shl(builder.zext(arguments[0], word), word(16))
        return builder.bitcast(upper, context.get_value_type(types.float32))

    return types.float32(number), build


@instruction
def like_number(typing_context: Any, value: Any, like: Any) -> Any:
    """A float32 as a network's number of the type of `like`, rounded to nearest, ties to even (no NaN)."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if signature.args[1] == types.float32:
            return arguments[0]
        word = context.get_value_type(types.uint32)
        bits = builder.bitcast(arguments[0], word)
        last = builder.and_(builder.lshr(bits, word(16)), word(1))
        rounded = builder.lshr(builder.add(builder.add(bits, word(0x7FFF)), last), word(16))
        return builder.trunc(rounded, context.get_value_type(types.uint16))

    return like(types.float32, like), build


@instruction
def _scaled(typing_context: Any, value: Any, exponent: Any) -> Any:
    """value 2 ^ n of a float32, where `exponent` is n + _TO_WHOLE."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word, number = (context.get_value_type(kind) for kind in (types.uint32, types.float32))
        bits, whole = (builder.bitcast(argument, word) for argument in arguments)
        return builder.bitcast(builder.add(bits, builder.shl(whole, word(23))), number)

    return types.float32(types.float32, types.float32), build


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def exponential(x: np.float32) -> Any:
    """exp(x) of a float32 between -87 and 87, its values beyond; relative error below 3e-7.

    exp(x) = 2 ^ n 2 ^ r with n whole and |r| <= 1/2, and the series of 2 ^ r.
    """
    power = min(max(x * _LOG2_E, np.float32(-125.0)), np.float32(125.0))
    whole = power + _TO_WHOLE
    r = power - (whole - _TO_WHOLE)
    series = _SERIES[6]
    for n in range(5, -1, -1):
        series = series * r + _SERIES[n]
    return _scaled(series, whole)


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def hyperbolic_tangent(x: np.float32) -> Any:
    """tanh(x) of a float32; error below 3e-7."""
    one, two = np.float32(1.0), np.float32(2.0)
    return one - two / (exponential(two * x) + one)
