"""Passes eased into one another: half the flicker, for no more error."""

from __future__ import annotations

import numpy as np
import pytest

from denoiser import OnlineDnSS, denoise
from denoiser.evaluate.measures import across_over_within
from denoiser.many import ManyDnSS
from denoiser.passes.eased import EASE, Eased
from denoiser.training.pairs import light_in_frame
from scenes.catalogue import make_scene
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensor

SHAPE, FRAMES, PLANES = (64, 96), 320, 16
SHARES = np.array([*EASE, *[0.0] * (PLANES - len(EASE))], np.float32)[:, None, None]


def passes(*levels: float) -> list[np.ndarray]:
    return [np.full((PLANES, 2, 3), level, np.float32) for level in levels]


def test_a_jump_at_rest_is_taken_out_of_the_first_planes_by_their_shares() -> None:
    eased = Eased((2, 3))
    first, second, third = (eased.add(rates) for rates in passes(0.2, 0.3, 0.3))
    assert np.array_equal(first, passes(0.2)[0]) and np.array_equal(third, passes(0.3)[0])
    np.testing.assert_allclose(second, 0.3 - 0.1 * np.broadcast_to(SHARES, second.shape), atol=1e-6)


def test_light_that_goes_on_in_a_straight_line_has_no_jump() -> None:
    ramp = np.broadcast_to(np.linspace(0.1, 0.4, 2 * PLANES, dtype=np.float32)[:, None, None], (2 * PLANES, 2, 3))
    eased = Eased((2, 3))
    found = np.concatenate([eased.add(ramp[:PLANES]), eased.add(ramp[PLANES:])])
    np.testing.assert_allclose(found, ramp, atol=1e-6)


def test_a_jump_where_light_moves_is_left() -> None:
    """Steps of 0.05 a frame at a rate of 0.2: of the jump 1 / (1 + 0.05^2 / (1e-3 x 0.22)), a twelfth, is eased."""
    moving = [np.full((PLANES, 2, 3), 0.2, np.float32) for _ in range(2)]
    moving[0][-1] += 0.05  # and back again in the first two planes
    moving[1][1] -= 0.05
    eased = Eased((2, 3))
    eased.add(moving[0])
    change = (eased.add(moving[1]) - moving[1])[0]
    print(change[0, 0])
    np.testing.assert_allclose(change, EASE[0] * 0.05 / (1 + 0.05**2 / (1e-3 * 0.22)), rtol=1e-3)


def test_rates_stay_between_0_and_1_and_a_short_last_pass_is_eased_as_far_as_it_goes() -> None:
    eased = Eased((2, 3))
    bright, dark = passes(1.0, 0.0)
    eased.add(bright)
    assert eased.add(dark[:3]).min() >= 0 and eased.add(dark[:1]).shape == (1, 2, 3)
    eased = Eased((2, 3))
    eased.add(dark)
    assert eased.add(np.ones((5, 2, 3), np.float32)).max() <= 1


@pytest.mark.parametrize(("scene", "mode"), [("disk", "best"), ("collage", "best"), ("dice", "fast")])
def test_half_the_flicker_for_no_more_error(scene: str, mode: str) -> None:
    world = make_scene(scene, SHAPE, 3, 10.0)
    keys = world.radiance(0, FRAMES)
    spikes = SpikeSensor(SensorModel.preset("scsim"), SHAPE, 5).step(keys, FRAMES)
    light = np.stack([light_in_frame(keys, frame) for frame in range(64, FRAMES - 32)])
    found = {}
    for ease in (False, True):
        rates = denoise(spikes, mode, output="rate", ease=ease)[64:-32]
        found[ease] = across_over_within(rates, light, PLANES, 64), 1e3 * np.square(rates - light).mean()
    print(f"{scene}, {mode}: flicker and squared error {found[False]} -> {found[True]}")
    assert found[True][0] < 0.65 * found[False][0] and found[True][1] < 1.01 * found[False][1]


def test_where_there_are_no_seams_it_is_refused() -> None:
    for options, message in (
        ({"mode": "best", "overlap": True}, "passes that overlap have no seams"),
        ({"mode": "paper"}, "too few planes"),
        ({"mode": "picture"}, "too few planes"),
    ):
        with pytest.raises(InputError, match=message):
            OnlineDnSS.pretrained(ease=True, **options)
    with pytest.raises(InputError, match="ease is 1; it must be"):
        OnlineDnSS.pretrained("best", ease=1)
    with pytest.raises(InputError, match="ease is True"):
        ManyDnSS(OnlineDnSS.pretrained("best", ease=True), 2, SHAPE)
