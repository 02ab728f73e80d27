"""Your own mesh or picture: files and trimesh meshes as surfaces, checked, with the reflection that they state."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

from scenes.film.pictures import SUFFIXES, check_size, read_picture
from scenes.film.transfer import grey, light_of
from scenes.renderers.protocol import Surface
from scenes.renderers.view import check_albedo, check_mesh
from scenes.surfaces.assembly import Albedo, Part, Points, assemble, joined
from scenes.surfaces.gltf import KINDS, MeshPart, read_gltf
from scenes.surfaces.materials import UNSTATED_ALBEDO, own_albedo
from scenes.surfaces.mesh_properties import unread_properties
from scenes.surfaces.wavefront import materials_used, plain_mtl, plain_obj
from scenes.surfaces.wrapping import unrolled
from scenes.textures import Texture
from spikecam_env.errors import InputError

ARCHIVES = ("zip", "gz", "bz2", "tar")
"""Endings of files in which trimesh would look for meshes."""
MOST_WORDS = 200
"""Characters of another library's error in ours."""
SMALLEST, LARGEST = 1e-3, 1e6
"""Longest side of a mesh [units of the world].  trimesh takes corners less than 1e-8 apart for one, and single
precision, in which some files and OpenGL hold them, knows a place at 1e6 to 0.06."""


def from_file(
    path: str | PathLike[str], texture: str | PathLike[str] | Texture | None = None, size: float | None = None
) -> Surface:
    """A mesh file (obj, stl, ply, glb, ...), with the texture given, or its own reflection.

    Its own: colours of vertices and faces, factors and pictures of materials, as grey; 0.7 where it says nothing.
    Several meshes in one file become one surface.  One warning names the parts of the file that it does not show.

    Args:
        path: a glTF file, or of a format that trimesh reads.
        texture: (h, w) linear grey in [0, 1], or a picture's path; default: the file's own.
        size: of its longest side, the middle at the origin; default: as it is in the file.

    Returns:
        The file's mesh with its albedo, and its emission where that is the same all over.

    Raises:
        InputError: there is no such file or no triangle in it, it is damaged, out of range (`from_mesh`), or needs a
            glTF extension that is not read.

    Example:
        >>> import trimesh
        >>> written = trimesh.creation.box((1.0, 1.0, 2.0)).export("box.stl")
        >>> from_file("box.stl", size=4.0).mesh.extents.round(6).tolist()
        [2.0, 2.0, 4.0]
    """
    source = Path(path)
    if not _is_file(source):
        raise InputError(f"no mesh file {path}; give the path of an obj, stl, ply or glb file")
    beside, unread = NeighbourFiles(str(source)), dict[str, None]()
    try:
        pieces = _sized(_pieces(source, beside, unread, texture is None), size)
        surface = _one_surface([_merged(piece) for piece in pieces], texture, unread)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    lacks = [_unshown(unread)] if unread else []
    lacks += [f"names {name}, which {fault}; its surface is without it" for name, fault in beside.faults.items()]
    if lacks:
        warnings.warn(f"{path} {'; it '.join(lacks)}", stacklevel=2)
    return surface


def from_mesh(
    mesh: trimesh.Trimesh, texture: str | PathLike[str] | Texture | None = None, size: float | None = None
) -> Surface:
    """A trimesh mesh; without texture coordinates of its own a texture is wrapped around its vertical axis.

    Normals that were given to the mesh are kept.  A warning names parts of its material that the surface does not show.

    Args:
        mesh: with faces; it is copied.
        texture: (h, w) linear grey in [0, 1], or a picture's path; default: the mesh's own.
        size: of its longest side, the middle at the origin; default: as it is.

    Raises:
        InputError: the mesh has no triangles or no area, vertices that are not finite, or faces of vertices that it
            does not have.  Its longest side is out of 0.001 to 1e6 where no size is given, or albedo is out of 0 to 1.

    Example:
        >>> import trimesh
        >>> from_mesh(trimesh.creation.box((1.0, 1.0, 2.0)), size=4.0).mesh.extents.round(6).tolist()
        [2.0, 2.0, 4.0]
    """
    unread = dict[str, None]()
    surface = _one_surface(_sized([MeshPart(mesh)], size), texture, unread)
    if unread:
        warnings.warn(f"the mesh {_unshown(unread)}", stacklevel=2)
    return surface


def picture(path: str | PathLike[str]) -> Texture:
    """A picture file as linear grey, (h, w) float32, upright as its EXIF says.

    Whole numbers are in [0, 1], taken as sRGB unless the file states another transfer; floats are linear light as they
    are.

    Raises:
        InputError: no picture can be read, or pixels are transparent.

    Example:
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


class NeighbourFiles(trimesh.resolvers.FilePathResolver):
    """Files that a mesh file names, in its folder.

    Args:
        faults: the fault of each file.
        materials: names of those that its material libraries (MTL) have.
    """

    def __init__(self, source: str) -> None:
        super().__init__(source)
        self.faults: dict[str, str] = {}
        self.materials: set[str] = set()

    def get(self, name: str) -> Any:
        """The bytes of a file; a missing one raises the error that trimesh expects."""
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
        if Path(name).suffix.lower() == ".mtl":
            data, names = plain_mtl(data)
            self.materials |= names
        return data


def _pieces(source: Path, beside: NeighbourFiles, unread: dict[str, None], own: bool) -> list[MeshPart]:
    """The meshes of a file; their albedos where it is a glTF file, which has them in its own way.

    Raises:
        InputError: it cannot be read.
    """
    kind = source.suffix[1:].lower()
    try:
        data = source.read_bytes()
        with np.errstate(all="ignore"):
            if kind in KINDS:
                pieces, names = read_gltf(data, beside.get, own)
                unread.update(dict.fromkeys(names))
                return pieces
            return [MeshPart(mesh) for mesh in _by_trimesh(kind, data, beside, unread)]
    except InputError:
        raise
    except Exception as error:  # the many ways in which a damaged mesh fails
        why = " ".join(str(error).split())[:MOST_WORDS]
        raise InputError(f"it cannot be read as a mesh ({why}); give an obj, stl, ply or glb file") from error


def _by_trimesh(kind: str, data: bytes, beside: NeighbourFiles, unread: dict[str, None]) -> list[trimesh.Trimesh]:
    """The meshes of a file that is no glTF; adds the parts that they do not show to `unread`."""
    if kind in ARCHIVES:
        raise InputError("it is an archive; unpack it, and give the mesh file in it")
    if kind == "obj":
        data, names = plain_obj(data)
        unread.update(dict.fromkeys(names))
    scene: Any = trimesh.load(BytesIO(data), file_type=kind, resolver=beside, force="scene", process=False)
    meshes = list(_placed(scene))
    unread.update(dict.fromkeys(unread_properties(kind, data, meshes)))
    if kind == "obj" and beside.materials:
        absent = sorted(materials_used(data) - beside.materials)
        unread.update({f"the material {name}, which its library does not have": None for name in absent})
    return meshes


def _placed(scene: trimesh.Scene) -> Iterator[trimesh.Trimesh]:
    """The meshes of a scene where they are; unlike those of `Scene.dump` they keep the normals that they were given."""
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        mesh: Any = scene.geometry[name]
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            yield mesh.copy(include_cache=True).apply_transform(transform)


def _one_surface(
    pieces: Sequence[MeshPart], texture: str | PathLike[str] | Texture | None, unread: dict[str, None]
) -> Surface:
    """Meshes in one space as one rigid surface; adds the parts that it does not show to `unread`."""
    emissions = {piece.emission for piece in pieces}
    if len(emissions) > 1:
        unread["emission of some parts"] = None
    emission = emissions.pop() if len(emissions) == 1 else 0.0
    return replace(_reflecting(pieces, texture, unread), emission=emission)


def _reflecting(
    pieces: Sequence[MeshPart], texture: str | PathLike[str] | Texture | None, unread: dict[str, None]
) -> Surface:
    if texture is not None:
        return _textured(_together([piece.mesh for piece in pieces]), _texture(texture))
    owned = [
        own_albedo(piece.mesh, unread.setdefault) if piece.albedo is None else (piece.mesh, piece.albedo)
        for piece in pieces
    ]
    if len(owned) == 1:
        return _textured(*owned[0])
    albedos = [albedo for _, albedo in owned]
    if all(np.ndim(albedo) == 0 and albedo == albedos[0] for albedo in albedos):
        return Surface(_together([mesh for mesh, _ in owned]), albedos[0])
    return assemble(*(_as_part(_textured(mesh, albedo)) for mesh, albedo in owned))


def _together(meshes: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """As one; with texture coordinates where all of them have some, unchanged (trimesh would pack them)."""
    if len(meshes) == 1:
        return meshes[0]
    parts = [_as_part(Surface(mesh, UNSTATED_ALBEDO)) for mesh in meshes]
    given = [uv for mesh in meshes if (uv := _coordinates(mesh)) is not None]
    have_all = len(given) == len(meshes)
    whole = joined(parts, given if have_all else [part.uv for part in parts], UNSTATED_ALBEDO)
    mesh = trimesh.Trimesh(whole.vertices, whole.faces, vertex_normals=whole.normals, process=False)
    if have_all:
        mesh.visual = trimesh.visual.TextureVisuals(uv=whole.uv)
    return mesh


def _coordinates(mesh: trimesh.Trimesh) -> Points | None:
    """(V, 2) of a mesh that has texture coordinates."""
    uv = getattr(mesh.visual, "uv", None)
    return None if uv is None or len(uv) != len(mesh.vertices) else np.array(uv, np.float64)[:, :2]


def _textured(mesh: trimesh.Trimesh, albedo: Albedo) -> Surface:
    """With texture coordinates around its vertical axis, where it needs some and has none."""
    check_albedo(albedo, "the mesh's own albedo")
    if np.ndim(albedo) == 2 and _coordinates(mesh) is None:
        mesh.visual = trimesh.visual.TextureVisuals(uv=_around(np.asarray(mesh.vertices)))
    return Surface(mesh, albedo)


def _sized(pieces: Sequence[MeshPart], size: float | None) -> list[MeshPart]:
    """Checked copies with the longest side given, the middle at the origin."""
    if not any(len(getattr(piece.mesh, "faces", ())) for piece in pieces):
        raise InputError("the mesh has no triangles; a cloud of points has no surface to render")
    if size is not None and not 0 < size < np.inf:
        raise InputError(f"size is {size}; it must be positive and finite")
    for piece in pieces:
        check_mesh(piece.mesh)
    pieces = [replace(piece, mesh=piece.mesh.copy(include_cache=True)) for piece in pieces]
    bounds = np.stack([piece.mesh.bounds for piece in pieces])
    bounds = np.stack([bounds[:, 0].min(0), bounds[:, 1].max(0)])
    longest = np.ptp(bounds, axis=0).max()
    if not 0 < longest < np.inf:
        raise InputError(f"the mesh is {longest:g} long; it must have an extent, and a finite one")
    if size is None:
        if not SMALLEST <= longest <= LARGEST:
            raise InputError(f"the mesh is {longest:g} units long, not {SMALLEST:g} to {LARGEST:g}; give its size")
        return pieces
    for piece in pieces:
        piece.mesh.apply_translation(-bounds.mean(0))
        piece.mesh.apply_scale(size / longest)
    return pieces


def _merged(piece: MeshPart) -> MeshPart:
    """With one vertex where several lie, and so smooth normals; meshes keep normals of their own.

    Vertices that have colours of their own share the normal alone.
    """
    mesh = piece.mesh
    if piece.albedo is not None or _has_normals(mesh):
        return piece
    if getattr(mesh.visual, "kind", None) != "vertex":
        mesh.process()
        return piece
    first, place = trimesh.grouping.unique_rows(mesh.vertices)
    whole = trimesh.Trimesh(mesh.vertices[first], place[mesh.faces], process=False)
    mesh.vertex_normals = whole.vertex_normals[place]  # type: ignore[method-assign]  # a property, which caches
    return piece


def _has_normals(mesh: trimesh.Trimesh) -> bool:
    """Whether it was given normals that have a direction; others are dropped."""
    cache: Any = mesh._cache.cache
    given = cache.get("vertex_normals")
    if given is None:
        return False
    lengths = np.linalg.norm(given, axis=1)
    if not (np.isfinite(lengths).all() and lengths.all()):
        del cache["vertex_normals"]
        return False
    mesh.vertex_normals = given / lengths[:, None]  # type: ignore[method-assign]
    return True


def _as_part(surface: Surface) -> Part:
    """With texture coordinates in [0, 1], as an atlas needs them."""
    mesh: Any = surface.mesh
    albedo = surface.albedo
    uv = np.zeros((len(mesh.vertices), 2))
    if np.ndim(albedo) == 2:
        albedo, uv = unrolled(np.asarray(albedo), np.array(mesh.visual.uv, np.float64)[:, :2])
    return Part(np.asarray(mesh.vertices), np.asarray(mesh.vertex_normals), uv, np.asarray(mesh.faces), albedo)


def _unshown(unread: dict[str, None]) -> str:
    return f"has {', '.join(unread)}, which its surface does not show"


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
