"""Parts of a glTF file that no surface shows, by name; and extensions without which a file cannot be read."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from scenes.surfaces.gltf.container import File, Tree
from scenes.surfaces.unshown import GLOSS, METAL, NORMAL_MAPS
from spikecam_env.errors import InputError

READ = (
    *("EXT_mesh_gpu_instancing", "EXT_texture_webp", "KHR_materials_emissive_strength"),
    *("KHR_materials_pbrSpecularGlossiness", "KHR_mesh_quantization", "KHR_node_visibility", "KHR_texture_transform"),
)
REPLACED = (
    *("EXT_meshopt_compression", "KHR_meshopt_compression", "KHR_draco_mesh_compression", "KHR_texture_basisu"),
    *("EXT_texture_avif", "MSFT_texture_dds"),
)
"""Extensions beside which a file may hold the same in the core's format: that is read."""
LOOKS_ALONE = ("KHR_materials_", "KHR_lights_", "EXT_lights_", "KHR_xmp", "KHR_animation_")
"""Beginnings of extensions without which shape and base colour are still right."""


def check_required(tree: Tree) -> None:
    """Refuse a file that needs an extension that is not read."""
    for name in tree.get("extensionsRequired", []):
        if name not in READ and not str(name).startswith(LOOKS_ALONE):
            raise InputError(f"the file needs {name}, which is not read; export it without")


def note_unread(file: File) -> None:
    """Note the parts of a file that no surface shows: animations, cameras, maps, other extensions."""
    for name in ("animations", "cameras"):
        if file.tree.get(name):
            file.without(name)
    if len(file.tree.get("scenes", [])) > 1:
        file.without("further scenes")
    for material in file.tree.get("materials", []):
        for name in _of_material(material):
            file.without(name)
    for name in sorted(set(_extensions(file.tree)) - set(READ) - set(REPLACED)):
        file.without(name)


def _of_material(material: Tree) -> Iterator[str]:
    """Names of properties that matter to light, where the material states them."""
    rough = material.get("pbrMetallicRoughness", {})
    if rough.get("metallicFactor", 0) > 0 or "metallicRoughnessTexture" in rough:
        yield METAL
    if rough.get("roughnessFactor", 1) < 1 or "metallicRoughnessTexture" in rough:
        yield GLOSS
    if "normalTexture" in material:
        yield NORMAL_MAPS
    if "occlusionTexture" in material:
        yield "occlusion"


def _extensions(part: Any) -> Iterator[str]:
    """Names of all extensions that a part of the tree has."""
    parts = part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()
    for inner in parts:
        yield from _extensions(inner)
    if isinstance(part, dict) and isinstance(part.get("extensions"), dict):
        yield from part["extensions"]
