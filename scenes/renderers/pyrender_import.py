"""pyrender without a window, on the versions of today.

pyrender 0.1.45 is dormant: its viewer pulls in pyglet and X11, and the platform of headless OpenGL must be set before
PyOpenGL is first imported.  Of pyrender we use the EGL contexts, the upload of meshes and the shader programs.
Its faulty parts are not used: 8-bit gamma-encoded pictures, `Mesh.bounds` (np.infty), `Texture` (unaligned
rows, glGenTextures of PyOpenGL 3.1.0 on Python >= 3.12), `OffscreenRenderer.delete` (ends everybody's contexts).
"""

from __future__ import annotations

import importlib
import logging
import os
import sys
import types
from typing import Any

from spikecam_env.errors import NotReadyError

_PLATFORM = "PYOPENGL_PLATFORM"


def import_pyrender(platform: str) -> Any:
    """The package pyrender over PyOpenGL's `platform`, "egl" or "osmesa".

    Raises:
        NotReadyError: PyOpenGL already serves another platform: there is one a process.
        ImportError: the system lacks the libraries; other errors of theirs pass through.
    """
    if "OpenGL.platform" in sys.modules and os.environ.get(_PLATFORM) != platform:
        raise NotReadyError(
            f"PyOpenGL is loaded for {os.environ.get(_PLATFORM) or 'a screen'} and cannot change to {platform}; "
            f"start a new process for {platform}"
        )
    os.environ[_PLATFORM] = platform
    logging.getLogger("OpenGL.acceleratesupport").setLevel(logging.WARNING)  # else it lists missing parts at each start
    if "pyrender.viewer" not in sys.modules:
        stub: Any = types.ModuleType("pyrender.viewer")
        stub.Viewer = None
        sys.modules["pyrender.viewer"] = stub
    return importlib.import_module("pyrender")
