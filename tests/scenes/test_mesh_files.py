"""Mesh files of users: their colours and materials are albedo, and files without a surface are refused by name."""

from __future__ import annotations

import struct
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from gltf_files import CORNERS, Gltf, albedo_at, read
from PIL import Image
from trimesh.visual import ColorVisuals, TextureVisuals
from trimesh.visual.material import PBRMaterial

from scenes.film.transfer import grey, linear_from_srgb
from scenes.renderers.protocol import Surface
from scenes.renderers.view import geometry
from scenes.surfaces.mesh_files import from_file, from_mesh, picture
from scenes.world import World
from spikecam_env.errors import InputError

RNG = np.random.default_rng(0)
COLOURS = RNG.integers(0, 256, (8, 3)).astype(np.uint8)


def box(**visual: object) -> trimesh.Trimesh:
    mesh = trimesh.creation.box()
    if visual:
        mesh.visual = ColorVisuals(mesh, **visual)
    return mesh


def luminance(rgb: np.ndarray, of_srgb: bool = True) -> np.ndarray:
    light = linear_from_srgb(rgb / 255) if of_srgb else np.float32(rgb / 255)
    return grey(light[None])[0]


def corners(surface: Surface) -> np.ndarray:
    """Albedo at every vertex."""
    assert np.shape(surface.albedo) == (len(surface.mesh.vertices),)
    return np.asarray(surface.albedo)


# -- reflection ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", ["ply", "obj", "glb"])
def test_colours_of_vertices_are_albedo(ending: str, tmp_path: Path) -> None:
    """sRGB in PLY and OBJ, linear in glTF."""
    box(vertex_colors=COLOURS).export(tmp_path / f"m.{ending}")
    surface = from_file(tmp_path / f"m.{ending}")
    mesh = box()
    at = [int(np.argmin(np.abs(mesh.vertices - v).sum(1))) for v in surface.mesh.vertices]
    np.testing.assert_allclose(corners(surface), luminance(COLOURS, ending != "glb")[at], atol=2e-3)


def test_colours_break_where_two_vertices_share_a_place(tmp_path: Path) -> None:
    places = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    colours = np.repeat([[255, 0, 0], [0, 255, 0]], 3, axis=0).astype(np.uint8)
    trimesh.Trimesh(places, [[0, 1, 2], [3, 4, 5]], vertex_colors=colours, process=False).export(tmp_path / "m.ply")
    surface = from_file(tmp_path / "m.ply")
    np.testing.assert_allclose(np.sort(corners(surface)), [0.2126] * 3 + [0.7152] * 3, atol=1e-3)
    np.testing.assert_allclose(surface.mesh.vertex_normals, [[0, 0, 1]] * 6, atol=1e-6)


def test_colours_of_faces_are_albedo_and_normals_stay_smooth(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(2)
    colours = RNG.integers(0, 256, (len(ball.faces), 3)).astype(np.uint8)
    ball.visual = ColorVisuals(ball, face_colors=colours)
    ball.export(tmp_path / "m.ply")
    surface = from_file(tmp_path / "m.ply")
    np.testing.assert_allclose(corners(surface).reshape(-1, 3)[:, 0], luminance(colours), atol=2e-3)
    outward = np.einsum("vk,vk->v", surface.mesh.vertex_normals, surface.mesh.vertices)
    assert outward.min() > 0.99 and geometry(surface).closed


def test_the_factor_of_a_material_is_linear(tmp_path: Path) -> None:
    mesh = box()
    mesh.visual = TextureVisuals(material=PBRMaterial(baseColorFactor=[0.5, 0.25, 1.0, 1.0]))
    mesh.export(tmp_path / "m.glb")
    expected = 0.2126 * 0.5 + 0.7152 * 0.25 + 0.0722
    assert from_file(tmp_path / "m.glb").albedo == pytest.approx(expected, abs=3e-3)


def test_a_factor_multiplies_a_texture(tmp_path: Path) -> None:
    mesh = box()
    image = Image.fromarray(np.full((4, 4, 3), 128, np.uint8))
    mesh.visual = TextureVisuals(RNG.random((8, 2)), PBRMaterial(baseColorFactor=[0.5] * 3, baseColorTexture=image))
    mesh.export(tmp_path / "m.glb")
    albedo = from_file(tmp_path / "m.glb").albedo
    np.testing.assert_allclose(albedo, 0.5 * float(linear_from_srgb(128 / 255)), rtol=0.01)


def test_a_texture_is_multiplied_by_one_colour_of_all_vertices_and_hides_several(tmp_path: Path) -> None:
    mesh = box()
    image = Image.fromarray(np.uint8([[[255] * 3, [0] * 3]] * 2))
    mesh.visual = TextureVisuals(RNG.random((8, 2)), PBRMaterial(baseColorTexture=image))
    for colours, white in ((np.full((8, 4), 102, np.uint8), 0.4), (RNG.integers(0, 256, (8, 4)), 1.0)):
        colours[:, 3] = 255
        mesh.visual.vertex_attributes["color"] = colours.astype(np.uint8)
        mesh.export(tmp_path / "m.glb")
        with warnings.catch_warnings(record=True) as given:
            warnings.simplefilter("always")
            np.testing.assert_allclose(from_file(tmp_path / "m.glb").albedo, [[white, 0.0]] * 2, rtol=1e-3)
        assert len(given) == (white == 1.0)
        assert all("m.glb has colours of vertices beside a texture" in str(w.message) for w in given)


def coloured(folder: Path, colours: np.ndarray, factor: list[float] | None = None) -> Path:
    """A triangle with COLOR_0 of any type that glTF allows, and a material's factor."""
    file = Gltf()
    tables = {"COLOR_0": file.table(colours, normalized=colours.dtype != np.float32)}
    file.part(CORNERS[:3], [0, 1, 2], attributes=tables, material=file.material(factor=factor))
    return file.written(folder)


@pytest.mark.parametrize("factor", [None, [0.5, 0.5, 0.5, 1.0]])
@pytest.mark.parametrize("kind", ["float32", "uint8", "uint16"])
def test_colours_of_gltf_are_linear_at_their_depth_and_times_the_factor(
    kind: str, factor: list[float] | None, tmp_path: Path
) -> None:
    """Half of 16 bits is 0x8000, whose lower 8 bits are 0."""
    light = np.repeat(np.float32([0.2, 0.50001, 1.0])[:, None], 4, 1)
    light[:, 3] = 1
    full = 1 if kind == "float32" else np.iinfo(kind).max
    path = coloured(tmp_path, (light * full).round(0 if full > 1 else 8).astype(kind), factor)
    expected = light[:, 0] * (1 if factor is None else 0.5)
    np.testing.assert_allclose(corners(from_file(path)), expected, atol=3e-3)


@pytest.mark.parametrize(("kind", "value"), [("float32", np.nan), ("float32", 2.0), ("float32", -1.0)])
def test_colours_of_gltf_out_of_range_are_refused(kind: str, value: float, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"m\.glb: colours run from"):
        from_file(coloured(tmp_path, np.full((3, 3), value, kind)))


@pytest.mark.parametrize(
    ("kind", "values", "albedo"),
    [
        ("uchar", (51, 128, 255), None),
        ("float", (0.2, 0.502, 1.0), None),
        ("ushort", (13107, 32768, 65535), "uint16"),
        ("float", (51, 128, 255), "float"),
    ],
)
def test_colours_of_a_ply_are_of_8_bits_or_floats(kind: str, values: tuple, albedo: str | None, tmp_path: Path) -> None:
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    head += "".join(f"property {kind} {name}\n" for name in ("red", "green", "blue"))
    head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    lines = [f"{place} {v} {v} {v}\n" for place, v in zip(("0 0 0", "1 0 0", "0 1 0"), values, strict=True)]
    (tmp_path / "m.ply").write_text(head + "".join(lines) + "3 0 1 2\n")
    if albedo is not None:
        with pytest.raises(InputError, match=rf"m\.ply: colours \({albedo}.*uchar, or floats"):
            from_file(tmp_path / "m.ply")
    else:
        expected = linear_from_srgb(np.float32([51, 128, 255]) / 255)
        np.testing.assert_allclose(corners(from_file(tmp_path / "m.ply")), expected, atol=2e-3)


MTL = "newmtl a\nKd 0.2 0.4 0.6\nnewmtl b\nmap_Kd wood.png\nnewmtl c\nKd 0.5 0.5 0.5\n"
OBJ = (
    "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 2 0\nvt 0 1\n"
    "usemtl a\nf 1 3 2\nusemtl b\nf 1/1 2/2 4/3\nusemtl c\nf 2 3 4\n"
)


def test_materials_of_an_obj_are_told_apart(tmp_path: Path) -> None:
    """Factors, and a texture that repeats twice along u: dark in the left half, bright in the right."""
    (tmp_path / "m.mtl").write_text(MTL)
    (tmp_path / "m.obj").write_text(OBJ)
    wood = np.repeat(np.uint8([[50, 200]]).repeat(8, 1), 8, 0)
    Image.fromarray(wood).save(tmp_path / "wood.png")
    surface = from_file(tmp_path / "m.obj")
    dark, bright = linear_from_srgb(np.float32([50, 200]) / 255)
    assert albedo_at(surface, (0.3, 0.3, 0)) == pytest.approx(0.2126 * 0.2 + 0.7152 * 0.4 + 0.0722 * 0.6, abs=3e-3)
    assert albedo_at(surface, (1 / 3, 1 / 3, 1 / 3)) == pytest.approx(0.5, abs=3e-3)
    for x, albedo in ((0.1, dark), (0.35, bright), (0.6, dark), (0.9, bright)):
        assert albedo_at(surface, (x, 0, 0.05)) == pytest.approx(albedo, rel=1e-3)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda folder: (folder / "wood.png").unlink(), r"names wood\.png, which is not there"),
        (lambda folder: (folder / "wood.png").write_text("hello"), r"wood\.png, which is no picture"),
        (lambda folder: (folder / "m.mtl").unlink(), r"names m\.mtl, which is not there"),
        (
            lambda folder: (folder / "m.mtl").write_text(MTL.replace("wood.png", "../secret.png")),
            r"names \.\./secret\.png, which is not there, or not in its folder",
        ),
    ],
)
def test_a_texture_that_is_not_there_is_named(spoil: Callable[[Path], object], message: str, tmp_path: Path) -> None:
    folder = tmp_path / "mesh"
    folder.mkdir()
    for name, text in (("m.mtl", MTL), ("m.obj", OBJ)):
        (folder / name).write_text(text)
    for place in (folder / "wood.png", tmp_path / "secret.png"):
        Image.fromarray(np.full((4, 4), 9, np.uint8)).save(place)
    spoil(folder)
    with pytest.warns(UserWarning, match=message):
        from_file(folder / "m.obj")


def test_several_coloured_meshes_become_one_surface(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    for i, colour in enumerate(([255, 0, 0], [0, 255, 0], [0, 0, 255])):
        scene.add_geometry(
            box(vertex_colors=[colour] * 8), transform=trimesh.transformations.translation_matrix([3 * i, 0, 0])
        )
    scene.export(tmp_path / "m.glb")
    surface = from_file(tmp_path / "m.glb", size=7.0)
    assert surface.mesh.bounds[1, 0] == pytest.approx(3.5)
    for x, albedo in ((-3, 0.2126), (0, 0.7152), (3, 0.0722)):
        assert albedo_at(surface, (x, 0.1, 0.5)) == pytest.approx(albedo, abs=0.01)


def test_colours_of_vertices_and_pictures_go_together(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    scene.add_geometry(box(vertex_colors=[[0, 255, 0]] * 8))
    wood = box()
    image = Image.fromarray(np.full((8, 8), 128, np.uint8))
    wood.visual = TextureVisuals(RNG.random((8, 2)), PBRMaterial(baseColorTexture=image))
    scene.add_geometry(wood, transform=trimesh.transformations.translation_matrix([3, 0, 0]))
    scene.export(tmp_path / "m.glb")
    surface = from_file(tmp_path / "m.glb")
    assert albedo_at(surface, (0.1, 0.2, 0.5)) == pytest.approx(0.7152, abs=0.04)
    assert albedo_at(surface, (3.1, 0.2, 0.5)) == pytest.approx(float(linear_from_srgb(128 / 255)), abs=1e-3)


def test_transparency_is_said(tmp_path: Path) -> None:
    box(vertex_colors=[[9, 9, 9, 100]] * 8).export(tmp_path / "m.ply")
    with pytest.warns(UserWarning, match="opaque"):
        from_file(tmp_path / "m.ply")


def test_a_mesh_that_says_nothing_is_light_grey(tmp_path: Path) -> None:
    box().export(tmp_path / "m.stl")
    assert read(tmp_path / "m.stl").albedo == 0.7


# -- shapes ----------------------------------------------------------------------------------------------------


def ply(vertices: list[list[float]], faces: list[list[int]]) -> str:
    """An ASCII PLY."""
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
    )
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    lines = [" ".join(map(str, v)) for v in vertices] + [" ".join(map(str, [len(f), *f])) for f in faces]
    return head + "\n".join(lines) + "\n"


TRIANGLE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        ([[0, 0, float("nan")], *TRIANGLE[1:]], [[0, 1, 2]], "1 vertices are not finite, the first is 0"),
        ([[0, 0, float("inf")], *TRIANGLE[1:]], [[0, 1, 2]], "not finite"),
        (TRIANGLE, [[0, 1, 7]], "faces name vertices 0 to 7|cannot be read"),
        (TRIANGLE, [[0, 1, -1]], "faces name vertices -1 to 1|cannot be read"),
        (TRIANGLE, [[0, 1, 1], [2, 2, 2]], "no area"),
        ([[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0, 1, 2]], "no area"),
        ([[0, 0, 0]] * 3, [[0, 1, 2]], "no area"),
        (TRIANGLE, [], "no triangles"),
        ([[1e-9 * x for x in v] for v in TRIANGLE], [[0, 1, 2]], "1e-09 units long.*give its size"),
        ([[1e30 * x for x in v] for v in TRIANGLE], [[0, 1, 2]], "1e\\+30 units long.*give its size"),
    ],
)
def test_a_mesh_without_surface_is_refused_by_name(vertices: list, faces: list, message: str, tmp_path: Path) -> None:
    (tmp_path / "m.ply").write_text(ply(vertices, faces))
    with pytest.raises(InputError, match=rf"m\.ply.*({message})"):
        from_file(tmp_path / "m.ply")


@pytest.mark.parametrize("scale", [1e-30, 1e-9, 1.0, 1e9, 1e30])
def test_any_unit_serves_where_a_size_is_given(scale: float, tmp_path: Path) -> None:
    (tmp_path / "m.obj").write_text(
        "".join(f"v {' '.join(repr(scale * x) for x in v)}\n" for v in TRIANGLE) + "f 1 2 3\n"
    )
    surface = from_file(tmp_path / "m.obj", size=2.0)
    np.testing.assert_allclose(np.ptp(surface.mesh.vertices, axis=0), [2, 2, 0], rtol=1e-9)
    np.testing.assert_allclose(np.abs(surface.mesh.vertex_normals[:, 2]), 1)
    geometry(surface)


@pytest.mark.parametrize("size", [0.0, -1.0, float("nan"), float("inf")])
def test_a_size_is_positive(size: float) -> None:
    with pytest.raises(InputError, match="size is"):
        from_mesh(box(), size=size)


@pytest.mark.parametrize(
    "content", [b"", b"ply\n", b"hello world", b"\x00" * 100, b"glTF\x02\x00\x00\x00\xff\xff\xff\x7f"]
)
@pytest.mark.parametrize("ending", ["ply", "obj", "stl", "glb", "off", "xyzzy", "zip"])
def test_a_file_without_mesh_is_refused(content: bytes, ending: str, tmp_path: Path) -> None:
    (tmp_path / f"m.{ending}").write_bytes(content)
    with pytest.raises(InputError, match=r"m\."):
        from_file(tmp_path / f"m.{ending}")


def test_a_cloud_of_points_is_refused(tmp_path: Path) -> None:
    trimesh.PointCloud(RNG.random((9, 3))).export(tmp_path / "m.ply")
    with pytest.raises(InputError, match="a cloud of points has no surface"):
        from_file(tmp_path / "m.ply")


def made_by_hand(**change: object) -> Surface:
    mesh = box()
    for name, value in change.items():
        if name != "albedo":
            setattr(mesh, name, value)
    return Surface(mesh, change.get("albedo", 0.5))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"albedo": 1.2}, "albedo runs from 1.2 to 1.2; a surface reflects 0 to 1"),
        ({"albedo": -0.1}, "albedo runs"),
        ({"albedo": np.full(8, 1.5)}, "albedo runs from 1.5"),
        ({"albedo": np.full(7, 0.5)}, "one for each of the 8 vertices"),
        ({"albedo": np.full((2, 2, 3), 0.5)}, "albedo has shape"),
        ({"albedo": np.full((4, 4), 1.5, np.float32)}, "albedo runs"),
        ({"vertices": np.full((8, 3), np.nan)}, "8 vertices are not finite"),
        ({"faces": np.array([[0, 1, 99]])}, "faces name vertices 0 to 99"),
    ],
)
def test_surfaces_made_by_hand_are_checked_before_they_are_drawn(change: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        geometry(made_by_hand(**change))


def test_float_textures_above_one_and_backgrounds_below_zero_are_refused() -> None:
    with pytest.raises(InputError, match=r"texture runs from 0 to 1\.5"):
        from_mesh(box(), np.float32([[0.0, 1.5]]))
    with pytest.raises(InputError, match="texture runs from nan"):
        from_mesh(box(), np.float32([[0.0, np.nan]]))
    for background in (-1.0, float("nan"), np.full((2, 2), np.nan, np.float32), np.zeros((0, 2), np.float32)):
        with pytest.raises(InputError, match="background"):
            World((8, 8), (), background=background)


# -- pictures --------------------------------------------------------------------------------------------------

HALF = np.float32(linear_from_srgb(128 / 255))


def saved(folder: Path, name: str, image: Image.Image, **options: object) -> Path:
    image.save(folder / name, **options)
    return folder / name


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_picture_stands_as_its_exif_says(orientation: int, tmp_path: Path) -> None:
    values = np.zeros((8, 16), np.uint8)
    values[:4, :4] = 255
    exif = Image.Exif()
    exif[0x0112] = orientation
    path = saved(tmp_path, "p.png", Image.fromarray(values), exif=exif)
    with Image.open(path) as image:
        from PIL import ImageOps

        expected = np.asarray(ImageOps.exif_transpose(image)) > 128
    np.testing.assert_array_equal(picture(path) > 0.5, expected)


@pytest.mark.parametrize(
    ("name", "mode", "code"),
    [
        ("p.png", "L", 128),
        ("p.png", "RGB", (128, 128, 128)),
        ("p.png", "P", 128),
        ("p.png", "LA", (128, 255)),
        ("p.png", "RGBA", (128, 128, 128, 255)),
        ("p.png", "I;16", 128 * 257),
        ("p.tif", "CMYK", (0, 0, 0, 127)),
        ("p.jpg", "CMYK", (0, 0, 0, 127)),
        ("p.bmp", "RGB", (128, 128, 128)),
        ("p.webp", "RGB", (128, 128, 128)),
        ("p.tif", "F", float(HALF)),
    ],
)
def test_half_grey_is_half_grey_in_every_mode(name: str, mode: str, code: object, tmp_path: Path) -> None:
    if mode == "P":
        image = Image.new("RGB", (8, 8), (128, 128, 128)).convert("P", palette=Image.Palette.ADAPTIVE)
    elif mode == "I;16":
        image = Image.fromarray(np.full((8, 8), code, np.uint16))
    else:
        image = Image.new(mode, (8, 8), code)  # type: ignore[arg-type]
    np.testing.assert_allclose(picture(saved(tmp_path, name, image)), HALF, atol=0.012 if name == "p.jpg" else 2e-4)


def test_black_and_white_is_0_and_1(tmp_path: Path) -> None:
    values = np.indices((8, 8)).sum(0) % 2 == 0
    np.testing.assert_allclose(picture(saved(tmp_path, "p.png", Image.fromarray(values))), values, atol=1e-6)


def test_a_png_says_its_own_transfer(tmp_path: Path) -> None:
    """gAMA of 1.0 is linear; cICP 9, 16 is PQ of wide colour."""
    from PIL.PngImagePlugin import PngInfo

    for chunk, data, light in (
        (b"gAMA", struct.pack(">I", 100_000), 128 / 255),
        (b"gAMA", struct.pack(">I", 45_455), float(HALF)),
        (b"cICP", bytes([9, 8, 0, 1]), 128 / 255),
    ):
        info = PngInfo()
        info.add(chunk, data)
        path = saved(tmp_path, "p.png", Image.new("L", (8, 8), 128), pnginfo=info)
        np.testing.assert_allclose(picture(path), light, atol=2e-3)


def bomb(side: int) -> bytes:
    """A PNG of 60000 x 60000 pixels that is some bytes long."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    head = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")
    )


def animated(folder: Path) -> Path:
    frames = [Image.new("L", (8, 8), grey) for grey in (10, 200)]
    frames[0].save(folder / "p.gif", save_all=True, append_images=frames[1:])
    return folder / "p.gif"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda folder: folder / "none.png", "no picture can be read"),
        (lambda folder: folder, "no picture can be read"),
        (lambda folder: folder / ("x" * 5000), "no picture can be read"),
        (lambda folder: folder / "a\x00.png", "no picture can be read"),
        (animated, "holds 2 pictures"),
        (lambda folder: saved(folder, "p.png", Image.new("RGBA", (8, 8), (9, 9, 9, 128))), "transparent"),
        (lambda folder: saved(folder, "p.png", Image.new("L", (8, 8), 9), transparency=9), "transparent"),
        (lambda folder: saved(folder, "p.tif", Image.new("F", (8, 8), -1.0)), "run from -1"),
        (lambda folder: saved(folder, "p.tif", Image.new("F", (8, 8), float("nan"))), "run from nan"),
        (lambda folder: saved(folder, "p.tif", Image.new("I", (8, 8), 70_000)), "whole numbers of 32 bits"),
    ],
)
def test_odd_pictures_are_named(make: Callable[[Path], Path], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        picture(make(tmp_path))


@pytest.mark.parametrize("side", [12_000, 60_000])
def test_a_giant_picture_is_refused_before_memory_is_taken(side: int, tmp_path: Path) -> None:
    import tracemalloc

    (tmp_path / "p.png").write_bytes(bomb(side))
    tracemalloc.start()
    with pytest.raises(InputError, match=r"pixels|too large"):
        picture(tmp_path / "p.png")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20e6


@pytest.mark.parametrize("ending", ["png", "jpg", "tif", "bmp", "exr", "hdr", "webp"])
@pytest.mark.parametrize("content", [b"", b"a text", b"\x89PNG\r\n\x1a\n", b"\x00" * 300])
def test_a_text_named_as_a_picture_is_refused(ending: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / f"p.{ending}").write_bytes(content)
    with pytest.raises(InputError, match=f"p.{ending} is (not a picture|damaged)"):
        picture(tmp_path / f"p.{ending}")


def test_a_picture_cut_off_is_refused(tmp_path: Path) -> None:
    for name in ("p.png", "p.jpg", "p.tif"):
        path = saved(tmp_path, name, Image.fromarray(RNG.integers(0, 256, (64, 64)).astype(np.uint8)))
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        with pytest.raises(InputError, match=f"{name} is"):
            picture(path)
