"""Another library of the same process ends EGL's display, and with it every context: the next picture starts anew."""

from __future__ import annotations

import subprocess
import sys

import pytest

SCENE = """
import numpy as np
import trimesh
from scenes.renderers.choose import make
from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole, Surface
eye = np.eye(4)
eye[2, 3] = 3.2
renderer, surface = make("egl-software"), Surface(trimesh.creation.icosphere(2, 0.5), 0.6)
def draw():
    lens = Pinhole(30.0, (15.5, 11.5), eye)
    return renderer.render(surface, np.eye(4), lens, Lighting(), PictureWindow(0, 0, 24, 32)).radiance
"""

MUJOCO = """
from scenes.mujoco import MujocoPictures, import_mujoco
mujoco = import_mujoco()
geoms = "<geom size='.2'/><geom size='.1' pos='.3 0 0' rgba='1 0 0 1'/>"
model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
pictures = MujocoPictures(model, (24, 32), renderer="egl-software")
def draw():
    return pictures.light(data)
"""

END_THE_DISPLAY = """
import ctypes
from scenes.renderers.egl import COMPATIBLE, EglContext, devices
def end():
    library = ctypes.CDLL("libEGL.so.1")
    assert library.eglTerminate(EglContext.on(library, next(devices(library, software=True)), COMPATIBLE).display)
"""

CLOSE_A_WINDOW = """
import pygame
def end():
    pygame.display.init()
    assert pygame.display.get_driver() == "offscreen"
    pygame.display.set_mode((16, 16))
    pygame.display.flip()
    pygame.quit()
"""

DRAW_ON = """
import gc
import numpy as np
before = draw()
assert np.ptp(before) > 0.05
for _ in range(3):
    end()
    np.testing.assert_array_equal(draw(), before)
end()
del draw, {holder}
gc.collect()
print("draws on")
"""


@pytest.mark.parametrize(("drawing", "holder"), [(SCENE, "renderer"), (MUJOCO, "pictures")], ids=["scene", "mujoco"])
@pytest.mark.parametrize("ending", [END_THE_DISPLAY, CLOSE_A_WINDOW], ids=["display", "window"])
def test_pictures_are_the_same_after_the_display_was_ended(
    drawing: str, holder: str, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if drawing == MUJOCO:
        pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    if ending == CLOSE_A_WINDOW:
        pytest.importorskip("pygame", reason="needs the extra video")
    monkeypatch.setenv("SDL_VIDEODRIVER", "offscreen")
    code = drawing + ending + DRAW_ON.format(holder=holder)
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert (run.returncode, run.stdout.strip(), run.stderr) == (0, "draws on", "")
