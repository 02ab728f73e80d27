"""Back-ends beside each other: they agree, live and end apart, and one that works is chosen."""

from __future__ import annotations

import gc
import logging
import os
import stat
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import trimesh

from benchmarks.renderers import compare_backends, objects
from scenes.renderers import choose
from scenes.renderers.choose import BACKENDS, choose_renderer
from scenes.renderers.embree import Embree
from scenes.renderers.opengl import OpenGL
from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole, Renderer, Sprite, Surface
from spikecam_env.errors import InputError, NotReadyError

WINDOW = PictureWindow(0, 0, 60, 80)
EYE = np.eye(4)
EYE[2, 3] = 3.2
CAMERA = Pinhole(70.0, (39.5, 29.5), EYE)


def ball() -> Surface:
    return Surface(trimesh.creation.icosphere(2, 0.5), 0.6)


def picture(renderer: Renderer, surface: Surface, supersample: int = 2) -> Sprite:
    return renderer.render(surface, np.eye(4), CAMERA, Lighting(), WINDOW, supersample)


@pytest.mark.slow
def test_every_backend_agrees_with_embree_to_half_a_percent_of_full_scale() -> None:
    """The bound is the 1/256 to which graphics cards know where between two texels they are."""
    rows = compare_backends((50, 80), repeats=1)
    print(*rows, sep="\n")
    assert [row.backend for row in rows] == list(BACKENDS)
    for row in rows:
        if row.backend in ("egl-software", "osmesa") and np.isnan(row.to_embree) and os.environ.get("CI") != "true":
            continue
        if row.backend == "egl-hardware" and np.isnan(row.to_embree):
            continue
        assert row.to_embree < 0.005, row.name


def test_textured_objects_agree_in_light_coverage_and_depth(opengl: OpenGL) -> None:
    embree = Embree()
    for surface, pose in objects():
        a, b = (renderer.render(surface, pose, CAMERA, Lighting(), WINDOW) for renderer in (opengl, embree))
        light, cover = (
            np.sqrt(np.mean(np.square(p - q))) for p, q in ((a.radiance, b.radiance), (a.coverage, b.coverage))
        )
        both = (a.coverage == 1) & (b.coverage == 1)
        depth = np.abs(a.depth[both] - b.depth[both]).max()
        print(f"{len(surface.mesh.faces):5d} triangles: radiance {light:.1e}, coverage {cover:.1e}, depth {depth:.1e}")
        assert light < 0.015 and cover < 0.015
        assert depth < 0.01


def test_tiles_join_without_a_seam(opengl: OpenGL, monkeypatch: pytest.MonkeyPatch) -> None:
    surface = ball()
    whole = picture(opengl, surface)
    monkeypatch.setattr("scenes.renderers.opengl.LARGEST", 34)
    tiled = picture(opengl, surface)
    np.testing.assert_allclose(tiled.radiance, whole.radiance, atol=1e-5)
    np.testing.assert_array_equal(tiled.coverage, whole.coverage)


def test_closing_one_renderer_leaves_the_other_alive(opengl: OpenGL, another_opengl: Callable[[], Renderer]) -> None:
    surface = ball()
    before = picture(opengl, surface)
    other = another_opengl()
    np.testing.assert_array_equal(picture(other, surface).radiance, before.radiance)
    np.testing.assert_array_equal(picture(opengl, surface).radiance, before.radiance)
    other.close()
    other.close()
    np.testing.assert_array_equal(picture(opengl, surface).radiance, before.radiance)
    np.testing.assert_array_equal(picture(opengl, ball()).radiance, before.radiance)
    with pytest.raises(NotReadyError, match="closed"):
        picture(other, surface)


def test_a_surface_that_is_gone_is_given_back(opengl: OpenGL) -> None:
    from OpenGL import GL

    gc.collect()  # surfaces of tests before
    surface = ball()
    picture(opengl, surface)
    texture = opengl._kept[surface].texture
    assert GL.glIsTexture(texture)
    del surface
    gc.collect()
    assert len(opengl._forgotten) == 1
    kept = ball()
    picture(opengl, kept)
    assert not opengl._forgotten


def test_a_renderer_refuses_to_live_on_in_a_fork(opengl: OpenGL, monkeypatch: pytest.MonkeyPatch) -> None:
    parent = os.getpid()
    monkeypatch.setattr(os, "getpid", lambda: parent + 1)
    with pytest.raises(NotReadyError, match="spawn"):
        picture(opengl, ball())


def test_a_renderer_refuses_another_thread(opengl: OpenGL) -> None:
    with ThreadPoolExecutor(1) as other, pytest.raises(NotReadyError, match="another thread"):
        other.submit(picture, opengl, ball()).result()


def test_one_process_serves_one_kind_of_opengl(opengl: OpenGL) -> None:
    with pytest.raises((NotReadyError, InputError), match=r"new process|libosmesa6"):
        choose_renderer("osmesa")


def test_auto_takes_the_first_that_works(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(choose.VARIABLE, raising=False)
    made: list[str] = []
    monkeypatch.setattr(choose, "problem", lambda name: "broken" if name == "egl-hardware" else None)
    monkeypatch.setattr(choose, "make", lambda name: made.append(name) or Embree())
    choose_renderer()
    assert made == ["egl-software"]


def test_without_opengl_embree_serves_and_one_line_says_so(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.delenv(choose.VARIABLE, raising=False)
    monkeypatch.setattr(choose, "problem", lambda name: None if name == "embree" else "missing")
    with caplog.at_level(logging.INFO):
        assert isinstance(choose_renderer(), Embree)
    (record,) = caplog.records
    print(record.getMessage())
    assert record.levelno == logging.WARNING
    assert "embree" in record.getMessage() and "libegl1 libgl1" in record.getMessage()


def test_where_nothing_works_one_error_has_every_reason_and_the_fix(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choose, "problem", lambda name: f"{name} is broken")
    with pytest.raises(InputError, match=r"osmesa is broken.*libegl1 libgl1.*pip install embreex") as caught:
        choose_renderer("auto")
    print(caught.value)


def test_the_choice_is_named_in_one_line(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setenv(choose.VARIABLE, "embree")
    with caplog.at_level(logging.INFO):
        assert isinstance(choose_renderer(), Embree)
    (record,) = caplog.records
    assert record.levelno == logging.INFO and "embree" in record.getMessage()


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"'vulkan'.*egl-software, embree, osmesa"):
        choose_renderer("vulkan")


def test_a_wanted_backend_that_does_not_serve_is_one_error_with_the_fix(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(name: str) -> OpenGL:
        raise RuntimeError("libEGL.so.1 is not on this machine")

    monkeypatch.setattr(choose, "OpenGL", refuses)
    with pytest.raises(InputError, match=r"libEGL\.so\.1 is not on this machine; .*apt-get install -y libegl1 libgl1"):
        choose_renderer("egl-software")


@pytest.mark.parametrize(
    ("body", "said"), [("kill -SEGV $$", "signal 11"), ("sleep 5", "hangs"), ("exit 3", "no mess")]
)
def test_a_driver_that_crashes_or_hangs_is_left_out(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, body: str, said: str
) -> None:
    driver = tmp_path / "python"
    driver.write_text(f"#!/bin/sh\n{body}\n")
    driver.chmod(driver.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr("sys.executable", str(driver))
    monkeypatch.setattr(choose, "LONGEST_TRIAL_S", 0.5)
    reason = choose.problem.__wrapped__("egl-software")
    print(reason)
    assert said in reason


def test_opengl_targets_grow_to_the_largest_window(opengl: OpenGL) -> None:
    surface = ball()
    small, large = PictureWindow(20, 30, 8, 20), PictureWindow(0, 0, 60, 80)
    first = opengl.render(surface, np.eye(4), CAMERA, Lighting(), small, 8)
    opengl.render(surface, np.eye(4), CAMERA, Lighting(), large, 8)
    again = opengl.render(surface, np.eye(4), CAMERA, Lighting(), small, 8)
    np.testing.assert_array_equal(first.radiance, again.radiance)
