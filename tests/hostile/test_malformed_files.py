"""Malformed files of every format that a command reads: one line, code 2, nothing left behind; never a traceback."""

from __future__ import annotations

import io
import itertools
import json
import os
import tempfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from mutations import damaged, json_files, npz, npz_files, toml_files
from tally import each, reads_or_refuses

from denoiser.evaluate.judge import RowResult
from denoiser.evaluate.work import FORMAT, Results
from denoiser.networks.reconstructor_recipe import WIDTH_STEP, reconstructor_recipe
from denoiser.weights import load_reconstructor, load_weights, pretrained_path, save_weights
from spikecam_env.calibration import write_flats
from spikecam_env.campaign import read_campaign
from spikecam_env.campaign.writing import save_rates
from spikecam_env.datasets import verify
from spikecam_env.datasets.manifest import Manifest
from spikecam_env.sensor import SensorModel

FRAMES, SHAPE = 64, (8, 8)
SHARE = 7
"""Of the cases of a reader, every so many go through its command too, which takes thirty times as long."""
RNG = np.random.default_rng(0)
FLOW = ("evaluate", "flow", "--rows", "noisy", "--scenes", "disk", "--size", 16, 16)

CAMPAIGN = {
    "format": "spikecam-campaign/1",
    "camera": {"height": 8, "width": 8, "frame_rate_hz": 40000.0},
    "recordings": [
        {
            "name": "flat-01",
            "spikes": "flat-01.dat",
            "frames": FRAMES,
            "radiance": "flat-01.npz",
            "use": "fit",
            "v_d": 1.1,
            "temperature_k": 300.0,
            "note": "a lamp",
        },
        {"name": "rates", "rates": "rates.npz", "radiance": "flat-02.npz", "v_d": 1.1},
        {"name": "dark-00", "spikes": "dark-00.dat", "frames": FRAMES, "radiance": "dark-00.npz", "v_d": 1.1},
        {"name": "flat-02", "spikes": "flat-02.dat", "frames": FRAMES, "radiance": "flat-02.npz", "v_d": 1.1},
    ],
}
MODEL = {
    "format": "spikecam-model/1",
    "name": "mine",
    "frame_rate_hz": 40000.0,
    "circuit": {
        "reset_V": 3.3,
        "reference_V": 2.2,
        "bias_V": -0.0076,
        "capacitance_fF": 4.348,
        "temperature_K": 300.0,
    },
    "effect": [
        {"name": "dead_time", "tau_us": 0.2},
        {"name": "shot_noise", "quanta": 700.0, "dark_is_noisy": True},
        {"name": "afterpulsing", "probability": 0.01, "delay_frames": 2},
    ],
}
LIGHT = {"frame": np.zeros(1), "radiance": np.full((1, 1, 1), 0.1, np.float32)}
BRIGHTER = {"frame": np.zeros(1), "radiance": np.full((1, 1, 1), 0.3, np.float32)}
RATES = {"rate": np.full(SHAPE, 0.3), "frames": np.array(FRAMES)}
SPIKES = (RNG.random((FRAMES, *SHAPE)) < 0.3).astype(np.uint8)
STREAM = {"spikes": SPIKES, "time_axis": np.array(0)}
MAPS = {"D_light": np.full(SHAPE, 3.0), "Nd": np.full(SHAPE, 2.0)}
PACKED = {"seq": np.packbits(SPIKES[:40], axis=0, bitorder="big"), "length": np.array(40)}


EVALUATION = {"shape": [8, 8], "frames": 200, "data": None}
RESULT = {
    "scene": "disk",
    "seed": 0,
    "interval": 10.0,
    "speed": 0.0,
    "row": "best",
    "weights": {"best": "0" * 64, "spk2img-clean": None},
    "pictures": {"tfi": {"db": 20.0, "ssim": 0.5, "niqe": None}},
    "mean_plane": {"db": 30.0, "ssim": 0.9, "niqe": None},
    "bias": 0.01,
    "db_by_place": [30.0, None],
}


def put(path: Path, data: bytes) -> None:
    """A new file there, even where a reader has the last one open."""
    path.unlink(missing_ok=True)
    path.write_bytes(data)


def every(share: int, files):
    """The first of every so many, to the last."""
    return itertools.islice(files, 0, None, share)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory) -> Path:
    """A good campaign, but for its campaign.json."""
    folder = tmp_path_factory.mktemp("campaign")
    write_flats(folder, SensorModel.preset("physical"), levels=(0.0, 0.1, 0.3), frames=FRAMES, shape=SHAPE)
    save_rates(folder / "rates.npz", RATES["rate"], FRAMES)
    return folder


def changed(folder: Path, name: str, data: bytes, good: dict = CAMPAIGN) -> Path:
    """The campaign with one file changed; the next change undoes it."""
    (folder / "campaign.json").write_text(json.dumps(good))
    for file, arrays in (("flat-01.npz", LIGHT), ("flat-02.npz", BRIGHTER), ("rates.npz", RATES)):
        put(folder / file, npz(arrays))
    put(folder / name, data)
    return folder


def calibrated(target: str, folder: Path, out: Path, meets, through_command: bool = True) -> None:
    """A campaign through its readers and, where they refuse it, through `calibrate`; a good one takes a second."""
    good = reads_or_refuses(target, lambda: [r.rate() if r.rates else r.load() for r in read_lit(folder)])
    if through_command and not good:
        assert meets(f"{target} (calibrate)", "calibrate", folder, "--out", out) == 2


def read_lit(folder: Path):
    """Its recordings, whose light can be read."""
    recordings = read_campaign(folder).recordings
    for recording in recordings:
        recording.light()
    return recordings


def test_a_malformed_campaign_json_is_refused(campaign: Path, tmp_path: Path, meets) -> None:
    number = itertools.count()

    def check(data: bytes) -> None:
        folder = changed(campaign, "campaign.json", data)
        calibrated("campaign.json", folder, tmp_path / "out", meets, next(number) % SHARE == 0)

    each(json_files(CAMPAIGN, within=2), check)


def test_malformed_light_is_refused(campaign: Path, tmp_path: Path, meets) -> None:
    def check(data: bytes) -> None:
        calibrated("light .npz", changed(campaign, "flat-01.npz", data), tmp_path / "out", meets)

    each(npz_files(LIGHT), check)


def test_malformed_rates_are_refused(campaign: Path, tmp_path: Path, meets) -> None:
    def check(data: bytes) -> None:
        calibrated("rates .npz", changed(campaign, "rates.npz", data), tmp_path / "out", meets)

    each(npz_files(RATES), check)


@pytest.mark.parametrize("command", ["diagnose", "ladder"])
@pytest.mark.parametrize("text", ["", "{", "[]", "null", "[" * 10_000, '{"format": "spikecam-campaign/1"}', "9" * 5000])
def test_a_malformed_campaign_is_refused_before_it_is_simulated(
    command: str, text: str, campaign: Path, tmp_path: Path, meets
) -> None:
    folder = changed(campaign, "campaign.json", text.encode())
    assert meets(f"campaign.json ({command})", command, folder, "--out", tmp_path / "out") == 2


def test_a_malformed_model_is_refused_by_its_reader(tmp_path: Path) -> None:
    def check(data: bytes) -> None:
        put(tmp_path / "model.toml", data)
        reads_or_refuses("model .toml", lambda: SensorModel.from_toml(tmp_path / "model.toml"))

    each(toml_files(MODEL), check)


def test_a_malformed_model_is_refused(tmp_path: Path, meets) -> None:
    def check(data: bytes) -> None:
        put(tmp_path / "model.toml", data)
        record = ("record", "--size", 4, 4, "--frames", 2, "--model", tmp_path / "model.toml", "--out")
        meets("model .toml (record)", *record, tmp_path / "out.dat")

    each(every(SHARE, toml_files(MODEL)), check)


TABLE = "file,radiance,name,use,v_d,temperature_k,note,height,width,flip,bit_order,first,count"
ROW = ["a.dat", "0.3", "flat", "fit", "1.1", "300", "lamp", "8", "8", "false", "little", "0", "64"]
CELLS = (
    "",
    "text",
    "-1",
    "0",
    "1e308",
    "nan",
    "9" * 400,
    "true",
    "../../evil",
    "/etc/hostname",
    "a\x00b",
    "x" * 200_000,
)


def label_tables():
    """(fault, the table)."""
    row = ",".join(ROW)
    for at, column in enumerate(TABLE.split(",")):
        for cell in CELLS:
            yield f"{column} is {cell[:12]!r}", f"{TABLE}\n{','.join([*ROW[:at], cell, *ROW[at + 1 :]])}\n".encode()
    yield "an unknown column", f"{TABLE},colour\n{row},red\n".encode()
    yield "a column twice", f"{TABLE},file\n{row},b.dat\n".encode()
    yield "a cell too many", f"{TABLE}\n{row},more\n".encode()
    yield "an open quote", f'{TABLE}\n"{row}\n'.encode()
    yield "a file twice", f"{TABLE}\n{row}\n{row}\n".encode()
    yield "no rows", f"{TABLE}\n".encode()
    yield "no table", b"\x89PNG\r\n\x1a\n"
    yield from damaged(f"{TABLE}\n{row}\n".encode())


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    folder = tmp_path / "recordings"
    folder.mkdir()
    (folder / "a.dat").write_bytes(np.packbits(SPIKES.reshape(FRAMES, -1), axis=1, bitorder="little").tobytes())
    return folder


def test_a_malformed_table_of_labels_is_refused(recordings: Path, tmp_path: Path, meets) -> None:
    def check(data: bytes) -> None:
        put(tmp_path / "labels.csv", data)
        options = ("--table", tmp_path / "labels.csv", "--frame-rate-hz", 40000)
        meets("labels .csv (campaign import)", "campaign", "import", recordings, tmp_path / "out", *options)

    each(label_tables(), check)


def imported(meets, target: str, folder: Path, out: Path, *labels: str) -> int:
    """`campaign import` of labelled files, of 8 x 8 pixels."""
    options = [part for label in labels for part in ("--label", label)]
    shape = ("--frame-rate-hz", 40000, "--height", 8, "--width", 8)
    return meets(f"{target} (campaign import)", "campaign", "import", folder, out, *options, *shape)


def test_a_malformed_stream_in_an_npz_is_refused(recordings: Path, tmp_path: Path, meets) -> None:
    def check(data: bytes) -> None:
        put(recordings / "x.npz", data)
        imported(meets, "spikes .npz", recordings, tmp_path / "out", "x.npz=0.3")

    each([*npz_files(STREAM), *npz_files(PACKED)], check)


def test_malformed_flat_maps_are_refused(recordings: Path, tmp_path: Path, meets) -> None:
    def check(data: bytes) -> None:
        put(recordings / "maps.npz", data)
        imported(meets, "flat maps .npz", recordings, tmp_path / "out", "maps.npz=relative")

    each(npz_files(MAPS), check)


def test_malformed_light_of_a_label_is_refused(recordings: Path, tmp_path: Path, meets) -> None:
    def check(data: bytes) -> None:
        put(recordings / "light.npz", data)
        imported(meets, "light .npz", recordings, tmp_path / "out", "a.dat=light.npz")

    each(npz_files(LIGHT), check)


def test_a_malformed_dat_is_refused(recordings: Path, tmp_path: Path, meets) -> None:
    def check(data: bytes) -> None:
        put(recordings / "a.dat", data)
        imported(meets, "spikes .dat", recordings, tmp_path / "out", "a.dat=0.3")

    each(damaged(bytes(range(256)) * 2), check)


def h5_files():
    """(fault, the file) for a recording in HDF5."""
    packed = np.packbits(SPIKES.reshape(FRAMES, -1), axis=1, bitorder="little")
    attributes = {"format": "spikecam-recording/1", "height": 8, "width": 8, "frame_rate_hz": 40000.0, "seed": 0}
    odd = {
        "text": "text",
        "true": True,
        "negative": -1,
        "zero": 0,
        "huge": 2**62,
        "a fraction": 7.5,
        "NaN": np.nan,
        "an array": np.arange(3),
        "an empty array": np.zeros(0),
        "null": h5py.Empty("f4"),
        "complex": 1j,
        "bytes": np.bytes_(b"\xff"),
        "records": np.zeros((), [("a", "i4")]),
    }
    for name in attributes:
        yield f"{name} is missing", _h5({"spikes": packed}, {k: v for k, v in attributes.items() if k != name})
        for label, value in odd.items():
            yield f"{name} is {label}", _h5({"spikes": packed}, {**attributes, name: value})
    streams = {
        "floats": packed.astype(float),
        "text": np.array("text", dtype="S4"),
        "signed": packed.astype(np.int8),
        "one axis": packed.reshape(-1),
        "three axes": SPIKES,
        "no axes": np.uint8(3),
        "empty": packed[:0],
        "too wide": np.zeros((4, 9), np.uint8),
        "complex": packed.astype(complex),
        "records": np.zeros((4, 8), [("a", "u1")]),
        "null": h5py.Empty("u1"),
    }
    for label, values in streams.items():
        yield f"spikes are {label}", _h5({"spikes": values}, attributes)
    yield "no spikes", _h5({}, attributes)
    yield "spikes are a group", _h5({"spikes/inner": packed}, attributes)
    yield "spikes declare much", _h5({}, attributes, declared=(1 << 50, 8))
    yield "spikes are outside", _h5({}, attributes, external=True)
    yield "spikes are a link", _h5({}, attributes, link=h5py.ExternalLink("/etc/hostname", "/x"))
    yield "spikes are a broken link", _h5({}, attributes, link=h5py.SoftLink("/nowhere"))
    yield from damaged(_h5({"spikes": packed}, attributes), flips=40)


def _h5(arrays: dict, attributes: dict, declared=None, external: bool = False, link=None) -> bytes:
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        for name, values in arrays.items():
            file.create_dataset(name, data=values)
        if declared is not None:
            file.create_dataset("spikes", declared, np.uint8, chunks=(64, 8))
        if external:
            file.create_dataset("spikes", (4, 8), np.uint8, external=[("/etc/hostname", 0, 32)])
        if link is not None:
            file["spikes"] = link
        for name, value in attributes.items():
            file.attrs[name] = value
    return memory.getvalue()


def test_a_malformed_h5_is_refused(recordings: Path, tmp_path: Path, meets) -> None:
    def check(data: bytes) -> None:
        put(recordings / "x.h5", data)
        labels = ("--label", "x.h5=0.3")
        meets("spikes .h5 (campaign import)", "campaign", "import", recordings, tmp_path / "out", *labels)

    each(h5_files(), check)


DATASET: dict[str, Any] = {
    "format": "spikecam-dataset/1",
    "settings": {
        "package_version": "0",
        "kind": "phm-n",
        "shape": [8, 8],
        "frames": 8,
        "seed": 0,
        "truth_every": 0,
        "mean_interval": 10.0,
        "model": "",
        "renderer": "embree",
    },
    "files": [
        {"path": "test/a.h5", "scene": "ball", "scene_seed": 0, "unit_seed": 1, "bytes": 3, "sha256": "0" * 64},
        {"path": "test/b.h5", "scene": "fan", "scene_seed": 0, "unit_seed": 1, "bytes": None, "sha256": None},
    ],
}


FILMS = {"film_rate_hz": 2000.0, "transfer": "linear", "interpolation": "linear", "white": 0.6}
CUTS = {n: v for n, v in DATASET["settings"].items() if n not in ("mean_interval", "renderer")} | {"films": FILMS}


@pytest.mark.parametrize("good", [DATASET, DATASET | {"settings": CUTS}], ids=["scenes", "films"])
def test_a_malformed_manifest_is_refused_by_its_reader(good: dict, tmp_path: Path) -> None:
    def check(data: bytes) -> None:
        put(tmp_path / "dataset.json", data)
        reads_or_refuses("dataset.json", lambda: verify(tmp_path))

    each(json_files(good), check)


def test_a_malformed_manifest_is_refused(tmp_path: Path, meets) -> None:
    def check(data: bytes) -> None:
        put(tmp_path / "dataset.json", data)
        meets("dataset.json (dataset verify)", "dataset", "verify", tmp_path, good_codes=(1,))  # its files are missing

    each(every(SHARE, json_files(DATASET)), check)


@pytest.mark.parametrize("kind", ["a folder", "no file", "a pipe", "unreadable"])
@pytest.mark.parametrize(
    "target, args",
    [
        ("model .toml (record)", ("record", "--out", "{out}.dat", "--model", "{bad}.toml", "--size", 4, 4)),
        ("campaign.json (calibrate)", ("calibrate", "{bad}", "--out", "{out}")),
        ("campaign.json (diagnose)", ("diagnose", "{bad}", "--out", "{out}")),
        ("campaign.json (ladder)", ("ladder", "{bad}", "--out", "{out}")),
        ("labels .csv (campaign import)", ("campaign", "import", "{here}", "{out}", "--table", "{bad}")),
        ("spikes .h5 (denoise)", ("denoise", "{bad}.h5", "--out", "{out}")),
        ("spikes .dat (denoise)", ("denoise", "{bad}.dat", "--out", "{out}")),
        ("spikes .npz (denoise)", ("denoise", "{bad}.npz", "--out", "{out}")),
        ("dataset.json (dataset verify)", ("dataset", "verify", "{bad}")),
        ("weights .pt (evaluate)", ("evaluate", "quick", "--best", "{bad}.pt", "--out", "{out}")),
        ("spikes .h5 (export)", ("export", "{bad}.h5", "--out", "{out}")),
        ("spikes .npz (evaluate truth)", ("evaluate", "truth", "--static", "{bad}.npz", "--out", "{out}")),
        ("flows (evaluate flow)", (*FLOW, "--flows", "{bad}", "--out", "{out}")),
        ("clips (evaluate spikezoo)", ("evaluate", "spikezoo", "{bad}.dat", "--out", "{out}")),
    ],
)
def test_what_is_no_file_is_refused(kind: str, target: str, args: tuple, tmp_path: Path, meets) -> None:
    for ending in ("", ".toml", ".h5", ".dat", ".npz", ".pt"):
        path = tmp_path / f"bad{ending}"
        if kind == "a folder" or (kind == "unreadable" and not ending):
            path.mkdir()
        elif kind == "a pipe":
            os.mkfifo(path)
        elif kind == "unreadable":
            path.symlink_to(path)
    words = {"bad": tmp_path / "bad", "out": tmp_path / "out", "here": tmp_path}
    assert meets(target, *(a.format(**words) if isinstance(a, str) else a for a in args)) == 2


def test_the_good_ones_are_good(campaign: Path, recordings: Path, tmp_path: Path, meets) -> None:
    """Else every mutation of them would be refused for another reason."""
    folder = changed(campaign, "campaign.json", json.dumps(CAMPAIGN).encode())
    assert meets("good files", "calibrate", folder, "--out", tmp_path / "out") == 0
    for name, arrays in (("x.npz", STREAM), ("maps.npz", MAPS), ("light.npz", LIGHT), ("packed.npz", PACKED)):
        (recordings / name).write_bytes(npz(arrays))
    labels = ("x.npz=0.3", "a.dat=light.npz", "packed.npz=0.2")
    assert imported(meets, "good files", recordings, tmp_path / "out", *labels) == 0
    assert imported(meets, "good files", recordings, tmp_path / "out", "maps.npz=relative") == 0
    (tmp_path / "dataset.json").write_text(json.dumps(DATASET))
    assert len(Manifest.read(tmp_path).files) == 2


def test_a_malformed_head_of_results_is_refused(tmp_path: Path) -> None:
    def check(data: bytes) -> None:
        path = tmp_path / "table1.jsonl"
        path.write_bytes(data.replace(b"\n", b" ") + b"\n" + json.dumps(RESULT).encode())
        reads_or_refuses("results .jsonl", lambda: Results.opened(path, EVALUATION, RowResult))

    each(json_files({"format": FORMAT, **EVALUATION}), check)


def test_a_malformed_result_is_refused(tmp_path: Path) -> None:
    def check(data: bytes) -> None:
        path = tmp_path / "table1.jsonl"
        path.write_bytes(json.dumps({"format": FORMAT, **EVALUATION}).encode() + b"\n" + data.replace(b"\n", b" "))
        reads_or_refuses("results .jsonl", lambda: Results.opened(path, EVALUATION, RowResult))

    each(json_files(RESULT, within=2), check)


def test_malformed_weights_are_refused(tmp_path: Path) -> None:
    def check(data: bytes) -> None:
        put(tmp_path / "x.pt", data)
        reads_or_refuses("weights .pt", lambda: load_weights(tmp_path / "x.pt"))

    each(damaged(pretrained_path("paper").read_bytes()), check)


def _reconstructor() -> bytes:
    """An untrained one; `test_weights_come_back_to_half_precision` reads such a file."""
    recipe = reconstructor_recipe("ssml", WIDTH_STEP)
    with tempfile.TemporaryDirectory() as folder:
        save_weights(Path(folder) / "x.pt", "ssml", recipe, recipe.network(), {})
        return (Path(folder) / "x.pt").read_bytes()


def test_malformed_weights_of_a_reconstructor_are_refused(tmp_path: Path) -> None:
    def check(data: bytes) -> None:
        put(tmp_path / "x.pt", data)
        reads_or_refuses("reconstructor .pt", lambda: load_reconstructor(tmp_path / "x.pt"))

    each(damaged(_reconstructor()), check)
