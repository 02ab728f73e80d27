"""EGL by ctypes: OpenGL contexts without a screen, in the core profile (pyrender's) or the compatible one (MuJoCo's).

PyOpenGL is not used: 3.1.0, which pyrender asks for, has no devices (EGLDeviceEXT), and pyrender's own EGL makes core
contexts alone.  Numbers are those of the headers `EGL/egl.h` and `EGL/eglext.h`.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

CORE = (0x3098, 4, 0x30FB, 1, 0x30FD, 0x0001, 0x3038)
"""Attributes of a context: EGL_CONTEXT_MAJOR_VERSION, _MINOR_VERSION, _OPENGL_PROFILE_MASK (core), EGL_NONE."""
COMPATIBLE = (0x3038,)
"""No attributes: the driver's newest version that still has the fixed functions."""

_CONFIGURATION = (
    *(0x3033, 0x0001),  # EGL_SURFACE_TYPE: EGL_PBUFFER_BIT
    *(0x3022, 8, 0x3023, 8, 0x3024, 8),  # EGL_BLUE_SIZE, _GREEN_SIZE, _RED_SIZE
    *(0x3025, 24),  # EGL_DEPTH_SIZE
    *(0x303F, 0x308E),  # EGL_COLOR_BUFFER_TYPE: EGL_RGB_BUFFER
    *(0x3040, 0x0008),  # EGL_RENDERABLE_TYPE: EGL_OPENGL_BIT
    *(0x3042, 0x0008),  # EGL_CONFORMANT: EGL_OPENGL_BIT
    0x3038,  # EGL_NONE
)
_OPENGL_API = 0x30A2
_PLATFORM_DEVICE = 0x313F
_EXTENSIONS = 0x3055
_SOFTWARE = b"EGL_MESA_device_software"
_MOST_DEVICES = 64

_LOST = (0x3001, 0x3006, 0x3008, 0x300E)
"""EGL_NOT_INITIALIZED, _BAD_CONTEXT, _BAD_DISPLAY, _CONTEXT_LOST: errors of a context that worked before."""

_Pointer = ctypes.c_void_p


class LostContextError(RuntimeError):
    """The context has ended: another library ended the display, which a process has once, or the driver stopped.

    SDL ends it as pygame closes a window that it drew off screen, pyrender with each of its renderers.

    Example:
        >>> issubclass(LostContextError, RuntimeError)
        True
    """


@dataclass(frozen=True)
class EglContext:
    """A context on one device.

    Example:
        >>> import ctypes
        >>> library = ctypes.CDLL("libEGL.so.1")  # doctest: +SKIP
        >>> EglContext.on(library, next(devices(library, software=True)), COMPATIBLE).make_current()  # doctest: +SKIP
    """

    library: ctypes.CDLL
    display: Any
    handle: Any

    @classmethod
    def on(cls, library: ctypes.CDLL, device: Any, attributes: tuple[int, ...]) -> EglContext:
        """A context on a device, not yet current.

        Raises:
            RuntimeError: the device does not serve such a context.
        """
        display = _Pointer(_extension(library, "eglGetPlatformDisplayEXT")(_PLATFORM_DEVICE, device, None))
        if not display or not library.eglInitialize(display, None, None):
            raise RuntimeError("its display does not start")
        configuration, count = _Pointer(), ctypes.c_int()
        wanted = _ints(_CONFIGURATION)
        if not (
            library.eglChooseConfig(display, wanted, ctypes.byref(configuration), 1, ctypes.byref(count))
            and count.value
        ):
            raise RuntimeError("it has no off-screen colours with depth")
        library.eglBindAPI(_OPENGL_API)
        library.eglCreateContext.restype = _Pointer
        handle = _Pointer(library.eglCreateContext(display, configuration, None, _ints(attributes)))
        if not handle:
            raise RuntimeError(f"it makes no context (EGL error {library.eglGetError():#x})")
        return cls(library, display, handle)

    def make_current(self) -> None:
        """Make it this thread's.

        Raises:
            LostContextError: it has ended; start another.
            RuntimeError: another thread has it.
        """
        self.library.eglBindAPI(_OPENGL_API)  # which every thread begins without
        if not self.library.eglMakeCurrent(self.display, None, None, self.handle):
            error = self.library.eglGetError()
            if error in _LOST:
                raise LostContextError(f"EGL has ended the context (error {error:#x})")
            raise RuntimeError(f"EGL does not give the context to this thread (error {error:#x})")

    def release(self) -> None:
        """Leave it to other threads."""
        self.library.eglBindAPI(_OPENGL_API)
        self.library.eglMakeCurrent(self.display, None, None, None)

    def end(self) -> None:
        """Destroy it; the display stays, for it may be another context's too."""
        self.library.eglDestroyContext(self.display, self.handle)

    def function(self, name: str) -> int | None:
        """Address of a function of OpenGL; None where there is none."""
        return _address(self.library, name)


def devices(library: ctypes.CDLL, software: bool) -> Iterator[Any]:
    """Devices that draw on the processor, or those that do not.

    Raises:
        RuntimeError: this EGL does not list devices.
    """
    found, count = (_Pointer * _MOST_DEVICES)(), ctypes.c_int()
    if not _extension(library, "eglQueryDevicesEXT")(_MOST_DEVICES, found, ctypes.byref(count)):
        raise RuntimeError("EGL lists no devices")
    extensions_of = _extension(library, "eglQueryDeviceStringEXT", ctypes.c_char_p)
    for device in map(_Pointer, found[: count.value]):
        if (_SOFTWARE in (extensions_of(device, _EXTENSIONS) or b"").split()) is software:
            yield device


def _extension(library: ctypes.CDLL, name: str, result: Any = _Pointer) -> Any:
    address = _address(library, name)
    if not address:
        raise RuntimeError(f"EGL has no {name}")
    return ctypes.CFUNCTYPE(result)(address)


def _address(library: ctypes.CDLL, name: str) -> int | None:
    library.eglGetProcAddress.restype = _Pointer
    address: int | None = library.eglGetProcAddress(name.encode())
    return address


def _ints(values: tuple[int, ...]) -> Any:
    return (ctypes.c_int * len(values))(*values)
