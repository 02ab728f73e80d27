"""Going frame by frame, four at a time, gives the bits of going from spike to spike."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from laws import jittered
from numpy.typing import NDArray

from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor
from spikecam_env.sensor.engines.compiled import fast
from spikecam_env.sensor.light import Segment

MODELS = {
    "ideal": SensorModel.preset("ideal"),
    "scsim": SensorModel.preset("scsim"),
    "physical": SensorModel.preset("physical"),
    "few electrons": jittered(50, kappa=0.09),
    "no shot noise": jittered(kappa=0.05),
}


def random_film(seed: int, shape: tuple[int, int], frames: int) -> Keyframes:
    """Keys that mostly come every frame or two, now and then after many or inside a frame; light from darkness to over
    two thresholds a frame in a few pixels, and much the same in neighbours."""
    rng = np.random.default_rng(seed)
    steps = rng.choice(
        [1.0, 1.0, 1.0, 1.0, 2.0, 3.0, 0.4, 9.0, 70.0], p=[0.16] * 4 + [0.2, 0.08, 0.04, 0.03, 0.01], size=frames
    )
    frame = np.cumsum(steps) - rng.integers(0, 3)
    bright = np.exp(rng.uniform(np.log(0.003), np.log(0.8), shape[0]))[:, None]
    light = bright * rng.uniform(0.7, 1.3, (frames, *shape))
    light[:, 0] = rng.choice([0.0, 0.9, 1.6, 5.0], (frames, shape[1]))
    return Keyframes(frame, light.astype(np.float32))


def recorded(
    model: SensorModel, light: Keyframes, shape: tuple[int, int], cuts: list[int]
) -> list[NDArray[np.generic]]:
    """Spikes of 150 frames asked for in pieces of these lengths, and the pixels after them."""
    sensor = SpikeSensor(model, shape, seed=3, engine="fast", bent_light="allow")
    spikes = np.concatenate([sensor.step(light, count) for count in cuts])
    pixels = sensor.state().pixels.pixels
    return [spikes, pixels.remaining, pixels.fired]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("shape", [(9, 113), (40, 64)])
def test_frame_by_frame_and_from_spike_to_spike_give_the_same_bits(
    model: str, shape: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """However the stream is cut."""
    light = random_film(len(model) + shape[0], shape, 150)
    found = []
    for often in (0.0, np.inf):
        monkeypatch.setattr(fast, "OFTEN", often)
        for cuts in ([150], [64, 5, 40, 1, 33, 7]):
            found.append(recorded(MODELS[model], light, shape, cuts))
    print(f"{found[0][0].mean():.3f} spikes a pixel and frame")
    for other in found[1:]:
        assert all(np.array_equal(a, b) for a, b in zip(found[0], other, strict=True))


def test_threads_and_cameras_of_both_kinds_in_a_call_change_no_bit() -> None:
    """Bits packed and not; light that changes every frame beside light that stays."""
    unit, phase = SensorModel.preset("scsim").draw_unit((1, 5000), 1), np.linspace(0.0, 0.99, 5000)
    light = random_film(5, (1, 5000), 64).radiance.reshape(64, -1)
    quick = [Segment(a, b, 1, 0, 1) for a, b in pairwise(light[:41])]
    steady = [Segment(light[0], light[1], 64, 0, 40)]
    alone = []
    for parts in (quick, steady):
        out = np.empty((40, 5000), np.uint8)
        fast.run_together([fast.Stretch.of(fast.start(unit, phase, 1), parts, out)])
        alone.append(out)
    both = [np.empty((40, 5000), np.uint8) for _ in range(2)]
    jobs = [fast.Stretch.of(fast.start(unit, phase, 1), p, out) for p, out in zip((quick, steady), both, strict=True)]
    assert [job.changes_often for job in jobs] == [True, False]
    fast.run_together(jobs, threads=2)
    assert all(np.array_equal(a, b) for a, b in zip(alone, both, strict=True))
    packed = np.empty((40, 625), np.uint8)
    fast._advance([fast.Stretch.of(fast.start(unit, phase, 1), quick, packed)], [packed], True, None)
    assert np.array_equal(np.unpackbits(packed, axis=1, bitorder="little"), alone[0])
