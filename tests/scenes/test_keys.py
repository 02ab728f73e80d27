from __future__ import annotations

import numpy as np
import pytest

from scenes import Collage, Gaze, RotatingDisk, SlidingTexture
from scenes.derived.later import Later
from scenes.keys import side_by_side
from spikecam_env.errors import InputError

SHAPE = (40, 60)


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("keys", [0, 1, 7, 65])
def test_every_key_is_painted_once_whatever_the_threads(keys: int, threads: int) -> None:
    painted: list[int] = []
    side_by_side(painted.append, keys, threads)
    assert sorted(painted) == list(range(keys))


def test_a_key_that_fails_is_heard_of() -> None:
    def fail(key: int) -> None:
        raise ZeroDivisionError(key)

    with pytest.raises(ZeroDivisionError):
        side_by_side(fail, 20, 2)


@pytest.mark.parametrize("gaze", [None, Gaze((2.0, 1.0), (5.0, -3.0), (100.0, 140.0))])
@pytest.mark.parametrize(
    "scene", [RotatingDisk(SHAPE), Collage(SHAPE, 3), SlidingTexture(SHAPE)], ids=lambda scene: type(scene).__name__
)
def test_later_is_the_same_light_from_another_moment_and_place(scene, gaze: Gaze | None) -> None:
    later = Later(scene, 1000, (3.0, -2.0))
    there = Gaze.fixed(3.0, -2.0) if gaze is None else Gaze((5.0, -1.0), (8.0, -5.0), (1100.0, 1140.0))
    keys, original = later.radiance(100, 140, gaze), scene.radiance(1100, 1140, there)
    np.testing.assert_array_equal(keys.frame + 1000, original.frame)
    np.testing.assert_array_equal(keys.radiance, original.radiance)
    truth, true = later.truth(120.5, gaze), scene.truth(1120.5, there)
    np.testing.assert_array_equal(truth.radiance, true.radiance)
    np.testing.assert_array_equal(truth.flow, true.flow)
    assert truth.poses == true.poses
    assert (Later(scene).radiance(3, 9).frame == scene.radiance(3, 9).frame).all()


def test_frames_must_run_forwards() -> None:
    with pytest.raises(InputError, match="frames run from 9 to 9"):
        SlidingTexture(SHAPE).radiance(9, 9)
