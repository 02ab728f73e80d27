"""A denoiser whose windows and network are tensors on a device against today's; on the processor, and on a GPU if any.

On a processor the same code runs as on a GPU, but for the recording of a pass (`denoiser.ground.captured`).
"""

from __future__ import annotations

import numpy as np
import pytest
import torch

from denoiser.ground.captured import WARM_UPS
from denoiser.many import ManyDnSS
from denoiser.online import OnlineDnSS
from spikecam_env.errors import InputError, NotReadyError
from spikecam_env.streams.packing import pack_frames

SHAPE = (10, 13)  # no multiple of 4 or 8
DEVICE = "cuda" if torch.cuda.is_available() else "cpu"
ROUNDING = 1e-5
"""Of rates in [0, 1]: float32 sums of some hundred terms, in another order, fed back over six passes."""

MAP = (np.linspace(0.8, 1.2, SHAPE[0] * SHAPE[1]).reshape(SHAPE), np.full(SHAPE, 0.002))


def online(device: str | None = DEVICE, **options) -> OnlineDnSS:
    options = {"output": "rate", "precision": "float32"} | options
    return OnlineDnSS.pretrained("best", device=device, **options)


def stream(frames: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    chance = np.exp(rng.uniform(np.log(0.01), 0.0, SHAPE))
    return (rng.random((frames, *SHAPE)) < chance).astype(np.uint8)


def rates(denoiser: OnlineDnSS, spikes: np.ndarray, cut: int) -> np.ndarray:
    pieces = [denoiser.push(spikes[first : first + cut]) for first in range(0, len(spikes), cut)]
    return np.concatenate([*pieces, denoiser.flush()])


def apart(found: np.ndarray, wanted: np.ndarray) -> float:
    assert found.shape == wanted.shape and wanted.std() > 1000 * ROUNDING
    return float(np.abs(found - wanted).max())


OPTIONS = ({}, {"unit": MAP}, {"overlap": True}, {"ease": True}, {"engine": "captured"})


@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize("frames", [9, 20, 47, 101])
def test_rates_are_those_without_a_device(frames: int, options: dict) -> None:
    spikes, plain = stream(frames), {name: value for name, value in options.items() if name != "engine"}
    worst = apart(rates(online(**options), spikes, 13), rates(online(None, **plain), spikes, 13))
    print(f"{frames} frames: {worst:.1e} apart")
    assert worst < ROUNDING


def test_what_a_recording_runs_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    """As a GPU does it: the pass is run some times, and then once more at each replay."""

    def recorded(step, device):
        for _ in range(WARM_UPS + 1):
            step()
        return lambda: step().clone()

    monkeypatch.setattr("denoiser.passes.on_device.captured", recorded)
    spikes = stream(101)
    np.testing.assert_array_equal(rates(online(engine="captured"), spikes, 13), rates(online(), spikes, 13))


def test_the_cutting_of_a_stream_changes_no_bit() -> None:
    spikes = stream(101)
    np.testing.assert_array_equal(rates(online(), spikes, 7), rates(online(), spikes, 101))


def test_tensors_stay_where_they_are_and_arrays_and_bits_give_the_same() -> None:
    spikes = stream(64)
    there = online().push(torch.from_numpy(spikes).to(DEVICE))
    assert isinstance(there, torch.Tensor) and there.device.type == DEVICE and there.dtype == torch.float32
    for found in (online().push(spikes), online().push_packed(pack_frames(spikes), SHAPE)):
        assert isinstance(found, np.ndarray)
        np.testing.assert_array_equal(found, there.cpu().numpy())
    packed = online().push_packed(torch.from_numpy(pack_frames(spikes)), SHAPE)
    assert isinstance(packed, torch.Tensor) and torch.equal(packed, there)
    np.testing.assert_array_equal(online(None).push_packed(pack_frames(spikes), SHAPE), online(None).push(spikes))


def test_spikes_are_those_of_the_decoder_on_the_host() -> None:
    spikes = stream(64)
    found, rate = online(output="both").push(torch.from_numpy(spikes).to(DEVICE))
    wanted, _ = online(None, output="both").push(spikes)
    assert found.dtype == torch.uint8 and rate.device.type == DEVICE
    assert (found.cpu().numpy() != wanted).mean() < 1e-3


@pytest.mark.parametrize("cut", [5, 20, 40, 67])
def test_a_saved_stream_goes_on_bit_for_bit(cut: int) -> None:
    spikes, first, second = stream(101), online(), online()
    first.push(spikes[:cut])
    second.restore(first.state())
    np.testing.assert_array_equal(rates(first, spikes[cut:], 9), rates(second, spikes[cut:], 9))


def test_the_state_of_a_stream_that_is_over_is_one() -> None:
    first, second = online(), online()
    rates(first, stream(40), 40)
    second.restore(first.state())
    with pytest.raises(NotReadyError):
        second.push(stream(1))


def test_many_streams_of_different_ages_are_denoised_as_alone() -> None:
    spikes, many = np.stack([stream(120, seed) for seed in range(3)]), ManyDnSS(online(), 3, SHAPE)
    before = many.push(torch.from_numpy(spikes[:, :40]).to(DEVICE))
    many.restart(np.array([False, True, False]))
    after = [many.push(spikes[:, first : first + 20]) for first in (40, 60, 80, 100)]
    for n, begins in enumerate((0, 40, 0)):
        pieces = [] if begins else [before[n].cpu().numpy()]
        found = np.concatenate([*pieces, *(piece[n] for piece in after)])
        worst = apart(found, online(None).push(spikes[n, begins:]))
        print(f"stream {n}: {worst:.1e} apart")
        assert worst < ROUNDING


def test_bfloat16_costs_what_it_costs_without_a_device() -> None:
    spikes = stream(101)
    exact = rates(online(None), spikes, 101)
    found, wanted = (rates(online(device, precision="bfloat16"), spikes, 101) for device in (DEVICE, None))
    errors = [float(np.sqrt(np.mean((r - exact) ** 2))) for r in (found, wanted)]
    print(f"bfloat16: {errors[0]:.1e} rms from float32; without a device {errors[1]:.1e}")
    assert errors[0] < 2 * errors[1]


def test_what_has_no_place_on_a_device_is_refused() -> None:
    with pytest.raises(InputError, match="device = 'tpu'"):
        online("tpu")
    with pytest.raises(InputError, match="many planes"):
        OnlineDnSS.pretrained("paper", device=DEVICE)
    with pytest.raises(InputError, match="give one"):
        online(None, engine="captured")
    for wrong in (
        torch.full((3, *SHAPE), 2, dtype=torch.uint8),
        torch.full((3, *SHAPE), -1, dtype=torch.int8),
        torch.zeros((3, *SHAPE)),
        torch.zeros(3, 4),
    ):
        with pytest.raises(InputError, match="spikes"):
            online().push(wrong)
    with pytest.raises(InputError, match="packed frames"):
        online().push_packed(np.zeros((3, 4), np.uint8), SHAPE)
    with pytest.raises(InputError, match="engine"):
        online().restore(online(None).state())
