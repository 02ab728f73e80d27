"""OpenGL without a screen: a context on a graphics card (EGL), on the processor (EGL or OSMesa).

A context is made once, made current before each use, and ended alone: pyrender ends the whole display with it, and
with the display every other context of the process.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from scenes.renderers.pyrender_import import import_pyrender
from spikecam_env.forked import may_be_forked

_PACKAGES = "install the system packages libegl1 and libgl1 (Debian, Ubuntu: apt-get install -y libegl1 libgl1)"

FIX = {
    "egl-hardware": f"{_PACKAGES} and the graphics card's driver",
    "egl-software": _PACKAGES,
    "osmesa": "install the system package libosmesa6 (Debian, Ubuntu: apt-get install -y libosmesa6)",
    "embree": "pip install embreex (x86-64, or macOS)",
}
"""Remedies for a back-end that does not work."""

_LIBRARIES = ("libEGL.so.1", "libOSMesa.so.8", "libOSMesa.so.6")
_started_in: int | None = None

EGL_EXTENSIONS = 0x3055
SOFTWARE = b"EGL_MESA_device_software"


@dataclass(frozen=True)
class Context:
    """A place to draw: `make_current()` before OpenGL calls, `end()` once."""

    make_current: Callable[[], None]
    end: Callable[[], None]


def can_start() -> bool:
    """Whether OpenGL can start in this process, or has: not in a fork of a process that has used it.

    There displays and threads are copied half, and the first call hangs.
    """
    if _started_in is not None:
        return _started_in == os.getpid()
    return not (may_be_forked() and any(map(_is_loaded, _LIBRARIES)))


def egl(software: bool) -> Context:
    """A context on the first graphics card, or on the processor, that serves OpenGL 4.1.

    Raises:
        RuntimeError: no device of this kind serves; errors of the libraries pass through.
    """
    _load("libEGL.so.1", "libEGL.so")
    import_pyrender("egl")
    from OpenGL.EGL import eglDestroyContext
    from pyrender.platforms import egl as platform

    failures = []
    for device in platform.query_devices():
        extensions = platform._eglQueryDeviceStringEXT(device._display, EGL_EXTENSIONS) or b""
        if (SOFTWARE in extensions.split()) is not software:
            continue
        made = platform.EGLPlatform(1, 1, device=device)
        try:
            made.init_context()
        except Exception as failure:
            failures.append(f"{device.name or 'a device'}: {type(failure).__name__} {failure}".strip())
            continue
        return Context(made.make_current, partial(eglDestroyContext, made._egl_display, made._egl_context))
    kind = "software device" if software else "graphics card"
    raise RuntimeError(f"EGL has no {kind} with OpenGL 4.1 ({'; '.join(failures) or 'none found'})")


def osmesa() -> Context:
    """A context in Mesa's off-screen library: OpenGL 3.3 on the processor.

    The library is called directly: PyOpenGL 3.1.0, which pyrender asks for, lacks OSMesaCreateContextAttribs.

    Raises:
        RuntimeError: the library is missing, or makes no context.
    """
    library = _load("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so")
    import_pyrender("osmesa")
    from OpenGL.platform import PLATFORM

    PLATFORM.GetCurrentContext.restype = ctypes.c_void_p  # PyOpenGL 3.1.0 looks contexts up, and its own have no hash
    library.OSMesaCreateContextAttribs.restype = ctypes.c_void_p
    attributes = (ctypes.c_int * 11)(
        *(0x22, 0x1908),  # OSMESA_FORMAT: RGBA
        *(0x30, 24),  # OSMESA_DEPTH_BITS
        *(0x33, 0x34),  # OSMESA_PROFILE: core
        *(0x36, 3, 0x37, 3),  # OSMESA_CONTEXT_MAJOR_VERSION, _MINOR_VERSION
        0,
    )
    handle = ctypes.c_void_p(library.OSMesaCreateContextAttribs(attributes, None))
    if not handle:
        raise RuntimeError("OSMesa makes no OpenGL 3.3 context")
    unused = np.zeros((1, 1, 4), np.uint8)

    def make_current() -> None:
        if not library.OSMesaMakeCurrent(handle, unused.ctypes.data_as(ctypes.c_void_p), 0x1401, 1, 1):
            raise RuntimeError("OSMesa lost its context")

    make_current()
    return Context(make_current, lambda: library.OSMesaDestroyContext(handle))


def _is_loaded(library: str) -> bool:
    try:
        ctypes.CDLL(library, mode=os.RTLD_NOLOAD)
    except OSError:
        return False
    return True


def _load(*names: str) -> ctypes.CDLL:
    global _started_in
    _started_in = os.getpid()
    for name in names:
        try:
            return ctypes.CDLL(name, mode=ctypes.RTLD_GLOBAL)
        except OSError:
            continue
    raise RuntimeError(f"{names[0]} is not on this machine")
