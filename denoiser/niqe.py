"""NIQE, the naturalness of a picture without a reference: lower is better.

Mittal, Soundararajan and Bovik, "Making a completely blind image quality analyzer", IEEE SPL 2013, by scikit-video,
whose model of natural pictures comes with it.  scikit-video 1.1.11 is older than numpy 1.24 and scipy 1.3: the names it
misses are lent to it while it is imported and called.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError

SMALLEST = 194
"""Least rows and columns: two patches of 96 pixels a side."""


def niqe(picture: NDArray[np.floating]) -> float:
    """(H, W) picture in [0, 1] -> NIQE of its 8-bit grey levels.

    Errors: InputError for a picture that is not (H, W), is smaller than 194 x 194, or without scikit-video.
    """
    grey = np.asarray(picture)
    if grey.ndim != 2 or min(grey.shape) < SMALLEST:
        raise InputError(f"picture has shape {grey.shape}; NIQE needs (H, W), at least {SMALLEST} x {SMALLEST}")
    with _names_of_old():
        measure = _scikit_video()
        return float(np.ravel(measure.niqe(np.clip(grey * 255, 0, 255).astype(np.float32)))[0])


def niqe_or_none(picture: NDArray[np.floating]) -> float | None:
    """`niqe`, or None where it cannot be had: without scikit-video, or for a small picture."""
    try:
        return niqe(picture)
    except InputError:
        return None


def _scikit_video() -> Any:
    try:
        import skvideo.measure
    except ImportError as error:
        raise InputError("NIQE needs scikit-video: pip install 'spikecam-env[dev]'") from error
    return skvideo.measure


@contextmanager
def _names_of_old() -> Iterator[None]:
    """np.float, np.int, np.bool, np.object and scipy.misc.imresize, for as long as scikit-video runs."""
    import scipy

    misc = ModuleType("scipy.misc")
    misc.imresize = _imresize  # type: ignore[attr-defined]
    names = {"float": float, "int": int, "bool": bool, "object": object}
    lent = [name for name in names if name not in vars(np)]
    before = sys.modules.get("scipy.misc"), vars(scipy).get("misc")
    sys.modules["scipy.misc"] = misc
    setattr(scipy, "misc", misc)  # noqa: B010
    for name in lent:
        setattr(np, name, names[name])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        for name in lent:
            delattr(np, name)
        _put_back(scipy, *before)


def _put_back(scipy: Any, module: ModuleType | None, attribute: Any) -> None:
    for holder, name, value in ((sys.modules, "scipy.misc", module), (vars(scipy), "misc", attribute)):
        if value is None:
            holder.pop(name, None)
        else:
            holder[name] = value


def _imresize(picture: NDArray, size: float, interp: str = "bicubic", mode: str | None = None) -> NDArray[np.float32]:
    """What scipy.misc.imresize did for floats: Pillow's antialiased bicubic."""
    from PIL import Image

    rows, columns = (max(1, int(n * size)) for n in picture.shape)
    image = Image.fromarray(np.asarray(picture, np.float32))
    return np.asarray(image.resize((columns, rows), Image.Resampling.BICUBIC))
