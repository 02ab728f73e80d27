"""What a mesh says of its own reflection, as grey albedo: colours of vertices or faces, materials.

Colours become a texture too.  It is a ramp from 0 to 1, and a corner's place on it is its albedo: between corners
places are linear, so albedo is, and a coarse reading of the ramp is the mean of what it covers.

Linear or not: pictures are sRGB.  Colours of vertices and faces are sRGB, but linear in glTF.  Factors (glTF's base
colour, Kd of MTL) are linear.  Source: glTF 2.0, 3.7.2.1 and 3.9.2.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from scenes.pictures import check_size
from scenes.transfer import Array, grey, linear_from_srgb
from spikecam_env.errors import InputError

UNSTATED_ALBEDO = 0.7
"""Of a mesh that says nothing: light grey paint."""
STEPS = 64
"""Texels from albedo 0 to 1.  OpenGL knows 1/256 of the way between two, so albedo to 6e-5."""
RAMP: Array = np.pad(np.linspace(0, 1, STEPS, dtype=np.float32), STEPS // 2, mode="edge")[None]
"""(1, 2 STEPS), with room at the ends for coarse readings."""
UNSTATED_DIFFUSE = (102, 102, 102, 255)
"""That trimesh gives to a material without one."""


def own_albedo(mesh: trimesh.Trimesh, linear_colours: bool = False) -> tuple[trimesh.Trimesh, float | Array]:
    """The mesh with texture coordinates, where its albedo needs them, and its albedo: one value or a texture (h, w).

    linear_colours: colours of vertices and faces are linear, not sRGB.
    Warns of transparency, and of colours that a texture hides.
    """
    visual: Any = mesh.visual
    kind = getattr(visual, "kind", None)
    if kind in ("vertex", "face"):
        colours = np.asarray(visual.vertex_colors if kind == "vertex" else visual.face_colors)
        return _coloured(mesh, colours, kind, linear_colours)
    material = getattr(visual, "material", None)
    if material is None:
        return mesh, UNSTATED_ALBEDO
    if hasattr(material, "to_pbr") and hasattr(material, "materials"):
        raise InputError("the mesh has several materials in one; export it with one material a mesh")
    factor, picture = _factor(material), _picture(material)
    colours = np.asarray(getattr(visual, "vertex_attributes", {}).get("color", ()))
    if str(getattr(material, "alphaMode", None) or "OPAQUE") != "OPAQUE":
        _warn_of_transparency()
    if picture is not None and getattr(visual, "uv", None) is not None:
        if len(colours) and (colours != colours[0]).any():
            warnings.warn("the mesh has a texture and colours of vertices; its texture is taken", stacklevel=4)
        return mesh, grey(linear_from_srgb(picture) * _or_one(factor))
    if len(colours) == len(mesh.vertices):
        return _coloured(mesh, colours, "vertex", linear_colours, _or_one(factor))
    return mesh, UNSTATED_ALBEDO if factor is None else float(grey(factor[None, None])[0, 0])


def _coloured(
    mesh: trimesh.Trimesh, colours: NDArray[Any], kind: str, is_linear: bool, factor: Array | float = 1.0
) -> tuple[trimesh.Trimesh, Array]:
    """The mesh on the ramp; colours (V or F, 3 or 4) are whole numbers of full scale or 0..1."""
    if len(colours) != (len(mesh.vertices) if kind == "vertex" else len(mesh.faces)):
        raise InputError(f"the mesh has {len(colours)} colours of {kind}s; it needs one for each")
    values = colours.astype(np.float32)
    if colours.dtype.kind in "iu":
        values /= np.float32(np.iinfo(colours.dtype).max)
    if not (values.min() >= 0 and values.max() <= 1):
        raise InputError(f"colours run from {values.min():g} to {values.max():g}; they must lie in 0 to full scale")
    if values.shape[1] == 4 and values[:, 3].min() < 1:
        _warn_of_transparency()
    rgb = values[:, :3] if is_linear else linear_from_srgb(values[:, :3])
    albedo = grey(rgb[None] * factor)[0].clip(0, 1)
    if kind == "face":
        mesh, albedo = _apart(mesh), np.repeat(albedo, 3)
    place = (STEPS // 2 + 0.5 + (STEPS - 1) * albedo.astype(np.float64)) / RAMP.shape[1]
    mesh.visual = trimesh.visual.TextureVisuals(uv=np.stack([place, np.full(len(place), 0.5)], -1))
    return mesh, RAMP


def _apart(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The same with corners that no two faces share; its normals stay."""
    corners = np.asarray(mesh.faces).ravel()
    return trimesh.Trimesh(
        np.asarray(mesh.vertices)[corners],
        np.arange(len(corners)).reshape(-1, 3),
        vertex_normals=np.asarray(mesh.vertex_normals)[corners],
        process=False,
    )


def _factor(material: Any) -> Array | None:
    """(3,) linear red, green, blue in 0..1; None where the material does not state it."""
    stated = getattr(material, "baseColorFactor", None)
    if stated is None and "kd" in getattr(material, "kwargs", {}):
        stated = np.asarray(material.kwargs["kd"], np.float64)
    diffuse = getattr(material, "diffuse", None)
    if stated is None and diffuse is not None and tuple(diffuse) != UNSTATED_DIFFUSE:
        stated = diffuse
    if stated is None:
        return None
    values = np.asarray(stated)
    rgb = np.broadcast_to(values[:3] if values.ndim else values, 3).astype(np.float32)
    rgb = rgb / np.float32(255) if values.dtype.kind in "iu" else rgb
    if not (rgb.min() >= 0 and rgb.max() <= 1):
        raise InputError(f"a material's colour is {values}; a surface reflects 0 to 1 of the light")
    return rgb


def _or_one(factor: Array | None) -> Array | float:
    return 1.0 if factor is None else factor


def _picture(material: Any) -> Array | None:
    """(h, w, 3) sRGB in 0..1, where the material has one."""
    image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    if image is None:
        return None
    check_size(image.width, image.height, "a texture of the mesh")
    return np.asarray(image.convert("RGB"), np.float32) / np.float32(255)


def _warn_of_transparency() -> None:
    warnings.warn("the mesh is transparent in places; surfaces are rendered opaque", stacklevel=5)
