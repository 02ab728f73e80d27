"""Names are names, and reading stays inside the folder unless the user says otherwise."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from spikecam_env.calibration import write_flats
from spikecam_env.campaign import read_campaign
from spikecam_env.cli.main import run
from spikecam_env.datasets import verify
from spikecam_env.errors import InputError
from spikecam_env.gap import Label, import_campaign
from spikecam_env.names import MOST_BYTES, distinct, file_name, inside
from spikecam_env.sensor import SensorModel
from spikecam_env.streams import save_vidar_dat
from spikecam_env.untrusted import hdf5_values, open_hdf5

GOOD = ("flat-120", "flat 120", "wand.hell", "Ünïcode", "2024_01_02", "a+b=c", "x" * MOST_BYTES)
BAD = (
    *("", " ", ".", "..", "../x", "a/b", "/etc/x", "C:\\x", "a\\b", "a:b", ".hidden", "x.", "x ", " x", "a\nb"),
    *("a\x00b", "a\x7f", "con", "NUL.txt", "com1", "\ud800", "a*", "a?", "x" * (MOST_BYTES + 1), "\u202eexe"),
)


@pytest.mark.parametrize("name", GOOD)
def test_a_plain_name_is_taken(name: str) -> None:
    assert file_name(name, "name") == name


def test_names_that_are_one_file_are_refused() -> None:
    distinct(["a", "b", "ab"], "recording")
    for names in (["a", "a"], ["Flat", "flat"], ["é", "e\u0301"]):
        with pytest.raises(InputError, match="recording"):
            distinct(names, "recording")


@pytest.fixture
def places(tmp_path: Path) -> tuple[Path, Path]:
    """(folder, a file beside it); in the folder `in.dat`, and links to within and without."""
    folder, beside = tmp_path / "folder", tmp_path / "beside.dat"
    (folder / "sub").mkdir(parents=True)
    for path in (folder / "in.dat", folder / "sub" / "in.dat", beside):
        path.write_bytes(b"x")
    (folder / "within.dat").symlink_to("in.dat")
    (folder / "without.dat").symlink_to(beside)
    (folder / "up").symlink_to(tmp_path)
    (folder / "circle.dat").symlink_to("circle.dat")
    return folder, beside


@pytest.mark.parametrize("text", ["in.dat", "sub/in.dat", "within.dat", "not there.dat"])
def test_a_file_in_the_folder_is_found(text: str, places) -> None:
    assert inside(places[0], text, "file") == places[0] / text


@pytest.mark.parametrize("text", ["../beside.dat", "sub/../../beside.dat", "without.dat", "up/beside.dat", "{beside}"])
def test_a_file_outside_of_the_folder_is_refused_unless_asked(text: str, places) -> None:
    folder, beside = places
    text = text.format(beside=beside)
    with pytest.raises(InputError, match="outside"):
        inside(folder, text, "file")
    assert inside(folder, text, "file", outside=True).read_bytes() == b"x"


@pytest.mark.parametrize("text", ["", "a\x00b", "\ud800", "x" * 300, "circle.dat", "C:\\x", "\\\\host\\x"], ids=ascii)
def test_what_is_no_path_is_refused(text: str, places) -> None:
    with pytest.raises(InputError, match="file"):
        inside(places[0], text, "file")


def test_a_folder_may_itself_be_a_link(places, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(places[0])
    assert inside(tmp_path / "link", "in.dat", "file").is_file()


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    folder = tmp_path / "recordings"
    folder.mkdir()
    save_vidar_dat(folder / "a.dat", np.zeros((8, 8, 8), np.uint8))
    save_vidar_dat(tmp_path / "beside.dat", np.zeros((8, 8, 8), np.uint8))
    return folder


HERE = {"frame_rate_hz": 40_000.0, "height": 8, "width": 8}


@pytest.mark.parametrize("name", [name for name in BAD if name], ids=ascii)
def test_an_import_writes_nothing_where_a_label_points(name: str, recordings: Path, tmp_path: Path) -> None:
    before = {*tmp_path.rglob("*")}  # a `../x` from `out` is in it
    with pytest.raises(InputError, match="name"):
        import_campaign(recordings, tmp_path / "out", [Label("a.dat", 0.3, name=name)], **HERE)
    assert {*tmp_path.rglob("*")} == before


def test_an_import_reads_beyond_its_folder_only_if_asked(recordings: Path, tmp_path: Path) -> None:
    label = [Label("../beside.dat", 0.3)]
    with pytest.raises(InputError, match="outside"):
        import_campaign(recordings, tmp_path / "out", label, **HERE)
    assert import_campaign(recordings, tmp_path / "out", label, outside=True, **HERE).recordings[0].name == "beside"


@pytest.mark.parametrize("where", ["beside", "link", "absolute"])
def test_a_campaign_reads_beyond_its_folder_only_if_asked(where: str, tmp_path: Path, capsys) -> None:
    folder = tmp_path / "campaign"
    write_flats(folder, SensorModel.preset("ideal"), levels=(0.0, 0.1), frames=16, shape=(4, 4))
    moved = tmp_path / "moved.dat"
    (folder / "flat-01.dat").rename(moved)
    data = json.loads((folder / "campaign.json").read_text())
    if where == "link":
        (folder / "flat-01.dat").symlink_to(moved)
    else:
        data["recordings"][1]["spikes"] = "../moved.dat" if where == "beside" else str(moved)
        (folder / "campaign.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"'flat-01': spikes.*outside"):
        read_campaign(folder)
    assert read_campaign(folder, outside=True).recordings[1].load().shape == (16, 4, 4)
    for command in ("calibrate", "diagnose", "ladder"):
        assert run([command, str(folder), "--out", str(tmp_path / "out")]) == 2
        assert "--outside" in capsys.readouterr().err


def test_a_dataset_reads_beyond_its_folder_only_if_asked(tmp_path: Path, capsys) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    settings = {"package_version": "0", "kind": "x", "shape": [8, 8], "frames": 8, "seed": 0, "truth_every": 0,
                "mean_interval": 10.0, "model": "", "renderer": "embree"}  # fmt: skip
    file = {"path": "../x.h5", "scene": "a", "scene_seed": 0, "unit_seed": 0, "bytes": 1, "sha256": "0" * 64}
    data = {"format": "spikecam-dataset/1", "settings": settings, "files": [file]}
    (folder / "dataset.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match="outside"):
        verify(folder)
    assert "missing" in verify(folder, outside=True)[0]
    assert run(["dataset", "verify", str(folder)]) == 2
    assert "--outside" in capsys.readouterr().err


def test_hdf5_values_in_other_files_are_refused_unless_asked(tmp_path: Path) -> None:
    (tmp_path / "raw.bin").write_bytes(bytes(range(8)))
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["x"] = np.arange(8, dtype=np.uint8)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["group/here"] = np.arange(8, dtype=np.uint8)
        file["soft"] = h5py.SoftLink("/group/here")
        file["link"] = h5py.ExternalLink("other.h5", "/x")
        file.create_dataset("raw", (8,), "u1", external=[(str(tmp_path / "raw.bin"), 0, 8)])
        layout = h5py.VirtualLayout((8,), "u1")
        layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", (8,))
        file.create_virtual_dataset("virtual", layout)
    with open_hdf5(tmp_path / "a.h5") as file:
        assert hdf5_values(file, "group/here", "a.h5").tolist() == list(range(8))
        assert hdf5_values(file, "group/here", "a.h5", slice(2, 4)).tolist() == [2, 3]
        for name in ("soft", "link", "raw", "virtual"):
            with pytest.raises(InputError, match=r"outside=True"):
                hdf5_values(file, name, "a.h5")
            assert hdf5_values(file, name, "a.h5", outside=True).tolist() == list(range(8))
        for name in ("nothing", "group", "group/here/x", ""):
            with pytest.raises(InputError):
                hdf5_values(file, name, "a.h5")


def test_an_hdf5_array_that_no_memory_holds_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("x", (1 << 50, 8), np.uint8, chunks=(64, 8))
    with open_hdf5(tmp_path / "a.h5") as file:
        with pytest.raises(InputError, match="memory"):
            hdf5_values(file, "x", "a.h5")
        assert hdf5_values(file, "x", "a.h5", slice(0, 3)).shape == (3, 8)
