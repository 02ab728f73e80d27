"""Transfer: from the values that a picture stores to linear light, and from colour to one grey.

light = TRANSFERS[name](value)          value: 0..1 of full scale

srgb       IEC 61966-2-1                                     1 is white
bt709      inverse of the camera's curve, ITU-R BT.709-6 (BT.601 and BT.2020 have the same)
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

BT709 = 1
"""Number of these primaries in H.273."""
LUMINANCE = {
    BT709: (0.2126, 0.7152, 0.0722),
    5: (0.2220, 0.7066, 0.0713),
    **dict.fromkeys((6, 7), (0.2124, 0.7011, 0.0866)),
    9: (0.2627, 0.6780, 0.0593),
    12: (0.2290, 0.6917, 0.0793),
}
"""Shares of linear red, green and blue in luminance, by the primaries' number in H.273; others are taken as BT.709's.
Source: the second row of each one's matrix to CIE XYZ; ITU-R BT.709, BT.470 (B, G), SMPTE 170M, ITU-R BT.2020, SMPTE EG
432-1 (P3, D65)."""


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


TRANSFERS: dict[str, Callable[[Pictures], Pictures]] = {
    "srgb": linear_from_srgb,
    "bt709": _from_bt709,
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
        InputError: the transfer is unknown.  Values are negative, not finite, or above 1 where it has no light for
            them.  The message begins with `where`.
    """
    try:
        law = curve(transfer)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    low, high = values.min(), values.max()
    most = np.inf if transfer == "linear" else 1.0
    if not (low >= 0 and high <= most and np.isfinite(high)):
        raise InputError(
            f"{where}: its values run from {low:g} to {high:g}; floats must lie in [0, 1], or be linear light, "
            'not negative and finite (transfer="linear")'
        )
    return law(values)


def grey(light: Pictures, channel: str = "luminance", primaries: int = BT709) -> Pictures:
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
        return light @ np.asarray(LUMINANCE.get(primaries, LUMINANCE[BT709]), np.float32)
    return np.ascontiguousarray(light[..., CHANNELS.index(channel) - 1])
