"""OBJ, MTL, PLY, STL and OFF: data that trimesh misreads are read right, named, or refused."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from gltf_files import GREYS, LIGHT, encoded, read, seen, warning_of

from scenes.surfaces.mesh_files import from_file
from spikecam_env.errors import InputError

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
FACES = "usemtl wood\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def obj(folder: Path, text: str = f"mtllib m.mtl\n{SQUARE}{FACES}", mtl: str | None = None) -> Path:
    (folder / "wood.png").write_bytes(encoded(GREYS))
    if mtl is not None:
        (folder / "m.mtl").write_text(f"newmtl wood\n{mtl}\n")
    (folder / "m.obj").write_text(text)
    return folder / "m.obj"


# -- OBJ and MTL -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ("", LIGHT),
        ("-o 0.25 0.5 0 ", np.roll(LIGHT, (2, -1), (0, 1))),
        ("-o 0.25 ", np.roll(LIGHT, -1, 1)),
        ("-s 0.5 0.25 1 -blendu on ", LIGHT[3:, :2].repeat(4, 0).repeat(2, 1)),
        ("-clamp on -o 0 0.5 ", LIGHT[[0, 0, 0, 1]]),
        (".\\", LIGHT),
    ],
    ids=["none", "offset", "offset of u alone", "scale", "clamped", "a path of Windows"],
)
def test_a_texture_lies_as_its_options_say(options: str, expected: np.ndarray, tmp_path: Path) -> None:
    np.testing.assert_allclose(seen(read(obj(tmp_path, mtl=f"map_Kd {options}wood.png"))), expected, rtol=1e-5)


def test_names_of_pictures_may_have_spaces(tmp_path: Path) -> None:
    path = obj(tmp_path, mtl="map_Kd -s 1 1 1 my 2 wood.png")
    (tmp_path / "wood.png").rename(tmp_path / "my 2 wood.png")
    np.testing.assert_allclose(seen(read(path)), LIGHT, rtol=1e-5)


@pytest.mark.parametrize(
    ("mtl", "name"),
    [
        ("Ke 1 0 0", "emission"),
        ("map_Ke wood.png", "emission"),
        ("d 0.5", "transparency (drawn opaque)"),
        ("Tr 0.5", "transparency (drawn opaque)"),
        ("map_d wood.png", "transparency (drawn opaque)"),
        ("Pm 1", "metal"),
        ("Ks 0.5 0.5 0.5", "gloss"),
        ("map_Bump -bm 0.2 wood.png", "normal maps"),
        ("norm wood.png", "normal maps"),
        ("map_Kd -mm 0 0.5 wood.png", "the option -mm of a texture"),
        ("map_Kd -imfchan r wood.png", "the option -imfchan of a texture"),
    ],
)
def test_properties_of_a_material_that_no_surface_shows_are_named(mtl: str, name: str, tmp_path: Path) -> None:
    assert f"m.obj has {name}, which its surface does not show" in warning_of(obj(tmp_path, mtl=mtl))


@pytest.mark.parametrize("opaque", ["d 1.0\nTr 0", "d 1", "Tr 0", "Tr 1", "d 1\nTr 1"])
def test_a_material_that_changes_nothing_is_not_named(opaque: str, tmp_path: Path) -> None:
    """Some programs write Tr 1 for opaque, others Tr 0."""
    read(obj(tmp_path, mtl=f"Ka 1 1 1\nKd 0.5 0.5 0.5\nKs 0 0 0\nKe 0 0 0\n{opaque}\nNs 250\nNi 1.45\nillum 2"))


def test_indices_count_back_from_their_line(tmp_path: Path) -> None:
    """Two triangles, each after its own vertices."""
    corner = "v {0} 0 0\nv {1} 0 0\nv {0} 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf -3/-3 -2/-2 -1/-1\n"
    surface = read(obj(tmp_path, corner.format(0, 1) + corner.format(5, 6)))
    assert surface.mesh.area == pytest.approx(1.0)
    np.testing.assert_allclose(surface.mesh.bounds, [[0, 0, 0], [6, 1, 0]])


def test_normals_of_an_obj_are_kept(tmp_path: Path) -> None:
    """Of any length; zeros are none."""
    for normal, expected in (("3 0 0", [1, 0, 0]), ("0 0 0", [0, 0, 1])):
        path = obj(tmp_path, f"{TRIANGLE}vn {normal}\nf 1//1 2//1 3//1\n")
        for size in (None, 5.0):
            np.testing.assert_allclose(read(path, size=size).mesh.vertex_normals, [expected] * 3)


def test_tabs_and_broken_lines_are_read(tmp_path: Path) -> None:
    text = f"{TRIANGLE}f 1 2 \\\n3\n".replace("v ", "v\t")
    assert read(obj(tmp_path, text)).mesh.area == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        (f"{TRIANGLE}f 1 2 3\nl 1 2\n", "points and lines"),
        (f"{TRIANGLE}f 1 2 3\ncstype bspline\nsurf 0 1 0 1 1 2 3\n", "curves and surfaces"),
        ("v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0\nf 1 2 3\n", "colours of some vertices"),
        (f"mtllib m.mtl\n{SQUARE}usemtl stone\nf 1 2 3\n", "the material stone, which its library does not have"),
        (f"mtllib m.mtl\nmtllib n.mtl\n{SQUARE}{FACES}", "further material libraries"),
        (f"mtllib m.mtl\n{TRIANGLE}usemtl wood\nf 1 2 3\n", "a texture without coordinates"),
        (f"mtllib m.mtl\n{SQUARE}usemtl wood\nf 1/1 2/2 3/99\n", "a texture without coordinates"),
    ],
)
def test_parts_of_an_obj_that_no_surface_shows_are_named(text: str, name: str, tmp_path: Path) -> None:
    assert f"m.obj has {name}" in warning_of(obj(tmp_path, text, mtl="map_Kd wood.png"))


@pytest.mark.parametrize("colour", ["128 0 0", "1.5 0 0", "-0.5 0 0"])
def test_colours_of_an_obj_are_from_0_to_1(colour: str, tmp_path: Path) -> None:
    lines = "".join(f"v {place} {colour}\n" for place in ("0 0 0", "1 0 0", "0 1 0"))
    with pytest.raises(InputError, match=r"m\.obj: colours of vertices run from"):
        from_file(obj(tmp_path, f"{lines}f 1 2 3\n"))


def test_an_index_before_the_first_line_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a face names -4, of 3 so far"):
        from_file(obj(tmp_path, f"{TRIANGLE}f -4 -2 -1\n"))


# -- PLY, STL, OFF, archives -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["diffuse_red", "r", "intensity", "texture_s"])
def test_properties_of_a_ply_that_are_not_read_are_named(name: str, tmp_path: Path) -> None:
    head = "".join(f"property float {axis}\n" for axis in ("x", "y", "z", "quality", name))
    lines = "".join(f"{place} 1 0.5\n" for place in ("0 0 0", "1 0 0", "0 1 0"))
    (tmp_path / "m.ply").write_text(
        f"ply\nformat ascii 1.0\nelement vertex 3\n{head}element face 1\nproperty list uchar int vertex_indices\n"
        f"end_header\n{lines}3 0 1 2\n"
    )
    assert f"m.ply has the property {name}, which" in warning_of(tmp_path / "m.ply")


@pytest.mark.parametrize(("stated", "said"), [(0x8000 | 31, True), (0, False)])
def test_colours_of_an_stl_are_named(stated: int, said: bool, tmp_path: Path) -> None:
    triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, stated)
    (tmp_path / "m.stl").write_bytes(bytes(80) + struct.pack("<I", 1) + triangle)
    if said:
        assert "m.stl has colours of faces" in warning_of(tmp_path / "m.stl")
    else:
        read(tmp_path / "m.stl")


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 255 0 0 255\n0 1 0 255 0 0 255\n3 0 1 2\n", "colours of vertices"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0\n", "colours of faces"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", None),
    ],
)
def test_colours_of_an_off_are_named(text: str, name: str | None, tmp_path: Path) -> None:
    (tmp_path / "m.off").write_text(text)
    if name is None:
        read(tmp_path / "m.off")
    else:
        assert f"m.off has {name}" in warning_of(tmp_path / "m.off")


def test_an_archive_is_refused(tmp_path: Path) -> None:
    (tmp_path / "m.zip").write_bytes(b"PK")
    with pytest.raises(InputError, match=r"m\.zip: it is an archive; unpack it"):
        from_file(tmp_path / "m.zip")
