"""Headerless files: the loaders warn of a wrong geometry, keep whole frames of a cut file, and read side files."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.streams import load_vidar_dat, pack_frames, read_recording, save_vidar_dat
from spikecam_env.streams.packets import LINES


def ramp(frames: int, shape: tuple[int, int], seed: int = 0) -> np.ndarray:
    light = np.linspace(0.1, 1, shape[1]) * np.linspace(0.3, 1, shape[0])[:, None]
    return SpikeSensor(SensorModel.preset("scsim"), shape, seed).step(light.astype(np.float32), frames)


@pytest.fixture(autouse=True)
def warnings_are_errors_unless_expected() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        yield


def test_500_x_800_read_as_250_x_400_is_warned_of_and_named(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    spikes = ramp(24, (500, 800))
    save_vidar_dat(path, spikes)
    with pytest.warns(UserWarning, match=r"a\.dat read as 250 x 400.*height=500, width=800") as warned:
        assert load_vidar_dat(path).shape == (96, 250, 400)
    assert len(warned) == 1 and "\n" not in str(warned[0].message)
    assert Path(warned[0].filename).name == "test_headerless.py"
    np.testing.assert_array_equal(load_vidar_dat(path, height=500, width=800), spikes)


@pytest.mark.parametrize("shape", [(250, 416), (64, 48), (300, 500)])
def test_another_size_is_warned_of_however_little_is_read(tmp_path: Path, shape: tuple[int, int]) -> None:
    path = tmp_path / "a.dat"
    whole = 12_500 * shape[0] * shape[1] // np.gcd(12_500 * 8, shape[0] * shape[1]) // 12_500
    save_vidar_dat(path, ramp(12_500 * 8 * whole // (shape[0] * shape[1]) * max(1, 40 // whole), shape))
    with pytest.warns(UserWarning, match=f"height={shape[0]}, width={shape[1]}"):
        load_vidar_dat(path, first=2, count=1)


def test_the_other_bit_order_is_warned_of(tmp_path: Path) -> None:
    patches = np.random.default_rng(0).uniform(0.05, 0.4, (25, 40)).repeat(10, axis=0).repeat(10, axis=1)
    spikes = SpikeSensor(SensorModel.preset("scsim"), (250, 400), 0).step(patches.astype(np.float32), 60)
    save_vidar_dat(tmp_path / "a.dat", spikes, bit_order="big")
    with pytest.warns(UserWarning, match="bit_order='big'"):
        load_vidar_dat(tmp_path / "a.dat")
    load_vidar_dat(tmp_path / "a.dat", bit_order="big")


def test_a_byte_a_pixel_is_warned_of_and_reads_as_raw(tmp_path: Path) -> None:
    spikes = ramp(100, (25, 40))
    spikes.tofile(tmp_path / "a.dat")
    with pytest.warns(UserWarning, match=r"one byte a pixel.*\.raw"):
        load_vidar_dat(tmp_path / "a.dat", height=250, width=400)
    spikes.tofile(tmp_path / "a.raw")
    recording = read_recording(tmp_path / "a.raw", height=25, width=40)
    np.testing.assert_array_equal(recording.spikes, spikes)


def test_a_size_that_does_not_divide_is_refused_where_the_spikes_say_why(tmp_path: Path) -> None:
    save_vidar_dat(tmp_path / "a.dat", ramp(30, (300, 500)))
    with pytest.raises(InputError, match=r"remainder 3500.*height=300, width=500"):
        load_vidar_dat(tmp_path / "a.dat", height=250, width=416)


@pytest.mark.parametrize("cut", [1, 700, 12_499])
def test_whole_frames_of_a_cut_recording_are_read_with_a_warning(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "a.dat"
    spikes = ramp(30, (250, 400))
    path.write_bytes(pack_frames(spikes).tobytes()[:-cut])
    with pytest.warns(UserWarning, match=r"a\.dat ends in the middle of a frame.*29 whole frames") as warned:
        np.testing.assert_array_equal(load_vidar_dat(path), spikes[:29])
    assert len(warned) == 1


def test_a_cut_that_another_known_size_divides_is_read_if_the_spikes_agree(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    spikes = ramp(40, (250, 400))
    packed = pack_frames(spikes).tobytes()
    path.write_bytes(packed[: 13_000 * 37])  # 481 000 bytes: 37 frames of 250 x 416, or 38.48 of 250 x 400
    with pytest.warns(UserWarning, match="38 whole frames"):
        np.testing.assert_array_equal(load_vidar_dat(path), spikes[:38])
    path.write_bytes(bytes(13_000 * 37))  # dark: the spikes say nothing, the size does
    with pytest.raises(InputError, match="250 x 416"):
        load_vidar_dat(path)


def test_a_cut_raw_file_is_read_with_a_warning(tmp_path: Path) -> None:
    spikes = ramp(10, (24, 41))
    (tmp_path / "a.bin").write_bytes(spikes.tobytes()[:-5])
    with pytest.warns(UserWarning, match="9 whole frames"):
        np.testing.assert_array_equal(read_recording(tmp_path / "a.bin", height=24, width=41).spikes, spikes[:9])


# Side files


@pytest.mark.parametrize("name", ["a.dat.json", "a.json"])
@pytest.mark.parametrize("ending", [".dat", ".raw"])
def test_a_side_file_gives_the_geometry(tmp_path: Path, name: str, ending: str) -> None:
    spikes = ramp(20, (24, 48))
    entries = {"height": 24, "width": 48, "flip": True, "crop_width": 40, "frame_rate_hz": 20000}
    (tmp_path / name.replace(".dat", ending)).write_text(json.dumps(entries))
    path = tmp_path / f"a{ending}"
    path.write_bytes(pack_frames(spikes).tobytes() if ending == ".dat" else spikes.tobytes())
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.spikes, spikes[:, ::-1, :40])
    assert recording.frame_rate_hz == 20_000.0
    assert recording.attributes["geometry_from"] == name.replace(".dat", ending)
    assert "20 frames of 24 rows x 40 columns, of 24 x 48 stored, flipped upside down" in str(recording)


def test_save_writes_a_side_file_that_reads_back(tmp_path: Path) -> None:
    spikes = ramp(20, (24, 41))
    options: dict[str, Any] = {"flip": True, "bit_order": "big", "side_file": True, "frame_rate_hz": 40_000.0}
    save_vidar_dat(tmp_path / "a.dat", spikes, **options)
    recording = read_recording(tmp_path / "a.dat")
    np.testing.assert_array_equal(recording.spikes, spikes)
    assert recording.frame_rate_hz == 40_000.0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.dat", "a.dat.json"]


def test_what_the_caller_says_counts_before_the_side_file_with_a_warning(tmp_path: Path) -> None:
    spikes = np.zeros((20, 24, 48), np.uint8)
    spikes[3, 1, 2] = 1
    save_vidar_dat(tmp_path / "a.dat", spikes, side_file=True)
    with pytest.warns(UserWarning, match=r"height=48, not 24, width=24, not 48 as a\.dat\.json says"):
        assert load_vidar_dat(tmp_path / "a.dat", height=48, width=24).shape == (20, 48, 24)
    assert load_vidar_dat(tmp_path / "a.dat", height=24, width=48).shape == (20, 24, 48)
    with pytest.warns(UserWarning, match="flip=True, not False"):
        np.testing.assert_array_equal(load_vidar_dat(tmp_path / "a.dat", flip=True), spikes[:, ::-1])


def test_a_json_file_of_something_else_is_no_side_file(tmp_path: Path) -> None:
    spikes = ramp(4, (250, 400))
    save_vidar_dat(tmp_path / "a.dat", spikes)
    for text in ('{"camera": "Vidar"}', "[1, 2]", '"text"'):
        (tmp_path / "a.json").write_text(text)
        assert read_recording(tmp_path / "a.dat").attributes["geometry_from"] == "usual"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "JSON"),
        ("[" * 100_000, "JSON"),
        ("[]", "dictionary"),
        ("{}", "height is missing"),
        ('{"height": 24}', "width is missing"),
        ('{"height": "24", "width": 48}', "height = '24'"),
        ('{"height": 24.5, "width": 48}', "height = 24.5"),
        ('{"height": true, "width": 48}', "height = True"),
        ('{"height": -1, "width": 48}', "height = -1"),
        ('{"height": 1e400, "width": 48}', "height"),
        ('{"height": ' + "1" * 400 + ', "width": 48}', "height"),
        ('{"height": 1000000, "width": 1000000}', "pixels"),
        ('{"height": 24, "width": 48, "widht": 3}', "widht"),
        ('{"height": 24, "width": 48, "bit_order": "middle"}', "bit_order"),
        ('{"height": 24, "width": 48, "flip": 1}', "flip"),
        ('{"height": 24, "width": 48, "crop_width": 49}', "crop_width is 49"),
        ('{"height": 24, "width": 48, "frame_rate_hz": 0}', "frame_rate_hz"),
        ('{"height": 24, "width": 48, "frame_rate_hz": NaN}', "NaN"),
        ('{"height": 24, "width": 48, "layout": "planes"}', "layout"),
    ],
)
def test_a_wrong_side_file_is_one_input_error(tmp_path: Path, text: str, said: str) -> None:
    save_vidar_dat(tmp_path / "a.dat", ramp(4, (24, 48)))
    (tmp_path / "a.dat.json").write_text(text)
    with pytest.raises(InputError, match=said) as refused:
        read_recording(tmp_path / "a.dat")
    assert "\n" not in str(refused.value) and len(str(refused.value)) < 400


@pytest.mark.parametrize(
    "options",
    [
        {"height": 0},
        {"height": -250},
        {"height": True},
        {"height": "250"},
        {"width": 2.5},
        {"width": 10**30},
        {"flip": "yes"},
        {"bit_order": "middle"},
        {"bit_order": 1},
        {"crop_width": 0},
        {"crop_width": 401},
        {"crop_width": 2.5},
        {"layout": "planes"},
        {"first": -1},
        {"first": 0.5},
        {"first": 4},
        {"count": 0},
        {"count": True},
        {"count": 10**30},
    ],
)
def test_options_out_of_range_are_refused(tmp_path: Path, options: dict[str, Any]) -> None:
    save_vidar_dat(tmp_path / "a.dat", np.zeros((4, 250, 400), np.uint8))
    with pytest.raises(InputError):
        load_vidar_dat(tmp_path / "a.dat", **options)


def test_raw_bytes_need_a_size_and_0_and_1(tmp_path: Path) -> None:
    (ramp(4, (24, 48)) * 255).tofile(tmp_path / "a.raw")
    with pytest.raises(InputError, match=r"give height and width, or a file a\.raw\.json"):
        read_recording(tmp_path / "a.raw")
    with pytest.raises(InputError, match=r"a\.raw: spikes hold the value 255"):
        read_recording(tmp_path / "a.raw", height=24, width=48)


# Packets of a megapixel camera


def as_packets(spikes: np.ndarray, *, rolled: int = 0) -> bytes:
    """The inverse of the reader: 500 pixels, 10 bits of line, 2 of channel a packet; a dump may begin anywhere."""
    rows = np.arange(1000)
    line = np.where(rows < LINES, LINES - rows, rows - LINES + 1)
    channel = np.where(rows < LINES, 0, 2)[:, None] + np.arange(2)
    bits = np.zeros((len(spikes), 1000, 2, 512), np.uint8)
    bits[..., :500] = spikes.reshape(len(spikes), 1000, 2, 500)
    bits[..., 500:510] = (line[:, None, None] >> np.arange(10)) & 1
    bits[..., 510:] = (channel[:, :, None] >> np.arange(2)) & 1
    return np.packbits(bits.reshape(-1, 512), axis=1, bitorder="little").tobytes()[rolled:]


@pytest.mark.parametrize("rolled", [0, 64, 48, 128_000 - 16])
def test_packets_are_read_from_their_first_whole_frame(tmp_path: Path, rolled: int) -> None:
    spikes = ramp(3, (1000, 1000))
    path = tmp_path / "a.dat"
    path.write_bytes(as_packets(spikes, rolled=rolled))
    kept = spikes if rolled == 0 else spikes[1:]
    np.testing.assert_array_equal(load_vidar_dat(path, layout="packets"), kept)
    np.testing.assert_array_equal(load_vidar_dat(path, layout="packets", first=1, count=1, flip=True), kept[1:2, ::-1])


def test_packets_read_as_bits_are_warned_of(tmp_path: Path) -> None:
    (tmp_path / "a.dat").write_bytes(as_packets(ramp(5, (1000, 1000))))
    with pytest.warns(UserWarning, match="layout='packets'"):
        load_vidar_dat(tmp_path / "a.dat", height=1000, width=1024)


def test_packets_out_of_step_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    whole = as_packets(ramp(3, (1000, 1000)))
    path.write_bytes(whole[:128_064] + whole[128_128:])  # one packet lost in frame 1
    with pytest.raises(InputError, match="frame 1 is out of step"):
        load_vidar_dat(path, layout="packets")
    assert load_vidar_dat(path, layout="packets", count=1).shape == (1, 1000, 1000)
    for data in (b"", bytes(200_000), whole[:1000], np.random.default_rng(0).bytes(300_000)):
        path.write_bytes(data)
        with pytest.raises(InputError, match="does not hold a frame"):
            load_vidar_dat(path, layout="packets")
    path.write_bytes(whole)
    with pytest.raises(InputError, match="leave height and width"):
        load_vidar_dat(path, layout="packets", height=250, width=400)
