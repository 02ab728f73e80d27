"""glTF 2.0: meshes of a .glb or .gltf file as triangles in space with their albedo.

    tree and bytes (container) -> arrays (accessors) -> places of meshes (nodes) -> triangles (shapes)
    materials, pictures, coordinates -> albedo (looks);  names of the rest of the file (unread)

Source: the glTF 2.0 specification, Khronos 2021, and its registry of extensions.
"""

from scenes.surfaces.gltf.reading import MeshPart, read_gltf

KINDS = ("glb", "gltf")
"""Endings of files, without the dot."""

__all__ = ["KINDS", "MeshPart", "read_gltf"]
