"""Training on recordings with a clean twin: what streams hold, what is held out, and that networks learn from them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from denoiser.training.recorded import HELD_OUT, REACH, RecordedStreams
from denoiser.training.train import TrainConfig, train
from denoiser.weights import load_weights
from scenes.flat.collage import Collage
from spikecam_env.datasets import twin_recordings
from spikecam_env.errors import InputError
from spikecam_env.sensor import SpikeSensor
from spikecam_env.streams import SpikeWriter, isi_planes, read_recording
from spikecam_env.streams.packing import pack_frames

SHAPE, FRAMES = (32, 48), 700
CPU = torch.device("cpu")


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A moving collage with its clean twin."""
    path = tmp_path_factory.mktemp("film") / "film.h5"
    keys = Collage(SHAPE, 3, speed=0.2, light=0.5).radiance(0, FRAMES)
    sensor = SpikeSensor("scsim", SHAPE, seed=2)
    twin = sensor.clean_twin()
    with SpikeWriter(path, SHAPE, 40_000.0) as writer:
        writer.append(sensor.step(keys, FRAMES), twin.step(keys, FRAMES))
    return path


def found_in(block: np.ndarray, whole: np.ndarray) -> tuple[int, int, int]:
    """Frame, row and column at which a block of spikes lies in a recording, where there is one."""
    frames, rows, columns = block.shape
    for row in range(whole.shape[1] - rows + 1):
        for column in range(whole.shape[2] - columns + 1):
            crop = pack_frames(np.ascontiguousarray(whole[:, row : row + rows, column : column + columns]))
            for frame in np.flatnonzero((crop[: len(crop) - frames + 1] == pack_frames(block)[0]).all(axis=1)):
                if np.array_equal(crop[frame : frame + frames], pack_frames(block)):
                    return int(frame), row, column
    raise AssertionError("the block is not in the recording")


@pytest.mark.parametrize("held_out", [False, True])
def test_streams_are_crops_of_the_recording_that_go_on_and_light_is_the_clean_interval(film: Path, held_out) -> None:
    noisy, clean = (read_recording(film, stream=name).spikes for name in ("spikes", "clean"))
    light = isi_planes(clean, normalised=True)
    streams = RecordedStreams(twin_recordings(film), held_out, 3, 16, CPU, seed=1)
    border = round((1 - HELD_OUT) * FRAMES)
    expected: list[tuple[int, int, int] | None] = [None] * 3
    for _ in range(8):
        block = streams.advance(16)
        for number in range(3):
            frame, row, column = found_in(block.noisy[number].numpy(), noisy)
            crop = np.s_[frame : frame + 16, row : row + 16, column : column + 16]
            np.testing.assert_array_equal(block.clean[number], clean[crop])
            bright = light[crop] > 1 / REACH  # no interval of these is cut off
            np.testing.assert_array_equal(block.light[number].numpy()[bright], light[crop][bright])
            assert frame >= border if held_out else frame + 16 <= border
            if not block.begins[number]:
                assert (frame, row, column) == expected[number]
            expected[number] = (frame + 16, row, column)


def test_the_same_seed_gives_the_same_streams(film: Path) -> None:
    def spikes(seed: int) -> torch.Tensor:
        return RecordedStreams(twin_recordings(film), False, 4, 16, CPU, seed).advance(32).noisy

    assert torch.equal(spikes(1), spikes(1)) and not torch.equal(spikes(1), spikes(2))


def trained(out: Path, film: Path, mode: str = "fast", **options) -> tuple[dict, list[dict]]:
    """Weights and validations after a training on a film."""
    own = {"batch": 4, "patch": 16, "validate_every": 1, "recordings": (str(film),), **options}
    weights = train(TrainConfig(mode=mode, out=out, **own), progress=False)
    return load_weights(weights)[1].state_dict(), json.loads((out / "curve.json").read_text())


def test_a_network_learns_from_a_film_and_follows_from_the_seed(film: Path, tmp_path: Path) -> None:
    options = {"steps": 60, "lr": 3e-3, "validate_every": 60, "validate_passes": 8, "channels": (8, 8, 8)}
    weights, curve = trained(tmp_path / "a", film, **options)
    again, _ = trained(tmp_path / "b", film, **options)
    assert all(torch.equal(weights[name], again[name]) for name in weights)
    _, first = trained(tmp_path / "c", film, **{**options, "steps": 1, "validate_every": 1})
    print(f"PSNR of the held-out part: {first[0]['network_db']} dB after 1 step, {curve[-1]['network_db']} after 60")
    assert curve[-1]["network_db"] > first[0]["network_db"] + 2
    assert set(curve[-1]) == {"step", "seconds", "loss", "network_db", "interval_db", "mean_db"}


@pytest.mark.parametrize("mode", ["paper", "spk2img-noisy", "spk2img-clean", "ssml"])
def test_every_mode_but_picture_takes_recordings(mode: str, film: Path, tmp_path: Path) -> None:
    options = {"width": 12} if mode.startswith(("spk", "ssml")) else {"validate_passes": 2}
    out = tmp_path / mode
    config = TrainConfig(mode=mode, out=out, steps=1, batch=2, patch=16, recordings=(str(film),), **options)
    assert train(config, progress=False).exists()


def test_recordings_that_will_not_do_are_refused_in_a_line(film: Path, tmp_path: Path) -> None:
    def refused(recording: Path, says: str, patch: int = 16) -> None:
        with pytest.raises(InputError, match=says):
            train(TrainConfig(out=tmp_path / "run", patch=patch, recordings=(str(recording),)), progress=False)

    spikes = np.zeros((200, *SHAPE), np.uint8)
    for name, twin in (("bare.h5", None), ("short.h5", spikes)):
        with SpikeWriter(tmp_path / name, SHAPE, 40_000.0) as writer:
            writer.append(spikes, twin)
    refused(tmp_path / "bare.h5", "bare.h5 holds no clean twin; make it with `spikecam film --clean`")
    refused(tmp_path / "short.h5", "short.h5 has 200 frames, of which 40 are for validation; 96 are needed")
    refused(tmp_path / "none.h5", "no file .*none.h5")
    refused(film, r"film.h5 has \(32, 48\) pixels; patch 48 must fit into it", patch=48)
    with pytest.raises(InputError, match="--recordings is for best, fast, paper"):
        TrainConfig(mode="picture", recordings=(str(film),))
