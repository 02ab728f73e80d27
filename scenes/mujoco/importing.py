"""MuJoCo imported without a screen and without PyOpenGL, whatever this machine has of them.

`import mujoco` looks for OpenGL by itself: for a screen, or with MUJOCO_GL=egl through PyOpenGL.
PyOpenGL 3.1.0, which pyrender asks for, has no EGLDeviceEXT.  Our contexts need neither (`scenes.renderers.contexts`).
"""

from __future__ import annotations

import importlib
import os
import sys
from typing import Any

from spikecam_env.errors import InputError

_VARIABLE = "MUJOCO_GL"


def import_mujoco() -> Any:
    """The package mujoco.  Where MUJOCO_GL names an OpenGL that works, MuJoCo's own `Renderer` has it too.

    Raises:
        InputError: it is not installed.

    Example:
        >>> import_mujoco().MjModel.from_xml_string("<mujoco/>").nbody
        1
    """
    if "mujoco" in sys.modules:
        return sys.modules["mujoco"]
    wanted = os.environ.get(_VARIABLE)
    try:
        if wanted is not None:
            try:
                return importlib.import_module("mujoco")
            except (AttributeError, ImportError, OSError, RuntimeError):
                pass  # this OpenGL does not work here, or PyOpenGL is too old for it
        os.environ[_VARIABLE] = "disable"
        return importlib.import_module("mujoco")
    except ModuleNotFoundError as error:
        if error.name != "mujoco":
            raise
        raise InputError("MuJoCo is not installed; pip install 'spikecam-env[mujoco]'") from error
    finally:
        if wanted is None:
            os.environ.pop(_VARIABLE, None)
        else:
            os.environ[_VARIABLE] = wanted
