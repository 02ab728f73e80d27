"""The numbers of the tasks: with each halved and doubled in turn, a property of its task fails.

A property is a quantity that is measured on the task, mostly on forty episodes without their pictures, and the range
that it is to lie in.  Its words are the quantity's docstring.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from scenes.catalogue import unexposed_scene
from scenes.flat.discs import PiecewisePath
from spikecam_env.envs import aiming, passes, scene, task
from spikecam_env.envs.course import Drive, StepOutcome, steps_of
from spikecam_env.envs.episode import Episode
from spikecam_env.envs.motor import Motor
from spikecam_env.envs.oracle import oracle
from spikecam_env.envs.registration import FULL_SHAPE, MAX_EPISODE_STEPS
from spikecam_env.envs.task import is_inside
from spikecam_env.envs.tasks import (
    TASKS,
    Catch,
    Exposure,
    LowLight,
    ReadDigit,
    ReadSpin,
    Saccade,
    Task,
    Track,
    catch,
    digits,
    exposure,
    read_spin,
    things,
)
from spikecam_env.envs.tasks.base import CameraUnits

RATE_HZ = 40_000.0
SIDE = 64


def view(of: Task) -> CameraUnits:
    return CameraUnits((SIDE, SIDE), RATE_HZ, of.frames_per_step, things.TRAIN_PICTURES)


def drawn(of: Task, count: int = 40) -> list[Episode]:
    return [of.draw(np.random.default_rng([number, of.stream]), view(of)) for number in range(count)]


def inner(scene: Any) -> Any:
    """The discs of a scene, whatever is before them."""
    while not hasattr(scene, "discs"):
        scene = scene.scene
    return scene


def paths(of: Task) -> list[PiecewisePath]:
    """Of the targets."""
    return [inner(episode.scene).discs[episode.target].path for episode in drawn(of)]


def from_middle(path: PiecewisePath) -> Any:
    """[shorter sides]"""
    return (path.place - (SIDE - 1) / 2) / SIDE


def crossings(of: Task) -> float:
    """At its mean speed the target crosses the picture two or three times in an episode."""
    return float(np.mean([path.speed for path in paths(of)]) * RATE_HZ / SIDE * of.duration_s)


def coasting(of: Task) -> float:
    """The gaze coasts on from its top rate by about half the radius of the target's circle: an agent has to brake."""
    return of.top_sides_s * of.rise_s / 2 / of.success_side


def covered(of: Any) -> float:
    """A target that counts as looked at covers the picture's middle: the way to its own over its radius."""
    return float(of.success_side / of.radius)


def slowest(of: Task) -> float:
    """Speed of the slowest target over the gaze's top."""
    return min(path.speed for path in paths(of)) * RATE_HZ / SIDE / of.top_sides_s


def fastest(of: Task) -> float:
    """Of the fastest."""
    return max(path.speed for path in paths(of)) * RATE_HZ / SIDE / of.top_sides_s


def nearest(of: Task) -> float:
    """Nearest that a target begins to the middle: it is not on it yet [shorter sides]."""
    return float(min(np.hypot(*from_middle(path)[0]) for path in paths(of)))


def farthest(of: Task) -> float:
    """Farthest: it is well in view."""
    return float(max(np.hypot(*from_middle(path)[0]) for path in paths(of)))


def walls(of: Task) -> float:
    """Where the targets turn back, from the middle [shorter sides]."""
    return float(max(np.abs(from_middle(path)).max() for path in paths(of)))


def best(of: Task) -> list[StepOutcome]:
    """The ends of the oracle's episodes."""
    drive = Drive(Motor(of.top_sides_s * SIDE, of.rise_s), of.axes, of.frames_per_step, RATE_HZ)
    return [list(steps_of(StepOutcome.begin(drive, episode), oracle))[-1] for episode in drawn(of, 10)]


def share_of_time(of: Task) -> float:
    """The oracle needs a fifth to a third of the time: an agent may hesitate, and may not try everything."""
    return float(np.mean([end.standing.step / end.episode.steps for end in best(of)]))


def share_of_holding(of: Task) -> float:
    """The oracle spends about half of its time on the way, and half on the target."""
    return float(np.mean([end.standing.held / end.standing.step for end in best(of)]))


def rises(of: Task) -> float:
    """The motor is at its top rate just before the earliest ball has to be met."""
    assert isinstance(of, Catch)
    return of.rise_s / (of.crossing_s[0] - catch.REACTION_S)


def reached(of: Task) -> float:
    """The earliest ball crosses within the motor's reach, and not as far away as the latest may."""
    assert isinstance(of, Catch)
    return of.reach(of.crossing_s[0] - catch.REACTION_S)


def in_time(of: Task) -> float:
    """The latest ball crosses before the episode is over, and not long before."""
    assert isinstance(of, Catch)
    return of.crossing_s[1] / of.duration_s


def crossing_frames(of: Task) -> list[float]:
    return [episode.crossing[1] - of.frames_per_step for episode in drawn(of) if isinstance(episode, catch.Meeting)]


def earliest(of: Task) -> float:
    """[ms], of a ball."""
    return min(crossing_frames(of)) / RATE_HZ * 1e3


def latest(of: Task) -> float:
    """[ms]"""
    return max(crossing_frames(of)) / RATE_HZ * 1e3


def crossing_places(of: Task) -> list[float]:
    """From the middle [shorter sides]."""
    episodes = drawn(of)
    return [abs(e.crossing[0] - (SIDE - 1) / 2) / SIDE for e in episodes if isinstance(e, catch.Meeting)]


def off_the_paddle(of: Task) -> float:
    """Nobody meets a ball by doing nothing: the nearest crosses at some two half widths of the paddle."""
    return min(crossing_places(of)) / of.success_side


def widest(of: Task) -> float:
    """The farthest crosses within the picture that the paddle begins with, and near its edge."""
    return max(crossing_places(of))


def whole_at_first(of: Any) -> float:
    """The ball is first seen whole, at the picture's top: its upper rim [shorter sides]."""
    return float(of.start - of.radius)


def whole_at_last(of: Any) -> float:
    """It is whole where it crosses, at the picture's bottom: its lower rim."""
    return float(of.line + of.radius)


def beginnings(of: Task) -> float:
    """The ball is first seen in the middle 40 % of the columns, so that its own column does not tell where it goes."""
    return float(max(abs(from_middle(path)[0, 0]) for path in paths(of)))


def seen_to_move(_: Any) -> float:
    """In the time to react the slowest ball moves by one to two of its radii."""
    ball = Catch()
    return (ball.line - ball.start) / ball.crossing_s[1] * catch.REACTION_S / ball.radius


def rows_of_line(_: Any) -> float:
    """The line is seen, and hides nothing: rows at 256 x 256."""
    of = CameraUnits((256, 256), RATE_HZ, Catch.frames_per_step, things.TRAIN_PICTURES)
    tile = Catch().draw(np.random.default_rng(0), of).scene.tile  # type: ignore[attr-defined]
    return float((tile[:256, 0] == np.float32(things.BRIGHT)).sum())


def shortest_interval(of: Task) -> float:
    """Least mean interval of an episode [frames]."""
    return min(1 / float(episode.scene.truth(0.0).radiance.mean()) for episode in drawn(of))


def longest_interval(of: Task) -> float:
    """[frames]"""
    return max(1 / float(episode.scene.truth(0.0).radiance.mean()) for episode in drawn(of))


def ambient(of: Task) -> list[Any]:
    """Decades of light at a hundred frames of every episode."""
    frames = np.linspace(0, of.duration_s * RATE_HZ, 100)
    return [[episode.scene.law(frame) for frame in frames] for episode in drawn(of)]  # type: ignore[attr-defined]


def decades(of: Task) -> float:
    """The light changes a thousandfold."""
    return float(np.ptp(ambient(of)))


def swings(of: Task) -> list[float]:
    """Periods of the light in an episode."""
    frames = of.duration_s * RATE_HZ
    return [frames / episode.scene.law.period for episode in drawn(of)]  # type: ignore[attr-defined]


def fewest_swings(of: Task) -> float:
    """All the light's range is met in every episode: more than one swing."""
    return min(swings(of))


def most_swings(of: Task) -> float:
    """An agent need not foresee it: three at most."""
    return max(swings(of))


def iris_over_light(of: Any) -> float:
    """The iris follows the fastest change of light, and not much faster ones."""
    return float(of.iris_decades_s / (2 * np.pi / of.period_s[0] * of.decades))


def exposed_by_chance(of: Any) -> float:
    """An iris that is left alone is right for a tenth to a fifth of the time."""
    return float((np.abs(ambient(of)) <= np.log10(of.tolerance)).mean())


def room_for_error(_: Any) -> float:
    """The iris can be wrong at the ends of the light too, either way: by more than is well exposed."""
    return exposure.IRIS_BEYOND / float(np.log10(Exposure().tolerance))


def turns_of_the_slowest(of: Task) -> float:
    """An agent may wait for some turns of the slowest disc."""
    return min(read_spin.RPM) / 60 * of.duration_s


def turn_a_step(_: Any) -> float:
    """The fastest disc turns by less than its bright sector in a step, and by more than a third [degrees]."""
    return max(read_spin.RPM) * 6 * ReadSpin.frames_per_step / RATE_HZ


def guesses(_: Any) -> float:
    """Who says one speed after another gives three answers, one fewer than there are speeds."""
    begun = StepOutcome.begin(Drive(Motor(640.0, 0.01), 2, 40, RATE_HZ), drawn(ReadSpin(), 1)[0])

    def guess(course: StepOutcome) -> Any:
        wrong = [float(n == (course.episode.truth + 1) % 4) for n in range(4)]  # type: ignore[attr-defined]
        return np.array([*oracle(course)[:2], 1.0, *wrong])

    return float(list(steps_of(begun, guess))[-1].episode.wrong)  # type: ignore[attr-defined]


def dark_spikes(_: Any) -> float:
    """A dark pixel of a disc fires about twice a step of 40 frames."""
    return things.DARK * Track.frames_per_step


def steps_to_cross(_: Any) -> float:
    """The earliest ball is in view for ten steps or more, fewer than twenty."""
    return Catch().crossing_s[0] * RATE_HZ / Catch.frames_per_step


def dark_background(_: Any) -> float:
    """So does one of the background."""
    return things.BACKGROUND[0] * Track.frames_per_step


def contrast(_: Any) -> float:
    """A disc's contrast is ten to twenty, and its light below a spike a frame."""
    return things.BRIGHT / things.DARK if things.BRIGHT < 1 else np.inf


def background_over_disc(_: Any) -> float:
    """The background is a third to a half as bright as a disc whose texture is half bright."""
    return sum(things.BACKGROUND) / (things.DARK + things.BRIGHT)


def texels_a_pixel(_: Any) -> float:
    """On the largest disc at the full size: one or more, less than two."""
    return things.TEXTURE_SIZE / (2 * ReadDigit().radius * min(FULL_SHAPE))


def roughness(_: Any) -> float:
    """Of the background: difference of neighbours over its spread.  Less than a quarter moves smoothly."""
    things.background.cache_clear()
    tile = things.background(0, (SIDE, SIDE))
    return float(np.diff(tile, axis=1).std() / tile.std())


def pieces_a_step(_: Any) -> float:
    """A path is straight for a step."""
    return things.PIECE_S * RATE_HZ / Track.frames_per_step


def heading(_: Any) -> float:
    """The target's heading after an episode: it has turned by about half a circle [radians, standard deviation]."""
    turned = []
    for path in paths(Track()):
        ways = np.diff(path.place, axis=0)
        turns = np.angle(np.exp(1j * np.diff(np.arctan2(ways[:, 1], ways[:, 0]))))
        turned.append((turns[np.abs(turns) < 1] ** 2).sum())  # a bounce is no turn
    return float(np.sqrt(np.mean(turned)))


def digit_reach(_: Any) -> float:
    """A digit and its bar fill the disc: how far its ink is from the middle, at most [radii]."""
    y, x = np.indices((128, 128)) - 63.5
    return max(float(np.hypot(x, y)[ink(n)].max()) / 64 for n in range(20))


def ink(number: int, name: str = "8") -> Any:
    """(128, 128): the dark texels of a digit."""
    return digits.digit(name, 128, np.random.default_rng([number, 2])) < 0.5


def bar(number: int) -> tuple[float, float, float, float]:
    """(x, y) of its middle, width and height [texels]: the lowest dark rows."""
    dark = ink(number)
    lowest = int(np.nonzero(dark.any(axis=1))[0].max())
    top = lowest
    while dark[top - 1].any():
        top -= 1
    _, columns = np.nonzero(dark[top : lowest + 1])
    return float(columns.mean()), (top + lowest) / 2, float(np.ptp(columns) + 1), float(lowest - top + 1)


def thinnest(_: Any) -> float:
    """Of a digit's strokes on a disc of a quarter of the side of 64 pixels [pixels]: it is resolved."""
    return min(bar(n)[3] for n in range(20)) / 128 * 2 * ReadDigit().radius * SIDE


def thickest(_: Any) -> float:
    """The holes of an 8 stay open: its strokes over its height."""
    return max(bar(n)[3] for n in range(20)) / 128 / digits.HEIGHT


def narrowest(_: Any) -> float:
    """Width of a digit over its font's."""
    return min(bar(n)[2] - bar(n)[3] for n in range(20)) / (128 / 3)


def broadest(_: Any) -> float:
    """At most: digits differ in width by a quarter and more."""
    return max(bar(n)[2] - bar(n)[3] for n in range(20)) / (128 / 3)


def lean(_: Any) -> float:
    """Between the bar's middle and the picture's, which is about the digit's, over their distance."""
    return max(abs(x - 63.5) / (y - 63.5) for x, y, _, _ in map(bar, range(20)))


def outcome_over_way(_: Any) -> float:
    """Success is worth about as much as the way to it: Saccade's, from a third of the side away."""
    way = np.mean(Saccade().start) / (np.hypot(1, 1) / 2)
    return float(task.OUTCOME / (task.PROGRESS * way))


def drifting_off(_: Any) -> float:
    """Who rests on a target of the fastest drift has it for a third of the time."""
    return aiming.SUCCESS_SHARE / task.DRIFT / (MAX_EPISODE_STEPS * 40 / RATE_HZ)


def over_drift(_: Any) -> float:
    """The slowest gaze is several times faster than the drift."""
    return scene.SLOWEST_GAZE / task.DRIFT


def beside(_: Any) -> float:
    """A camera at rest that looks a quarter of the side past the fastest target keeps it in view for 5 ms [ms]."""
    return 1e3 * 0.25 / scene.FASTEST_TARGET


def pace(_: Any) -> float:
    """A target takes as much of the gaze's rate as that of Track does, half."""
    return scene.GAZE_OVER_TARGET * float(np.mean(Track().speed))


def bend(_: Any) -> float:
    """A body that vibrates at 40 Hz and 80 shorter sides a second leaves a straight line by a quarter of a side between
    two looks: it stays in view, and looks are as rare as that allows."""
    turn = 2 * np.pi * 40
    return 80 / turn * (1 - float(np.cos(turn * passes.EVERY_S)))


@lru_cache
def passes_of(name: str) -> tuple[Any, passes.Passes]:
    """A scene, with the passes of its first target."""
    made: Any = unexposed_scene(name, (SIDE, SIDE), 0, RATE_HZ)
    return made, passes.passes(made, next(iter(made.places(0.0))), 60_000)


def good_moments(name: str) -> float:
    """Share of the moments in which the target is in the scene's own view, and has LEAST_STEPS left."""
    made, found = passes_of(name)
    target, good = next(iter(made.places(0.0))), []
    for frame in np.random.default_rng(0).integers(40_000, size=400):
        left = found.end(int(frame)) - frame >= (scene.LEAST_STEPS + 1) * 40
        good.append(left and is_inside(made.places(float(frame))[target], made.shape))
    return float(np.mean(good))


def moments_of_dice(_: Any) -> float:
    """Dice has the shortest passes: an episode begins in the first third of its time in view, or half."""
    return good_moments("dice")


def no_good_moment(_: Any) -> float:
    """Train is out of its view for most of the time: one episode in twenty begins out of it."""
    return float((1 - good_moments("train")) ** scene._STARTS)


def rounds(_: Any) -> float:
    """Car, whose passes are the longest but Train's, may be met in two of them."""
    return scene.LATEST_START / float(np.diff(passes_of("car")[1].cuts).mean())


def after_the_train(_: Any) -> float:
    """The end of the pass of Train in which the latest episode begins is known: its frame is less."""
    return scene.CUTS_KNOWN / passes_of("train")[1].end(scene.LATEST_START)


@lru_cache
def fastest_world() -> float:
    """Top speed of the target of the fastest of twelve random worlds [shorter sides/s]."""
    worlds: list[Any] = [unexposed_scene("random", (SIDE, SIDE), seed, RATE_HZ) for seed in range(12)]
    return max(passes.passes(world, next(iter(world.places(0.0))), 20_000).top_px_s for world in worlds) / SIDE


def over_worlds(_: Any) -> float:
    """No random world of twelve is faster than all are taken for, and the fastest has more than half of that."""
    return scene.RANDOM_TOP / fastest_world()


def test_top_speed_has_no_leap_in_it() -> None:
    """A ball that is thrown again after 0.13 s, as `scenes.catalogue.ball`: some 40 sides a second."""
    top = passes_of("ball")[1].top_px_s / SIDE
    print(f"{top:.1f} sides/s")
    assert 36 < top < 44


@dataclass(frozen=True)
class Number:
    """owner: a task, or the class or module of a constant; name: of the number, `.0` or `.1` the end of a range."""

    owner: Task | type[Task] | ModuleType
    name: str
    quantity: Callable[[Any], float]
    least: float
    most: float

    def __str__(self) -> str:
        owner = type(self.owner).__name__ if isinstance(self.owner, Task) else self.owner.__name__
        return f"{owner.rsplit('.', 1)[-1]}.{self.name}"

    def measured(self, factor: float, monkeypatch: pytest.MonkeyPatch) -> float:
        """The quantity, with the number `factor` times its value."""
        name, _, end = self.name.partition(".")
        value = getattr(self.owner, name)
        if not isinstance(value, tuple):
            value *= factor
        else:
            value = tuple(sorted(each * factor if end in ("", str(n)) else each for n, each in enumerate(value)))
        if isinstance(self.owner, Task):
            return self.quantity(replace(self.owner, **{name: value}))
        with monkeypatch.context() as patched:
            patched.setattr(self.owner, name, value)
            return self.quantity(self.owner)


T, S, C, R, D, X, L = Track(), Saccade(), Catch(), ReadSpin(), ReadDigit(), Exposure(), LowLight()
NUMBERS = (
    Number(T, "top_sides_s", crossings, 2, 3),
    Number(T, "duration_s", crossings, 2, 3),
    Number(T, "rise_s", coasting, 0.25, 0.75),
    Number(T, "success_side", covered, 0.7, 1),
    Number(T, "radius", covered, 0.7, 1),
    Number(T, "speed.0", slowest, 0.2, 0.3),
    Number(T, "speed.1", fastest, 0.7, 0.8),
    Number(T, "start.0", nearest, 1 / 8, 0.2),
    Number(T, "start.1", farthest, 0.2, 0.3),
    Number(T, "room", walls, 0.8, 1.0),
    Number(S, "duration_s", share_of_time, 0.2, 0.33),
    Number(S, "hold_s", share_of_holding, 0.33, 0.55),
    Number(S, "success_side", covered, 0.4, 0.8),
    Number(S, "radius", covered, 0.4, 0.8),
    Number(S, "speed.0", slowest, 0.2, 0.3),
    Number(S, "speed.1", fastest, 0.4, 0.5),
    Number(S, "start.0", nearest, 0.2, 0.3),
    Number(S, "start.1", farthest, 0.3, 0.39),
    Number(S, "room", walls, 0.4, 0.7),
    Number(C, "top_sides_s", reached, 0.12, 0.225),
    Number(C, "rise_s", rises, 0.5, 1),
    Number(C, "duration_s", in_time, 0.5, 0.9),
    Number(C, "success_side", covered, 0.7, 1),
    Number(C, "radius", covered, 0.7, 1),
    Number(C, "crossing_s.0", earliest, 5, 7),
    Number(C, "crossing_s.1", latest, 18, 20),
    Number(C, "away.0", off_the_paddle, 1.5, 2.5),
    Number(C, "away.1", widest, 0.35, 0.5),
    Number(C, "start", whole_at_first, 0, 0.1),
    Number(C, "line", whole_at_last, 0.8, 1),
    Number(C, "spread", beginnings, 0.15, 0.2),
    Number(R, "duration_s", turns_of_the_slowest, 3, 6),
    Number(R, "radius", covered, 0.5, 0.8),
    Number(R, "speed.0", slowest, 0.05, 0.08),
    Number(R, "speed.1", fastest, 0.15, 0.2),
    Number(R, "start.0", nearest, 0.2, 0.25),
    Number(R, "start.1", farthest, 0.25, 0.35),
    Number(R, "room", walls, 0.45, 0.6),
    Number(D, "radius", covered, 0.4, 0.7),
    Number(X, "decades", decades, 2.5, 3),
    Number(X, "period_s.0", most_swings, 2, 3),
    Number(X, "period_s.1", fewest_swings, 1.2, 1.8),
    Number(X, "iris_decades_s", iris_over_light, 1, 1.5),
    Number(X, "tolerance", exposed_by_chance, 0.1, 0.2),
    Number(L, "mean_interval.0", shortest_interval, 18, 30),
    Number(L, "mean_interval.1", longest_interval, 140, 220),
    Number(Task, "frames_per_step", dark_spikes, 1.5, 3),
    Number(Catch, "frames_per_step", steps_to_cross, 9, 19),
    Number(catch, "REACTION_S", seen_to_move, 1, 2),
    Number(catch, "LINE_SIDES", rows_of_line, 3, 5),
    Number(exposure, "IRIS_BEYOND", room_for_error, 1, 2.5),
    Number(read_spin, "RPM", turn_a_step, 30, 90),
    Number(read_spin, "LOCK_SHARE", guesses, 3, 3),
    Number(things, "DARK", dark_spikes, 1.5, 3),
    Number(things, "BRIGHT", contrast, 10, 20),
    Number(things, "BACKGROUND.0", dark_background, 1.5, 3),
    Number(things, "BACKGROUND.1", background_over_disc, 1 / 3, 1 / 2),
    Number(things, "TEXTURE_SIZE", texels_a_pixel, 1, 2),
    Number(things, "BLUR_PX", roughness, 0.12, 0.25),
    Number(things, "PIECE_S", pieces_a_step, 0.7, 1.4),
    Number(things, "TURN", heading, 2, 4),
    Number(digits, "HEIGHT", digit_reach, 0.7, 1),
    Number(digits, "STROKE.0", thinnest, 1.5, 3),
    Number(digits, "STROKE.1", thickest, 0.15, 0.25),
    Number(digits, "WIDTH.0", narrowest, 0.6, 1.0),
    Number(digits, "WIDTH.1", broadest, 1.0, 1.5),
    Number(digits, "SLANT", lean, 0.15, 0.3),
    Number(task, "PROGRESS", outcome_over_way, 0.8, 1.5),
    Number(task, "DRIFT", drifting_off, 0.25, 0.4),
    Number(task, "OUTCOME", outcome_over_way, 0.8, 1.5),
    Number(aiming, "SUCCESS_SHARE", drifting_off, 0.25, 0.4),
    Number(scene, "SLOWEST_GAZE", over_drift, 4, 8),
    Number(scene, "FASTEST_TARGET", beside, 4, 8),
    Number(scene, "GAZE_OVER_TARGET", pace, 0.8, 1.25),
    Number(scene, "RANDOM_TOP", over_worlds, 1, 2),
    Number(scene, "LEAST_STEPS", moments_of_dice, 0.1, 0.35),
    Number(scene, "_STARTS", no_good_moment, 0.01, 0.1),
    Number(scene, "LATEST_START", rounds, 1.5, 3),
    Number(scene, "CUTS_KNOWN", after_the_train, 1.05, 1.5),
    Number(passes, "EVERY_S", bend, 0.1, 0.5),
)


@pytest.mark.slow
@pytest.mark.parametrize("number", NUMBERS, ids=str)
def test_a_number_that_is_halved_or_doubled_fails_its_property(number: Number, monkeypatch: pytest.MonkeyPatch) -> None:
    half, as_it_is, twice = (number.measured(factor, monkeypatch) for factor in (0.5, 1.0, 2.0))
    print(f"{number}: {half:.4g}, {as_it_is:.4g}, {twice:.4g}; {number.least:.4g} to {number.most:.4g}")
    assert number.least <= as_it_is <= number.most
    assert not number.least <= half <= number.most and not number.least <= twice <= number.most


def test_every_number_of_every_task_is_in_the_table() -> None:
    there = {(type(n.owner), n.name.split(".")[0]) for n in NUMBERS if isinstance(n.owner, Task)}
    for kind in TASKS.values():
        parent = kind.__mro__[1]
        for field in fields(kind):
            if field.default is None:  # the task's own light
                continue
            if kind is Track or field.default != getattr(parent, field.name, None):
                assert (kind, field.name) in there, (kind.__name__, field.name)


def test_every_constant_of_their_modules_is_in_the_table() -> None:
    """Numbers and ranges; fonts are no quantity, and the length of an episode is `registration`'s."""
    there = {n.name.split(".")[0] for n in NUMBERS} | {"FONTS", "MAX_EPISODE_STEPS", "FULL_SHAPE"}
    for module in (aiming, passes, scene, task, catch, digits, exposure, read_spin, things):
        for name, value in vars(module).items():
            numbers = value if isinstance(value, tuple) else (value,)
            if name.isupper() and all(isinstance(each, int | float) for each in numbers):
                assert name in there, (module.__name__, name)
