"""glTF files: features of the core and its usual extensions are read right, named, or refused."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from gltf_files import (
    COMPONENTS,
    CORNERS,
    GREYS,
    LIGHT,
    TWO_TRIANGLES,
    UPRIGHT,
    Gltf,
    encoded,
    pictured,
    read,
    seen,
    warning_of,
)
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenes.film.transfer import linear_from_srgb
from scenes.renderers.protocol import Surface
from scenes.surfaces.mesh_files import from_file
from spikecam_env.errors import InputError

HALF_TURN = [0.0, 0.0, 1.0, 0.0]


def area(surface: Surface) -> float:
    return float(surface.mesh.area)


# -- texture coordinates and pictures --------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["float32", "uint8", "uint16"])
@pytest.mark.parametrize("apart", [0, 4])
def test_texture_coordinates_of_any_type_lie_at_the_same_place(kind: str, apart: int, tmp_path: Path) -> None:
    file = Gltf()
    at = UPRIGHT if kind == "float32" else (UPRIGHT * np.iinfo(kind).max).astype(kind)
    coordinates = file.table(at, apart, normalized=kind != "float32")
    file.part(attributes={"TEXCOORD_0": coordinates}, material=file.material(file.picture()))
    np.testing.assert_allclose(seen(read(file.written(tmp_path))), LIGHT, rtol=1e-5)


def test_a_texture_is_at_the_set_of_coordinates_that_it_names(tmp_path: Path) -> None:
    file = Gltf()
    sets = {"TEXCOORD_0": file.table(0 * UPRIGHT), "TEXCOORD_1": file.table(UPRIGHT)}
    file.part(attributes=sets, material=file.material(file.picture(texCoord=1)))
    np.testing.assert_allclose(seen(read(file.written(tmp_path))), LIGHT, rtol=1e-5)


QUADRANT = {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5]}


@pytest.mark.parametrize(
    ("transform", "expected"),
    [
        ({"offset": [0.25, 0.5]}, np.roll(LIGHT, (-2, -1), (0, 1))),
        ({"scale": [0.5, 0.25]}, LIGHT[:1, :2].repeat(4, 0).repeat(2, 1)),
        ({"offset": [0, 1], "scale": [1, -1]}, LIGHT[::-1]),
        (QUADRANT, np.rot90(LIGHT[2:, :2], -1).repeat(2, 0).repeat(2, 1)),
    ],
    ids=["offset", "scale", "flipped", "the specification's example"],
)
def test_a_transform_moves_the_texture(transform: dict, expected: np.ndarray, tmp_path: Path) -> None:
    """The specification: `QUADRANT` shows the lower left quadrant of the picture, rotated clockwise by 90 degrees."""
    file = pictured(extensions={"KHR_texture_transform": transform})
    np.testing.assert_allclose(seen(read(file.written(tmp_path))), expected, rtol=1e-5)


def test_a_transform_may_name_another_set_of_coordinates(tmp_path: Path) -> None:
    file = Gltf()
    sets = {"TEXCOORD_0": file.table(0 * UPRIGHT), "TEXCOORD_1": file.table(UPRIGHT)}
    moved = file.picture(extensions={"KHR_texture_transform": {"texCoord": 1}})
    file.part(attributes=sets, material=file.material(moved))
    np.testing.assert_allclose(seen(read(file.written(tmp_path))), LIGHT, rtol=1e-5)


REPEATED = np.tile(LIGHT, (2, 2))
MIRRORED = np.block([[LIGHT, LIGHT[:, ::-1]], [LIGHT[::-1], LIGHT[::-1, ::-1]]])


@pytest.mark.parametrize(
    ("wrap", "expected"), [(10497, REPEATED), (33648, MIRRORED), (33071, np.pad(LIGHT, ((0, 4), (0, 4)), "edge"))]
)
@pytest.mark.parametrize("shared", [False, True])
def test_a_texture_goes_on_as_its_sampler_says(wrap: int, expected: np.ndarray, shared: bool, tmp_path: Path) -> None:
    """Alone, and in the atlas of a surface with another part."""
    file = pictured(2 * UPRIGHT, sampler={"wrapS": wrap, "wrapT": wrap})
    if shared:
        file.part(CORNERS + np.float32([0, 0, -9]), material=file.material(factor=[0.5, 0.5, 0.5, 1]))
    np.testing.assert_allclose(seen(read(file.written(tmp_path)), 8, 8), expected, rtol=1e-5)


def test_own_textures_lie_at_the_coordinates_of_the_file(tmp_path: Path) -> None:
    file = pictured(UPRIGHT * np.float32([1, 0.5]), sampler={"wrapS": 33071})
    surface = read(file.written(tmp_path), texture=LIGHT)
    np.testing.assert_allclose(seen(surface, 2, 4), LIGHT[:2], rtol=1e-5)


def test_own_textures_lie_on_every_part_at_its_coordinates(tmp_path: Path) -> None:
    """Two squares, each with the whole picture; where one has no coordinates it goes around both."""
    file = Gltf()
    for place in (0, 3):
        file.part(CORNERS + np.float32([place, 0, 0]), attributes={"TEXCOORD_0": file.table(UPRIGHT)})
    surface = read(file.written(tmp_path), texture=LIGHT)
    assert len(surface.mesh.vertices) == 2 * 6
    np.testing.assert_allclose(seen(surface), LIGHT, rtol=1e-5)
    np.testing.assert_allclose(surface.mesh.visual.uv[:6], surface.mesh.visual.uv[6:])
    del file.tree["meshes"][0]["primitives"][1]["attributes"]["TEXCOORD_0"]
    around = read(file.written(tmp_path), texture=LIGHT).mesh
    np.testing.assert_allclose(around.visual.uv[:, 1], around.vertices[:, 1], atol=1e-6)


@pytest.mark.parametrize(
    ("pixels", "form"),
    [
        (GREYS, "PNG"),
        (GREYS.astype(np.uint16) * 257, "PNG"),
        (np.stack([GREYS] * 3, -1), "PNG"),
        (np.stack([GREYS] * 3, -1), "WEBP"),
        (np.stack([GREYS, GREYS, GREYS, 0 * GREYS + 9], -1), "PNG"),
    ],
    ids=["grey", "grey of 16 bits", "colour", "WebP", "with alpha, which an opaque material does not have"],
)
def test_pictures_of_any_depth_are_srgb(pixels: np.ndarray, form: str, tmp_path: Path) -> None:
    file = Gltf()
    coordinates = file.table(UPRIGHT)
    file.part(attributes={"TEXCOORD_0": coordinates}, material=file.material(file.picture(pixels, form)))
    if form == "WEBP":
        file.tree["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}}]
    np.testing.assert_allclose(seen(read(file.written(tmp_path))), LIGHT, rtol=1e-3)


def test_files_beside_the_mesh_are_found_by_their_encoded_names(tmp_path: Path) -> None:
    """A .gltf with its bytes in `all bytes.bin` and its picture in `my wood.png`."""
    file = pictured()
    file.tree["images"] = [{"uri": "my%20wood.png"}]
    (tmp_path / "my wood.png").write_bytes(encoded(GREYS))
    (tmp_path / "all bytes.bin").write_bytes(file.blob)
    tree = {**file.tree, "buffers": [{"byteLength": len(file.blob), "uri": "all%20bytes.bin"}]}
    (tmp_path / "m.gltf").write_text(json.dumps(tree))
    np.testing.assert_allclose(seen(read(tmp_path / "m.gltf")), LIGHT, rtol=1e-5)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda file: file.tree.update(images=[{"uri": "none.png"}]), r"names none\.png, which is not there"),
        (lambda file: file.tree.update(images=[{"uri": "data:image/png;base64,aGVsbG8="}]), r"image 0 \(damaged"),
        (lambda file: file.tree["images"][0].update(bufferView=file.view(b"hello")), r"image 0 \(damaged"),
        (
            lambda file: file.tree.update(textures=[{"extensions": {"KHR_texture_basisu": {"source": 0}}}]),
            "a texture whose picture is in no known format",
        ),
        (
            lambda file: file.tree["meshes"][0]["primitives"][0]["attributes"].pop("TEXCOORD_0"),
            "a texture without coordinates",
        ),
    ],
)
def test_a_picture_that_cannot_be_shown_is_named(spoil: Callable, message: str, tmp_path: Path) -> None:
    file = pictured()
    spoil(file)
    with pytest.warns(UserWarning, match=message):
        assert from_file(file.written(tmp_path)).albedo == 0.7


def test_specular_and_glossy_materials_have_their_diffuse_colour(tmp_path: Path) -> None:
    file = pictured()
    file.tree["materials"] = [
        {
            "extensions": {
                "KHR_materials_pbrSpecularGlossiness": {
                    "diffuseFactor": [0.5, 0.5, 0.5, 1],
                    "diffuseTexture": {"index": 0},
                }
            }
        }
    ]
    np.testing.assert_allclose(seen(read(file.written(tmp_path))), LIGHT / 2, rtol=1e-5)


def test_colours_of_vertices_multiply_a_picture_of_one_colour(tmp_path: Path) -> None:
    file = pictured(pixels=np.full((2, 2), 128, np.uint8))
    shades = np.float32([[s, s, s] for s in (0.2, 0.4, 0.6, 0.8)])
    file.tree["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = file.table(shades)
    surface = read(file.written(tmp_path))
    at = [int(np.argmin(np.abs(v - CORNERS).sum(1))) for v in surface.mesh.vertices]
    np.testing.assert_allclose(surface.albedo, shades[at, 0] * float(linear_from_srgb(128 / 255)), rtol=1e-4)


# -- shapes ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "normalized"), [("int8", True), ("uint8", True), ("int16", True), ("uint16", True), ("int16", False)]
)
def test_quantised_positions_lie_where_they_are_meant(kind: str, normalized: bool, tmp_path: Path) -> None:
    """KHR_mesh_quantization: whole numbers, and a node that scales them."""
    file, full = Gltf(), np.iinfo(kind).max if normalized else 1000
    file.part(CORNERS)
    place = file.table((CORNERS * full).astype(kind), apart=-3 * np.dtype(kind).itemsize % 4, normalized=normalized)
    file.tree["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = place
    file.tree["nodes"][0]["scale"] = [2, 3, 1] if normalized else [2 / full, 3 / full, 1]
    file.tree |= {name: ["KHR_mesh_quantization"] for name in ("extensionsUsed", "extensionsRequired")}
    np.testing.assert_allclose(read(file.written(tmp_path)).mesh.bounds, [[0, 0, 0], [2, 3, 0]], atol=1e-6)


@pytest.mark.parametrize("based", [True, False])
def test_sparse_rows_replace_others(based: bool, tmp_path: Path) -> None:
    file = Gltf()
    file.part(CORNERS)
    rows, values = (0, 1, 2, 3) if not based else (2,), CORNERS if not based else np.float32([[5, 1, 0]])
    accessor = file.tree["accessors"][0]
    accessor["sparse"] = {
        "count": len(rows),
        "indices": {"bufferView": file.view(np.uint16(rows).tobytes()), "componentType": COMPONENTS["uint16"]},
        "values": {"bufferView": file.view(values.tobytes())},
    }
    if not based:
        del accessor["bufferView"]
    np.testing.assert_allclose(read(file.written(tmp_path)).mesh.bounds[1], [5 if based else 1, 1, 0])


@pytest.mark.parametrize(
    ("mode", "indices"),
    [(4, TWO_TRIANGLES), (5, [1, 2, 0, 3]), (6, [0, 1, 2, 3]), (6, None)],
    ids=["triangles", "strip", "fan", "fan without indices"],
)
def test_triangles_of_every_mode_face_the_same_way(mode: int, indices: list | None, tmp_path: Path) -> None:
    file = Gltf()
    file.part(indices=indices, mode=mode)
    surface = read(file.written(tmp_path))
    assert area(surface) == pytest.approx(1.0)
    np.testing.assert_allclose(surface.mesh.face_normals, [[0, 0, 1]] * 2)


@pytest.mark.parametrize("mode", [0, 1, 2, 3])
def test_points_and_lines_are_named(mode: int, tmp_path: Path) -> None:
    file = Gltf()
    file.part()
    file.part(indices=[0, 1], mode=mode)
    assert "m.glb has points and lines" in warning_of(file.written(tmp_path))


def test_normals_are_those_of_the_file_and_flat_without_any(tmp_path: Path) -> None:
    """A roof of two slopes."""
    roof = np.float32([[-1, 0, 0], [-1, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, 0], [1, 1, 0]])
    faces = [0, 2, 3, 0, 3, 1, 2, 4, 5, 2, 5, 3]
    for normals in (np.float32([[0, 0, 1]] * 6), None):
        file = Gltf()
        file.part(roof, faces, attributes={} if normals is None else {"NORMAL": file.table(normals)})
        for size in (None, 3.0):
            shown = read(file.written(tmp_path), size=size).mesh.vertex_normals
            if normals is None:
                np.testing.assert_allclose(np.abs(shown), [[0.5**0.5, 0, 0.5**0.5]] * 12, atol=1e-6)
            else:
                np.testing.assert_allclose(shown, normals)


@pytest.mark.parametrize("at", ["mesh", "node"])
def test_a_morphed_mesh_has_its_shape_at_rest(at: str, tmp_path: Path) -> None:
    file = Gltf()
    target = {"POSITION": file.table(np.float32([[0, 0, 0], [2, 0, 0], [2, 0, 0], [0, 0, 0]]))}
    file.part(targets=[target])
    file.tree["meshes"][0]["weights"] = [0.5 if at == "mesh" else 0.0]
    if at == "node":
        file.tree["nodes"][0]["weights"] = [0.5]
    np.testing.assert_allclose(read(file.written(tmp_path)).mesh.bounds[1], [2, 1, 0])


def test_a_skinned_mesh_stands_where_its_joints_are(tmp_path: Path) -> None:
    """The left side hangs on a joint at the origin, the right on one 3 further; its own node's scale does not count."""
    file = Gltf()
    joints = np.uint8([[0, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0]])
    weights = np.uint8([[255, 0, 0, 0]] * 4)
    tables = {"JOINTS_0": file.table(joints), "WEIGHTS_0": file.table(weights, normalized=True)}
    file.part(attributes=tables)
    bind = np.stack([np.eye(4), np.eye(4)]).astype(np.float32)
    bind[1, 3, 0] = -1.0  # by columns: 1 to the left
    file.tree["skins"] = [{"joints": [1, 2], "inverseBindMatrices": file.table(bind.reshape(2, 16))}]
    file.tree["nodes"] = [
        {"mesh": 0, "skin": 0, "scale": [100, 100, 100]},
        {"children": [2]},
        {"translation": [3, 0, 0]},
    ]
    file.tree["scenes"] = [{"nodes": [0, 1]}]
    np.testing.assert_allclose(read(file.written(tmp_path)).mesh.bounds, [[0, 0, 0], [3, 1, 0]])


# -- places ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "node",
    [
        {"translation": [5, 0, 0], "rotation": HALF_TURN, "scale": [2, 1, 1]},
        {"matrix": [-2, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]},
        {"children": [1], "translation": [5, 0, 0]},
        {"children": [1], "translation": [5, 0, 0], "camera": 0},
    ],
    ids=["TRS", "matrix", "parent", "below a camera"],
)
def test_a_mesh_is_where_its_nodes_put_it(node: dict, tmp_path: Path) -> None:
    file = Gltf()
    file.part()
    file.tree["nodes"] = [node]
    if "children" in node:
        file.tree["nodes"].append({"mesh": 0, "rotation": HALF_TURN, "scale": [2, 1, 1]})
    else:
        node["mesh"] = 0
    surface = read(file.written(tmp_path))
    np.testing.assert_allclose(surface.mesh.bounds, [[3, -1, 0], [5, 0, 0]], atol=1e-12)


@pytest.mark.parametrize("given", [True, False])
def test_a_mirrored_mesh_keeps_its_front(given: bool, tmp_path: Path) -> None:
    file = Gltf()
    file.part(attributes={"NORMAL": file.table(np.float32([[0, 0, 1]] * 4))} if given else {})
    file.tree["nodes"][0]["scale"] = [-1e-3, 1, 1]
    mesh = read(file.written(tmp_path)).mesh
    np.testing.assert_allclose(mesh.face_normals, [[0, 0, 1]] * 2)
    np.testing.assert_allclose(mesh.vertex_normals, [[0, 0, 1]] * len(mesh.vertices))


def test_instances_are_all_there(tmp_path: Path) -> None:
    file = Gltf()
    file.part()
    places = file.table(np.float32([[0, 0, 0], [5, 0, 0], [0, 5, 0]]))
    sizes = file.table(np.float32([[1, 1, 1], [2, 2, 1], [1, 1, 1]]))
    instancing = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places, "SCALE": sizes}}}
    file.tree["nodes"][0]["extensions"] = instancing
    file.tree["extensionsRequired"] = list(instancing)
    surface = read(file.written(tmp_path))
    assert area(surface) == pytest.approx(1 + 4 + 1)
    np.testing.assert_allclose(surface.mesh.bounds[1], [7, 6, 0])


@pytest.mark.parametrize(
    ("tree", "places"),
    [
        ({"scene": 1, "scenes": [{"nodes": [0]}, {"nodes": [1]}]}, [5]),
        ({"scenes": [{"nodes": [0]}, {"nodes": [1]}]}, [0]),
        ({"scenes": []}, [0, 5]),
        ({"scenes": [{"nodes": [0, 1]}]}, [0, 5]),
    ],
    ids=["the scene named", "the first", "no scenes", "both nodes"],
)
def test_the_scene_that_is_shown_is_the_one_that_the_file_names(tree: dict, places: list, tmp_path: Path) -> None:
    file = Gltf()
    file.part()
    del file.tree["scene"]
    file.tree |= {"nodes": [{"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0]}], **tree}
    if len(tree["scenes"]) > 1:
        assert "further scenes" in warning_of(file.written(tmp_path))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        surface = from_file(file.written(tmp_path))
    assert sorted({float(x) for x in surface.mesh.vertices[:, 0]}) == sorted(x + d for x in places for d in (0, 1))


def test_hidden_nodes_are_not_there(tmp_path: Path) -> None:
    file = Gltf()
    file.part()
    hidden = {"extensions": {"KHR_node_visibility": {"visible": False}}, "children": [2]}
    file.tree |= {"nodes": [{"mesh": 0}, hidden, {"mesh": 0}], "scenes": [{"nodes": [0, 1]}]}
    assert area(read(file.written(tmp_path))) == pytest.approx(1.0)


# -- light and alpha -------------------------------------------------------------------------------------------


def test_emission_of_one_colour_is_the_surfaces(tmp_path: Path) -> None:
    file = Gltf()
    strong = {"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}}
    file.part(material=file.material(factor=[0.5] * 3 + [1], emissiveFactor=[0.5, 0.5, 0.5], extensions=strong))
    surface = read(file.written(tmp_path))
    assert surface.emission == pytest.approx(2.0) and surface.albedo == pytest.approx(0.5)
    file.part(CORNERS + 2, material=file.material(factor=[0.5] * 3 + [1]))
    assert "emission of some parts" in warning_of(file.written(tmp_path))


@pytest.mark.parametrize(
    ("alpha", "mode", "visible", "warning"),
    [
        (0.3, "OPAQUE", 2.0, None),
        (0.3, "MASK", 1.0, None),
        (0.7, "MASK", 2.0, None),
        (0.0, "BLEND", 1.0, None),
        (0.3, "BLEND", 2.0, "transparency"),
        (1.0, "BLEND", 2.0, None),
        ([0, 255], "MASK", 2.0, "an alpha mask"),
        ([0, 100], "MASK", 1.0, None),
    ],
)
def test_alpha_hides_a_part_that_is_all_transparent_and_is_named_where_it_hides_some(
    alpha: float | list, mode: str, visible: float, warning: str | None, tmp_path: Path
) -> None:
    file = Gltf()
    file.part()
    if isinstance(alpha, list):
        pixels = np.full((1, 2, 4), 200, np.uint8)
        pixels[0, :, 3] = alpha
        look = file.material(file.picture(pixels), alphaMode=mode)
    else:
        look = file.material(factor=[1, 1, 1, alpha], alphaMode=mode)
    file.part(CORNERS + np.float32([3, 0, 0]), material=look, attributes={"TEXCOORD_0": file.table(UPRIGHT)})
    if warning is None:
        surface = read(file.written(tmp_path))
    else:
        with pytest.warns(UserWarning, match=f"{warning}.*drawn opaque"):
            surface = from_file(file.written(tmp_path))
    assert area(surface) == pytest.approx(visible)


# -- warnings and refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"animations": [{"channels": [], "samplers": []}]}, "animations"),
        ({"cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]}, "cameras"),
        ({"extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}}, "KHR_lights_punctual"),
        ({"materials": [{"pbrMetallicRoughness": {"metallicFactor": 1.0}}]}, "metal"),
        ({"materials": [{"pbrMetallicRoughness": {"roughnessFactor": 0.2}}]}, "gloss"),
        ({"materials": [{"normalTexture": {"index": 0}}]}, "normal maps"),
        ({"materials": [{"occlusionTexture": {"index": 0}}]}, "occlusion"),
        ({"materials": [{"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}]}, "an emissive texture"),
        *(
            ({"materials": [{"extensions": {f"KHR_materials_{name}": {}}}]}, f"KHR_materials_{name}")
            for name in ("unlit", "transmission", "clearcoat", "ior", "specular", "sheen", "volume", "iridescence")
        ),
        ({"extensions": {"KHR_materials_variants": {"variants": [{"name": "red"}]}}}, "KHR_materials_variants"),
        ({"extensions": {"VENDOR_future": {}}}, "VENDOR_future"),
        ({"materials": [{"doubleSided": True}]}, "two-sided parts (shaded by their front)"),
        ({"samplers": [{"magFilter": 9728}]}, "sharp texels (NEAREST)"),
    ],
)
def test_features_that_no_surface_shows_are_named(change: dict, name: str, tmp_path: Path) -> None:
    file = pictured(sampler={})
    for key, value in change.items():
        file.tree[key] = value
    if "materials" in change:
        file.tree["extensionsRequired"] = [key for m in change["materials"] for key in m.get("extensions", {})]
    assert f"m.glb has {name}, which its surface does not show" in warning_of(file.written(tmp_path))


def test_the_backs_of_a_closed_mesh_are_not_seen_and_not_named(tmp_path: Path) -> None:
    file = Gltf()
    cube = trimesh.creation.box()
    file.part(np.float32(cube.vertices), cube.faces.ravel(), material=file.material(doubleSided=True))
    read(file.written(tmp_path))


def test_all_of_it_is_named_in_one_line(tmp_path: Path) -> None:
    file = pictured(extensions={"VENDOR_b": {}})
    file.tree |= {"animations": [{}], "cameras": [{}], "extensions": {"VENDOR_a": {}}}
    file.tree["images"] = [{"uri": "none.png"}]
    line = warning_of(file.written(tmp_path))
    print(line)
    has, names = (
        "m.glb has animations, cameras, VENDOR_a, VENDOR_b, which its surface does not show",
        "it names none.png",
    )
    assert f"{has}; {names}, which is not there" in line


@pytest.mark.parametrize(
    "name", ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu", "VENDOR_future"]
)
def test_a_file_that_needs_an_unknown_extension_is_refused(name: str, tmp_path: Path) -> None:
    file = pictured()
    file.tree["extensionsRequired"] = [name]
    with pytest.raises(InputError, match=rf"m\.glb: the file needs {name}, which is not read; export it without"):
        from_file(file.written(tmp_path))


def test_data_beside_a_compressed_copy_are_read(tmp_path: Path) -> None:
    file = pictured()
    part, view = file.tree["meshes"][0]["primitives"][0], file.tree["bufferViews"][0]
    part["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    view["extensions"] = {"EXT_meshopt_compression": {"buffer": 0}}
    file.tree["textures"][0]["extensions"] = {"KHR_texture_basisu": {"source": 0}}
    np.testing.assert_allclose(seen(read(file.written(tmp_path))), LIGHT, rtol=1e-5)


def test_a_picture_in_an_unknown_format_beside_the_mesh_is_named(tmp_path: Path) -> None:
    file = pictured()
    file.tree["images"] = [{"uri": "wood.ktx2"}]
    (tmp_path / "wood.ktx2").write_bytes(b"hello")
    assert "has image 0 (damaged, or in no known format)" in warning_of(file.written(tmp_path))


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda f: f.tree["accessors"][1].update(count=10**12), r"10{12} rows of 3; at most"),
        (lambda f: f.tree["accessors"][1].update(count=500), "cut off or damaged"),
        (lambda f: f.tree["bufferViews"][0].update(byteLength=10**9), "bufferView 0 is of bytes 0 to"),
        (lambda f: f.tree["bufferViews"][0].update(buffer=1), "names buffers 1, and has 1"),
        (lambda f: f.tree["scenes"][0].update(nodes=[-1]), "names nodes -1, and has 1"),
        (lambda f: f.tree["nodes"][0].update(children=[0]), "node 0 is below two nodes, or below itself"),
        (lambda f: f.tree["asset"].update(version="1.0"), r"is glTF '1\.0'; version 2 is read"),
        (lambda f: f.part(indices=[0, 1, 2, 3]), "4 corners of triangles; it must be three"),
        (lambda f: f.part(indices=[0, 1, 7]), "faces name vertices 0 to 7"),
        (lambda f: f.part(attributes={"NORMAL": f.table(np.full((4, 3), np.nan, np.float32))}), "normals .* NaN"),
        (lambda f: f.part(attributes={"NORMAL": f.table(np.zeros((3, 3), np.float32))}), "rows {'NORMAL': 3}"),
        (lambda f: f.part(CORNERS + np.float32([np.inf, 0, 0])), "not finite"),
        (lambda f: f.part(material=f.material(factor=[2, 1, 1, 1])), "a material's colour is"),
        (lambda f: f.part(material=7), "names materials 7, and has 1"),
        (lambda f: f.tree.pop("asset"), "cannot be read as a mesh"),
        (lambda f: f.tree.update(nodes=[{"mesh": "0"}]), "names meshes '0', and has 1"),
    ],
)
def test_damaged_files_are_refused_in_a_line(spoil: Callable, message: str, tmp_path: Path) -> None:
    file = pictured()
    spoil(file)
    with pytest.raises(InputError, match=rf"m\.glb: .*({message})"):
        from_file(file.written(tmp_path))


def test_a_texture_that_would_fill_memory_is_refused(tmp_path: Path) -> None:
    for far, message in ((1e5, "laid out over 100000 x 100000 times its size"), (1e9, "run to 1e\\+09; they must lie")):
        file = pictured(UPRIGHT * np.float32(far), sampler={"wrapS": 33071, "wrapT": 33071})
        with pytest.raises(InputError, match=message):
            from_file(file.written(tmp_path))


MANY = settings(
    max_examples=150,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def everything() -> Gltf:
    """A square with most features of a part, another of strips, on two joints and at two instances."""
    file = pictured(extensions={"KHR_texture_transform": QUADRANT}, sampler={"wrapS": 33648, "magFilter": 9728})
    file.tree["materials"][0] |= {"alphaMode": "MASK", "emissiveFactor": [1, 1, 1], "doubleSided": True}
    tables = {
        "COLOR_0": file.table(np.full((4, 4), 90, np.uint8), normalized=True),
        "JOINTS_0": file.table(np.uint8([[0, 1, 0, 0]] * 4)),
        "WEIGHTS_0": file.table(np.float32([[0.5, 0.5, 0, 0]] * 4)),
        "NORMAL": file.table(np.float32([[0, 0, 1]] * 4)),
    }
    file.part(mode=5, attributes=tables, targets=[{"POSITION": file.table(CORNERS)}])
    places = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": file.table(CORNERS[:2])}}}
    file.tree["meshes"][0]["weights"] = [0.5]
    file.tree["skins"] = [{"joints": [1, 2], "inverseBindMatrices": file.table(np.float32([np.eye(4).ravel()] * 2))}]
    file.tree["nodes"] = [{"mesh": 0, "skin": 0}, {"children": [2]}, {"mesh": 0, "extensions": places}]
    file.tree["scenes"] = [{"nodes": [0, 1]}]
    file.tree = deepcopy(file.tree)
    return file


def read_or_refused(path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        try:
            from_file(path)
        except InputError as error:
            assert path.name in str(error) and "\n" not in str(error) and len(str(error)) < 500 + len(str(path))


def test_any_bytes_in_a_file_are_read_or_refused(tmp_path: Path) -> None:
    whole = everything().bytes()

    @MANY
    @given(st.integers(0, len(whole) - 1), st.binary(min_size=1, max_size=3), st.integers(0, 4))
    def check(at: int, put: bytes, cut: int) -> None:
        (tmp_path / "m.glb").write_bytes(whole[:at] + put + whole[at + cut :])
        read_or_refused(tmp_path / "m.glb")

    check()


def places_in(part: object, at: tuple = ()) -> list[tuple]:
    inner = part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ()
    return [place for key, value in inner for place in ((*at, key), *places_in(value, (*at, key)))]


ODD = (None, True, -1, 0, 1, 7, 10**9, 10**400, 0.5, float("nan"), 1e308, "", "x", [], {}, [1], [0, 0, 0], 33071, 5125)


def test_any_value_in_a_tree_is_read_or_refused(tmp_path: Path) -> None:
    places = places_in(everything().tree)

    @settings(MANY, max_examples=40)  # most values leave a file that is read to its end
    @given(st.sampled_from(places), st.sampled_from(ODD))
    def check(place: tuple, value: object) -> None:
        file = everything()
        part: Any = file.tree
        for key in place[:-1]:
            part = part[key]
        part[place[-1]] = deepcopy(value)
        read_or_refused(file.written(tmp_path))

    check()
