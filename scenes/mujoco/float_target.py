"""MuJoCo's off-screen picture in floats: no steps of 1/255, and light above white is kept.

`mjr_render` draws into a buffer of 8 bits a colour.  Its memory is replaced by 32-bit floats of the same size; the
buffer stays MuJoCo's, which draws into it as before.  Numbers are those of the header `GL/gl.h`.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np

from scenes.mujoco.importing import import_mujoco
from spikecam_env.types import Pictures

_FRAMEBUFFER, _RENDERBUFFER = 0x8D40, 0x8D41
_RGBA32F = 0x8814
_COMPLETE = 0x8CD5
_RGB, _FLOAT = 0x1907, 0x1406


class FloatTarget:
    """Where a MuJoCo context draws floats.  The OpenGL context must be current in every call.

    Args:
        context: mujoco.MjrContext.
        function: address of a function of OpenGL by its name.
        rows: of the picture.
        columns: of the picture.

    Raises:
        RuntimeError: this OpenGL does not draw floats.
    """

    def __init__(self, context: Any, function: Callable[[str], int | None], rows: int, columns: int) -> None:
        mujoco = import_mujoco()
        self._context, self._shape = context, (rows, columns)
        context.offSamples = 0  # every sample is a pixel of its own, so that textures and edges are averaged alike
        for width in (columns + 1, columns):  # the size that it has already would be left as it is, with its samples
            mujoco.mjr_resizeOffscreen(width, rows, context)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
        self._read = ctypes.CFUNCTYPE(None, *(ctypes.c_int,) * 6, ctypes.c_void_p)(_address(function, "glReadPixels"))
        _function(function, "glBindRenderbuffer", 2)(_RENDERBUFFER, context.offColor)
        _function(function, "glRenderbufferStorage", 4)(_RENDERBUFFER, _RGBA32F, columns, rows)
        self._bind = _function(function, "glBindFramebuffer", 2)
        self._bind(_FRAMEBUFFER, context.offFBO)
        state = _function(function, "glCheckFramebufferStatus", 1, ctypes.c_int)(_FRAMEBUFFER)
        if state != _COMPLETE:
            raise RuntimeError(f"this OpenGL does not draw {columns} x {rows} floats (state {state:#x})")

    def colours(self) -> Pictures:
        """(rows, columns, 3) float32 of the picture drawn last, from the top."""
        values = np.empty((*self._shape, 3), np.float32)
        self._bind(_FRAMEBUFFER, self._context.offFBO)
        self._read(0, 0, self._shape[1], self._shape[0], _RGB, _FLOAT, values.ctypes.data)
        return values[::-1]


def _function(function: Callable[[str], int | None], name: str, count: int, result: Any = None) -> Any:
    """A function of OpenGL that takes so many whole numbers."""
    return ctypes.CFUNCTYPE(result, *(ctypes.c_int,) * count)(_address(function, name))


def _address(function: Callable[[str], int | None], name: str) -> int:
    address = function(name)
    if not address:
        raise RuntimeError(f"this OpenGL has no {name}")
    return address
