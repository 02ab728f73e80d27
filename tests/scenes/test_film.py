"""Films as files: light and times as taken, whatever the codec; unknown light or times are refused by name."""

from __future__ import annotations

import re
import struct
import warnings
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from made_films import greys, write_film, yuv420
from PIL import Image

from scenes import VideoScene
from scenes.film.transfer import curve
from spikecam_env.errors import InputError

MILLI = Fraction(1, 1000)
RAMP = np.tile(np.linspace(0, 1, 32), (32, 1))
FULL = {"light": (0.0, 1.0)}


def quiet(*args: object, **options: object) -> VideoScene:
    """A scene of a film that warns of nothing."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return VideoScene(*args, **options)  # type: ignore[arg-type]


def numbered(folder: Path, names: list[str], grey: int = 100) -> Path:
    folder.mkdir()
    for i, name in enumerate(names):
        Image.fromarray(np.full((6, 8), grey + i, np.uint8)).save(folder / name)
    return folder


# -- times -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "codec"), [("f.mp4", "libx264"), ("f.mkv", "ffv1"), ("f.webm", "libvpx-vp9"), ("f.ts", "libx264")]
)
def test_light_of_a_variable_rate_is_where_its_time_stamps_say(name: str, codec: str, tmp_path: Path) -> None:
    """10 pictures a second, then 60: light within 1 % at every picture, and keys as the truth says."""
    ticks = [*range(0, 500, 100), *(500 + round(i * 1000 / 60) for i in range(12))]
    codes = np.linspace(40, 220, len(ticks)).round().astype(int)
    pictures = [yuv420(p, 128) for p in greys(codes)]
    options = {"crf": "1"} if codec == "libx264" else {"lossless": "1"} if "vp9" in codec else None
    path = write_film(tmp_path / name, pictures, "yuv420p", codec, ticks=ticks, time_base=MILLI, options=options)
    scene = VideoScene(path, **FULL, transfer="gamma2.2")
    expected = ((codes - 16) / 219).clip(0, 1) ** 2.2
    for tick, light in zip(ticks, expected, strict=True):
        keys = scene.radiance(tick * 40, tick * 40 + 1)
        assert scene.truth(tick * 40).radiance.mean() == pytest.approx(light, rel=0.01, abs=1e-4)
        assert keys.at(tick * 40).mean() == pytest.approx(light, rel=0.01, abs=1e-4)
    assert scene.frames == pytest.approx(40 * ticks[-1])


def test_time_stamps_rounded_to_milliseconds_are_a_constant_rate_again(tmp_path: Path) -> None:
    scene = quiet(write_film(tmp_path / "f.mkv", greys(range(9)), rate=240), transfer="srgb")
    assert scene.frames_per_picture == 40_000 / 240


@pytest.mark.parametrize("stamp", [33, 20])
def test_time_stamps_that_do_not_rise_are_refused_unless_the_user_says_the_times(stamp: int, tmp_path: Path) -> None:
    """A block of Matroska is its track (0x81), its time stamp in two bytes, and the picture."""
    path = write_film(tmp_path / "f.mkv", greys((0, 80, 160, 240)), ticks=[0, 33, 66, 99], time_base=MILLI)
    block = path.read_bytes()
    assert block.count(b"\x81\x00\x42") == 1
    path.write_bytes(block.replace(b"\x81\x00\x42", bytes([0x81, 0, stamp])))
    with pytest.raises(InputError, match=r"do not rise.*film_rate_hz"):
        VideoScene(path, transfer="linear")
    assert quiet(path, 1000.0, transfer="linear").frames_per_picture == 40
    times = quiet(path, times_s=[1, 1.5, 1.75, 3], transfer="linear", **FULL)
    assert times.truth(40_000 * 0.5).radiance.mean() == pytest.approx(80 / 255, rel=1e-3)
    with pytest.raises(InputError, match=r"times_s has shape \(3,\) for 4"):
        VideoScene(path, times_s=[1, 2, 3], transfer="linear")
    with pytest.raises(InputError, match="times_s must be finite"):
        VideoScene(path, times_s=[1, 2, 2, 3], transfer="linear")


def test_a_slow_film_was_faster_in_life(tmp_path: Path) -> None:
    ticks = [0, 100, 150, 400]
    path = write_film(tmp_path / "f.mkv", greys((0, 80, 160, 240)), ticks=ticks, time_base=MILLI)
    assert quiet(path, transfer="linear", slow=40.0).frames == 400
    assert len(quiet(path, transfer="linear", slow=40.0, seconds=0.003).__dict__["_light"]) == 3
    with pytest.raises(InputError, match="one of film_rate_hz, times_s and slow"):
        VideoScene(path, 30.0, slow=2.0)


@pytest.mark.parametrize("rate", [30.0, 240.0, 900.0, 1000.0, 90_000.0])
@pytest.mark.parametrize("interpolation", ["linear", "hold"])
def test_keys_carry_the_light_of_every_frame(rate: float, interpolation: str) -> None:
    """Alternating pictures: light between keys is that of the scene, at picture times and between."""
    film = np.stack(greys([0, 255, 0, 200, 30]))
    scene = VideoScene(film, rate, interpolation=interpolation, gamma=1.0, **FULL)  # type: ignore[arg-type]
    start = round(40_000 / rate) - 50
    keys = scene.radiance(start, start + 200)
    frames = np.arange(start, start + 201)
    error = max(abs(float(keys.at(f)[0, 0] - scene.truth(f).radiance[0, 0])) for f in frames)
    print(f"{rate:g} Hz, {interpolation}: {len(keys.frame)} keys, error {error:.1e}")
    assert error < 1e-3 and np.diff(keys.frame).max() <= 64
    cut = scene.radiance(start + 70, start + 90)
    shared = np.isin(cut.frame, keys.frame)
    assert shared.all() and np.array_equal(cut.radiance, keys.radiance[np.isin(keys.frame, cut.frame)])


def test_hold_shows_a_picture_until_the_next() -> None:
    scene = VideoScene(np.stack(greys([0, 255, 51])), 1000.0, interpolation="hold", gamma=1.0, **FULL)
    seen = [float(scene.radiance(f, f + 1).at(f)[0, 0]) for f in (0, 39, 40, 79, 80, 119)]
    np.testing.assert_allclose(seen, [0, 0, 1, 1, 0.2, 0.2], rtol=1e-3)


def test_mean_interval_is_that_of_the_whole_film_by_the_time_of_each_picture() -> None:
    film = np.stack(greys([0, 255, 0]))
    scene = VideoScene(film, times_s=[0, 0.1, 0.4], gamma=1.0, mean_interval=5.0)
    mean = np.mean([scene.truth(f).radiance[0, 0] for f in range(0, 16_000, 10)])
    assert mean == pytest.approx(1 / 5, rel=1e-3)
    part = VideoScene(film, times_s=[0, 0.1, 0.4], gamma=1.0, mean_interval=5.0, seconds=0.05)
    assert np.mean([part.truth(f).radiance[0, 0] for f in range(2001)]) == pytest.approx(1 / 5, rel=1e-3)
    held = VideoScene(film, 100.0, gamma=1.0, mean_interval=5.0, interpolation="hold", seconds=0.015)
    assert np.mean([held.truth(f).radiance[0, 0] for f in range(600)]) == pytest.approx(1 / 5, rel=1e-2)
    with pytest.raises(InputError, match="no light"):
        VideoScene(np.zeros((2, 4, 4), np.uint8), 9.0, mean_interval=5.0)


# -- whole or not ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "codec", "stored_as"),
    [("f.avi", "mjpeg", "yuvj420p"), ("f.mkv", "ffv1", "yuv420p"), ("f.avi", "ffv1", "yuv420p")],
)
def test_half_a_film_says_how_much_is_missing(name: str, codec: str, stored_as: str, tmp_path: Path) -> None:
    path = write_film(tmp_path / name, [yuv420(p, 128) for p in greys(range(60, 160))], stored_as, codec)
    assert quiet(path, transfer="srgb").pictures == 100
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.warns(UserWarning, match=r"cut off or damaged.*100 pictures"):
        scene = VideoScene(path, transfer="srgb")
    assert 10 < scene.pictures < 60
    quiet(path, most_pictures=3, transfer="srgb")  # pictures that were not requested are not missed


def test_a_film_without_its_table_of_contents_is_refused(tmp_path: Path) -> None:
    path = write_film(tmp_path / "f.mp4", [yuv420(p, 128) for p in greys(range(60, 90))], "yuv420p", "libx264")
    path.write_bytes(path.read_bytes()[:-600])
    with pytest.raises(InputError, match="is not a film"):
        VideoScene(path)


# -- light -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stored_as", "bits", "limited"),
    [
        ("gray", 8, False),
        ("gray10le", 10, False),
        ("gray16le", 16, False),
        ("yuv420p", 8, True),
        ("yuv420p10le", 10, True),
        ("yuv420p10le", 10, False),
        ("gray12le", 12, False),
        ("gray12le", 12, True),
    ],
)
def test_a_ramp_is_recovered_to_its_last_bit(stored_as: str, bits: int, limited: bool, tmp_path: Path) -> None:
    low, span = (16 << (bits - 8), 219 << (bits - 8)) if limited else (0, 2**bits - 1)
    codes = (low + span * RAMP).round().astype(np.uint8 if bits == 8 else np.uint16)
    picture = yuv420(codes, 128 << (bits - 8)) if stored_as.startswith("yuv") else codes
    path = write_film(tmp_path / "f.mkv", [picture] * 2, stored_as, color_range=1 if limited else 2, color_trc=8)
    seen = quiet(path, **FULL).truth(0).radiance
    error = np.abs(seen - (codes.astype(float) - low) / span).max()
    print(f"{stored_as}, {'limited' if limited else 'full'} range: error {error * span:.3f} of a code")
    assert error < max(0.01 / span, 2e-7) or (bits == 8 and error < 5e-4)  # float16 holds 8-bit films


@pytest.mark.parametrize(
    ("name", "trc"), [("bt709", 1), ("bt709", 6), ("gamma2.2", 4), ("gamma2.8", 5), ("linear", 8), ("srgb", 13)]
)
def test_the_transfer_that_the_file_states_is_undone(name: str, trc: int, tmp_path: Path) -> None:
    codes = (1023 * RAMP).round().astype(np.uint16)
    path = write_film(tmp_path / "f.mkv", [codes] * 2, "gray10le", color_trc=trc, color_range=2)
    scene = quiet(path, **FULL)
    assert scene.transfer == name
    np.testing.assert_allclose(scene.truth(0).radiance, curve(name)(np.float32(codes / 1023)), rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize(("trc", "name"), [(10, r"number 10 of H\.273"), (16, "PQ"), (18, "HLG")])
def test_another_transfer_is_refused_by_name_unless_the_user_says_one(trc: int, name: str, tmp_path: Path) -> None:
    path = write_film(tmp_path / "f.mkv", greys((0, 100)), color_trc=trc)
    with pytest.raises(InputError, match=rf"unknown transfer '{name}'; choose one of bt709, gamma2\.2, linear, srgb"):
        VideoScene(path)
    assert quiet(path, transfer="bt709").transfer == "bt709"


@pytest.mark.parametrize(("codec", "name"), [("libx264", "f.mp4"), ("libx265", "f.mov"), ("prores_ks", "f.mov")])
def test_ten_bits_of_a_film_camera_are_light(codec: str, name: str, tmp_path: Path) -> None:
    """BT.709-6: V = 0.5 is 0.2598 of light."""
    stored_as = "yuv422p10le" if codec == "prores_ks" else "yuv420p10le"
    luma = np.full((32, 32), 64 + 876 // 2, np.uint16)
    chroma = np.full((32 if codec == "prores_ks" else 16, 32), 512, np.uint16)
    options = {"x265-params": "log-level=none:crf=1"} if codec == "libx265" else {"crf": "1"}
    tags = {"color_trc": 1, "color_primaries": 9, "colorspace": 9, "color_range": 1}
    picture = np.concatenate([luma, chroma])
    scene = quiet(write_film(tmp_path / name, [picture] * 3, stored_as, codec, options=options, **tags), **FULL)
    assert scene.truth(0).radiance.mean() == pytest.approx(0.2598, rel=0.01)


@pytest.mark.parametrize(("name", "light"), [("bt709", 0.2598), ("srgb", 0.2140), ("gamma2.2", 0.2176)])
def test_transfers_have_the_values_of_their_standards(name: str, light: float) -> None:
    """At 0, 0.5 and 1: BT.709-6, IEC 61966-2-1, and 0.5 to the power 2.2."""
    np.testing.assert_allclose(curve(name)(np.float32([0, 0.5, 1])), [0, light, 1], rtol=2e-3)


def test_ten_bits_of_unstated_transfer_are_refused_and_eight_bits_warn(tmp_path: Path) -> None:
    ten = write_film(tmp_path / "ten.mkv", greys((0, 500), np.uint16), "gray10le")
    with pytest.raises(InputError, match="10 bits and it does not state their transfer"):
        VideoScene(ten)
    eight = write_film(tmp_path / "eight.mkv", greys((0, 100)))
    with pytest.warns(UserWarning, match=r"does not state its transfer; gamma2\.2"):
        VideoScene(eight)


@pytest.mark.parametrize("stored_as", ["yuyv422", "nv12", "gray", "rgb24", "bgra"])
def test_raw_pixels_of_any_order_are_the_same_light(stored_as: str, tmp_path: Path) -> None:
    """Without colour; Y of limited range, for a raw film states none."""
    luma, codes = (16 + 219 * RAMP).round().astype(np.uint8), (255 * RAMP).round().astype(np.uint8)
    picture = {
        "yuyv422": np.stack([luma, np.full_like(luma, 128)], -1),
        "nv12": yuv420(luma, 128),
        "gray": codes,
        "rgb24": np.stack([codes] * 3, -1),
        "bgra": np.stack([codes, codes, codes, np.full_like(codes, 255)], -1),
    }[stored_as]
    path = write_film(tmp_path / "f.nut", [picture] * 2, stored_as, "rawvideo")
    expected = (luma - 16.0) / 219 if stored_as in ("yuyv422", "nv12") else codes / 255
    np.testing.assert_allclose(quiet(path, transfer="linear", **FULL).truth(0).radiance, expected, atol=5e-4)


def test_colour_is_luminance_or_one_channel(tmp_path: Path) -> None:
    red = np.zeros((32, 32, 3), np.uint8)
    red[..., 0] = 255
    path = write_film(tmp_path / "f.mov", [red] * 2, "rgb24", "png")
    assert quiet(path, transfer="linear", **FULL).truth(0).radiance.mean() == pytest.approx(0.2126, rel=1e-3)
    assert quiet(path, transfer="linear", channel="red", **FULL).truth(0).radiance.mean() == 1
    assert quiet(path, transfer="linear", channel="blue", **FULL).truth(0).radiance.max() == 0


def test_wide_colour_has_its_own_luminance(tmp_path: Path) -> None:
    """BT.2020's red has 0.2627 of the luminance of its white."""
    red = np.zeros((32, 32, 3), np.uint16)
    red[..., 0] = 65535
    path = write_film(tmp_path / "f.mkv", [red] * 2, "gbrp16le", color_primaries=9, color_trc=8)
    assert quiet(path, **FULL).truth(0).radiance.mean() == pytest.approx(0.2627, rel=1e-4)


@pytest.mark.parametrize(("matrix", "kr", "kb"), [(1, 0.2126, 0.0722), (6, 0.299, 0.114), (9, 0.2627, 0.0593)])
def test_colours_follow_the_stated_matrix(matrix: int, kr: float, kb: float, tmp_path: Path) -> None:
    rgb = np.array([0.8, 0.4, 0.2])
    y = kr * rgb[0] + (1 - kr - kb) * rgb[1] + kb * rgb[2]
    cb, cr = (rgb[2] - y) / 2 / (1 - kb), (rgb[0] - y) / 2 / (1 - kr)
    planes = [16 + 219 * y, 128 + 224 * cb, 128 + 224 * cr]
    luma, *colour = (np.full((32, 32), round(plane * 4), np.uint16) for plane in planes)
    picture = np.concatenate([luma, *(plane[:8] for plane in colour)])
    path = write_film(tmp_path / "f.mkv", [picture] * 2, "yuv420p10le", colorspace=matrix, color_range=1)
    for channel, value in zip(("red", "green", "blue"), rgb, strict=True):
        assert quiet(path, transfer="linear", channel=channel, **FULL).truth(0).radiance.mean() == pytest.approx(
            value, abs=2e-3
        )


def test_colour_of_half_resolution_lies_at_the_left_of_two_pixels_as_h264_has_it(tmp_path: Path) -> None:
    """Red rises between the columns 14 and 16, by half of it at 15."""
    cb, cr = np.full((16, 16), 128, np.uint8), np.full((16, 16), 128, np.uint8)
    cr[:, 8:] = 200
    picture = np.concatenate([greys([110])[0], cb.reshape(8, 32), cr.reshape(8, 32)])
    path = write_film(tmp_path / "f.mp4", [picture] * 2, "yuv420p", "libx264", options={"qp": "0"})
    red = quiet(path, transfer="linear", channel="red", **FULL).truth(0).radiance[16]
    np.testing.assert_allclose((red[13:18] - red[0]) / (red[-1] - red[0]), [0, 0, 0.5, 1, 1], atol=0.01)


# -- folders and lists -----------------------------------------------------------------------------------------


def test_a_folder_is_in_the_order_of_its_numbers(tmp_path: Path) -> None:
    folder = numbered(tmp_path / "clip", [f"img{i}.png" for i in range(8, 13)])
    (folder / ".DS_Store").write_bytes(b"x")
    scene = quiet(folder, 1000.0, **FULL)
    seen = [scene.truth(40 * i).radiance.mean() for i in range(5)]
    np.testing.assert_allclose(seen, curve("srgb")(np.float32((100 + np.arange(5)) / 255)), rtol=1e-3)
    with pytest.raises(InputError, match="have no times; say film_rate_hz"):
        VideoScene(folder)


def test_a_list_gives_every_picture_its_time(tmp_path: Path) -> None:
    folder = numbered(tmp_path / "clip", ["a.png", "b.png", "c.png"])
    (folder / "times.csv").write_text("time_s, name\n1.0, b.png\n1.1,a.png\n1.5,c.png\n")
    scene = quiet(folder / "times.csv", **FULL)
    seen = [scene.truth(f).radiance.mean() for f in (0, 4000, 20_000)]
    np.testing.assert_allclose(seen, curve("srgb")(np.float32([101 / 255, 100 / 255, 102 / 255])), rtol=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a.png,0\nb.png,1\n", r"unknown column of .*times\.csv 'a\.png'.*name, time_s"),
        ("", "first line must name the columns: name,time_s"),
        ("name\na.png\n", "no column 'time_s'"),
        ("name,time_s\na.png,0\nb.png,0\n", "line 3: the time is 0 s; it must be finite and after"),
        ("name,time_s\na.png,0\nb.png,nan\n", "line 3: the time is nan s"),
        ("name,time_s\na.png,0\nb.png,soon\n", "line 3: the time is 'soon'"),
        ("name,time_s\na.png,0\nb.png\n", "line 3 has 1 entries"),
        ("name,time_s\na.png,0\n../b.png,1\n", r"line 3: '\.\./b\.png' leads out"),
        ("name,time_s\na.png,0\n/etc/passwd,1\n", "leads out"),
        ("name,time_s\na.png,0\nmissing.png,1\n", "there is no file"),
        ("name,time_s\na.png,0\n", "lists 1 pictures"),
        ('name,time_s\n"a.png,0\n', "entries"),
        ("name,time_s\na.png,0\n" + "b" * 200_000 + ".png,1\n", "line 3 is no line of a table: field larger"),
        ("name,time_s\na.png,0\n" + "b" * 5000 + ".png,1\n", "cannot read"),
        ("name,time_s\na.png,0\nb\x00.png,1\n", "line 3: the name is|line contains NUL"),
    ],
)
def test_an_odd_list_is_named_by_its_line(text: str, message: str, tmp_path: Path) -> None:
    folder = numbered(tmp_path / "clip", ["a.png", "b.png"])
    (folder / "times.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        VideoScene(folder / "times.csv")


def test_an_odd_folder_is_named(tmp_path: Path) -> None:
    folder = numbered(tmp_path / "clip", ["img1.png", "img2.png", "img4.png", "img5.png"])
    with pytest.raises(InputError, match=r"between img2\.png and img4\.png the numbers rise by 2.*missing"):
        VideoScene(folder, 30.0)
    (folder / "img4.png").unlink()
    (folder / "img5.png").unlink()
    (folder / "notes.txt").write_text("x")
    with pytest.raises(InputError, match=r"holds notes\.txt, which is no picture"):
        VideoScene(folder, 30.0)
    (folder / "notes.txt").unlink()
    Image.fromarray(np.zeros((5, 8), np.uint8)).save(folder / "img3.png")
    with pytest.raises(InputError, match=r"picture 3 has shape, bits, transfer \(\(5, 8\)"):
        VideoScene(folder, 30.0)
    Image.fromarray(np.zeros((6, 8), np.uint16)).save(folder / "img3.png")
    with pytest.raises(InputError, match=r"picture 3 has shape, bits, transfer .* 16, None"):
        VideoScene(folder, 30.0)
    (folder / "img3.png").write_bytes((folder / "img2.png").read_bytes()[:50])
    with pytest.raises(InputError, match=r"img3\.png is damaged"):
        VideoScene(folder, 30.0)
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(InputError, match="holds 0 pictures"):
        VideoScene(empty, 30.0)


@pytest.mark.parametrize("name", ["f.png", "f.tif", "f.hdr", "f.pfm", "f.ppm"])
def test_pictures_of_16_bits_and_floats_keep_their_depth(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "clip"
    folder.mkdir()
    light = np.repeat(RAMP[..., None], 3, -1) * (4.0 if name in ("f.hdr", "f.pfm") else 1.0)
    kept = light.astype(np.float32) if name in ("f.hdr", "f.pfm") else (65535 * light).round().astype(np.uint16)
    for i in (1, 2):
        assert cv2.imwrite(str(folder / f"{i}{name[1:]}"), kept)
    floats = kept.dtype == np.float32
    if not floats:
        with pytest.raises(InputError, match="16 bits and it does not state their transfer"):
            VideoScene(folder, 30.0)
    scene = quiet(folder, 30.0, transfer=None if floats else "linear", **FULL)
    expected = light[..., 0]
    np.testing.assert_allclose(scene.truth(0).radiance, expected, atol=0.02 if name == "f.hdr" else 1e-5)


@pytest.mark.parametrize("kind", ["float", "half"])
def test_an_exr_is_linear_light_above_one(kind: str, tmp_path: Path) -> None:
    folder = tmp_path / "clip"
    folder.mkdir()
    light = np.float32(np.repeat(3 * RAMP[..., None], 3, -1))
    options = {"format": kind}
    write_film(folder / "p%d.exr", [light] * 2, "gbrpf32le", "exr", options=options, container_format="image2")
    scene = quiet(folder, 30.0, **FULL)
    assert scene.transfer == "linear"
    np.testing.assert_allclose(scene.truth(0).radiance, light[..., 0], rtol=1e-5 if kind == "float" else 1e-3)


# -- refusals and odd films ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "codec", "stored_as", "picture", "message"),
    [
        ("f.mp4", "libx264", "yuv420p", yuv420(greys([80])[0], 128), "interlaced"),
        ("f.mov", "png", "rgba", np.full((32, 32, 4), 254, np.uint8), "transparent"),
        ("f.mkv", "ffv1", "yuv420p", yuv420(greys([80])[0], 128), "coded by matrix 8 of H.273; convert it to BT.709"),
        ("f.nut", "rawvideo", "rgb565le", av.VideoFrame(32, 32, "rgb565le"), "pixels are rgb565le; convert it to RGB"),
        ("f.nut", "rawvideo", "monow", av.VideoFrame(32, 32, "monow"), "pixels are monow; convert it to RGB"),
    ],
)
def test_rare_encodings_are_refused_by_name(
    name: str, codec: str, stored_as: str, picture: Any, message: str, tmp_path: Path
) -> None:
    options = {"x264-params": "tff=1"} if message == "interlaced" else None
    path = write_film(tmp_path / name, [picture] * 2, stored_as, codec, options=options, colorspace=8)
    with pytest.raises(InputError, match=message):
        VideoScene(path, transfer="srgb")


def test_a_film_stands_upright_as_its_file_says(tmp_path: Path) -> None:
    codes = np.zeros((32, 48), np.uint8)
    codes[:8] = 255
    plain = write_film(tmp_path / "plain.mp4", [yuv420(codes, 128)] * 3, "yuv420p", "libx264")
    turned = tmp_path / "turned.mp4"
    content = plain.read_bytes()
    upright = struct.pack(">9i", 1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30)  # a matrix, of the track
    at = content.index(upright, content.index(b"tkhd"))
    quarter = struct.pack(">9i", 0, -(1 << 16), 0, 1 << 16, 0, 0, 0, 0, 1 << 30)
    turned.write_bytes(content[:at] + quarter + content[at + len(quarter) :])
    upright = VideoScene(turned, transfer="linear").truth(0).radiance
    seen = VideoScene(plain, transfer="linear").truth(0).radiance
    reader = cv2.VideoCapture(str(turned))
    _, by_opencv = reader.read()
    assert upright.shape == by_opencv.shape[:2] == (48, 32) != seen.shape
    bright = by_opencv[..., 0] > 128
    assert upright[bright].min() > upright[~bright].max()


@pytest.mark.parametrize("pixels", [(33, 47), (1, 64)])
def test_odd_sizes_are_read_whole(pixels: tuple[int, int], tmp_path: Path) -> None:
    picture = np.full((*pixels, 3), 77, np.uint8)
    scene = quiet(write_film(tmp_path / "f.mov", [picture] * 2, "rgb24", "png"), transfer="srgb")
    assert scene.shape == pixels


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x00" * 5000,
        b"#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n/etc/hostname\n",
        b"ffconcat version 1.0\nfile /etc/hostname\n",
        b"hello world " * 500,
    ],
)
@pytest.mark.parametrize("name", ["f.mp4", "f.txt", "f.m3u8"])
def test_a_file_without_film_is_refused(content: bytes, name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match="not a film"):
        VideoScene(tmp_path / name)


@pytest.mark.parametrize("name", ["x" * 5000, "a\x00b.mp4", "", "http://localhost/f.mp4"])
def test_a_name_of_no_file_is_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"there is no film|\. is a folder|\. holds 0 pictures"):
        VideoScene(name, transfer="srgb")


def test_a_film_of_one_picture_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds 1 pictures"):
        VideoScene(write_film(tmp_path / "f.mkv", greys([80])), transfer="srgb")
    Image.fromarray(np.zeros((8, 8), np.uint8)).save(tmp_path / "f.png")
    with pytest.raises(InputError, match="holds 1 pictures"):
        VideoScene(tmp_path / "f.png", transfer="srgb")


GREY = np.zeros((2, 4, 4), np.uint8)


@pytest.mark.parametrize(
    ("film", "options", "message"),
    [
        (np.full((2, 4, 4), np.nan), {"gamma": 1.0}, "floats must lie"),
        (np.full((2, 4, 4), -0.1), {"transfer": "linear"}, "floats must lie"),
        (np.full((2, 4, 4), np.inf), {"transfer": "linear"}, "floats must lie"),
        (np.full((2, 4, 4), 2.0), {}, "floats must lie"),
        (GREY[:1], {}, "T of 2 or more"),
        (np.zeros((2, 0, 4), np.uint8), {}, "has shape"),
        (np.zeros((3, 4, 4, 2), np.uint8), {}, "has shape"),
        (np.zeros((2, 4, 4), complex), {}, "complex128"),
        (np.zeros((2, 4, 4), np.int32), {}, "int32"),
        (np.ma.masked_less(np.ones((2, 4, 4)), 0.5), {}, "masked"),
        (GREY, {"film_rate_hz": None}, "film_rate_hz is None"),
        (GREY, {"film_rate_hz": None, "times_s": [[0, 1]], "seconds": 1.0}, "times_s must be finite"),
        (GREY, {"transfer": "hlg"}, "unknown transfer 'hlg'; choose one of bt709, gamma2.2, linear, srgb"),
        (GREY, {"transfer": "srgb", "gamma": 2.0}, "one of the two"),
        (GREY, {"gamma": 0.0}, "gamma is 0"),
        (GREY, {"light": (1.0, 0.0)}, "light is"),
        (GREY, {"most_pictures": 1}, "most_pictures is 1"),
        (GREY, {"channel": "red"}, "the pictures are grey"),
        (GREY, {"channel": "pink"}, "unknown channel"),
        (GREY, {"interpolation": "cubic"}, "unknown interpolation"),
        (GREY, {"mean_interval": 0.5}, "mean_interval = 0.5; it must be a number from 1"),
        (GREY, {"shape": (0, 4)}, "shape is"),
        (GREY, {"seconds": float("nan")}, "seconds is nan"),
    ],
)
def test_odd_arrays_and_options_are_named(film: np.ndarray, options: dict, message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        VideoScene(film, **{"film_rate_hz": 30.0, **options})


@pytest.mark.parametrize("rate", [1e-308, 1e-9, 1e9, 1e308])
def test_a_film_has_a_length_that_frames_can_count(rate: float) -> None:
    with pytest.raises(InputError, match="the film lasts"):
        VideoScene(np.zeros((3, 4, 4), np.uint8), rate)


def test_a_film_that_memory_does_not_hold_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_film(tmp_path / "f.mkv", greys(range(20)), color_trc=13)
    monkeypatch.setattr("scenes.film.film_files.MOST_BYTES", 10 * 32 * 32 * 4)
    with pytest.raises(InputError, match="more than 11 pictures"):
        VideoScene(path)
    assert quiet(path, shape=(16, 16)).pictures == 20


def test_linear_light_may_lie_above_one() -> None:
    scene = VideoScene(np.full((2, 4, 4), 2.5), 30.0, transfer="linear", **FULL)
    np.testing.assert_allclose(scene.truth(0).radiance, 2.5)
