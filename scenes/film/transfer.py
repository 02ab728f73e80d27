"""Transfer: from the values that a picture stores to linear light, and from colour to one grey.

light = TRANSFERS[name](value)          value: 0..1 of full scale

srgb       IEC 61966-2-1                                     1 is white
bt709      inverse of the camera's curve, ITU-R BT.709-6 (BT.601 and BT.2020 have the same)
pq         ITU-R BT.2100, SMPTE ST 2084, light of the screen; 1 is 10 000 cd/m2
hlg        inverse of the camera's curve, ITU-R BT.2100; 1 is the brightest light of the scene
linear     as it is
gamma2.2   a power law; any positive number serves, `gamma1.8`
"""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from spikecam_env.errors import InputError, unknown_name
from spikecam_env.types import Pictures

CHANNELS = ("luminance", "red", "green", "blue")

LUMINANCE: dict[str, tuple[float, float, float]] = {
    "bt709": (0.2126, 0.7152, 0.0722),
    "bt470bg": (0.2220, 0.7066, 0.0713),
    "smpte170m": (0.2124, 0.7011, 0.0866),
    "smpte432": (0.2290, 0.6917, 0.0793),
    "bt2020": (0.2627, 0.6780, 0.0593),
}
"""Shares of linear red, green and blue in luminance, by the primaries.  Source: the second row of each one's matrix to
CIE XYZ; ITU-R BT.709, BT.470, SMPTE 170M, SMPTE EG 432-1 (P3, D65), ITU-R BT.2020."""


def linear_from_srgb(encoded: ArrayLike) -> Pictures:
    """sRGB values in [0, 1] to linear light (IEC 61966-2-1).

    Example:
        >>> [round(float(light), 3) for light in linear([0.0, 0.5, 1.0])]
        [0.0, 0.214, 1.0]
    """
    code = np.asarray(encoded, np.float32)
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4).astype(np.float32)


def _from_bt709(value: Pictures) -> Pictures:
    return np.where(value < 0.081, value / 4.5, ((value + 0.099) / 1.099) ** (1 / 0.45)).astype(np.float32)


def _from_pq(value: Pictures) -> Pictures:
    """Constants: SMPTE ST 2084.  In float64: it takes a small difference to the power 6.3."""
    m1, m2 = 2610 / 16384, 128 * 2523 / 4096
    c1, c2, c3 = 3424 / 4096, 32 * 2413 / 4096, 32 * 2392 / 4096
    root = value.astype(np.float64) ** (1 / m2)
    return ((np.maximum(root - c1, 0) / (c2 - c3 * root)) ** (1 / m1)).astype(np.float32)


def _from_hlg(value: Pictures) -> Pictures:
    """Constants: ITU-R BT.2100-2, table 5."""
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    return np.where(value <= 0.5, value**2 / 3, (np.exp((value - c) / a) + b) / 12).astype(np.float32)


TRANSFERS: dict[str, Callable[[Pictures], Pictures]] = {
    "srgb": linear_from_srgb,
    "bt709": _from_bt709,
    "pq": _from_pq,
    "hlg": _from_hlg,
    "linear": lambda value: value,
}


def curve(transfer: str) -> Callable[[Pictures], Pictures]:
    """The function of a transfer, float32 in [0, 1] to linear light.

    Raises:
        InputError: the name is unknown.
    """
    if transfer in TRANSFERS:
        return TRANSFERS[transfer]
    power = re.fullmatch(r"gamma(\d+(?:\.\d+)?)", transfer)
    if not power or not 0.1 <= float(power[1]) <= 10:
        raise unknown_name("transfer", transfer, [*TRANSFERS, "gamma2.2"])
    gamma = np.float32(power[1])
    return lambda value: np.asarray(value**gamma, np.float32)


def light_of(values: Pictures, transfer: str, where: str) -> Pictures:
    """Linear light of stored values; those of `linear` may lie above 1.

    Raises:
        InputError: values are negative, not finite, or above 1 where the transfer has no light for them.  The message
            begins with `where`.
    """
    low, high = values.min(), values.max()
    most = np.inf if transfer == "linear" else 1.0
    if not (low >= 0 and high <= most and np.isfinite(high)):
        raise InputError(
            f"{where}: its values run from {low:g} to {high:g}; floats must lie in [0, 1], or be linear light, "
            'not negative and finite (transfer="linear")'
        )
    return curve(transfer)(values)


def grey(light: Pictures, channel: str = "luminance", primaries: str = "bt709") -> Pictures:
    """(h, w) of linear light (h, w) or (h, w, 3: red, green, blue): luminance, or one channel.

    Raises:
        InputError: the channel is unknown, or the picture has no colour.
    """
    if channel not in CHANNELS:
        raise unknown_name("channel", channel, CHANNELS)
    if light.ndim == 2:
        if channel != "luminance":
            raise InputError(f"channel is {channel!r}, and the pictures are grey; leave it away")
        return light
    if channel == "luminance":
        return light @ np.asarray(LUMINANCE[primaries], np.float32)
    return np.ascontiguousarray(light[..., CHANNELS.index(channel) - 1])
