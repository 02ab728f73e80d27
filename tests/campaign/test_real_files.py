"""Real recordings into a campaign: labels, formats, parts, and refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spikecam_env.calibration import calibrate
from spikecam_env.campaign import real_files
from spikecam_env.errors import InputError
from spikecam_env.gap import Dark, Flat, Label, Step, import_campaign, labels_from_table, write_campaign
from spikecam_env.sensor import Keyframes
from spikecam_env.streams import SpikeWriter, save_npz, save_vidar_dat
from tools.real_recordings import REAL

real = pytest.mark.skipif(not REAL.is_dir(), reason=f"the real recordings are not at {REAL}")

SHAPE = (10, 16)
RNG = np.random.default_rng(0)
SPIKES = (RNG.random((60, *SHAPE)) < 0.3).astype(np.uint8)
HERE = {"height": 10, "width": 16, "frame_rate_hz": 20_000.0}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The same stream as the formats have it, a rate map, and light over time."""
    home = tmp_path / "recordings"
    home.mkdir()
    save_vidar_dat(home / "up.dat", SPIKES)
    save_vidar_dat(home / "down.dat", SPIKES, flip=True)
    save_npz(home / "first.npz", SPIKES)
    np.savez(home / "last.npz", spk=np.moveaxis(SPIKES, 0, 2))
    with SpikeWriter(home / "h.h5", SHAPE, 20_000.0) as writer:
        writer.append(SPIKES)
    np.savez(home / "rates.npz", rate=SPIKES.mean(axis=0), frames=60)
    np.savez(home / "light.npz", frame=[0.0, 59.0], radiance=np.full((2, 1, 1), 0.3, np.float32))
    return home


def test_every_format_gives_the_same_recording(folder: Path, tmp_path: Path) -> None:
    labels = [
        Label("up.dat", 0.3, name="a"),
        Label("down.dat", 0.3, name="b", reading={"flip": True}),
        Label("first.npz", 0.3, use="holdout"),
        Label("last.npz", "light.npz", reading={"time_axis": 2, "key": "spk"}, v_d=0.7, temperature_k=310.0, note="n"),
        Label("h.h5", "unknown"),
        Label("rates.npz", 0.3),
    ]
    campaign = import_campaign(folder, tmp_path / "out", labels, **HERE)
    assert campaign.shape == SHAPE and campaign.frame_rate_hz == 20_000.0
    for recording in campaign.recordings[:5]:
        np.testing.assert_array_equal(recording.load(), SPIKES)
    np.testing.assert_array_equal(campaign.recordings[5].rate(), SPIKES.mean(axis=0))
    assert [r.name for r in campaign.recordings] == ["a", "b", "first", "last", "h", "rates"]
    last = campaign.recordings[3]
    assert (last.v_d, last.temperature_k, last.note, last.use) == (0.7, 310.0, "n", "fit")
    assert campaign.recordings[4].light() is None and last.light().frame.tolist() == [0.0, 59.0]
    assert campaign.recordings[0].static_radiance()[0, 0] == np.float32(0.3)


def test_a_part_and_a_held_out_end(folder: Path, tmp_path: Path) -> None:
    labels = [Label("first.npz", "light.npz"), Label("h.h5", 0.3, use="holdout"), Label("rates.npz", 0.2)]
    campaign = import_campaign(
        folder, tmp_path / "out", labels, rows=(2, 8), columns=(3, 7), holdout_share=0.25, frame_rate_hz=20_000.0
    )
    part = SPIKES[:, 2:8, 3:7]
    head, tail, other, rates = campaign.recordings
    np.testing.assert_array_equal(head.load(), part[:45])
    np.testing.assert_array_equal(tail.load(), part[45:])
    np.testing.assert_array_equal(other.load(), part)
    np.testing.assert_array_equal(rates.rate(), part.mean(axis=0))
    assert (head.use, tail.use, tail.name) == ("fit", "holdout", "first-holdout")
    assert tail.light().frame.tolist() == [-45.0, 14.0]


def test_a_table_says_it_too(folder: Path, tmp_path: Path) -> None:
    table = tmp_path / "labels.csv"
    table.write_text(
        "file, radiance, use, flip, height, width, first, name\n"
        "up.dat, 0, fit, false, 10, 16, 20, dark\n"
        "down.dat, unknown, holdout, true, 10, 16, ,\n"
        "h.h5, light.npz,,,,,,\n"
    )
    labels = labels_from_table(table)
    campaign = import_campaign(folder, tmp_path / "out", labels, frame_rate_hz=20_000.0)
    np.testing.assert_array_equal(campaign.recordings[0].load(), SPIKES[20:])
    np.testing.assert_array_equal(campaign.recordings[1].load(), SPIKES)
    assert [r.name for r in campaign.recordings] == ["dark", "down", "h"]
    assert campaign.recordings[0].static_radiance().max() == 0.0


def test_labels_in_lux_become_radiance(folder: Path, tmp_path: Path) -> None:
    campaign = import_campaign(folder, tmp_path / "out", [Label("h.h5", 335.0)], radiance_per_unit=6e-4)
    assert campaign.recordings[0].static_radiance()[0, 0] == pytest.approx(0.201, rel=1e-6)


def test_an_imported_campaign_is_worth_as_much_as_the_one_it_is_from(tmp_path: Path) -> None:
    levels = (0.05, 0.2, 0.5)
    planned = [Dark(), *(Flat(radiance=x) for x in levels), Step()]
    written = write_campaign(tmp_path / "a", "physical", shape=(8, 8), frames=1500, recordings=planned)
    labels = [Label(f"{p.file_name}.dat", r) for p, r in zip(planned, (0, *levels, "step.npz"), strict=True)]
    again = import_campaign(tmp_path / "a", tmp_path / "b", labels, height=8, width=8, frame_rate_hz=40_000.0)
    np.testing.assert_array_equal(calibrate(again).main.gain, calibrate(written).main.gain)


def folder_label(file: str, radiance="0.3", **options) -> Label:
    return Label(file, radiance if radiance in ("unknown", "relative", "light.npz") else float(radiance), **options)


@pytest.mark.parametrize(
    ("labels", "options", "message"),
    [
        ([], {}, r"no labels.*down\.dat.*up\.dat"),
        ([folder_label("absent.dat")], {}, r"no file .*absent\.dat"),
        ([folder_label("up.dat")], {"height": 7}, "remainder"),
        ([folder_label("up.dat"), folder_label("up.dat")], {}, "two recordings would be named 'up'"),
        ([folder_label("up.dat", use="train")], {}, "choose one of fit, holdout"),
        ([folder_label("up.dat", "relative")], {}, "`relative` is for flat maps"),
        ([folder_label("up.dat")], {"rows": (5, 50)}, "rows 5 to 50 of up.dat, which has 10"),
        ([folder_label("up.dat")], {"holdout_share": 1.0}, "holdout_share = 1.0"),
        ([folder_label("up.dat")], {"colour": 3}, "unknown reading option 'colour'"),
        ([folder_label("up.dat")], {"frame_rate_hz": None}, "do not say their frame rate"),
        ([folder_label("h.h5")], {"frame_rate_hz": 40_000.0}, "says 20000 frames a second"),
        ([folder_label("last.npz", reading={"time_axis": 5})], {}, "time_axis is 5"),
        ([folder_label("h.h5"), folder_label("small.npz")], {}, r"'small' has \(4, 4\) pixels, 'h' has \(10, 16\)"),
        ([folder_label("flat.npz")], {}, "which axis is time"),
        ([folder_label("text.npz")], {}, r"not a readable \.npz"),
        ([folder_label("notes.txt")], {}, "ends in '.txt'"),
        ([folder_label("up.dat", "light.npz", reading={"height": 5, "width": 32})], {"columns": (0, 3)}, None),
        ([folder_label("big.npz")], {}, "runs from 0 to 1.5"),
    ],
)
def test_nonsense_is_refused_and_nothing_is_left(labels, options, message, folder: Path, tmp_path: Path) -> None:
    save_npz(folder / "small.npz", SPIKES[:, :4, :4])
    np.savez(folder / "flat.npz", a=np.ones((5, 5, 5), np.uint8))
    np.savez(folder / "big.npz", rate=np.array([[0.0, 1.5]]), frames=10)
    for name in ("text.npz", "notes.txt"):
        (folder / name).write_text("no recording")
    settings = HERE | options
    if message is None:
        assert import_campaign(folder, tmp_path / "out", labels, **settings).shape == (5, 3)
        return
    with pytest.raises(InputError, match=message):
        import_campaign(folder, tmp_path / "out", labels, **settings)
    assert {p.name for p in tmp_path.iterdir()} == {"recordings"}


def test_a_folder_that_holds_something_is_not_written_over(folder: Path) -> None:
    with pytest.raises(InputError, match="not an empty folder"):
        import_campaign(folder, folder, [Label("h.h5", 0.3)])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("file,light\na.dat,3\n", "unknown column of .* 'light'"),
        ("file\na.dat\n", "no column 'radiance'"),
        ("file,radiance\n", "lists no recordings"),
        ("file,radiance\na.dat,\n", "line 2: the radiance is missing"),
        ("file,radiance\n,3\n", "line 2: the file's name is missing"),
        ("file,radiance\na.dat,bright\n", "line 2: radiance is 'bright'"),
        ("file,radiance\na.dat,-1\n", "line 2: radiance is '-1'"),
        ("file,radiance,first\na.dat,1,2.5\n", "line 2: first is '2.5'; it must be a whole number"),
        ("file,radiance,flip\na.dat,1,up\n", "flip is 'up'"),
        ("file,radiance\na.dat,1,2\n", "line 2 has more cells"),
    ],
)
def test_a_bad_table_is_refused_by_line(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "labels.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        labels_from_table(tmp_path / "labels.csv")


@real
def test_the_wall_and_the_flat_maps_become_campaigns(tmp_path: Path) -> None:
    wall = import_campaign(
        REAL,
        tmp_path / "wall",
        [Label("wall.npz", "unknown")],
        frame_rate_hz=40_000.0,
        rows=(110, 174),
        columns=(15, 79),
        holdout_share=0.5,
    )
    assert wall.shape == (64, 64) and [r.frames for r in wall.recordings] == [250, 250]
    assert 0.1 < wall.recordings[0].load().mean() < 0.3 and wall.recordings[0].light() is None
    maps = import_campaign(REAL, tmp_path / "maps", [Label("flat_335lux_maps.npz", "relative")], frame_rate_hz=20_000.0)
    lit, dark, dim = maps.recordings
    assert (lit.use, dark.use, dim.use) == ("fit", "fit", "holdout")
    assert np.median(dim.rate() - dark.rate()) == pytest.approx(dim.static_radiance()[0, 0], rel=1e-6)
    assert np.median(lit.rate() - dark.rate()) == pytest.approx(lit.static_radiance()[0, 0], rel=1e-6)
    assert dark.static_radiance().max() == 0.0


def test_light_that_jumps_is_the_same_for_a_part_that_begins_later():
    jumps = np.array([0.0, 1.5, 900.25, 1200.75])
    light = Keyframes.steps(jumps, np.array([0.1, 0.4, 0.2, 0.3], np.float32).reshape(-1, 1, 1))
    later = real_files._later(light, 1000)
    for t in (0.0, 200.7, 200.75, 900.0):
        assert later.at(t) == light.at(t + 1000)
