"""Your own mesh or picture: files and trimesh meshes as surfaces, checked, with the reflection that they state."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

from scenes.assembly import Albedo, Part, Points, assemble
from scenes.materials import GLTF_COLOURS, gltf_colours_kept, own_albedo
from scenes.pictures import SUFFIXES, check_size, read_picture
from scenes.renderers.protocol import Surface
from scenes.renderers.view import check_albedo, check_mesh
from scenes.textures import Texture
from scenes.transfer import grey, light_of
from spikecam_env.errors import InputError

SMALLEST, LARGEST = 1e-3, 1e6
"""Longest side of a mesh [units of the world].  trimesh takes corners less than 1e-8 apart for one, and single
precision, in which some files and OpenGL hold them, knows a place at 1e6 to 0.06."""


def from_file(
    path: str | PathLike[str], texture: str | PathLike[str] | Texture | None = None, size: float | None = None
) -> Surface:
    """A mesh file that trimesh reads (obj, stl, ply, glb, ...), with the texture given, or its own reflection.

    Its own: colours of vertices and faces, factors and pictures of materials, as grey (`scenes.materials`); 0.7 where
    it says nothing.  Several meshes in one file become one surface.

    size   of its longest side, the middle at the origin; default: as it is in the file
    Warns of transparency, and of a texture that is not there or is no picture.
    Errors: InputError where there is no such file, no triangle in it, it is damaged, or out of range (`from_mesh`).

    >>> import trimesh
    >>> written = trimesh.creation.box((1.0, 1.0, 2.0)).export("box.stl")
    >>> from_file("box.stl", size=4.0).mesh.extents.round(6).tolist()
    [2.0, 2.0, 4.0]
    """
    source = Path(path)
    if not _is_file(source):
        raise InputError(f"no mesh file {path}; give the path of an obj, stl, ply or glb file")
    kind = source.suffix[1:].lower()
    beside = Beside(str(source))
    try:
        data = source.read_bytes()
        data = gltf_colours_kept(data, kind) if kind in ("glb", "gltf") else data
        with np.errstate(all="ignore"):
            scene: Any = trimesh.load(BytesIO(data), file_type=kind, resolver=beside, force="scene", process=False)
            meshes = [m for m in scene.dump() if isinstance(m, trimesh.Trimesh) and len(m.faces)]
    except Exception as error:
        raise InputError(f"{path} cannot be read as a mesh ({error}); give an obj, stl, ply or glb file") from error
    for name, fault in beside.faults.items():
        warnings.warn(f"{path} names {name}, which {fault}; its surface is without it", stacklevel=2)
    try:
        meshes = [_merged(mesh) for mesh in _sized(meshes, size)]
        return _one_surface(meshes, texture)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def from_mesh(
    mesh: trimesh.Trimesh, texture: str | PathLike[str] | Texture | None = None, size: float | None = None
) -> Surface:
    """A trimesh mesh; without texture coordinates of its own a texture is wrapped around its vertical axis.

    Errors: InputError for a mesh without triangles or area, vertices that are not finite, faces of vertices that it
    does not have, a longest side out of 0.001 to 1e6 where no size is given, and albedo out of 0 to 1.

    >>> import trimesh
    >>> from_mesh(trimesh.creation.box((1.0, 1.0, 2.0)), size=4.0).mesh.extents.round(6).tolist()
    [2.0, 2.0, 4.0]
    """
    return _one_surface(_sized([mesh], size), texture)


def picture(path: str | PathLike[str]) -> Texture:
    """A picture file as linear grey, (h, w) float32, upright as its EXIF says.

    Whole numbers are in [0, 1], taken as sRGB unless the file states another transfer; floats are linear light as they
    are.  Errors: InputError where no picture can be read, and for transparent pixels (`scenes.pictures`).

    >>> from PIL import Image
    >>> Image.fromarray(np.full((4, 6), 255, np.uint8)).save("white.png")
    >>> light = picture("white.png")
    >>> light.shape, float(light.max())
    ((4, 6), 1.0)
    """
    if not _is_file(Path(path)):
        raise InputError(f"no picture can be read from {path}; give the path of a png, jpg or tif file")
    stored = read_picture(path)
    return grey(light_of(stored.values, stored.transfer or "srgb", str(path)), primaries=stored.primaries)


class Beside(trimesh.resolvers.FilePathResolver):
    """Files that a mesh file names, in its folder; `faults` says of each what is wrong with it."""

    def __init__(self, source: str) -> None:
        super().__init__(source)
        self.faults: dict[str, str] = {}

    def get(self, name: str) -> Any:
        """The bytes of a file; raises what trimesh expects where there are none."""
        try:
            if not Path(self.parent, name.strip()).resolve().is_relative_to(Path(self.parent).resolve()):
                raise OSError("lies outside of its folder")
            data = super().get(name)
        except Exception:
            self.faults[name] = "is not there, or not in its folder"
            raise
        if Path(name).suffix.lower() in SUFFIXES:
            try:
                with Image.open(BytesIO(data)) as image:
                    check_size(image.width, image.height, name)
                    image.verify()
            except Exception:
                self.faults[name] = "is no picture, or damaged"
                raise
        return data


def _one_surface(
    meshes: Sequence[trimesh.Trimesh],
    texture: str | PathLike[str] | Texture | None,
) -> Surface:
    """Meshes in one space as one rigid surface."""
    if texture is not None:
        return _textured(_together(meshes), _texture(texture))
    owned = [own_albedo(mesh) for mesh in meshes]
    if len(owned) == 1:
        return _textured(*owned[0])
    albedos = [albedo for _, albedo in owned]
    if all(np.ndim(albedo) == 0 and albedo == albedos[0] for albedo in albedos):
        return Surface(_together(meshes), albedos[0])
    return assemble(*(_as_part(_textured(mesh, albedo)) for mesh, albedo in owned))


def _together(meshes: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    whole: Any = meshes[0] if len(meshes) == 1 else trimesh.util.concatenate(meshes)
    return whole  # type: ignore[no-any-return]


def _textured(mesh: trimesh.Trimesh, albedo: Albedo) -> Surface:
    """With texture coordinates around its vertical axis, where it needs some and has none."""
    check_albedo(albedo, "the mesh's own albedo")
    uv = getattr(mesh.visual, "uv", None)
    if np.ndim(albedo) == 2 and (uv is None or len(uv) != len(mesh.vertices)):
        mesh.visual = trimesh.visual.TextureVisuals(uv=_around(np.asarray(mesh.vertices)))
    return Surface(mesh, albedo)


def _sized(meshes: Sequence[trimesh.Trimesh], size: float | None) -> list[trimesh.Trimesh]:
    """Copies, checked; their longest side as asked, their middle at the origin."""
    if not any(len(getattr(mesh, "faces", ())) for mesh in meshes):
        raise InputError("the mesh has no triangles; a cloud of points has no surface to render")
    if size is not None and not 0 < size < np.inf:
        raise InputError(f"size is {size}; it must be positive and finite")
    for mesh in meshes:
        check_mesh(mesh)
    meshes = [mesh.copy() for mesh in meshes]
    bounds = np.stack([mesh.bounds for mesh in meshes])
    bounds = np.stack([bounds[:, 0].min(0), bounds[:, 1].max(0)])
    longest = np.ptp(bounds, axis=0).max()
    if not 0 < longest < np.inf:
        raise InputError(f"the mesh is {longest:g} long; it must have an extent, and a finite one")
    if size is None:
        if not SMALLEST <= longest <= LARGEST:
            raise InputError(f"the mesh is {longest:g} units long, not {SMALLEST:g} to {LARGEST:g}; give its size")
        return meshes
    for mesh in meshes:
        mesh.apply_translation(-bounds.mean(0))
        mesh.apply_scale(size / longest)
    return meshes


def _merged(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """With one vertex where several lie; those with colours of their own share the normal alone."""
    if getattr(mesh.visual, "kind", None) != "vertex" and GLTF_COLOURS not in mesh.vertex_attributes:
        mesh.process()
        return mesh
    if "vertex_normals" in mesh._cache:
        return mesh
    first, place = trimesh.grouping.unique_rows(mesh.vertices)
    whole = trimesh.Trimesh(mesh.vertices[first], place[mesh.faces], process=False)
    mesh.vertex_normals = whole.vertex_normals[place]  # type: ignore[method-assign]  # a property, which caches
    return mesh


def _as_part(surface: Surface) -> Part:
    """With texture coordinates in [0, 1], as an atlas needs them."""
    mesh: Any = surface.mesh
    albedo = surface.albedo
    uv = np.zeros((len(mesh.vertices), 2))
    if np.ndim(albedo) == 2:
        uv = np.array(mesh.visual.uv, np.float64)[:, :2]
        low = np.floor(uv.min(0) + 1e-6)
        times = np.maximum(1, np.ceil(uv.max(0) - 1e-6) - low).astype(int)
        if times.max() > 1:
            tiled = np.shape(albedo) * times[::-1]
            check_size(int(tiled[1]), int(tiled[0]), f"a texture that repeats {times[0]} x {times[1]} times")
            albedo = np.tile(np.asarray(albedo), times[::-1])
        uv = (uv - low) / times
    return Part(np.asarray(mesh.vertices), np.asarray(mesh.vertex_normals), uv, np.asarray(mesh.faces), albedo)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, or with a zero in it
        return False


def _around(vertices: Points) -> Points:
    """Cylinder coordinates about y, mirrored half-way round so that there is no seam."""
    centred = vertices - vertices.mean(0)
    u = np.abs(np.arctan2(centred[:, 0], centred[:, 2])) / np.pi
    height = np.ptp(vertices[:, 1])
    return np.stack([u, (vertices[:, 1] - vertices[:, 1].min()) / (height or 1)], -1)


def _texture(texture: str | PathLike[str] | Texture) -> Texture:
    if isinstance(texture, (str, PathLike)):
        values, name = picture(texture), str(texture)
    else:
        values, name = np.asarray(texture, np.float32), "texture"
    if values.ndim != 2:
        raise InputError(f"texture has shape {values.shape}; give (h, w) linear grey in [0, 1], or a picture's path")
    check_albedo(values, name)
    return values
