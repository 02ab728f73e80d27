"""OpenGL without a screen: a context on a graphics card (EGL), on the processor (EGL or OSMesa).

A context is made once, made current before each use, and ended alone: pyrender ends the whole display with it, and
with the display every other context of the process.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scenes.renderers.egl import COMPATIBLE, CORE, EglContext, devices
from scenes.renderers.pyrender_import import import_pyrender
from spikecam_env.errors import NotReadyError
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
_started: tuple[str, ...] | None = None
"""Names of the library that draws in this process."""

PROFILES = ("core", "compatible")
"""Of OpenGL: core for pyrender, compatible (with its fixed functions) for MuJoCo."""


@dataclass(frozen=True)
class Context:
    """A place to draw: `make_current()` before OpenGL calls, `release()` after them where several threads use it,
    `end()` once."""

    make_current: Callable[[], None]
    release: Callable[[], None]
    end: Callable[[], None]
    function: Callable[[str], int | None]
    """Address of a function of OpenGL by its name."""


def start(kind: str, profile: str = "core") -> Context:
    """A context of this kind, "egl-hardware", "egl-software" or "osmesa"; it is this thread's.

    Args:
        kind: of back-end; one process serves EGL or OSMesa, not both.
        profile: of `PROFILES`.
    """
    return osmesa(profile) if kind == "osmesa" else egl(kind == "egl-software", profile)


def can_start() -> bool:
    """Whether OpenGL can start in this process, or has: not in a fork of a process that has used it.

    There displays and threads are copied half, and the first call hangs.
    """
    if _started_in is not None:
        return _started_in == os.getpid()
    return not (may_be_forked() and any(map(_is_loaded, _LIBRARIES)))


def egl(software: bool, profile: str = "core") -> Context:
    """A context on the first graphics card, or on the processor, that serves it.

    Raises:
        RuntimeError: no device of this kind serves; errors of the libraries pass through.
    """
    library = _load("libEGL.so.1", "libEGL.so")
    if profile == "core":
        import_pyrender("egl")
    failures = []
    for device in devices(library, software):
        try:
            made = EglContext.on(library, device, CORE if profile == "core" else COMPATIBLE)
            made.make_current()
        except RuntimeError as failure:
            failures.append(str(failure))
            continue
        return Context(made.make_current, made.release, made.end, made.function)
    kind = "software device" if software else "graphics card"
    raise RuntimeError(f"EGL has no {kind} that draws ({'; '.join(failures) or 'none found'})")


def osmesa(profile: str = "core") -> Context:
    """A context in Mesa's off-screen library, on the processor: OpenGL 3.3, or the newest with the fixed functions.

    The library is called directly: PyOpenGL 3.1.0, which pyrender asks for, lacks OSMesaCreateContextAttribs.

    Raises:
        RuntimeError: the library is missing, or makes no context.
    """
    library = _load("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so")
    if profile == "core":
        import_pyrender("osmesa")
        from OpenGL.platform import PLATFORM

        PLATFORM.GetCurrentContext.restype = ctypes.c_void_p  # PyOpenGL 3.1.0's own contexts have no hash
    library.OSMesaCreateContextAttribs.restype = ctypes.c_void_p
    library.OSMesaGetProcAddress.restype = ctypes.c_void_p
    version = (0x33, 0x34, 0x36, 3, 0x37, 3)  # OSMESA_PROFILE: core, OSMESA_CONTEXT_MAJOR_VERSION, _MINOR_VERSION
    attributes = (
        *(0x22, 0x1908),  # OSMESA_FORMAT: RGBA
        *(0x30, 24),  # OSMESA_DEPTH_BITS
        *(version if profile == "core" else (0x33, 0x35)),  # OSMESA_PROFILE: compatible
        0,
    )
    handle = ctypes.c_void_p(library.OSMesaCreateContextAttribs((ctypes.c_int * len(attributes))(*attributes), None))
    if not handle:
        raise RuntimeError("OSMesa makes no OpenGL 3.3 context")
    unused = np.zeros((1, 1, 4), np.uint8)

    def make_current() -> None:
        if not library.OSMesaMakeCurrent(handle, unused.ctypes.data_as(ctypes.c_void_p), 0x1401, 1, 1):
            raise RuntimeError("OSMesa lost its context")

    make_current()
    return Context(
        make_current,
        release=lambda: library.OSMesaMakeCurrent(None, None, 0, 0, 0),
        end=lambda: library.OSMesaDestroyContext(handle),
        function=lambda name: library.OSMesaGetProcAddress(name.encode()),
    )


def _is_loaded(library: str) -> bool:
    try:
        ctypes.CDLL(library, mode=os.RTLD_NOLOAD)
    except OSError:
        return False
    return True


def _load(*names: str) -> ctypes.CDLL:
    global _started_in, _started
    if _started not in (None, names):
        raise NotReadyError(
            f"OpenGL is loaded from {(_started or names)[0]} and cannot change to {names[0]}; "
            f"start a new process for {names[0]}"
        )
    _started_in, _started = os.getpid(), names
    for name in names:
        try:
            return ctypes.CDLL(name, mode=ctypes.RTLD_GLOBAL)
        except OSError:
            continue
    _started = None
    raise RuntimeError(f"{names[0]} is not on this machine")
