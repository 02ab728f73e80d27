"""How fast and how exact each back-end is on this machine, on one picture of six textured objects, 17 000 triangles.

python -m benchmarks.renderers
"""

from __future__ import annotations

import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from typing import Any

import numpy as np
import trimesh
import tyro
from numpy.typing import NDArray
from trimesh.transformations import rotation_matrix

from scenes.renderers.choose import BACKENDS, make, problem
from scenes.renderers.embree import Embree
from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole, Renderer, Sprite, Surface
from scenes.textures import TEXTURES
from spikecam_env.bench.machine import SHAPE
from spikecam_env.cli.bench import print_figures

EXACT_RAYS = 16
"""A pixel and axis, of the picture that back-ends, and light in space, are compared with."""

Objects = list[tuple[Surface, NDArray[np.float64]]]


@dataclass(frozen=True)
class RendererComparison:
    """One back-end on this machine."""

    backend: str
    """Name, as `choose_renderer` takes it."""
    name: str
    """The back-end's own name, or the reason why it does not work."""
    key_ms: float
    """Time of all objects of the picture once, best of the repeats [ms]; NaN where it does not work."""
    error: float
    """rms of radiance against `EXACT_RAYS`^2 rays a pixel where there is an object, share of full scale."""
    to_embree: float
    """rms of radiance against embree at the same supersampling, likewise."""


def compare_backends(
    shape: tuple[int, int] = SHAPE, supersample: int = 2, repeats: int = 20
) -> list[RendererComparison]:
    """One row for each of `BACKENDS`, each measured in a process of its own, one after the other."""
    truth = [sprite.radiance for sprite in _key(Embree(), shape, EXACT_RAYS)]
    embree = [sprite.radiance for sprite in _key(Embree(), shape, supersample)]
    rows = []
    for backend in BACKENDS:
        reason = problem(backend)
        if reason is not None:
            rows.append(RendererComparison(backend, reason, np.nan, np.nan, np.nan))
            continue
        with ProcessPoolExecutor(1, get_context("spawn")) as process:
            name, seconds, key = process.submit(_measured, backend, shape, supersample, repeats).result()
        rows.append(RendererComparison(backend, name, 1e3 * seconds, _rms(key, truth, truth), _rms(key, embree, truth)))
    return rows


def bench_renderers() -> list[dict[str, Any]]:
    """`compare_backends` at 250 x 400 as a table; times in ms, rms in per cent."""
    return [
        {
            "back-end": row.backend,
            "key, ms": row.key_ms,
            "rms, %": 100 * row.error,
            "to embree, %": 100 * row.to_embree,
            "name": row.name,
        }
        for row in compare_backends(SHAPE)
    ]


def objects(seed: int = 0) -> Objects:
    """Six surfaces and their poses: a disk that tilts, a sphere, a torus, a box, a capsule, a wall behind them."""
    rng = np.random.default_rng(seed)
    box = trimesh.creation.box((0.5, 0.5, 0.5)).subdivide().subdivide().subdivide().subdivide()
    box.unmerge_vertices()
    capsule = trimesh.creation.capsule(0.5, 0.2, count=[48, 48])
    capsule.apply_translation(-capsule.centroid)
    placed = [
        (trimesh.creation.cylinder(0.6, 0.02, sections=256), "dead_leaves", (0.5, 0.2, 0), (-0.75, 0.1, -0.4)),
        (trimesh.creation.icosphere(4, 0.33), "checker", (0.2, 1, 0.1), (-1.1, 0.45, 0.3)),
        (trimesh.creation.torus(0.42, 0.17, 64, 32), "stripes", (1, 0.4, 0.2), (0.75, 0.35, 0.0)),
        (box, "glyphs", (0.3, 1, 0.5), (1.05, -0.45, 0.5)),
        (capsule, "blobs", (0, 0.2, 1), (0.1, -0.35, 0.1)),
        (trimesh.creation.box((8, 5, 0.01)), "fractal_noise", (0, 0, 1e-9), (0, 0, -1.5)),
    ]
    made: Objects = []
    for mesh, kind, turn, place in placed:
        middle, size = mesh.bounds.mean(axis=0), np.ptp(mesh.bounds, axis=0).max()
        mesh.visual = trimesh.visual.TextureVisuals(uv=((mesh.vertices - middle) / size + 0.5)[:, :2])
        pose = rotation_matrix(np.linalg.norm(turn), turn)
        pose[:3, 3] = place
        made.append((Surface(mesh, TEXTURES[kind](rng, 512)), pose))
    return made


def _key(renderer: Renderer, shape: tuple[int, int], supersample: int, of: Objects | None = None) -> list[Sprite]:
    """Each object alone in the whole picture."""
    rows, columns = shape
    eye = np.eye(4)
    eye[2, 3] = 3.2
    camera = Pinhole(1.18 * rows, ((columns - 1) / 2, (rows - 1) / 2), eye)
    window = PictureWindow(0, 0, rows, columns)
    return [
        renderer.render(surface, pose, camera, Lighting(), window, supersample) for surface, pose in of or objects()
    ]


def _measured(
    backend: str, shape: tuple[int, int], supersample: int, repeats: int
) -> tuple[str, float, list[NDArray[np.float32]]]:
    """Name, best time [s] after a first picture that compiles and uploads, radiance of each object."""
    renderer, of = make(backend), objects()
    key = _key(renderer, shape, supersample, of)
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        _key(renderer, shape, supersample, of)
        times.append(time.perf_counter() - start)
    renderer.close()
    return renderer.name, min(times), [sprite.radiance for sprite in key]


def _rms(key: list[NDArray[np.float32]], other: list[NDArray[np.float32]], covered: list[NDArray[np.float32]]) -> float:
    """Over the pixels of all objects where there is light."""
    squares = [np.square(a - b, dtype=np.float64)[c > 0] for a, b, c in zip(key, other, covered, strict=True)]
    return float(np.sqrt(np.mean(np.concatenate(squares))))


if __name__ == "__main__":
    tyro.cli(partial(print_figures, bench_renderers), description=__doc__)
