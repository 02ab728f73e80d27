"""glTF files by hand, as a tree and the bytes of its tables; mesh files as surfaces, their albedo and warnings."""

from __future__ import annotations

import json
import struct
import warnings
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

from scenes.film.transfer import linear_from_srgb
from scenes.renderers.protocol import Surface
from scenes.renderers.view import geometry
from scenes.surfaces.mesh_files import from_file

COMPONENTS = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
CORNERS = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
UPRIGHT = np.float32([[0, 1], [1, 1], [1, 0], [0, 0]])
"""Coordinates with which the unit square shows a picture as it is; v points down."""
TWO_TRIANGLES = [0, 1, 2, 0, 2, 3]
GREYS = np.random.default_rng(1).permutation(np.linspace(20, 250, 16).astype(np.uint8)).reshape(4, 4)
"""A picture of 4 x 4 pixels, no two of them equal."""
LIGHT = linear_from_srgb(GREYS / np.float32(255))


class Gltf:
    """A file with one node and one mesh; `tree` is changed by the tests."""

    def __init__(self, **tree: Any) -> None:
        self.blob = b""
        self.tree: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}],
            "accessors": [],
            "bufferViews": [],
            **tree,
        }

    def view(self, data: bytes, **more: Any) -> int:
        self.blob += bytes(-len(self.blob) % 4)
        self.tree["bufferViews"].append({"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data), **more})
        self.blob += data
        return len(self.tree["bufferViews"]) - 1

    def table(self, values: Any, apart: int = 0, **more: Any) -> int:
        """An accessor of (rows, columns), with so many other bytes between two rows."""
        values = np.asarray(values)
        values = values.reshape(len(values), -1)
        rows = [row.tobytes() + b"\x5a" * apart for row in values]
        stride = {"byteStride": len(rows[0])} if apart else {}
        shape = {"componentType": COMPONENTS[values.dtype.name], "type": KINDS[values.shape[1]], "count": len(values)}
        self.tree["accessors"].append({"bufferView": self.view(b"".join(rows), **stride), **shape, **more})
        return len(self.tree["accessors"]) - 1

    def part(self, positions: Any = CORNERS, indices: Any = TWO_TRIANGLES, mesh: int = 0, **more: Any) -> dict:
        """A primitive; attributes=... are further tables by name."""
        attributes = {"POSITION": self.table(positions), **more.pop("attributes", {})}
        primitive: dict[str, Any] = {"attributes": attributes, **more}
        if indices is not None:
            primitive["indices"] = self.table(np.uint16(indices))
        self.tree["meshes"][mesh]["primitives"].append(primitive)
        return primitive

    def picture(self, pixels: Any = GREYS, form: str = "PNG", sampler: dict | None = None, **info: Any) -> dict:
        """A texture's entry in a material."""
        data = pixels if isinstance(pixels, bytes) else encoded(pixels, form)
        images = self.tree.setdefault("images", [])
        images.append({"bufferView": self.view(data), "mimeType": f"image/{form.lower()}"})
        textures = self.tree.setdefault("textures", [])
        textures.append({"source": len(images) - 1})
        if sampler is not None:
            self.tree["samplers"] = [sampler]
            textures[-1]["sampler"] = 0
        return {"index": len(textures) - 1, **info}

    def material(self, picture: dict | None = None, factor: list | None = None, **more: Any) -> int:
        rough: dict[str, Any] = {} if picture is None else {"baseColorTexture": picture}
        rough |= {} if factor is None else {"baseColorFactor": factor}
        self.tree.setdefault("materials", []).append({"pbrMetallicRoughness": rough, **more})
        return len(self.tree["materials"]) - 1

    def bytes(self) -> bytes:
        tree = {**self.tree, "buffers": [{"byteLength": len(self.blob)}, *self.tree.get("buffers", [])]}
        text = json.dumps(tree).encode()
        text += b" " * (-len(text) % 4)
        blob = self.blob + bytes(-len(self.blob) % 4)
        body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
        return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body

    def written(self, folder: Path) -> Path:
        (folder / "m.glb").write_bytes(self.bytes())
        return folder / "m.glb"


def pictured(coordinates: Any = UPRIGHT, pixels: Any = GREYS, normalized: bool = False, **info: Any) -> Gltf:
    """The unit square with a picture."""
    file = Gltf()
    sampler = info.pop("sampler", None)
    material = file.material(file.picture(pixels, sampler=sampler, **info))
    at = file.table(coordinates, normalized=normalized)
    file.part(attributes={"TEXCOORD_0": at}, material=material)
    return file


def read(path: Path, **options: object) -> Surface:
    """The surface of a file that warns of nothing."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return from_file(path, **options)  # type: ignore[arg-type]


def warning_of(path: Path) -> str:
    """The one warning, of one line, that reading a file gives."""
    with warnings.catch_warnings(record=True) as given:
        warnings.simplefilter("always")
        from_file(path)
    assert len(given) == 1 and "\n" not in str(given[0].message)
    return str(given[0].message)


def encoded(pixels: Any, form: str = "PNG") -> bytes:
    out = BytesIO()
    Image.fromarray(np.asarray(pixels)).save(out, form, **({"lossless": True} if form == "WEBP" else {}))
    return out.getvalue()


def albedo_at(surface: Surface, at: tuple[float, float, float]) -> float:
    """At a place on the surface, as a renderer has it at full fineness, without interpolation of texels."""
    shape = geometry(surface)
    triangles = shape.vertices[shape.faces]
    near = trimesh.triangles.closest_point(triangles, np.repeat([at], len(triangles), axis=0))
    face = int(np.argmin(np.linalg.norm(near - at, axis=1)))
    share = trimesh.triangles.points_to_barycentric(triangles[[face]], [at])[0]
    u, v = share @ shape.uv[shape.faces[face]]
    texture = shape.albedo.level(0)
    row, column = (int(np.floor(x % 1 * n)) for x, n in zip((1 - v, u), texture.shape, strict=True))
    return float(texture[row, column])


def seen(surface: Surface, rows: int = 4, columns: int = 4) -> np.ndarray:
    """(rows, columns) albedo of the unit square, at the middles of its cells, the upper row first."""
    return np.array(
        [
            [albedo_at(surface, ((c + 0.5) / columns, 1 - (r + 0.5) / rows, 0.0)) for c in range(columns)]
            for r in range(rows)
        ]
    )
