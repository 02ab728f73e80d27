"""A mesh's own reflection, as grey albedo: colours of vertices or faces, materials.

Linear or not: pictures and colours of vertices and faces are sRGB, factors (Kd of MTL) are linear.  glTF has rules of
its own (`scenes.surfaces.gltf`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

from scenes.film.pictures import check_size
from scenes.film.transfer import grey, linear_from_srgb
from scenes.surfaces.unshown import NO_COORDINATES, TRANSPARENCY
from scenes.surfaces.wavefront import PLACE, unread_of
from scenes.surfaces.wrapping import CLAMP, unrolled
from spikecam_env.errors import InputError
from spikecam_env.types import Pictures

UNSTATED_ALBEDO = 0.7
"""Of a mesh that says nothing: light grey paint."""
UNSTATED_DIFFUSE = (102, 102, 102, 255)
"""That trimesh gives to a material without one."""


def own_albedo(mesh: trimesh.Trimesh, without: Callable[[str], None]) -> tuple[trimesh.Trimesh, float | Pictures]:
    """A mesh as trimesh read it, and its albedo: one value, one for each vertex (V,), or a texture (h, w).

    Faces of several colours get corners of their own.

    Args:
        mesh: with its colours or its material; its texture coordinates change where a material moves its picture.
        without: is called with the name of each part of the material that no surface shows.

    Raises:
        InputError: colours or factors are out of 0 to full scale, or the mesh has several materials in one.
    """
    visual: Any = mesh.visual
    kind, material = getattr(visual, "kind", None), getattr(visual, "material", None)
    if hasattr(material, "materials"):
        raise InputError("the mesh has several materials in one; export it with one material a mesh")
    factor, picture = (_factor(material), _picture(material)) if material is not None else (None, None)
    if str(getattr(material, "alphaMode", None) or "OPAQUE") != "OPAQUE":
        without(TRANSPARENCY)
    for name in unread_of(getattr(material, "kwargs", {})):
        without(name)
    if picture is not None and getattr(visual, "uv", None) is not None:
        light = grey(linear_from_srgb(picture) * (1.0 if factor is None else factor))
        return mesh, _laid_out(mesh, light, getattr(material, "kwargs", {}).get(PLACE))
    if picture is not None:
        without(NO_COORDINATES)
    if kind in ("vertex", "face"):
        _check_ply(mesh, kind)
        colours = visual.vertex_colors if kind == "vertex" else visual.face_colors
        return _coloured(mesh, np.asarray(colours), kind, without)
    return mesh, UNSTATED_ALBEDO if factor is None else float(grey(factor[None, None])[0, 0])


def colour_of(values: Any) -> Pictures:
    """A factor as (3,) linear red, green, blue.

    Args:
        values: one or more numbers, red, green, blue first: in 0..1, or whole ones of 255.

    Raises:
        InputError: they are out of 0 to full scale.
    """
    stated = np.asarray(values)
    rgb = np.broadcast_to(stated[:3] if stated.ndim else stated, 3).astype(np.float32)
    rgb = rgb / np.float32(255) if stated.dtype.kind == "u" else rgb
    if not (rgb.min() >= 0 and rgb.max() <= 1):
        raise InputError(f"a material's colour is {stated}; a surface reflects 0 to 1 of the light")
    return rgb


def pixels_of(image: Image.Image) -> tuple[Pictures, Pictures]:
    """Colours (h, w, 3), encoded as they are stored, and alpha (h, w) of an open picture, both in 0..1.

    Raises:
        InputError: it has more than MOST_PICTURE_PIXELS.
    """
    check_size(image.width, image.height, "a texture of the mesh")
    if image.mode.startswith("I") or image.mode == "F":
        values = np.asarray(image, np.float32) / np.float32(1 if image.mode == "F" else 65535)
        return np.repeat(values[..., None], 3, axis=2), np.ones_like(values)
    values = np.asarray(image.convert("RGBA"), np.float32) / np.float32(255)
    return values[..., :3], values[..., 3]


def _coloured(
    mesh: trimesh.Trimesh, colours: NDArray[Any], kind: str, without: Callable[[str], None]
) -> tuple[trimesh.Trimesh, Pictures]:
    """The mesh and the albedo of its vertices; colours (V or F, 3 or 4) uint8."""
    if len(colours) != (len(mesh.vertices) if kind == "vertex" else len(mesh.faces)):
        raise InputError(f"the mesh has {len(colours)} colours of {kind}s; it needs one for each")
    values = colours.astype(np.float32) / np.float32(255)
    if values.shape[1] == 4 and values[:, 3].min() < 1:
        without(TRANSPARENCY)
    albedo = grey(linear_from_srgb(values[None, :, :3]))[0].clip(0, 1)
    return (mesh, albedo) if kind == "vertex" else (_apart(mesh), np.repeat(albedo, 3))


def _check_ply(mesh: trimesh.Trimesh, kind: str) -> None:
    """Refuse colours of a PLY that trimesh cuts to 8 bits: those of 16, and floats above 1."""
    data: Any = mesh.metadata.get("_ply_raw", {}).get(kind, {}).get("data", {})
    for name in {"red", "green", "blue"} & set(data if isinstance(data, dict) else data.dtype.names):
        values = np.asarray(data[name])
        most = 1.0 if values.dtype.kind == "f" else 255
        if values.dtype == np.uint16 or not (values.min() >= 0 and values.max() <= most):
            raise InputError(
                f"colours ({values.dtype}) run to {values.max():g}; they must be uchar, or floats from 0 to 1"
            )


def _apart(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The same with corners that no two faces share; its normals stay."""
    corners = np.asarray(mesh.faces).ravel()
    return trimesh.Trimesh(
        np.asarray(mesh.vertices)[corners],
        np.arange(len(corners)).reshape(-1, 3),
        vertex_normals=np.asarray(mesh.vertex_normals)[corners],
        process=False,
    )


def _factor(material: Any) -> Pictures | None:
    """(3,) linear red, green, blue in 0..1; None where the material does not state it."""
    stated = getattr(material, "baseColorFactor", None)
    if stated is None and "kd" in getattr(material, "kwargs", {}):
        stated = np.asarray(material.kwargs["kd"], np.float64)
    diffuse = getattr(material, "diffuse", None)
    if stated is None and diffuse is not None and tuple(diffuse) != UNSTATED_DIFFUSE:
        stated = diffuse
    if stated is None:
        return None
    return colour_of(stated)


def _laid_out(mesh: trimesh.Trimesh, light: Pictures, place: list[str] | None) -> Pictures:
    """A picture (h, w), and the coordinates of the mesh changed, as MTL's options have it."""
    if place is None:
        return light
    visual: Any = mesh.visual
    across, up, wide, high, clamped = (float(value) for value in place[:5])
    uv = np.array(visual.uv, np.float64)[:, :2] * (wide, high) + (across, up)
    if clamped:
        light, uv = unrolled(light, uv, CLAMP, CLAMP)
    visual.uv = uv
    return light


def _picture(material: Any) -> Pictures | None:
    """(h, w, 3) sRGB in 0..1, where the material has one."""
    image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    return None if image is None else pixels_of(image)[0]
