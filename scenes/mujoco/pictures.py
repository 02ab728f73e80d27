"""Pictures that MuJoCo draws, off screen, in a context of our own: linear light, colour, depth, segmentation.

MuJoCo adds up the light of its lamps in the numbers of its colours, and writes the sum without a transfer curve: a lamp
twice as strong gives a number twice as large, up to 1.  So its numbers are linear light, however they look on a screen.
(Of textures alone a model may state `colorspace="sRGB"`; MuJoCo then makes them linear itself.)
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from scenes.film.transfer import curve, grey
from scenes.mujoco.cameras import Projection, camera_named
from scenes.mujoco.float_target import FloatTarget
from scenes.mujoco.importing import import_mujoco
from scenes.renderers import contexts
from scenes.renderers.choose import chosen
from scenes.renderers.contexts import FIX
from scenes.renderers.egl import LostContextError
from spikecam_env.checked import checked_count, checked_shape
from spikecam_env.errors import InputError, NotReadyError, shown, unknown_name
from spikecam_env.types import Pictures

SUPERSAMPLE = 4
"""Samples a pixel and axis: fewer leave edges that jump as things move; keys of a white ball on grey are then 0.8 %
from eight times as many, with 3 it is 1.1 %, with 2 it is 1.9 % (`python -m benchmarks.mujoco_light`)."""
MOST_SAMPLES = 8
"""Samples a pixel and axis at most: 64 a pixel."""
MOST_GEOMS = 10_000
"""Things of a picture at most, as MuJoCo's own `Renderer` has it."""
KINDS = ("egl-hardware", "egl-software", "osmesa")

_lost: list[Any] = []
"""MuJoCo's contexts whose context of OpenGL has ended.  They are kept: one that is deleted deletes textures and buffers
by their numbers, which in the context that is then current are others."""

_SPAWN = "start processes with multiprocessing.get_context('spawn'), or draw in the children alone"


class MujocoPictures:
    """Pictures of a MuJoCo model.  The first one starts OpenGL.

    Threads may share an object: they draw one after another.  After a fork each process makes its own.

    Args:
        model: mujoco.MjModel.
        shape: (rows, columns).
        camera: name or number of one of the model's, -1 for the free camera, or an MjvCamera; default: the first.
        supersample: samples a pixel and axis, of which light and colour are the mean; default 4, to 8.
        transfer: from MuJoCo's numbers to linear light: "linear" [default], as its lamps add up, or one of
            `scenes.film.transfer`, such as "srgb", for scenes whose colours were chosen by their look on a screen.
        renderer: "egl-hardware", "egl-software" or "osmesa"; default: SPIKECAM_RENDERER, else the first that works.

    Raises:
        InputError: MuJoCo or OpenGL is missing, or an argument is out of range.

    Example:
        >>> mujoco = import_mujoco()
        >>> sphere = "<geom type='sphere' size='.2' rgba='1 0 0 1'/>"
        >>> model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{sphere}</worldbody></mujoco>")
        >>> data = mujoco.MjData(model)
        >>> mujoco.mj_forward(model, data)
        >>> with MujocoPictures(model, (32, 32)) as pictures:
        ...     int(pictures.colour(data)[16, 16].argmax())
        0
    """

    def __init__(
        self,
        model: Any,
        shape: tuple[int, int],
        camera: Any = None,
        *,
        supersample: int = SUPERSAMPLE,
        transfer: str = "linear",
        renderer: str | None = None,
    ) -> None:
        mujoco = import_mujoco()
        if not isinstance(model, mujoco.MjModel):
            raise InputError(f"model is a {type(model).__name__}; give a mujoco.MjModel, e.g. env.unwrapped.model")
        if renderer is not None and renderer not in (*KINDS, "auto"):
            raise unknown_name("renderer of MuJoCo", renderer, (*KINDS, "auto"))
        self.model, self.shape = model, checked_shape(shape)
        self.supersample = checked_count(supersample, "supersample", MOST_SAMPLES)
        self.camera = camera_named(model, camera)
        self._curve = None if transfer == "linear" else curve(transfer)
        self._wanted = renderer
        self._options = mujoco.MjvOption()
        self._scene = mujoco.MjvScene(model, MOST_GEOMS)
        self._one_draws = threading.Lock()
        self._drawing: _Drawing | None = None
        self._closed = False

    def light(self, data: Any) -> Pictures:
        """(rows, columns) float32, linear luminance (BT.709) of the picture; 1 is MuJoCo's white.

        Args:
            data: mujoco.MjData whose poses are computed, as `mj_forward` or a step leaves them.
        """
        values = self._colours(data)
        return averaged(grey(values if self._curve is None else self._curve(values)), self.supersample)

    def colour(self, data: Any) -> NDArray[np.uint8]:
        """(rows, columns, 3) uint8: MuJoCo's picture, edges averaged over the samples."""
        values = averaged(self._colours(data), self.supersample)
        return np.rint(255 * np.clip(values, 0, 1)).astype(np.uint8)

    def depth(self, data: Any) -> Pictures:
        """(rows, columns) float32, distance along the camera's axis at the pixel's centre [m]; inf where nothing is."""
        mujoco = import_mujoco()
        with self._drawn(data, self.shape, by_number=True) as drawing:
            drawing.context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
            stored = np.empty(self.shape, np.float32)
            mujoco.mjr_readPixels(None, stored, _rectangle(self.shape), drawing.context)
            lens = self.projection()
        return _metres(stored[::-1].astype(np.float64), lens)

    def segmentation(self, data: Any) -> NDArray[np.int32]:
        """(rows, columns, 2) int32: number and kind (mjtObj) of the thing at the pixel's centre; -1, -1: none."""
        mujoco = import_mujoco()
        with self._drawn(data, self.shape, by_number=True) as drawing:
            colours = np.empty((*self.shape, 3), np.uint8)
            mujoco.mjr_readPixels(colours, None, _rectangle(self.shape), drawing.context)
            things = [(g.segid + 1, g.objid, g.objtype) for g in self._scene.geoms[: self._scene.ngeom] if g.segid >= 0]
        table = np.full((self._scene.ngeom + 1, 2), -1, np.int32)
        for number, identity, kind in things:
            table[number] = identity, kind
        numbers = colours[::-1].astype(np.int64) @ (1, 1 << 8, 1 << 16)
        return np.asarray(table[numbers], np.int32)

    def projection(self, data: Any | None = None) -> Projection:
        """The camera as it draws these poses; without data as it drew the last picture."""
        if data is not None:
            import_mujoco().mjv_updateCamera(self.model, data, self.camera, self._scene)
        return Projection.of(self._scene.camera, self.shape)

    def close(self) -> None:
        """Give the context back; may be called again."""
        self._closed = True
        if self._drawing is not None and self._drawing.process == os.getpid():
            with self._one_draws:
                self._drawing.end()

    def __enter__(self) -> MujocoPictures:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _colours(self, data: Any) -> Pictures:
        rows, columns = self.shape
        fine = (rows * self.supersample, columns * self.supersample)
        with self._drawn(data, fine) as drawing:
            return drawing.target.colours()

    @contextmanager
    def _drawn(self, data: Any, shape: tuple[int, int], by_number: bool = False) -> Iterator[_Drawing]:
        """The picture in the context's buffer, which is current inside."""
        mujoco = import_mujoco()
        checked_data(self.model, data)
        with self._one_draws:
            drawing = self._current()
            try:
                mujoco.mjv_updateScene(
                    self.model, data, self._options, None, self.camera, mujoco.mjtCatBit.mjCAT_ALL, self._scene
                )
                for flag in (mujoco.mjtRndFlag.mjRND_SEGMENT, mujoco.mjtRndFlag.mjRND_IDCOLOR):
                    self._scene.flags[flag] = by_number
                mujoco.mjr_render(_rectangle(shape), self._scene, drawing.context)
                yield drawing
            finally:
                drawing.opengl.release()

    def _current(self) -> _Drawing:
        """The drawing with its context made current; a new one where the context was lost."""
        drawing = self._started()
        try:
            drawing.opengl.make_current()
        except LostContextError:
            drawing.end()
            self._drawing = None
            drawing = self._started()
            drawing.opengl.make_current()
        return drawing

    def _started(self) -> _Drawing:
        if self._closed:
            raise NotReadyError("these pictures are closed; make a new MujocoPictures")
        if self._drawing is None:
            rows, columns = self.shape
            fine = (rows * self.supersample, columns * self.supersample)
            self._drawing = _start(self.model, fine, chosen(self._wanted))
            self._drawing.end = finalize(self, self._drawing.end)
        if self._drawing.process != os.getpid():
            raise NotReadyError(f"MuJoCo drew before this process was forked, and OpenGL does not follow; {_SPAWN}")
        return self._drawing


@dataclass
class _Drawing:
    """A context of MuJoCo in one of OpenGL, and the process that made it."""

    opengl: contexts.Context
    context: Any
    target: FloatTarget
    process: int
    end: Any


def _start(model: Any, shape: tuple[int, int], kind: str) -> _Drawing:
    """MuJoCo's context for pictures of this size; it is released, for whichever thread draws first."""
    mujoco = import_mujoco()
    if kind not in KINDS:
        raise InputError(
            f"MuJoCo draws with OpenGL alone, not with {shown(kind)}; {FIX['egl-software']}, or unset SPIKECAM_RENDERER"
        )
    if not contexts.can_start():
        raise NotReadyError(f"MuJoCo cannot draw in a fork of a process that has used OpenGL; {_SPAWN}")
    try:
        opengl = contexts.start(kind, "compatible")
    except NotReadyError:
        raise
    except RuntimeError as failure:
        raise InputError(f"renderer {kind!r} does not work here: {failure}; {FIX[kind]}") from failure
    try:
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50)
        target = FloatTarget(context, opengl.function, *shape)
    except (RuntimeError, mujoco.FatalError) as failure:
        raise InputError(
            f"MuJoCo does not draw with {kind!r}: {failure}; name another in SPIKECAM_RENDERER"
        ) from failure
    finally:
        opengl.release()
    return _Drawing(opengl, context, target, os.getpid(), _Ending(opengl, context, os.getpid()))


@dataclass
class _Ending:
    """Gives a context back, once, in the process that made it."""

    opengl: contexts.Context
    context: Any
    process: int

    def __call__(self) -> None:
        if self.process != os.getpid():
            return
        try:
            self.opengl.make_current()
        except LostContextError:
            _lost.append(self.context)
            return
        self.context.free()
        self.opengl.release()
        self.opengl.end()


def checked_data(model: Any, data: Any) -> Any:
    """The data of this model as it is.

    Raises:
        InputError: it is no mujoco.MjData, or that of a model of another size.
    """
    if not isinstance(data, import_mujoco().MjData):
        raise InputError(f"data is a {type(data).__name__}; give the mujoco.MjData, e.g. env.unwrapped.data")
    if (len(data.qpos), len(data.xpos), len(data.geom_xpos)) != (model.nq, model.nbody, model.ngeom):
        raise InputError("data belongs to another model; give mujoco.MjData(model) of the same model")
    return data


def averaged(values: Pictures, supersample: int) -> Pictures:
    """The mean over supersample x supersample neighbours of an array (rows, columns, ...).

    Example:
        >>> averaged(np.arange(8, dtype=np.float32).reshape(2, 4), 2).tolist()
        [[2.5, 4.5]]
    """
    if supersample == 1:
        return np.ascontiguousarray(values)
    total = np.zeros((values.shape[0] // supersample, values.shape[1] // supersample, *values.shape[2:]), np.float32)
    for row in range(supersample):
        for column in range(supersample):
            total += values[row::supersample, column::supersample]
    total *= np.float32(1 / supersample**2)
    return total


def _rectangle(shape: tuple[int, int]) -> Any:
    return import_mujoco().MjrRect(0, 0, shape[1], shape[0])


def _metres(stored: NDArray[np.float64], lens: Projection) -> Pictures:
    """Distance of a depth buffer that holds 1 at the near plane and 0 at the far one; there is nothing at 0."""
    near, far = lens.near, lens.far
    with np.errstate(divide="ignore"):
        distance = far - stored * (far - near) if lens.orthographic else near * far / (near + stored * (far - near))
    return np.where(stored > 0, distance, np.inf).astype(np.float32)
