"""Meshes: closed shapes face outward, atlases keep every part's grey, and your own files become surfaces."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import trimesh

from scenes.meshes import (
    assemble,
    box,
    capsule,
    disc,
    from_file,
    from_mesh,
    lathe,
    linear,
    picture,
    prism,
    sphere,
    torus,
)
from scenes.trajectories import Still
from spikecam_env.errors import InputError

SOLIDS = {
    "sphere": ([sphere(0.5)], 4 / 3 * np.pi * 0.125),
    "torus": ([torus(0.5, 0.2)], 2 * np.pi**2 * 0.5 * 0.04),
    "box": (box((1, 2, 3)), 6.0),
    "cylinder": ([lathe([(0, -1), (0.5, -1), (0.5, 1), (0, 1)], smooth=False)], np.pi * 0.25 * 2),
    "capsule": ([capsule(1.0, 0.25)], np.pi * 0.0625 + 4 / 3 * np.pi * 0.25**3),
    "prism": (prism([(0, 0), (2, 0), (2, 1), (1, 0.5), (0, 1)], 0.5), 0.75),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_have_their_volume_so_their_faces_look_outward(name: str) -> None:
    parts, volume = SOLIDS[name]
    mesh = assemble(*parts).mesh
    print(f"{name}: volume {mesh.volume:.4f}, exactly {volume:.4f}")
    # inscribed polyhedra of 32 or more sections: 1 - cos(pi / 32) = 0.5 % a direction
    assert mesh.volume == pytest.approx(volume, rel=0.02)
    outward = np.einsum("fk,fk->f", mesh.face_normals, np.asarray(mesh.vertex_normals)[mesh.faces].mean(1))
    assert outward.min() > 0.2


def test_normals_are_as_given_and_moved_with_the_part() -> None:
    ball = sphere(1.0).moved(Still((5, 0, 0), (0, 0, 90)))
    np.testing.assert_allclose(ball.normals, ball.vertices - [5, 0, 0], atol=1e-3)


def test_an_atlas_shows_every_part_its_own_grey() -> None:
    stripes = np.repeat(np.float32([0.2, 0.7])[:, None], 8, 0).repeat(16, 1)
    surface = assemble(disc(1.0, 0.3), disc(1.0, stripes).moved(Still((0, 0, 1))), disc(1.0, 0.9))
    atlas, uv = surface.albedo, surface.mesh.visual.uv
    rows, columns = atlas.shape
    seen = atlas[
        np.clip(((1 - uv[:, 1]) * rows).astype(int), 0, rows - 1),
        np.clip((uv[:, 0] * columns).astype(int), 0, columns - 1),
    ]
    first, second, third = np.split(seen, 3)
    assert (first == np.float32(0.3)).all() and (third == np.float32(0.9)).all()
    assert set(second) == {np.float32(0.2), np.float32(0.7)}
    lower = np.split(uv[:, 1], 3)[1] < np.median(np.split(uv[:, 1], 3)[1]) - 0.005
    assert (second[lower] == np.float32(0.7)).all()


def test_a_mesh_file_and_a_picture_become_a_surface(tmp_path) -> None:
    trimesh.creation.box(extents=(1, 2, 3)).export(tmp_path / "crate.stl")
    cv2.imwrite(str(tmp_path / "wood.png"), np.full((8, 12, 3), 128, np.uint8))
    surface = from_file(tmp_path / "crate.stl", tmp_path / "wood.png", size=0.5)
    assert np.ptp(surface.mesh.bounds, axis=0).max() == pytest.approx(0.5)
    assert surface.mesh.visual.uv.shape == (len(surface.mesh.vertices), 2)
    np.testing.assert_allclose(surface.albedo, linear(128 / 255), rtol=1e-5)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda path: from_file(path / "none.obj"), "no mesh file"),
        (lambda path: picture(path / "none.png"), "no picture"),
        (lambda path: from_mesh(trimesh.Trimesh(), 0.5), "no triangles"),
        (lambda path: from_mesh(trimesh.creation.box(), np.zeros((2, 2, 3))), "linear grey"),
        (lambda path: assemble(), "at least one part"),
        (lambda path: box((1, 1, 1), [0.1, 0.2]), "six"),
        (lambda path: prism([(0, 0), (0, 1), (1, 1), (1, 0)], 1.0), "counter-clockwise"),
    ],
)
def test_nonsense_is_named(call, message: str, tmp_path) -> None:
    with pytest.raises(InputError, match=message):
        call(tmp_path)
