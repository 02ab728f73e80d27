"""What a mesh says of its own reflection, as grey albedo: colours of vertices or faces, materials.

Linear or not: pictures are sRGB.  Colours of vertices and faces are sRGB, but linear in glTF.  Factors (glTF's base
colour, Kd of MTL) are linear.  Source: glTF 2.0, 3.7.2.1 and 3.9.2.
"""

from __future__ import annotations

import json
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
GLTF_COLOURS = "_COLOR_0"
"""Name of the vertices' attribute that holds glTF's colours, linear, as `gltf_colours_kept` has it."""
UNSTATED_DIFFUSE = (102, 102, 102, 255)
"""That trimesh gives to a material without one."""


def own_albedo(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, float | Array]:
    """The mesh, and its albedo: one value, one for each vertex (V,), or a texture (h, w).

    Faces of several colours have corners of their own.
    Warns of transparency, and of colours that a texture hides.
    Errors: InputError for colours and factors out of 0 to full scale, and several materials in one mesh.
    """
    visual: Any = mesh.visual
    kind, material = getattr(visual, "kind", None), getattr(visual, "material", None)
    if hasattr(material, "materials"):
        raise InputError("the mesh has several materials in one; export it with one material a mesh")
    factor, picture = (_factor(material), _picture(material)) if material is not None else (None, None)
    linear: Any = mesh.vertex_attributes.get(GLTF_COLOURS)
    if str(getattr(material, "alphaMode", None) or "OPAQUE") != "OPAQUE":
        _warn_of_transparency()
    if picture is not None and getattr(visual, "uv", None) is not None:
        light = linear_from_srgb(picture) * _or_one(factor)
        if linear is not None and (linear != linear[0]).any():
            warnings.warn("the mesh has a texture and colours of vertices; its texture alone is taken", stacklevel=4)
        elif linear is not None:
            light *= _linear_rgb(linear[:1], is_linear=True)
        return mesh, grey(light)
    if linear is not None:
        return _coloured(mesh, linear, "vertex", True, _or_one(factor))
    if kind in ("vertex", "face"):
        _check_ply(mesh, kind)
        colours = visual.vertex_colors if kind == "vertex" else visual.face_colors
        return _coloured(mesh, np.asarray(colours), kind)
    return mesh, UNSTATED_ALBEDO if factor is None else float(grey(factor[None, None])[0, 0])


def gltf_colours_kept(data: bytes, kind: str) -> bytes:
    """A glTF file, kind "gltf" or "glb", with its COLOR_0 under the name GLTF_COLOURS.

    trimesh leaves the numbers of that one as they are.  Of COLOR_0 it keeps the lower 8 of 16 bits, and nothing beside
    a material.  What is no glTF comes back as it was.
    """
    head = 20 if kind == "glb" else 0
    try:
        size = int.from_bytes(data[12:16], "little") if head else len(data)
        tree = json.loads(data[head : head + size])
        for primitive in (p for mesh in tree.get("meshes", ()) for p in mesh["primitives"]):
            attributes = primitive["attributes"]
            if "COLOR_0" in attributes:
                attributes[GLTF_COLOURS] = attributes.pop("COLOR_0")
        text = json.dumps(tree).encode()
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return data
    if not head:
        return text
    text += b" " * (-len(text) % 4)
    rest = data[head + size :]
    whole = (head + len(text) + len(rest)).to_bytes(4, "little")
    return data[:8] + whole + len(text).to_bytes(4, "little") + data[16:20] + text + rest


def _coloured(
    mesh: trimesh.Trimesh, colours: NDArray[Any], kind: str, is_linear: bool = False, factor: Array | float = 1.0
) -> tuple[trimesh.Trimesh, Array]:
    """The mesh and the albedo of its vertices; colours (V or F, 3 or 4) are whole numbers of full scale or 0..1."""
    if len(colours) != (len(mesh.vertices) if kind == "vertex" else len(mesh.faces)):
        raise InputError(f"the mesh has {len(colours)} colours of {kind}s; it needs one for each")
    albedo = grey(_linear_rgb(colours, is_linear)[None] * factor)[0].clip(0, 1)
    return (mesh, albedo) if kind == "vertex" else (_apart(mesh), np.repeat(albedo, 3))


def _linear_rgb(colours: NDArray[Any], is_linear: bool) -> Array:
    """(N, 3) of colours (N, 3 or 4)."""
    values = colours.astype(np.float32)
    if colours.dtype.kind in "iu":
        values /= np.float32(np.iinfo(colours.dtype).max)
    if not (values.min() >= 0 and values.max() <= 1):
        raise InputError(f"colours run from {values.min():g} to {values.max():g}; they must lie in 0 to full scale")
    if values.shape[1] == 4 and values[:, 3].min() < 1:
        _warn_of_transparency()
    return values[:, :3] if is_linear else linear_from_srgb(values[:, :3])


def _check_ply(mesh: trimesh.Trimesh, kind: str) -> None:
    """Errors: InputError for colours of a PLY that trimesh cuts to 8 bits: those of 16, and floats above 1."""
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
    return np.asarray(np.asarray(image.convert("RGB"), np.float32) / np.float32(255))


def _warn_of_transparency() -> None:
    warnings.warn("the mesh is transparent in places; surfaces are rendered opaque", stacklevel=5)
