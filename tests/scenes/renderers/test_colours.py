"""Colours of a mesh as they are seen: every back-end shows the albedo between corners that interpolation gives."""

from __future__ import annotations

import numpy as np
import trimesh

from scenes.film.transfer import grey, linear_from_srgb
from scenes.meshes import from_mesh
from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole, Renderer, Surface

WINDOW = PictureWindow(0, 0, 40, 60)
EYE = np.eye(4)
EYE[2, 3] = 3.0
CAMERA = Pinhole(60.0, (29.5, 19.5), EYE)
ALBEDO_ALONE = Lighting(ambient=1.0, intensity=0.0)


def seen(renderer: Renderer, surface: Surface, supersample: int = 2) -> tuple[np.ndarray, np.ndarray]:
    sprite = renderer.render(surface, np.eye(4), CAMERA, ALBEDO_ALONE, WINDOW, supersample)
    return sprite.radiance, sprite.coverage == 1


def sheet(cells: int = 1) -> trimesh.Trimesh:
    """A sheet of 2 x 1 that faces the camera, of cells x cells x 2 triangles."""
    x, y = np.meshgrid(np.linspace(-1, 1, cells + 1), np.linspace(-0.5, 0.5, cells + 1))
    a = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    b, c, d = a + 1, a + cells + 2, a + cells + 1
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return trimesh.Trimesh(np.stack([x, y, 0 * x], -1).reshape(-1, 3), faces, process=False)


def test_albedo_is_linear_between_coloured_corners(renderer: Renderer) -> None:
    mesh = sheet()
    code = np.where(mesh.vertices[:, 0] < 0, 0, 255).astype(np.uint8)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=np.repeat(code[:, None], 3, 1))
    light, inside = seen(renderer, from_mesh(mesh))
    expected = ((np.arange(60) - 29.5) / 20 + 1) / 2
    error = np.abs(light - expected)[inside].max()
    print(f"{renderer.name}: {inside.sum()} pixels, error {error:.1e}")
    assert inside.sum() > 500 and error < 2e-3


def test_coloured_faces_keep_their_edges(renderer: Renderer) -> None:
    mesh = sheet(2)
    left = mesh.triangles_center[:, 0] < 0
    colours = np.where(left[:, None], [255, 0, 0], [0, 255, 0]).astype(np.uint8)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, face_colors=colours)
    light, inside = seen(renderer, from_mesh(mesh))
    columns = np.broadcast_to(np.arange(60), light.shape)
    assert np.abs(light[inside & (columns < 29)] - 0.2126).max() < 1e-3
    assert np.abs(light[inside & (columns > 30)] - 0.7152).max() < 1e-3


def test_fine_colours_are_averaged_over_the_pixel(renderer: Renderer) -> None:
    """A dark mesh with a white vertex in twenty, eight triangles a pixel: the picture's mean is that of the colours."""
    mesh = sheet(160)
    white = np.random.default_rng(0).random(len(mesh.vertices)) < 0.05
    rgb = np.repeat(np.where(white, 255, 20)[:, None], 3, 1).astype(np.uint8)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=rgb)
    albedo = grey(linear_from_srgb(rgb[None] / 255))[0]
    light, inside = seen(renderer, from_mesh(mesh))
    print(f"{renderer.name}: mean {light[inside].mean():.4f}, of the colours {albedo.mean():.4f}")
    # 2 x 2 rays in each of some 800 pixels
    assert abs(light[inside].mean() - albedo.mean()) < 3 * albedo.std() / np.sqrt(4 * inside.sum())
