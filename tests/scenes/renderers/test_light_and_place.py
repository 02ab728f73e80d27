"""Every back-end against closed forms: the place of points in the picture, their distance and their light."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole, Renderer, Sprite, Surface
from spikecam_env.errors import InputError
from spikecam_env.types import Pictures

PICTURE = PictureWindow(0, 0, 90, 120)
FOCAL, CENTRE = 150.0, (59.5, 44.5)
CAMERA = Pinhole(FOCAL, CENTRE, np.eye(4))
AMBIENT_ONLY = Lighting(ambient=1.0, intensity=0.0)


def at(x: float, y: float, z: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def card(width: float, height: float) -> trimesh.Trimesh:
    """A rectangle in the plane z = 0, its texture upright."""
    x, y = width / 2, height / 2
    mesh = trimesh.Trimesh([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)], [(0, 1, 2), (0, 2, 3)], process=False)
    mesh.visual = trimesh.visual.TextureVisuals(uv=np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float))
    return mesh


def disc(radius: float, corners: int = 256) -> trimesh.Trimesh:
    angle = 2 * np.pi * np.arange(corners) / corners
    rim = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    faces = [(corners, i, (i + 1) % corners) for i in range(corners)]
    return trimesh.Trimesh(np.vstack([rim, np.zeros(3)]), faces, process=False)


def grid(sprite: Sprite) -> tuple[np.ndarray, np.ndarray]:
    """x and y of every pixel's centre."""
    window = sprite.window
    return np.meshgrid(np.arange(window.columns) + window.left, np.arange(window.rows) + window.top)


def rms(difference: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(difference, dtype=np.float64))))


def test_tilted_plane_has_lamberts_radiance(renderer: Renderer) -> None:
    lighting = Lighting(ambient=0.25, intensity=0.5, towards=(0.0, 3.0, 4.0))
    tilt = trimesh.transformations.rotation_matrix(0.4, (1, 0, 0))
    sprite = renderer.render(Surface(card(20, 20), albedo=0.6), at(0, 0, -5) @ tilt, CAMERA, lighting, PICTURE)
    cosine = tilt[:3, 2] @ (0, 0.6, 0.8)
    expected = 0.6 * (0.25 + 0.5 * cosine)
    print(f"radiance {sprite.radiance.min():.6f} .. {sprite.radiance.max():.6f}, closed form {expected:.6f}")
    np.testing.assert_allclose(sprite.radiance, expected, rtol=1e-5)
    np.testing.assert_array_equal(sprite.coverage, 1)


def test_light_from_behind_leaves_the_ambient(renderer: Renderer) -> None:
    lighting = Lighting(ambient=0.25, intensity=0.5, towards=(0, 0, -1))
    sprite = renderer.render(Surface(card(20, 20), albedo=0.6), at(0, 0, -5), CAMERA, lighting, PICTURE)
    np.testing.assert_allclose(sprite.radiance, 0.15, rtol=1e-5)


def test_tilted_plane_has_the_depth_of_the_pinhole_law(renderer: Renderer) -> None:
    tilt = trimesh.transformations.rotation_matrix(0.7, (0.6, 0.8, 0))
    sprite = renderer.render(Surface(card(30, 30)), at(0.1, 0.2, -5) @ tilt, CAMERA, Lighting(), PICTURE, supersample=1)
    x, y = grid(sprite)
    ray = np.stack([(x - CENTRE[0]) / FOCAL, (CENTRE[1] - y) / FOCAL, -np.ones_like(x, float)], axis=-1)
    normal = tilt[:3, 2]
    expected = normal @ (0.1, 0.2, -5) / (ray @ normal)
    error = np.abs(sprite.depth / expected - 1).max()
    print(f"depth {expected.min():.2f} .. {expected.max():.2f}, relative error at most {error:.1e}")
    assert error < 1e-5


def test_sphere_has_lamberts_radiance_by_its_vertex_normals(renderer: Renderer) -> None:
    lighting = Lighting(ambient=0.2, intensity=0.7, towards=(0.3, 0.8, 0.6))
    radius, distance = 1.0, 4.0
    sphere = Surface(trimesh.creation.icosphere(5, radius), albedo=0.5)
    sprite = renderer.render(sphere, at(0, 0, -distance), CAMERA, lighting, PICTURE, supersample=1)
    x, y = grid(sprite)
    ray = np.stack([(x - CENTRE[0]) / FOCAL, (CENTRE[1] - y) / FOCAL, -np.ones_like(x, float)], axis=-1)
    a, b, c = (ray**2).sum(axis=-1), ray[..., 2] * distance, distance**2 - radius**2
    seen = b**2 - a * c > 0.1
    hit = ((-b - np.sqrt(np.where(seen, b**2 - a * c, 0))) / a)[..., None] * ray + (0, 0, distance)
    lamp = np.array(lighting.towards) / np.linalg.norm(lighting.towards)
    expected = 0.5 * (0.2 + 0.7 * np.clip(hit @ lamp / radius, 0, None))
    error = rms((sprite.radiance - expected)[seen])
    facet = 2.2 / 2**5 / 2
    print(f"rms from the true sphere {error:.1e}; facets of half-width {facet:.3f} rad leave about {facet**2:.1e}")
    assert error < facet**2


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.313, -0.207)])
def test_coverage_of_a_disc_adds_up_to_its_area(renderer: Renderer, place: tuple[float, float]) -> None:
    radius, distance, corners, supersample = 0.8, 5.0, 256, 4
    sprite = renderer.render(
        Surface(disc(radius, corners)), at(*place, -distance), CAMERA, Lighting(), PICTURE, supersample
    )
    size = radius * FOCAL / distance
    expected = corners / 2 * np.sin(2 * np.pi / corners) * size**2
    rim_rays = 2 * np.pi * size * supersample
    sd = np.sqrt(rim_rays / 12) / supersample**2
    print(f"area {sprite.coverage.sum():.2f}, closed form {expected:.2f}, sampling sd {sd:.2f} pixels")
    assert abs(sprite.coverage.sum() - expected) < 4 * sd
    assert ((sprite.coverage >= 0) & (sprite.coverage <= 1)).all()


def test_coverage_of_a_sphere_is_wider_than_its_equator(renderer: Renderer) -> None:
    radius, distance, supersample = 1.0, 4.0, 4
    sprite = renderer.render(
        Surface(trimesh.creation.icosphere(5, radius)), at(0, 0, -distance), CAMERA, Lighting(), PICTURE, supersample
    )
    size = FOCAL * radius / np.sqrt(distance**2 - radius**2)
    expected = np.pi * size**2
    sd = np.sqrt(2 * np.pi * size * supersample / 12) / supersample**2
    facets = expected * (2.2 / 2**5) ** 2 / 6
    print(f"area {sprite.coverage.sum():.2f}, closed form {expected:.2f}, sd {sd:.2f}, lost to facets < {facets:.2f}")
    assert abs(sprite.coverage.sum() - expected) < 4 * sd + facets


def test_centre_of_a_disc_is_where_the_pinhole_law_puts_it_to_a_twentieth_of_a_pixel(renderer: Renderer) -> None:
    rng = np.random.default_rng(1)
    worst = 0.0
    for _ in range(8):
        place = rng.uniform(-0.5, 0.5, 2)
        sprite = renderer.render(Surface(disc(0.3)), at(*place, -5), CAMERA, Lighting(), PICTURE)
        x, y = grid(sprite)
        weight = sprite.coverage / sprite.coverage.sum()
        expected = CENTRE[0] + FOCAL * place[0] / 5, CENTRE[1] - FOCAL * place[1] / 5
        worst = max(worst, abs((x * weight).sum() - expected[0]), abs((y * weight).sum() - expected[1]))
    print(f"centre of light off by at most {worst:.3f} pixels")
    assert worst < 0.05


def test_moving_the_camera_is_moving_the_world_the_other_way(renderer: Renderer) -> None:
    surface = Surface(trimesh.creation.box((1, 0.7, 0.5)))
    pose = at(0.2, 0.1, -5) @ trimesh.transformations.rotation_matrix(0.6, (1, 2, 3))
    eye = at(0.4, -0.3, 1) @ trimesh.transformations.rotation_matrix(0.3, (0, 1, 0.2))
    flat = Lighting(1.0, 0.0)
    moved = renderer.render(surface, pose, Pinhole(FOCAL, CENTRE, eye), flat, PICTURE)
    still = renderer.render(surface, np.linalg.inv(eye) @ pose, CAMERA, flat, PICTURE)
    assert moved.coverage.sum() > 100
    np.testing.assert_allclose(moved.coverage, still.coverage)


def test_a_mirrored_pose_shows_the_mirrored_picture(renderer: Renderer) -> None:
    surface = Surface(trimesh.creation.annulus(0.3, 0.7, 0.4))
    pose = at(0, 0, -5) @ trimesh.transformations.rotation_matrix(0.9, (1, 2, 0))
    mirror = np.diag([-1.0, 1, 1, 1])
    lighting = Lighting(towards=(0, 1, 1))
    image, mirrored = (renderer.render(surface, p, CAMERA, lighting, PICTURE) for p in (pose, mirror @ pose))
    assert image.coverage.sum() > 100
    assert rms(image.coverage - mirrored.coverage[:, ::-1]) < 0.01
    assert rms(image.radiance - mirrored.radiance[:, ::-1]) < 0.01


def test_a_room_is_seen_from_inside_and_a_sheet_from_behind(renderer: Renderer) -> None:
    room = renderer.render(Surface(trimesh.creation.box((4, 4, 6))), np.eye(4), CAMERA, AMBIENT_ONLY, PICTURE)
    np.testing.assert_array_equal(room.coverage, 1)
    assert room.depth[44, 59] == pytest.approx(3)
    behind = at(0, 0, -5) @ trimesh.transformations.rotation_matrix(np.pi, (0, 1, 0))
    sheet = renderer.render(Surface(card(9, 9)), behind, CAMERA, AMBIENT_ONLY, PICTURE)
    np.testing.assert_array_equal(sheet.coverage, 1)


def test_radiance_is_premultiplied(renderer: Renderer) -> None:
    lamp = Surface(disc(0.8), albedo=0.0, emission=2.0)
    sprite = renderer.render(lamp, at(0.1, 0.05, -5), CAMERA, Lighting(), PICTURE, supersample=3)
    edge = (sprite.coverage > 0) & (sprite.coverage < 1)
    assert edge.sum() > 50
    np.testing.assert_allclose(sprite.radiance, 2 * sprite.coverage, atol=1e-6)
    assert np.isinf(sprite.depth[sprite.coverage == 0]).all()
    np.testing.assert_allclose(sprite.depth[sprite.coverage > 0], 5, rtol=1e-5)


@pytest.mark.parametrize("shape", [(2, 2), (5, 7), (3, 13), (6, 1), (9, 31)])
def test_texture_is_upright_and_unsheared_at_any_width(renderer: Renderer, shape: tuple[int, int]) -> None:
    texture = np.random.default_rng(2).random(shape, np.float32)
    rows, columns = shape
    texel = 9
    camera = Pinhole(100.0, ((columns * texel - 1) / 2, (rows * texel - 1) / 2), np.eye(4))
    window = PictureWindow(0, 0, rows * texel, columns * texel)
    surface = Surface(card(columns * texel / 100, rows * texel / 100), texture)
    sprite = renderer.render(surface, at(0, 0, -1), camera, AMBIENT_ONLY, window, supersample=1)
    centres = sprite.radiance[texel // 2 :: texel, texel // 2 :: texel]
    print(f"{rows} x {columns}: texel centres off by at most {np.abs(centres - texture).max():.1e}")
    np.testing.assert_allclose(centres, texture, atol=1 / 256)
    np.testing.assert_array_equal(sprite.coverage, 1)


def test_texture_finer_than_the_rays_is_its_mean_and_does_not_alias(renderer: Renderer) -> None:
    checker = (np.indices((512, 512)).sum(axis=0) % 2).astype(np.float32)
    distance, width = 7.0, 4.0
    sprite = renderer.render(Surface(card(width, width), checker), at(0, 0, -distance), CAMERA, AMBIENT_ONLY, PICTURE)
    inside = sprite.radiance[sprite.coverage == 1]
    texels_a_ray = 512 / (width * FOCAL / distance) / 2
    print(f"{texels_a_ray:.2f} texels a ray: mean {inside.mean():.5f}, rms {inside.std():.1e} of a checkerboard")
    assert texels_a_ray > 2 * np.sqrt(2)  # from there on only levels >= 1 are read, where this checkerboard is grey
    assert rms(inside - 0.5) < 1e-5


@pytest.mark.parametrize(
    "window", [PictureWindow(-20, -30, 60, 70), PictureWindow(70, 100, 50, 60), PictureWindow(20, 35, 1, 1)]
)
def test_a_window_is_a_cut_of_the_plane_also_outside_the_picture(renderer: Renderer, window: PictureWindow) -> None:
    surface = Surface(trimesh.creation.icosphere(3, 2.0), 0.7)
    wide = PictureWindow(-40, -40, 170, 200)
    whole, part = (renderer.render(surface, at(0.2, 0, -5), CAMERA, Lighting(), w) for w in (wide, window))
    cut = np.s_[window.top + 40 : window.top + 40 + window.rows, window.left + 40 : window.left + 40 + window.columns]
    different = np.count_nonzero(np.abs(part.coverage - whole.coverage[cut]) > 1e-6)
    print(f"{different} of {part.coverage.size} pixels have an edge ray on the other side")
    assert different <= 2
    assert rms(part.radiance - whole.radiance[cut]) < 2e-3


def test_nothing_is_seen_beside_or_behind_the_camera(renderer: Renderer) -> None:
    for place in ((50, 0, -5), (0, 0, 5)):
        sprite = renderer.render(Surface(disc(1)), at(*place), CAMERA, Lighting(), PICTURE)
        assert not sprite.coverage.any() and not sprite.radiance.any() and np.isinf(sprite.depth).all()


def test_a_floor_that_passes_below_the_camera_is_seen_to_its_horizon(renderer: Renderer) -> None:
    floor = Surface(card(400, 600))
    pose = at(0, -1, 0) @ trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0))
    sprite = renderer.render(floor, pose, CAMERA, Lighting(), PICTURE)
    horizon = int(CENTRE[1] + FOCAL / 300)  # the middle of row 45: one of its two rows of rays is below
    print(f"coverage about the horizon, row {horizon}: {sprite.coverage[horizon - 1 : horizon + 2, 60]}")
    assert not sprite.coverage[:horizon].any()
    np.testing.assert_array_equal(sprite.coverage[horizon], 0.5)
    np.testing.assert_array_equal(sprite.coverage[horizon + 1 :], 1)


def test_nonsense_is_refused_with_the_fix(renderer: Renderer) -> None:
    texture: Pictures = np.ones((4, 4), np.float32)
    bare = disc(1)
    empty = trimesh.Trimesh(np.zeros((0, 3)), np.zeros((0, 3), int))
    colour = np.ones((4, 4, 3), np.float32)

    def render(surface: Surface, window: PictureWindow = PICTURE, supersample: int = 2, turn: float = 1.0) -> None:
        renderer.render(surface, turn * np.eye(4), CAMERA, Lighting(), window, supersample)

    with pytest.raises(InputError, match=r"TextureVisuals\(uv"):
        render(Surface(bare, texture))
    with pytest.raises(InputError, match="no triangles"):
        render(Surface(empty))
    with pytest.raises(InputError, match=r"\(4, 4, 3\)"):
        render(Surface(card(1, 1), colour))
    with pytest.raises(InputError, match="0 rows"):
        render(Surface(bare), PictureWindow(0, 0, 0, 5))
    with pytest.raises(InputError, match="supersample is 0"):
        render(Surface(bare), supersample=0)
    with pytest.raises(InputError, match="inverted"):
        render(Surface(bare), turn=0.0)
    with pytest.raises(InputError, match="towards"):
        renderer.render(Surface(bare), at(0, 0, -5), CAMERA, Lighting(towards=(0, 0, 0)), PICTURE)
