"""A scene at another speed: the same pictures, passed sooner."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import RotatingDisk
from scenes.derived.faster import Faster, at_speed, speed_of
from scenes.protocol import Gaze, Scene
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensor


@pytest.fixture(scope="module")
def disk() -> RotatingDisk:
    return RotatingDisk((32, 48), rpm=2000)


def test_it_is_at_the_speed_that_was_asked_for(disk: RotatingDisk) -> None:
    fast = at_speed(disk, 2.0)
    print(f"speed {speed_of(disk):.3f} -> {speed_of(fast):.3f} pixels a frame")
    assert isinstance(fast, Scene)
    assert speed_of(fast) == pytest.approx(2.0, rel=0.05)


def test_its_light_is_that_of_the_scene_at_another_time(disk: RotatingDisk) -> None:
    fast = Faster(disk, 2.5)
    keys = fast.radiance(10, 20)
    assert keys.frame[0] <= 10 and keys.frame[-1] >= 20
    for frame in (10.0, 13.2, 20.0):
        own = disk.radiance(int(frame * 2.5), int(frame * 2.5) + 1).at(frame * 2.5)
        assert np.abs(keys.at(frame) - own).max() < 1e-4
    np.testing.assert_array_equal(fast.truth(4.0).radiance, disk.truth(10.0).radiance)
    np.testing.assert_allclose(fast.truth(4.0).flow, 2.5 * disk.truth(10.0).flow, rtol=1e-6)


def test_a_camera_sees_the_mean_rate_of_the_scene(disk: RotatingDisk) -> None:
    model = SensorModel.preset("ideal")
    rates = [
        SpikeSensor(model, disk.shape, 0).step(scene.radiance(0, 200), 200).mean() for scene in (disk, Faster(disk, 3))
    ]
    assert rates[1] == pytest.approx(rates[0], rel=0.02)


@pytest.mark.parametrize("factor", [0.0, -1.0, float("nan"), 1e4])
def test_a_factor_that_is_none_is_refused(disk: RotatingDisk, factor: float) -> None:
    with pytest.raises(InputError, match="factor"):
        Faster(disk, factor)


def test_a_still_scene_has_no_speed_and_a_gaze_is_refused(disk: RotatingDisk) -> None:
    still = RotatingDisk((16, 16), rpm=0)
    assert speed_of(still) == 0
    with pytest.raises(InputError, match="nothing moves"):
        at_speed(still, 1.0)
    with pytest.raises(InputError, match="gaze"):
        Faster(disk, 2.0).radiance(0, 1, Gaze.fixed(1, 0))
