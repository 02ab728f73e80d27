"""OpenGL through pyrender, off screen, in linear light.

pyrender gives the context, uploads meshes and compiles shaders; the draw call and the float targets are ours, as stock
pyrender pictures are 8-bit and gamma-encoded.  Two passes: `surface` draws supersample x supersample rays a pixel of
(radiance, 1, depth), `mean` averages them into the window; only the window's pixels exist.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary, finalize

import numpy as np

from scenes.renderers import contexts
from scenes.renderers.egl import LostContextError
from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole, Sprite, Surface
from scenes.renderers.pyramid import SHARPER, Pyramid
from scenes.renderers.view import (
    NEAREST,
    SurfaceArrays,
    blank,
    checked,
    geometry,
    moved,
    pasted,
    reached,
    to_camera,
    towards,
)
from spikecam_env.compiled import njit
from spikecam_env.errors import NotReadyError
from spikecam_env.types import Floats, Pictures

LARGEST = 4096
"""Rays a side drawn at once; larger windows are drawn in tiles.  Every OpenGL 4.1 draws 16384; this is 270 MB."""

SHADERS = Path(__file__).parent / "shaders"


class OpenGL:
    """Back-end by OpenGL; see `scenes.renderers.protocol.Renderer`.

    Args:
        kind: "egl-hardware", "egl-software" or "osmesa"; one process serves EGL or OSMesa, not both.

    Raises:
        RuntimeError: this OpenGL does not draw; errors of the libraries pass through (`choose_renderer` sums them up).
        NotReadyError: it is used in another thread, or in a forked process, where OpenGL would hang.
    """

    def __init__(self, kind: str) -> None:
        self._kind, self._home = kind, _here()
        self._start()

    def _start(self) -> None:
        """Start OpenGL with nothing in its memory."""
        self._context = contexts.start(self._kind)
        from OpenGL import GL
        from pyrender.shader_program import ShaderProgram

        self._gl = GL
        library = "OSMesa" if self._kind == "osmesa" else "EGL"
        self.name = f"{library} ({GL.glGetString(GL.GL_RENDERER).decode()})"
        self._surface_program, self._mean_program = (
            ShaderProgram(str(SHADERS / f"{name}.vert"), str(SHADERS / f"{name}.frag")) for name in ("surface", "mean")
        )
        for program in (self._surface_program, self._mean_program):
            program._add_to_context()
        self._uniforms: dict[int, dict[str, int]] = {}
        self._nothing = GL.glGenVertexArrays(1)
        self._kept: WeakKeyDictionary[Surface, _Uploaded] = WeakKeyDictionary()
        self._forgotten: list[_Uploaded] = []
        self._targets: _Targets | None = None
        self._end = finalize(self, _end, self._context, self._home)
        self._end.atexit = False

    def render(
        self,
        surface: Surface,
        pose: Floats,
        camera: Pinhole,
        lighting: Lighting,
        window: PictureWindow,
        supersample: int = 2,
    ) -> Sprite:
        checked(window, supersample)
        self._enter()
        uploaded = self._uploaded(surface)
        matrix = to_camera(pose, camera)
        corners = moved(uploaded.geometry.vertices, matrix)
        part = reached(corners, camera, window)
        if part is None:
            return blank(window)
        farthest = -corners[:, 2].min()
        nearest = max(-corners[:, 2].max(), NEAREST * farthest)
        self._light(surface, uploaded, pose, matrix, lighting)
        abilities = self._abilities(uploaded.geometry, matrix)
        sprite = blank(part)
        for tile in _tiles(part, max(1, LARGEST // supersample)):
            self._draw(
                uploaded, _to_window(camera, tile, 0.999 * nearest, 1.001 * farthest), tile, supersample, abilities
            )
            self._read(sprite, tile)
        return pasted(sprite, window)

    def close(self) -> None:
        if self._home == _here():
            self._end()

    def _enter(self) -> None:
        """Make the context current, a new one where it was lost, and release the memory of surfaces that are gone."""
        if not self._end.alive:
            raise NotReadyError("this renderer is closed; make a new one with choose_renderer()")
        if self._home != _here():
            raise NotReadyError(
                "this renderer was made in another thread, or before the process was forked, and OpenGL does not "
                "follow; make one in each, and start processes with multiprocessing.get_context('spawn')"
            )
        try:
            self._context.make_current()
        except LostContextError:
            self._end.detach()
            self._start()
        while self._forgotten:
            self._forgotten.pop().delete()

    def _uploaded(self, surface: Surface) -> _Uploaded:
        if surface not in self._kept:
            self._kept[surface] = _Uploaded.of(geometry(surface))
            finalize(surface, self._forgotten.append, self._kept[surface]).atexit = False
        return self._kept[surface]

    def _light(self, surface: Surface, uploaded: _Uploaded, pose: Floats, matrix: Floats, lighting: Lighting) -> None:
        gl = self._gl
        gl.glUseProgram(self._surface_program._program_id)
        at = self._at(self._surface_program)
        gl.glUniformMatrix4fv(at("to_camera"), 1, True, matrix.astype(np.float32))
        gl.glUniformMatrix3fv(at("to_world"), 1, True, np.linalg.inv(pose[:3, :3]).T.astype(np.float32))
        gl.glUniform3f(at("towards_lamp"), *map(float, towards(lighting)))
        gl.glUniform3f(at("light"), float(lighting.ambient), float(lighting.intensity), float(surface.emission))
        gl.glUniform1f(at("levels"), float(len(uploaded.geometry.albedo.start)))
        gl.glUniform1f(at("sharper"), SHARPER)

    def _abilities(self, geometry: SurfaceArrays, matrix: Floats) -> list[Any]:
        """Without back faces where they are hidden, in a closed surface seen from outside: a quarter faster."""
        gl = self._gl
        gl.glFrontFace(gl.GL_CW if np.linalg.det(matrix) > 0 else gl.GL_CCW)  # in the picture y points down
        eye = np.linalg.inv(matrix)[:3, 3]
        outside = (eye < geometry.vertices.min(axis=0)).any() or (eye > geometry.vertices.max(axis=0)).any()
        hidden = [gl.GL_CULL_FACE] if geometry.closed and outside else []
        return [gl.GL_SCISSOR_TEST, gl.GL_DEPTH_TEST, *hidden]

    def _draw(
        self, uploaded: _Uploaded, to_window: Floats, tile: PictureWindow, supersample: int, abilities: list[Any]
    ) -> None:
        gl = self._gl
        targets = self._targets_for(tile, supersample)
        gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, targets.rays)
        gl.glViewport(0, 0, tile.columns * supersample, tile.rows * supersample)
        gl.glScissor(0, 0, tile.columns * supersample, tile.rows * supersample)
        for ability in abilities:
            gl.glEnable(ability)
        gl.glClearColor(0.0, 0.0, 0.0, 0.0)
        gl.glClear(gl.GL_COLOR_BUFFER_BIT | gl.GL_DEPTH_BUFFER_BIT)
        gl.glUseProgram(self._surface_program._program_id)
        gl.glUniformMatrix4fv(self._at(self._surface_program)("to_window"), 1, True, to_window.astype(np.float32))
        gl.glBindTexture(gl.GL_TEXTURE_2D, uploaded.texture)
        gl.glBindVertexArray(uploaded.primitive._vaid)
        gl.glDrawElements(gl.GL_TRIANGLES, uploaded.geometry.faces.size, gl.GL_UNSIGNED_INT, ctypes.c_void_p(0))
        for ability in abilities:
            gl.glDisable(ability)

        if supersample == 1:  # a ray is a pixel, and is read from where it was drawn
            return
        gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, targets.pixels)
        gl.glViewport(0, 0, tile.columns, tile.rows)
        gl.glUseProgram(self._mean_program._program_id)
        gl.glUniform1i(self._at(self._mean_program)("supersample"), int(supersample))
        gl.glBindTexture(gl.GL_TEXTURE_2D, targets.rays_texture)
        gl.glBindVertexArray(self._nothing)
        gl.glDrawArrays(gl.GL_TRIANGLES, 0, 3)

    def _read(self, sprite: Sprite, tile: PictureWindow) -> None:
        gl = self._gl
        values = np.empty((tile.rows, tile.columns, 4), np.float32)
        gl.glReadPixels(0, 0, tile.columns, tile.rows, gl.GL_RGBA, gl.GL_FLOAT, values)
        top, left = tile.top - sprite.window.top, tile.left - sprite.window.left
        inside = np.s_[top : top + tile.rows, left : left + tile.columns]
        _split(values, sprite.radiance[inside], sprite.coverage[inside], sprite.depth[inside])

    def _targets_for(self, tile: PictureWindow, supersample: int) -> _Targets:
        rows, columns = tile.rows * supersample, tile.columns * supersample
        if self._targets is None or rows > self._targets.rows or columns > self._targets.columns:
            if self._targets is not None:
                rows, columns = max(rows, self._targets.rows), max(columns, self._targets.columns)
                self._targets.delete()
            self._targets = _Targets.of(rows, columns)
        return self._targets

    def _at(self, program: Any) -> Callable[[str], int]:
        """Places of its uniforms, each requested of OpenGL once: through Python that takes longer than to set one."""
        known = self._uniforms.setdefault(program._program_id, {})

        def place(name: str) -> int:
            if name not in known:
                known[name] = self._gl.glGetUniformLocation(program._program_id, name)
            return known[name]

        return place


@dataclass(frozen=True)
class _Uploaded:
    """A surface in OpenGL's memory."""

    geometry: SurfaceArrays
    primitive: Any
    texture: int

    @classmethod
    def of(cls, geometry: SurfaceArrays) -> _Uploaded:
        from pyrender import Primitive

        primitive = Primitive(geometry.vertices, geometry.normals, texcoord_0=geometry.uv, indices=geometry.faces)
        primitive._add_to_context()
        return cls(geometry, primitive, _texture(geometry.albedo))

    def delete(self) -> None:
        self.primitive.delete()
        _delete_textures(self.texture)


@dataclass(frozen=True)
class _Targets:
    """Where the two passes draw: `rays` (rows, columns) with depth, `pixels` no larger."""

    rows: int
    columns: int
    rays: int
    rays_texture: int
    depth: int
    pixels: int
    pixels_texture: int

    @classmethod
    def of(cls, rows: int, columns: int) -> _Targets:
        from OpenGL import GL as gl

        depth = gl.glGenRenderbuffers(1)
        gl.glBindRenderbuffer(gl.GL_RENDERBUFFER, depth)
        gl.glRenderbufferStorage(gl.GL_RENDERBUFFER, gl.GL_DEPTH_COMPONENT32F, columns, rows)
        rays, rays_texture = _float_target(rows, columns)
        gl.glFramebufferRenderbuffer(gl.GL_FRAMEBUFFER, gl.GL_DEPTH_ATTACHMENT, gl.GL_RENDERBUFFER, depth)
        pixels, pixels_texture = _float_target(rows, columns)
        for target in (rays, pixels):
            gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, target)
            state = gl.glCheckFramebufferStatus(gl.GL_FRAMEBUFFER)
            if state != gl.GL_FRAMEBUFFER_COMPLETE:
                raise RuntimeError(f"this OpenGL does not draw {columns} x {rows} floats (state {state:#x})")
        return cls(rows, columns, rays, rays_texture, depth, pixels, pixels_texture)

    def delete(self) -> None:
        from OpenGL import GL as gl

        gl.glDeleteFramebuffers(2, [self.rays, self.pixels])
        gl.glDeleteRenderbuffers(1, [self.depth])
        _delete_textures(self.rays_texture, self.pixels_texture)


def _here() -> tuple[int, int]:
    """This process, this thread."""
    return os.getpid(), threading.get_ident()


def _end(context: contexts.Context, home: tuple[int, int]) -> None:
    """Give the context back with all that is in it, where that can be done: in its own process and thread."""
    if home == _here():
        with suppress(LostContextError):
            context.make_current()
            context.end()


@njit(nogil=True, cache=True)
def _split(values: Pictures, radiance: Pictures, coverage: Pictures, depth: Pictures) -> None:
    """Split values (rows, columns, 4) into pictures; uncovered pixels are infinitely far."""
    for row in range(values.shape[0]):
        for x in range(values.shape[1]):
            radiance[row, x], coverage[row, x] = values[row, x, 0], values[row, x, 1]
            depth[row, x] = values[row, x, 2] if values[row, x, 1] != 0 else np.inf


def _to_window(camera: Pinhole, window: PictureWindow, near: float, far: float) -> Floats:
    """(4, 4) camera to clip coordinates of a window: pixel centres at half cells, the picture's first row first."""
    matrix = np.zeros((4, 4))
    matrix[0, 0] = 2 * camera.focal / window.columns
    matrix[0, 2] = 1 - 2 * (camera.centre[0] - window.left + 0.5) / window.columns
    matrix[1, 1] = -2 * camera.focal / window.rows
    matrix[1, 2] = 1 - 2 * (camera.centre[1] - window.top + 0.5) / window.rows
    matrix[2, 2], matrix[2, 3] = -(far + near) / (far - near), -2 * far * near / (far - near)
    matrix[3, 2] = -1
    return matrix


def _tiles(window: PictureWindow, side: int) -> Iterator[PictureWindow]:
    for top in range(window.top, window.top + window.rows, side):
        rows = min(side, window.top + window.rows - top)
        for left in range(window.left, window.left + window.columns, side):
            yield PictureWindow(top, left, rows, min(side, window.left + window.columns - left))


def _float_target(rows: int, columns: int) -> tuple[int, int]:
    """A framebuffer and its RGBA float texture; the framebuffer stays bound."""
    from OpenGL import GL as gl

    texture = _new_texture()
    gl.glTexImage2D(gl.GL_TEXTURE_2D, 0, gl.GL_RGBA32F, columns, rows, 0, gl.GL_RGBA, gl.GL_FLOAT, None)
    for parameter in (gl.GL_TEXTURE_MIN_FILTER, gl.GL_TEXTURE_MAG_FILTER):
        gl.glTexParameteri(gl.GL_TEXTURE_2D, parameter, gl.GL_NEAREST)
    framebuffer = gl.glGenFramebuffers(1)
    gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, framebuffer)
    gl.glFramebufferTexture2D(gl.GL_FRAMEBUFFER, gl.GL_COLOR_ATTACHMENT0, gl.GL_TEXTURE_2D, texture, 0)
    return framebuffer, texture


def _texture(albedo: Pyramid) -> int:
    """Every level as float32, OpenGL's first row being our last."""
    from OpenGL import GL as gl

    texture = _new_texture()
    for index in range(len(albedo.start)):
        level = np.ascontiguousarray(albedo.level(index)[::-1])
        height, width = level.shape
        gl.glTexImage2D(gl.GL_TEXTURE_2D, index, gl.GL_R32F, width, height, 0, gl.GL_RED, gl.GL_FLOAT, level)
    for parameter, value in (
        (gl.GL_TEXTURE_MAX_LEVEL, len(albedo.start) - 1),
        (gl.GL_TEXTURE_MIN_FILTER, gl.GL_LINEAR_MIPMAP_LINEAR),
        (gl.GL_TEXTURE_MAG_FILTER, gl.GL_LINEAR),
        (gl.GL_TEXTURE_WRAP_S, gl.GL_REPEAT),
        (gl.GL_TEXTURE_WRAP_T, gl.GL_REPEAT),
    ):
        gl.glTexParameteri(gl.GL_TEXTURE_2D, parameter, value)
    return texture


def _new_texture() -> int:
    """A texture, bound.  By the raw call: PyOpenGL 3.1.0's own fails on Python >= 3.12."""
    from OpenGL import GL as gl
    from OpenGL.raw.GL.VERSION.GL_1_1 import glGenTextures

    name = (ctypes.c_uint * 1)()
    glGenTextures(1, name)
    gl.glBindTexture(gl.GL_TEXTURE_2D, name[0])
    return int(name[0])


def _delete_textures(*names: int) -> None:
    from OpenGL.raw.GL.VERSION.GL_1_1 import glDeleteTextures

    glDeleteTextures(len(names), (ctypes.c_uint * len(names))(*names))
