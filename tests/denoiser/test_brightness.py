"""Spikes brighter than their rates: as many times more, cut at one a frame, and said where they are written."""

from __future__ import annotations

import json
import pickle
import warnings
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from denoiser import DenoiseObservation, OnlineDnSS, denoise
from denoiser.decoders.brightness import TARGET, automatic
from spikecam_env.errors import InputError
from spikecam_env.streams import SpikeWriter, read_recording
from tests.commands import said, spikecam

SHAPE = (16, 24)
FRAMES = 256


def stream(rate: float, frames: int = FRAMES) -> np.ndarray:
    """Spikes of pixels from half the rate to one and a half of it, evenly spaced as a camera's."""
    light = np.linspace(0.5, 1.5, SHAPE[0] * SHAPE[1]).reshape(SHAPE) * rate
    charge = np.random.default_rng(5).random(SHAPE) + light * np.arange(frames + 1)[:, None, None]
    return np.diff(np.floor(charge), axis=0).astype(np.uint8)


@pytest.mark.parametrize("factor", [0.5, 4.0])
def test_spikes_are_as_many_times_the_rates_where_none_saturates(factor: float) -> None:
    """To one spike a pixel, which the decoder has not yet made or has made already."""
    spikes, rates = denoise(stream(0.05), "fast", output="both", brightness=factor)
    off = spikes.sum(axis=0) - factor * rates.sum(axis=0, dtype=np.float64)
    print(f"factor {factor:g}: mean {spikes.mean() / rates.mean():.3f} of the rates, off by {np.abs(off).max():.3f}")
    assert rates.max() * factor < 1
    assert np.abs(off).max() < 1.001  # float32 sums
    assert np.array_equal(rates, denoise(stream(0.05), "fast", output="rate"))


def test_a_brightness_of_1_changes_no_bit() -> None:
    for overlap in (False, True):
        one, none = (
            denoise(stream(0.2), "fast", output="both", overlap=overlap, **its) for its in ({"brightness": 1}, {})
        )
        assert all(np.array_equal(a, b) for a, b in zip(one, none, strict=True))


def test_the_share_that_saturates_is_that_of_rates_above_one_over_the_factor() -> None:
    online = OnlineDnSS.pretrained("fast", output="both", brightness=4)
    assert online.saturated == 0.0
    (spikes, rates), (last_spikes, last_rates) = online.push(stream(0.25)), online.flush()
    spikes, rates = np.concatenate([spikes, last_spikes]), np.concatenate([rates, last_rates])
    print(f"saturated {100 * online.saturated:.1f} %")
    assert 0.2 < online.saturated < 0.8
    assert online.saturated == (rates > 0.25).mean()
    assert spikes[:, rates.min(axis=0) > 0.25].all()  # a spike in every frame, not two


def test_a_stream_goes_on_from_its_state_and_from_none_of_another_brightness() -> None:
    first, other = (OnlineDnSS.pretrained("fast", brightness=b) for b in (4, 2))
    whole = denoise(stream(0.25), "fast", brightness=4)
    pieces = [first.push(stream(0.25)[:100])]
    second = OnlineDnSS.pretrained("fast", brightness=4)
    second.restore(pickle.loads(pickle.dumps(first.state())))
    pieces += [second.push(stream(0.25)[100:]), second.flush()]
    assert np.array_equal(np.concatenate(pieces), whole)
    first.push(stream(0.25)[100:])
    first.flush()
    assert second.saturated == first.saturated > 0
    assert second.another().brightness == 4 and second.another().saturated == 0
    with pytest.raises(InputError, match=r"brightness 4.0, this one has 2.0"):
        other.restore(first.state())


@pytest.mark.parametrize("brightness", [0, -1, 0.001, 101, float("nan"), float("inf"), "4", "auto", None, True, [4]])
def test_nonsense_is_refused(brightness: object) -> None:
    with pytest.raises(InputError, match="brightness"):
        OnlineDnSS.pretrained("fast", brightness=brightness)


def test_a_network_without_spikes_has_none_brighter() -> None:
    with pytest.raises(InputError, match="no spikes"):
        OnlineDnSS.pretrained("picture", brightness=4)


def test_the_automatic_factor_brings_the_mean_to_its_target_and_saturates_less_than_a_hundredth() -> None:
    for rate, least in ((0.025, 3.5), (0.01, 8.0)):
        factor = automatic(stream(rate))
        online = OnlineDnSS.pretrained("fast", brightness=factor)
        mean = np.concatenate([online.push(stream(rate)), online.flush()]).mean()
        print(f"mean {rate:g}: factor {factor:g}, mean after it {mean:.4f}, saturated {online.saturated:.4f}")
        assert least < factor <= TARGET / rate * 1.05
        assert mean == pytest.approx(TARGET, rel=0.25)  # in dim light the rates of `fast` are too dark, by a sixth here
        assert online.saturated < 0.01
    few = stream(0.01)
    few[:, :, 0] = stream(0.6)[:, :, 0]  # a column of light up to 0.9, in a mean of 0.035
    rates = few.mean(axis=0)
    print(f"with a bright column: factor {automatic(few):g}")
    assert automatic(few) < TARGET / few.mean() - 1 and (rates * automatic(few) > 1).mean() < 0.012
    for bright in (stream(0.3), np.zeros((8, *SHAPE), np.uint8), np.ones((8, *SHAPE), np.uint8)):
        assert automatic(bright) == 1.0


class Dim(gymnasium.Env):
    """A camera before dim light."""

    observation_space = gymnasium.spaces.MultiBinary((32, *SHAPE))
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.blocks = iter(np.split(stream(0.05), FRAMES // 32))
        return next(self.blocks).astype(np.int8), {}

    def step(self, action):
        return next(self.blocks).astype(np.int8), 0.0, False, False, {}


@pytest.mark.parametrize("warm_up", ["black", "noisy"])
def test_agents_see_brighter_spikes_and_rates_as_they_are(warm_up: str) -> None:
    def seen(**options: object) -> np.ndarray:
        env = DenoiseObservation(Dim(), "fast", warm_up=warm_up, **options)
        return np.concatenate([env.reset(seed=0)[0], *(env.step(0)[0] for _ in range(7))])

    bright, plain = seen(brightness=4.0), seen()
    begins = 31 if warm_up == "black" else 0
    print(f"{warm_up}: {bright[begins:].mean() / plain[begins:].mean():.3f} times as many")
    assert bright[begins:].mean() == pytest.approx(4 * plain[begins:].mean(), rel=0.05)
    assert np.array_equal(seen(output="rate", brightness=4.0), seen(output="rate"))
    with pytest.raises(InputError, match="OnlineDnSS instead"):
        DenoiseObservation(Dim(), OnlineDnSS.pretrained("fast"), brightness=4.0)


@pytest.fixture(scope="module")
def dim(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dim recording with its light, denoised as it is and four times brighter."""
    file = tmp_path_factory.mktemp("dim") / "dim.h5"
    with SpikeWriter(file, SHAPE, 40_000.0) as writer:
        writer.append(stream(0.025))
        light = np.linspace(0.5, 1.5, SHAPE[0] * SHAPE[1]).reshape(SHAPE) * 0.025
        writer.append_truth(128.5, radiance=light.astype(np.float32))
    for name, option in (("plain", ()), ("bright", ("--brightness", 4)), ("auto", ("--brightness", "auto"))):
        out = ("--out", file.with_name(name), "--no-film", "--mode", "fast")
        assert spikecam("denoise", file, *out, *option) == 0
    return file


def test_a_recording_says_its_brightness_and_reading_it_warns(dim: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plain = read_recording(dim.with_name("plain") / "denoised.h5")
    for name in ("bright", "auto"):
        with pytest.warns(UserWarning, match=r"spikes are \S+ times as many as its light gives.*divide rates"):
            found = read_recording(dim.with_name(name) / "denoised.h5")
        summary = json.loads((dim.with_name(name) / "summary.json").read_text())
        assert found.brightness == found.attributes["spike_brightness"] == summary["brightness"]
        assert found.attributes["saturated"] == summary["saturated"] == 0
        assert found.spikes.mean() / found.brightness == pytest.approx(plain.spikes.mean(), rel=0.05)
        assert f"spike_brightness {found.brightness}" in str(found)
    assert plain.brightness == 1.0
    assert found.brightness == pytest.approx(4, abs=0.3)


def test_figures_of_a_denoised_recording_are_in_light_whatever_its_brightness(dim: Path, capsys) -> None:
    rows = [
        json.loads((dim.with_name(name) / "summary.json").read_text())["rows"] for name in ("plain", "bright", "auto")
    ]
    for plain, *bright in zip(*rows, strict=True):
        for one in bright:
            assert one["spikes/frame"] == pytest.approx(plain["spikes/frame"], rel=0.05)
            assert one["PSNR, light [dB]"] > plain["PSNR, light [dB]"] - 0.1
    capsys.readouterr()
    assert (
        spikecam("denoise", dim.with_name("bright") / "denoised.h5", "--out", dim.with_name("again"), "--no-film") == 0
    )
    summary = json.loads((dim.with_name("again") / "summary.json").read_text())
    for row in summary["rows"]:
        assert row["spikes/frame"] == pytest.approx(0.025, rel=0.2)
    assert len([line for line in said(capsys.readouterr().err) if "divide rates" in line]) == 1
    with pytest.warns(UserWarning, match="4 times"):
        assert read_recording(dim.with_name("again") / "denoised.h5").brightness == 4.0


@pytest.mark.parametrize(
    "words",
    [
        ("denoise", "FILE", "--out", "restored", "--no-film", "--mode", "fast"),
        ("live", "FILE", "--frames", 64, "--mode", "fast"),
        ("view", "FILE", "--frames", 64, "--no-denoise", "--save", "seen.rrd"),
        ("train", "--start", "best", "--recordings", "FILE", "--out", "run", "--steps", 1, "--patch", 16),
        ("campaign", "import", "FOLDER", "campaign", "--label", "denoised.h5=unknown"),
    ],
    ids=lambda words: words[0],
)
def test_every_command_that_reads_a_recording_says_that_its_spikes_are_brighter(
    words: tuple[object, ...], dim: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("spikecam_env.cli.screen.window.has_display", lambda: False)
    folder = dim.with_name("bright")
    spikecam(*({"FILE": folder / "denoised.h5", "FOLDER": folder}.get(str(word), word) for word in words))
    assert capsys.readouterr().err.count("denoised.h5: its spikes are 4 times as many as its light gives") == 1


@pytest.mark.parametrize("brightness", ["0", "nan", "-4", "1e9", "inf"])
def test_a_command_refuses_nonsense_in_a_line(brightness: str, dim: Path, capsys) -> None:
    assert spikecam("denoise", dim, "--out", dim.with_name("none"), "--brightness", brightness) == 2
    (line,) = said(capsys.readouterr().err)
    assert "brightness" in line
    assert not dim.with_name("none").exists()


def test_a_brightness_in_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    with SpikeWriter(tmp_path / "odd.h5", SHAPE, None, spike_brightness="very") as writer:
        writer.append(stream(0.1, 8))
    with pytest.raises(InputError, match="spike_brightness = 'very'"):
        read_recording(tmp_path / "odd.h5")
