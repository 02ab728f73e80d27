"""Procedural textures: (size, size) float32 in [0, 1], linear, from an explicit generator.

`TEXTURES` maps a name to a function (rng, size) -> texture; `random_texture` draws one.  Those that say
"tiles" repeat without a seam.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
import scipy

from spikecam_env.compiled import njit
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.types import Floats, Pictures

Texture = Pictures


def random_texture(rng: np.random.Generator, size: int, kinds: Sequence[str] | None = None) -> Texture:
    """One texture of a kind drawn evenly from `kinds` (default: all of `TEXTURES`).

    Raises:
        InputError: size < 8 or an unknown kind.

    Example:
        >>> random_texture(np.random.default_rng(0), 64, kinds=["checker", "stripes"]).shape
        (64, 64)
    """
    if size < 8:
        raise InputError(f"texture size is {size}; it must be at least 8 pixels")
    names = tuple(TEXTURES) if kinds is None else tuple(kinds)
    for name in names:
        if name not in TEXTURES:
            raise unknown_name("texture", name, TEXTURES)
    return TEXTURES[names[rng.integers(len(names))]](rng, size)


def fractal_noise(rng: np.random.Generator, size: int) -> Texture:
    """Noise of amplitude 1 / f^p, p in [0.8, 2], as in natural images (p about 1).  Tiles.

    Example:
        >>> texture = fractal_noise(np.random.default_rng(0), 64)
        >>> texture.shape, bool(texture.min() >= 0 and texture.max() <= 1)
        ((64, 64), True)
    """
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :])
    frequency[0, 0] = np.inf
    spectrum = np.fft.rfft2(rng.standard_normal((size, size))) * frequency ** -rng.uniform(0.8, 2.0)
    return _stretch(np.fft.irfft2(spectrum, s=(size, size)))


def dead_leaves(rng: np.random.Generator, size: int) -> Texture:
    """Shaded discs that cover each other, radii drawn from r^-3: edges at every scale.

    Source: Lee, Mumford and Huang, "Occlusion models for natural images", IJCV 2001.  Tiles.

    Example:
        >>> texture = dead_leaves(np.random.default_rng(0), 64)
        >>> texture.shape, bool(texture.min() >= 0 and texture.max() <= 1)
        ((64, 64), True)
    """
    image = np.full((size, size), rng.random(), np.float32)
    smallest, largest = max(2.0, size / 100), size / 4
    radii = (smallest**-2 - rng.random(1200) * (smallest**-2 - largest**-2)) ** -0.5
    for radius in radii:
        row, column = rng.uniform(0, size, 2)
        grey = rng.random()
        down, right = rng.normal(0, 0.15, 2)
        _paint_disc(image, int(row), int(column), radius, grey, down, right)
    return _soften(image)


def stripes(rng: np.random.Generator, size: int) -> Texture:
    """Waves in one direction, from a sine to hard stripes.  Tiles.

    Example:
        >>> texture = stripes(np.random.default_rng(0), 64)
        >>> texture.shape, bool(texture.min() >= 0 and texture.max() <= 1)
        ((64, 64), True)
    """
    along, across = _wave_numbers(rng, size / 10)
    y, x = _grid(size)
    wave = np.sin(2 * np.pi * (along * x + across * y) + rng.uniform(0, 2 * np.pi))
    turned = wave.T if rng.random() < 0.5 else wave
    return _stretch(np.tanh(rng.uniform(0.5, 6.0) * turned))


def checker(rng: np.random.Generator, size: int) -> Texture:
    """Two crossed waves: a checkerboard at any angle, soft to hard.  Tiles.

    Example:
        >>> texture = checker(np.random.default_rng(0), 64)
        >>> texture.shape, bool(texture.min() >= 0 and texture.max() <= 1)
        ((64, 64), True)
    """
    along, across = _wave_numbers(rng, size / 14)
    y, x = _grid(size)
    phase = rng.uniform(0, 2 * np.pi, 2)
    first = np.sin(2 * np.pi * (along * x + across * y) + phase[0])
    second = np.sin(2 * np.pi * (along * y - across * x) + phase[1])
    return _stretch(np.tanh(rng.uniform(1.0, 8.0) * first * second))


def blobs(rng: np.random.Generator, size: int) -> Texture:
    """Smoothed noise pushed to two levels: islands of one scale.  Tiles.

    Example:
        >>> texture = blobs(np.random.default_rng(0), 64)
        >>> texture.shape, bool(texture.min() >= 0 and texture.max() <= 1)
        ((64, 64), True)
    """
    grain = rng.standard_normal((size, size))
    noise = scipy.ndimage.gaussian_filter(grain, rng.uniform(0.004, 0.03) * size, mode="wrap")
    return _stretch(np.tanh(rng.uniform(0.5, 5.0) * noise / noise.std()))


def rectangles(rng: np.random.Generator, size: int) -> Texture:
    """Upright rectangles of random grey that cover each other.  Tiles.

    Example:
        >>> texture = rectangles(np.random.default_rng(0), 64)
        >>> texture.shape, bool(texture.min() >= 0 and texture.max() <= 1)
        ((64, 64), True)
    """
    image = np.full((size, size), rng.random(), np.float32)
    for height, width in rng.integers(max(2, size // 120), max(4, size // 5), (150, 2)):
        rows = (rng.integers(size) + np.arange(height)) % size
        columns = (rng.integers(size) + np.arange(width)) % size
        image[np.ix_(rows, columns)] = rng.random()
    return _soften(image)


def gradient(rng: np.random.Generator, size: int) -> Texture:
    """Very smooth shading.  Tiles.

    Example:
        >>> texture = gradient(np.random.default_rng(0), 64)
        >>> texture.shape, bool(texture.min() >= 0 and texture.max() <= 1)
        ((64, 64), True)
    """
    noise = scipy.ndimage.gaussian_filter(rng.standard_normal((size, size)), rng.uniform(0.08, 0.2) * size, mode="wrap")
    return _stretch(noise)


def glyphs(rng: np.random.Generator, size: int) -> Texture:
    """Lines of letters and digits, dark on light or light on dark.

    Example:
        >>> texture = glyphs(np.random.default_rng(0), 64)
        >>> texture.shape, bool(texture.min() >= 0 and texture.max() <= 1)
        ((64, 64), True)
    """
    page = np.full((size, size), 255, np.uint8)
    scale = rng.uniform(0.0012, 0.004) * size
    pitch = max(6, int(26 * scale))
    for baseline in range(pitch, size + pitch, pitch):
        line = "".join(rng.choice(_ALPHABET, 2 + size // max(3, int(9 * scale))))
        cv2.putText(
            page,
            line,
            (-int(rng.integers(pitch)), baseline),
            int(rng.choice(_FONTS)),
            0.7 * scale,
            0,
            max(1, round(1.4 * scale)),
            cv2.LINE_AA,
        )
    image = (page / 255).astype(np.float32)
    return 1 - image if rng.random() < 0.5 else image


TEXTURES: dict[str, Callable[[np.random.Generator, int], Texture]] = {
    "fractal_noise": fractal_noise,
    "dead_leaves": dead_leaves,
    "stripes": stripes,
    "checker": checker,
    "blobs": blobs,
    "rectangles": rectangles,
    "gradient": gradient,
    "glyphs": glyphs,
}
"""Kinds of textures by name: (rng, size) -> (size, size) in [0, 1], periodic."""

_ALPHABET = tuple("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789&%?!  ")
_FONTS = (
    cv2.FONT_HERSHEY_SIMPLEX,
    cv2.FONT_HERSHEY_DUPLEX,
    cv2.FONT_HERSHEY_COMPLEX,
    cv2.FONT_HERSHEY_TRIPLEX,
)


def _wave_numbers(rng: np.random.Generator, highest: float) -> tuple[int, int]:
    """Whole waves along two axes: log-uniform from 2 to `highest`, tilted up to 45 degrees."""
    along = max(1, round(2.0 * (max(highest, 2.0) / 2.0) ** rng.random()))
    return along, int(rng.integers(-along, along + 1))


def _grid(size: int) -> tuple[Floats, Floats]:
    """(y, x) as (size, 1) and (1, size) in [0, 1)."""
    axis = np.arange(size) / size
    return axis[:, None], axis[None, :]


def _soften(image: Texture) -> Texture:
    """A blur of 0.6 texels across hard edges."""
    return np.asarray(scipy.ndimage.gaussian_filter(image, 0.6, mode="wrap").clip(0, 1).astype(np.float32, copy=False))


def _stretch(image: Floats) -> Texture:
    """To the full range [0, 1]."""
    low, high = image.min(), image.max()
    return np.asarray(((image - low) / max(high - low, 1e-12)).astype(np.float32))


@njit(cache=True, nogil=True, error_model="numpy")
def _paint_disc(image: Texture, row: int, column: int, radius: float, grey: float, down: float, right: float) -> None:
    """A disc over the image, wrapped at the borders; its shade rises by `down` and `right` from middle to edge."""
    size, reach = len(image), int(np.ceil(radius))
    for dy in range(-reach, reach + 1):
        line = image[(row + dy) % size]
        for dx in range(-reach, reach + 1):
            if dy**2 + dx**2 <= radius**2:
                line[(column + dx) % size] = min(max(grey + (down * dy + right * dx) / radius, 0.0), 1.0)
