"""Simulated streams: their light, their spikes, and when they begin anew."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from denoiser.passes.recipe import RECIPES
from denoiser.training.simulated import AGES, SHAPES, SPEEDS, TWINS, Bank, SimulatedStreams
from scenes.catalogue import make_scene
from spikecam_env.errors import InputError
from spikecam_env.sensor.engines.compiled import fast
from spikecam_env.sensor.light import Segment

COUNT, PATCH = 12, 32


@pytest.fixture
def streams(bank):
    return SimulatedStreams(COUNT, PATCH, seed=5, bank=bank)


@pytest.fixture(scope="module")
def scenes(bank):
    """The scenes of many streams, of which nothing is painted."""
    return SimulatedStreams(4000, 8, seed=1, bank=bank)._scene(4000)


def joined(streams, calls, frames=16):
    """(noisy, clean, light) of the next calls, none of which may begin a stream but the first."""
    parts = [streams.advance(frames) for _ in range(calls)]
    assert not any(bool(part.begins.any()) for part in parts[1:])
    return tuple(torch.cat([getattr(part, name) for part in parts], 1).double() for name in ("noisy", "clean", "light"))


def motion(scene):
    """(B, layers) speed of the centre [pixels/frame], turn [radians/frame], radius [pixels]."""
    return scene["velocity"].norm(dim=-1), scene["spin"].abs(), scene["extent"].norm(dim=-1)


def still(scene):
    """(B,) whether nothing moves."""
    speed, turn, _ = motion(scene)
    return (speed.amax(1) == 0) & (turn.amax(1) == 0)


def test_same_seed_same_streams(bank):
    first, again, other = (SimulatedStreams(4, PATCH, seed=seed, bank=bank) for seed in (5, 5, 6))
    for _ in range(8):
        a, b, c = (s.advance(16) for s in (first, again, other))
        assert all(torch.equal(getattr(a, name), getattr(b, name)) for name in ("noisy", "clean", "light", "begins"))
    assert not torch.equal(a.light, c.light) and not torch.equal(a.noisy, c.noisy)


def test_light_and_spikes_are_in_range(streams):
    part = streams.advance(16)
    assert part.noisy.shape == part.clean.shape == part.light.shape == (COUNT, 16, PATCH, PATCH)
    assert part.noisy.dtype == part.clean.dtype == torch.uint8 and part.light.dtype == torch.float32
    assert set(part.noisy.unique().tolist()) == set(part.clean.unique().tolist()) == {0, 1}
    assert 0 <= part.light.min() < 0.05 and 0.5 < part.light.max() <= 1


def test_clean_spikes_are_the_light_to_one_spike(streams):
    """In every pixel, over frames that move: the noise-free twin integrates the light and has no fixed pattern."""
    _, clean, light = joined(streams, 5)
    worst = float((clean.sum(1) - light.sum(1)).abs().max())
    print(f"worst difference {worst:.3f} spikes")
    assert worst < 1 + 1e-3


def test_noisy_spikes_follow_the_light_the_gain_and_the_dark_rate(streams):
    """A pixel's count errs by less than a spike; without its own gain and dark rate it errs by more."""
    noisy, _, light = joined(streams, 5)
    gain, dark = (plane.double() for plane in streams.unit(torch.arange(COUNT)))
    frames = noisy.shape[1]
    expected = gain * light.sum(1) + dark * frames
    seen = (light.amax(1) < 0.7) & (expected > 5)
    error = (noisy.sum(1) - expected).square()[seen].mean().sqrt()
    blind = (noisy.sum(1) - light.sum(1)).square()[seen].mean().sqrt()
    ratio = float(noisy.sum(1)[seen].sum() / expected[seen].sum())
    print(f"{int(seen.sum())} pixels: error {error:.3f} spikes, blind to the unit {blind:.3f}, ratio {ratio:.4f}")
    assert error < 1 and blind > 2 * error and abs(ratio - 1) < 5 / math.sqrt(float(expected[seen].sum()))


def test_a_gain_changes_the_noisy_spikes_alone(bank):
    faster = replace(bank, gain=1.5 * bank.gain)
    plain, bright = (SimulatedStreams(4, PATCH, seed=5, bank=b).advance(32) for b in (bank, faster))
    assert torch.equal(plain.light, bright.light) and torch.equal(plain.clean, bright.clean)
    assert bright.noisy.sum() > 1.2 * plain.noisy.sum()


def test_held_light_gives_the_spikes_of_the_fast_engine(streams):
    """Same law, same draws: the same bits, in scenes at rest."""
    rows = torch.nonzero(still(streams._state)).flatten().tolist()
    assert rows
    engines = {row: fast_engine(streams, row) for row in rows}
    part = streams.advance(48)
    for row, engine in engines.items():
        held = part.light[row, 0].flatten().numpy()
        expected = np.concatenate([fast.run(engine, Segment(held, held, 1, 0, 1)) for _ in range(48)])
        assert np.array_equal(part.noisy[row].reshape(48, -1).numpy(), expected)
    print(f"{len(rows)} streams at rest, {int(part.noisy[rows].sum())} spikes")


def fast_engine(streams, row):
    """The noisy pixels of a stream, in the fast engine."""
    mine = {name: value[row].numpy().copy() for name, value in streams._state.items()}
    law = fast.PixelLaw(mine["gain"], mine["dark"], mine["spread"], tuple(mine["polynomial"]))
    words = mine["seeds"].view(np.uint32)
    return fast.FastState(law, mine["noisy remaining"], mine["noisy fired"].view(np.uint32), (words[0], words[1]))


def test_scenes_at_rest_stay_as_they_are(streams):
    rows = still(streams._state)
    light = streams.advance(32).light
    change = (light - light[:, :1]).abs().amax(dim=(1, 2, 3))
    print(f"at rest: {int(rows.sum())} of {COUNT}")
    assert change[rows].max() == 0 and (change[~rows] > 0).any()


def test_nothing_is_faster_than_the_fastest(scenes):
    speed, turn, radius = motion(scenes)
    assert speed.max() <= SPEEDS[1] and (turn * radius).max() <= SPEEDS[1] * (1 + 1e-5)
    assert (turn[:, 0] == 0).all(), "a background that turns shows more than its texture"


def test_the_demonstrations_disk_is_among_the_speeds(scenes):
    """At 2000 rpm its rim is slower than a sixth of the scenes that move, and faster than most."""
    disk = make_scene("disk", (250, 400))
    rim = 2000 / 60 * 2 * math.pi / disk.frame_rate_hz * disk.radius
    moving = fastest(scenes)[~still(scenes)]
    faster = float((moving > rim).float().mean())
    print(f"rim {rim:.2f} pixels/frame, slower than {faster:.3f} of the scenes that move")
    assert 1 / 6 < faster < 1 / 2


def fastest(scene):
    """(B,) speed of the fastest layer, its rim included [pixels/frame]."""
    speed, turn, radius = motion(scene)
    return torch.maximum(speed, turn * radius).amax(1)


def brightest(scene):
    """(B,) [spikes/frame]."""
    return scene["levels"].amax(dim=(1, 2))


MIXTURE = {
    "at rest": (lambda s: still(s).float().mean(), 0.3, 1.4),
    "moves over a pixel a frame, of scenes that move": (
        lambda s: (fastest(s)[~still(s)] > 1).float().mean(),
        0.17,
        1.4,
    ),
    "looks still in a window, of scenes that move": (
        lambda s: (fastest(s)[~still(s)] < 1 / 48).float().mean(),
        0.03,
        1.7,
    ),
    "backgrounds at rest in scenes that move": (lambda s: at_rest(s)[:, 0].mean(), 0.5, 1.2),
    "shapes at rest in scenes that move": (lambda s: at_rest(s)[:, 1:].mean(), 0.15, 1.4),
    "scenes darker than a spike in seven frames": (lambda s: (brightest(s) < 0.15).float().mean(), 0.37, 1.3),
    "the brightest light of the darkest scenes": (lambda s: brightest(s).quantile(0.01), 0.012, 1.4),
    "the brightest light of all": (lambda s: brightest(s).max(), 1.0, 1.05),
    "shapes shown": (lambda s: s["shown"][:, 1:].float().mean(), 0.7, 1.3),
    "shapes that turn in scenes that move": (lambda s: (motion(s)[1][~still(s), 1:] > 0).float().mean(), 0.4, 1.4),
    "the fastest turn": (lambda s: motion(s)[1].max(), 0.05, 1.4),
    "extent of a shape, of the picture's side": (lambda s: s["extent"].mean() / 8, 0.28, 1.4),
    "the thinnest shape, of the picture's side": (lambda s: s["extent"].min() / 8, 0.06, 1.4),
    "texels a pixel": (lambda s: s["zoom"].mean(), 0.95, 1.4),
    "contrast": (lambda s: (s["levels"].amax((1, 2)) / s["levels"].amin((1, 2))).median(), 6.9, 1.3),
}
"""A measure of many scenes, its value, and a factor that it keeps to: twice a constant is another mixture."""


def at_rest(scene):
    """(B', layers) whether the centre stays, in scenes in which something moves."""
    return (motion(scene)[0][~still(scene)] == 0).float()


@pytest.mark.parametrize("name", MIXTURE)
def test_the_mixture_of_scenes(scenes, name):
    measured, about, within = MIXTURE[name]
    found = float(measured(scenes))
    print(f"{name}: {found:.4f}")
    assert about / within < found < about * within


@pytest.mark.slow
def test_before_a_panning_camera_all_layers_move_alike(bank):
    streams = SimulatedStreams(4000, 8, seed=1, bank=bank, panned=0.5)
    velocity = streams._scene(4000)["velocity"]
    moves = (velocity.norm(dim=-1) > 0).all(dim=1)
    alike = (velocity - velocity[:, :1]).abs().amax(dim=(1, 2)) < 1e-6
    print(f"all layers move in {moves.float().mean():.3f} of the scenes, alike in {(moves & alike).float().mean():.3f}")
    assert 0.5 < moves.float().mean() < 0.62  # a few of the others move in all layers by themselves
    assert (moves & alike).float().mean() > 0.14  # half of those at rest, STILL


def test_weak_texture_is_no_brighter_and_hardly_darker(bank):
    plain, weak = (SimulatedStreams(4000, 8, seed=1, bank=bank, weak=share)._scene(4000) for share in (0.0, 1.0))
    contrast = weak["levels"][..., 0] / weak["levels"][..., 1] - 1
    print(f"contrast {contrast.min():.4f} to {contrast.max():.4f}")
    assert contrast.min() > 0.0199 and 0.28 < contrast.max() < 0.301
    assert weak["levels"].amax() <= plain["levels"].amax() * 1.01 and plain["levels"].amin() > 0


def test_a_stream_begins_anew_at_its_age(bank):
    streams = SimulatedStreams(8, 16, seed=2, bank=bank)
    ages, seen = torch.full((8,), -1), []
    for _ in range(70):
        part = streams.advance(16)
        seen += ages[part.begins & (ages >= 0)].tolist()
        ages = torch.where(part.begins, torch.where(ages < 0, -1, 0), ages)
        ages = torch.where(ages < 0, torch.where(streams._state["age"] == 16, 16, -1), ages + 16)
    print(sorted(seen))
    assert len(seen) > 8 and set(seen) <= {age for age, _ in AGES}


def test_ages_leave_time_to_learn_a_gain_and_few_young_streams(bank):
    """Some streams outlive the longest mean; one pass in 20 to 40 is the first of a stream, which does not count."""
    layout = RECIPES["best"].layout
    lengths = SimulatedStreams(2000, 8, seed=1, bank=bank)._ages(2000)["length"]
    first = layout.planes / float(lengths.mean())
    print(f"{first:.4f} of the passes are first ones")
    assert (lengths > 1.5 * max(layout.memories)).float().mean() > 0.2 and 1 / 40 < first < 1 / 20


def test_rows_advance_alone(bank):
    together, apart = (SimulatedStreams(4, PATCH, seed=5, bank=bank) for _ in range(2))
    whole = [together.advance(16) for _ in range(2)]
    others = torch.tensor([3, 0, 2])
    before = {name: value[others].clone() for name, value in apart._state.items()}
    alone = [apart.advance(16, torch.tensor([1])) for _ in range(2)]
    assert all(torch.equal(value, apart._state[name][others]) for name, value in before.items())
    rest = [apart.advance(16, others) for _ in range(2)]
    for a, b, c in zip(whole, alone, rest, strict=True):
        for name in ("noisy", "clean", "light", "begins"):
            assert torch.equal(getattr(a, name)[1], getattr(b, name)[0])
            assert torch.equal(getattr(a, name)[others], getattr(c, name))


def test_a_twin_is_the_same_without_the_other(bank):
    both, alone = (SimulatedStreams(4, PATCH, seed=5, bank=bank, twins=twins) for twins in (TWINS, ("noisy",)))
    for _ in range(2):
        part, mine = both.advance(32), alone.advance(32)
        assert torch.equal(part.noisy, mine.noisy) and torch.equal(part.light, mine.light)
    assert list(part.spikes) == list(TWINS) and list(mine.spikes) == ["noisy"]


def test_a_bank_for_few_streams_holds_no_more_than_they_can_show():
    few = Bank.drawn(3, torch.device("cpu"), textures=40, units=4, streams=1)
    many = Bank.drawn(3, torch.device("cpu"), textures=7, units=2, streams=1000)
    assert (len(few.textures), len(few.gain)) == (SHAPES + 1, 1)
    assert (len(many.textures), len(many.gain)) == (7, 2)


def test_a_patch_larger_than_the_units_is_refused(bank):
    with pytest.raises(InputError, match="patch is 193"):
        SimulatedStreams(1, 193, bank=bank)
