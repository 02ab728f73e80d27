"""Trajectories: poses follow their formulas, chain, and are rigid."""

from __future__ import annotations

import numpy as np
import pytest

from scenes.trajectories import (
    Ballistic,
    Bouncing,
    Path,
    Repeating,
    Shake,
    Spinning,
    Still,
    Swinging,
    Trajectory,
    Vibrating,
)
from spikecam_env.errors import InputError

TIMES = np.linspace(-0.3, 1.7, 41)
SQUARE = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 0.0, 0.0))

ALL = [
    Still((1, 2, 3), (10, 20, 30)),
    Ballistic((0, 1, 0), (3, 2, 0), (0, -9.81, 0)),
    Spinning((0, 1, 1), 2000, 30),
    Swinging((1, 0, 0), 30, 5, 0.2),
    Vibrating((0, 0.1, 0), 50),
    Bouncing(0.5),
    Path((0.0, 0.3, 0.6, 1.0), SQUARE, closed=True),
    Shake(0.5, 0.1, seed=3),
    Repeating(Ballistic(velocity=(1, 0, 0)), 0.5),
    Still((1, 0, 0)) @ Spinning((0, 1, 0), 60) @ Still((0, 0, 1)),
]


@pytest.mark.parametrize("motion", ALL, ids=lambda motion: type(motion).__name__)
def test_every_pose_is_rigid_and_one_time_is_as_many(motion: Trajectory) -> None:
    poses = motion.pose(TIMES)
    assert poses.shape == (len(TIMES), 4, 4)
    turn = poses[:, :3, :3]
    np.testing.assert_allclose(turn @ np.swapaxes(turn, 1, 2), np.broadcast_to(np.eye(3), turn.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(turn), 1, atol=1e-12)
    np.testing.assert_array_equal(poses[:, 3], np.broadcast_to([0, 0, 0, 1], (len(TIMES), 4)))
    np.testing.assert_allclose(motion.pose(TIMES[7]), poses[7], atol=1e-12)
    np.testing.assert_allclose(motion.pose(TIMES[:6].reshape(2, 3)), poses[:6].reshape(2, 3, 4, 4), atol=1e-12)


def test_a_throw_is_a_parabola() -> None:
    pose = Ballistic((1, 2, 3), (4, 5, 6), (0, -10, 0)).pose(0.5)
    np.testing.assert_allclose(pose[:3, 3], [1 + 2, 2 + 2.5 - 1.25, 3 + 3])


def test_a_bounce_falls_freely_and_repeats() -> None:
    ball = Bouncing(0.8, 9.81)
    period = 2 * np.sqrt(2 * 0.8 / 9.81)
    height = ball.pose(np.array([0.0, 0.1, period / 2, period]))[:, 1, 3]
    np.testing.assert_allclose(height, [0.8, 0.8 - 9.81 * 0.01 / 2, 0.0, 0.8], atol=1e-12)


def test_chains_turn_first_and_move_then() -> None:
    pose = (Still((5, 0, 0)) @ Spinning((0, 0, 1), 60, 90)).pose(0.0)
    np.testing.assert_allclose(pose @ [1, 0, 0, 1], [5, 1, 0, 1], atol=1e-12)


def test_a_closed_path_goes_through_its_points_again_and_again() -> None:
    path = Path((0.0, 0.3, 0.6, 1.0), SQUARE, closed=True)
    np.testing.assert_allclose(path.pose(np.array([0.3, 2.6]))[:, :3, 3], [SQUARE[1], SQUARE[2]], atol=1e-12)


def test_shake_has_the_deviation_it_says() -> None:
    angle = 0.2
    turn = Shake(angle, seed=1).pose(np.linspace(0, 100, 4000))[:, :3, :3]
    about_x = np.degrees(np.arctan2(turn[:, 2, 1], turn[:, 2, 2]))
    print(f"rms {np.std(about_x):.3f} degrees, {angle} asked")
    # a sum of five sines of equal amplitude has exactly this variance over a long time; 100 s hold > 600 periods
    assert np.std(about_x) == pytest.approx(angle, rel=0.03)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (lambda: Path((0.0,), ((0, 0, 0),)), "two at least"),
        (lambda: Path((0.0, 0.0), ((0, 0, 0), (1, 0, 0))), "rising times"),
        (lambda: Path((0.0, 1.0), ((0, 0, 0), (1, 0, 0)), closed=True), "must end where it starts"),
        (lambda: Spinning((0, 0, 0), 1).pose(0.0), "axis"),
    ],
)
def test_bad_motions_are_named(bad, message: str) -> None:
    with pytest.raises(InputError, match=message):
        bad()
