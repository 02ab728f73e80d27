"""Digits as textures: dark on a bright disc, over a bar, which tells a 6 from a 9 that stands on its head.

A digit's font, stroke, width and slant follow from the number of the texture.
"""

from __future__ import annotations

import cv2
import numpy as np

from scenes.textures import Texture

DIGITS = tuple("0123456789")
FONTS = (cv2.FONT_HERSHEY_SIMPLEX, cv2.FONT_HERSHEY_DUPLEX, cv2.FONT_HERSHEY_COMPLEX, cv2.FONT_HERSHEY_TRIPLEX)
HEIGHT = 0.5
"""Of a digit [diameters of the disc]: with its bar it just fits in."""
STROKE = (0.12, 0.2)
"""Thinnest and thickest [digit's heights]: two pixels at least, on a disc of a quarter of a side of 64 pixels."""
WIDTH = (0.8, 1.2)
"""Narrowest and widest, over the font's own."""
SLANT = 0.25
"""Most that a digit leans either way [shift over height]; an italic font has 0.2 to 0.3."""


def digit(name: str, size: int, rng: np.random.Generator, *, bar: bool = True) -> Texture:
    """(size, size) of a digit, or of a letter.

    Args:
        name: one of DIGITS, or a capital.
        size: side of the picture [pixels].
        rng: draws font, stroke, width and slant.
        bar: whether a bar is below; without, the digit is in the middle.

    Example:
        >>> digit("7", 32, np.random.default_rng(0), bar=False).shape
        (32, 32)
    """
    fine = 4 * size
    font, stroke = int(rng.choice(FONTS)), round(rng.uniform(*STROKE) * HEIGHT * fine)
    width, slant = rng.uniform(*WIDTH), rng.uniform(-SLANT, SLANT)
    (_, unit), _ = cv2.getTextSize(name, font, 1.0, 1)
    scale = HEIGHT * fine / unit
    (across, down), _ = cv2.getTextSize(name, font, scale, 1)
    picture = np.ones((fine, fine), np.float32)
    left, bottom = (fine - across) // 2, (fine + down - 2 * stroke * bar) // 2
    cv2.putText(picture, name, (left, bottom), font, scale, 0.0, stroke, cv2.LINE_AA)
    if bar:
        under = bottom + 2 * stroke
        cv2.line(picture, (fine // 3, under), (2 * fine // 3, under), 0.0, stroke, cv2.LINE_AA)
    middle = fine / 2
    lean = np.array([[width, -slant, middle * (1 - width + slant)], [0.0, 1.0, 0.0]])
    leant = cv2.warpAffine(picture, lean, (fine, fine), borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(cv2.resize(leant, (size, size), interpolation=cv2.INTER_AREA), np.float32)
