"""Training reconstructors: the input of each, that it learns, and that a run goes on."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch

from denoiser.networks import spk2imgnet, ssml
from denoiser.networks.reconstructor_recipe import LEARNED, WIDTH_STEP, reconstructor_recipe
from denoiser.training import lessons, training_source
from denoiser.training import train as training
from denoiser.training.lessons import Lesson, LessonWindows, RollingWindows
from denoiser.training.resumable_run import Run
from denoiser.training.simulated import TWINS, Bank, StreamBlock
from denoiser.training.train import TrainConfig, train
from denoiser.training.train_config import SOURCES
from denoiser.training.training_source import HeldOut
from denoiser.weights import load_reconstructor
from spikecam_env.errors import InputError
from spikecam_env.streams import isi_plane


class Flats:
    """Still streams of one light each; noisy spikes are twice as many as clean ones.  Ages are counted in the light."""

    def __init__(self, count=4, patch=16, device="cpu", seed=0, *, bank=None, compiled=False, twins=TWINS):
        self.twins = twins
        self.rng = torch.Generator().manual_seed(seed)
        self.count, self.patch, self.device, self.renewed = count, patch, device, []
        self.rate = torch.rand(count, 1, 1, 1, generator=self.rng) * 0.4 + 0.05

    def advance(self, frames):
        shape = (self.count, frames, self.patch, self.patch)
        drawn = torch.rand(shape, generator=self.rng)
        begins = torch.zeros(self.count, dtype=torch.bool)
        begins[self.renewed] = True
        light = self.rate.expand(shape).contiguous()
        spikes = {"noisy": (drawn < 2 * light).byte(), "clean": (drawn < light).byte()}
        return StreamBlock({twin: spikes[twin] for twin in self.twins}, light, begins)


class NoBank:
    @classmethod
    def drawn(cls, seed, device, **_):
        return cls()


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(training_source, "SimulatedStreams", Flats)
    monkeypatch.setattr(training, "Bank", NoBank)
    monkeypatch.setattr(Lesson, "held_out", HeldOut(streams=2, passes=1))


def config(out, mode="spk2img-clean", **options):
    small = {"batch": 4, "patch": 16, "width": WIDTH_STEP, "validate_every": 4, "steps": 5, "frames_a_step": 41}
    return TrainConfig(mode=mode, out=out, **(small | options))


def weights_after(out, mode="spk2img-clean", **options):
    return load_reconstructor(train(config(out, mode, **options), progress=False))[1].state_dict()


def same(a, b):
    return all(torch.equal(a[name], b[name]) for name in a)


def lesson_of(mode, width=WIDTH_STEP):
    """The lesson of a mode, and its networks untrained."""
    return SOURCES[mode], SOURCES[mode].networks(reconstructor_recipe(mode, width))


def windows_of(span, seed=0):
    """Full windows of a few flats."""
    flats = Flats(4, 16, seed=seed)
    part = flats.advance(span)
    return LessonWindows(part.clean, part.light, torch.ones(4, dtype=torch.bool))


@pytest.mark.parametrize("mode", LEARNED)
def test_a_few_steps_lower_the_loss(mode):
    torch.manual_seed(0)
    lesson, networks = lesson_of(mode)
    windows = windows_of(lesson.span)
    adam = torch.optim.Adam(networks.parameters(), 1e-3)
    losses = []
    for _ in range(10):
        loss = lesson.losses(networks, windows, torch.float32).mean()
        adam.zero_grad()
        loss.backward()
        adam.step()
        losses.append(float(loss.detach()))
    print(mode, losses)
    assert losses[1] < losses[0] and losses[-1] < 0.9 * losses[0]


@pytest.mark.parametrize("mode", LEARNED)
def test_every_weight_learns(mode):
    """No part of a network is without effect on its loss, once the displacements have left rest."""
    torch.manual_seed(0)
    lesson, networks = lesson_of(mode)
    with torch.no_grad():
        for weight in networks.parameters():
            if not weight.any():
                weight.normal_(std=0.01)
    lesson.losses(networks, windows_of(lesson.span), torch.float32).mean().backward()
    for name, weight in networks.named_parameters():
        assert weight.grad is not None and weight.grad.any(), name


def test_ssml_does_not_see_the_light():
    torch.manual_seed(0)
    lesson, networks = lesson_of("ssml")
    windows = windows_of(lesson.span)
    other = LessonWindows(windows.spikes, torch.rand_like(windows.light), windows.old)
    assert torch.equal(lesson.losses(networks, windows, torch.float32), lesson.losses(networks, other, torch.float32))


@pytest.mark.parametrize("width", [12, 24, 36, 48])
def test_the_gradients_are_finite_in_mixed_precision(width):
    lesson, networks = lesson_of("ssml", width)
    networks.to(memory_format=torch.channels_last)
    with torch.autocast("cpu", torch.bfloat16):
        loss = lesson.losses(networks, windows_of(lesson.span), torch.bfloat16).mean()
    loss.backward()
    assert all(bool(torch.isfinite(w.grad).all()) for w in networks.parameters())


def test_the_blind_network_does_not_see_the_pixel_and_sees_its_neighbours():
    torch.manual_seed(0)
    spikes = torch.rand(1, 41, 33, 33, requires_grad=True)
    ssml.Blind(WIDTH_STEP)(spikes)[0, 0, 16, 16].backward()
    seen = spikes.grad[0].abs().sum(0)
    assert seen[16, 16] == 0
    assert (seen[15:18, 15:18] > 0).sum() == 8 and (seen[14:19, 14:19] > 0).sum() == 24


def test_the_label_is_the_tfi_of_the_stream():
    rng = np.random.default_rng(0)
    spikes = (rng.random((81, 12, 12)) < 0.2).astype(np.uint8)
    label = ssml.interval_rate(torch.from_numpy(spikes)[None], 40)[0, 0].numpy()
    whole = spikes[:41].any(0) & spikes[41:].any(0)
    assert whole.mean() > 0.9
    assert np.array_equal(label[whole], isi_plane(spikes, 40, normalised=True)[whole])


def test_the_label_of_a_pixel_without_an_interval_is_its_mean():
    spikes = torch.zeros(1, 41, 1, 3, dtype=torch.uint8)
    spikes[0, 3, 0, 1] = 1
    spikes[0, 30, 0, 2] = 1
    assert ssml.interval_rate(spikes, 20).flatten().tolist() == pytest.approx([0, 1 / 41, 1 / 41])


def test_the_loss_has_its_minimum_at_the_mean():
    """Of an uncertain target: a divisor by the target would put it below (at its harmonic mean, nearly)."""
    target = torch.tensor([0.1, 0.9]).reshape(2, 1, 1, 1)
    guess = torch.full((1, 1, 1, 1), 0.5, requires_grad=True)
    lessons._distance(guess.expand(2, 1, 1, 1), target).sum().backward()
    assert float(guess.grad) == pytest.approx(0, abs=1e-6)


def test_a_student_takes_a_fifth_of_its_own_rate():
    """Where d(student, blind) + w d(student, label) is least: blind + w / (1 + w) (label - blind), w = 1/4."""
    blind, label = (torch.full((1, 1, 1, 1), value) for value in (0.2, 0.7))
    least = torch.full((1, 1, 1, 1), 0.2 + 0.2 * (0.7 - 0.2), requires_grad=True)
    (lessons._distance(least, blind) + ssml.OWN_SHARE * lessons._distance(least, label)).sum().backward()
    assert float(least.grad) == pytest.approx(0, abs=1e-6)


def test_a_blind_network_takes_an_eleventh_of_the_student():
    """As above, v = 1/10."""
    label, student = (torch.full((1, 1, 1, 1), value) for value in (0.2, 0.7))
    least = torch.full((1, 1, 1, 1), 0.2 + (0.7 - 0.2) / 11, requires_grad=True)
    (lessons._distance(least, label) + ssml.BACK_SHARE * lessons._distance(least, student)).sum().backward()
    assert float(least.grad) == pytest.approx(0, abs=1e-6)


def test_light_and_estimates_weigh_ten_to_one():
    """Of an untrained network whose answers are set: errors of 0.1 everywhere, found and divisor 0.2 + 0.05."""

    class Answers(torch.nn.Module):
        def with_estimates(self, spikes):
            return self.light, self.estimates

    (lesson, networks), windows = lesson_of("spk2img-clean"), windows_of(41)
    windows.light[:] = 0.1
    networks["student"] = answers = Answers()
    right, wrong = (torch.full((4, 5, 16, 16), value) for value in (0.1, 0.2))
    answers.light, answers.estimates = wrong[:, :1], right
    assert lesson.losses(networks, windows, torch.float32).tolist() == pytest.approx([0.1**2 / 0.25] * 4)
    answers.light, answers.estimates = right[:, :1], wrong
    assert lesson.losses(networks, windows, torch.float32).tolist() == pytest.approx([0.1 * 0.1**2 / 0.25] * 4)


def test_the_label_knows_a_rate_of_one_in_sixty_whatever_the_phase():
    """Not one in 122: there the mean of the frames stands in."""
    span = lesson_of("ssml")[0].span
    for interval, whole in ((60, True), (122, False)):
        spikes = torch.zeros(1, span, 1, interval, dtype=torch.uint8)
        for phase in range(interval):
            spikes[0, phase::interval, 0, phase] = 1
        label = ssml.interval_rate(spikes, span // 2)
        assert torch.allclose(label, torch.full_like(label, 1 / interval)) == whole


def test_a_still_block_passes_through_displacement_and_a_moved_one_comes_back():
    features = torch.rand(2, 8, 12, 12)
    moves = torch.zeros(2, 3 * spk2imgnet.GROUPS, 12, 12)
    assert torch.allclose(spk2imgnet.displace(features, moves), features, atol=1e-5)
    moves[:, 0::3], moves[:, 1::3] = 2.0, -1.0  # read two rows below and a column to the left
    found = spk2imgnet.displace(torch.roll(features, (2, -1), (2, 3)), moves)
    assert torch.allclose(found[..., 2:-2, 2:-2], features[..., 2:-2, 2:-2], atol=1e-5)


def test_time_scales_see_their_frames_alone():
    """A filter of reach r sees the 2 r + 1 frames about the block's centre, folded pixels of each."""
    seen = spk2imgnet._frames_seen(1)[:, :, 0, 0].reshape(len(spk2imgnet.REACHES), spk2imgnet.BLOCK, -1)
    assert seen.shape[2] == spk2imgnet.FOLD**2 and (seen == seen[:, :, :1]).all()
    assert seen[:, :, 0].sum(1).tolist() == [2 * r + 1 for r in spk2imgnet.REACHES]
    assert torch.equal(seen, seen.flip(1))


def test_blocks_are_the_publications():
    """41 frames in five blocks of 13 about frames 6, 13, 20, 27, 34."""
    assert spk2imgnet.CENTRES == (6, 13, 20, 27, 34)
    assert spk2imgnet.STARTS[-1] + spk2imgnet.BLOCK == spk2imgnet.WINDOW == 41


def test_a_window_counts_once_its_stream_is_old_enough():
    flats = Flats(3)
    rolling = RollingWindows(flats, "clean", 41)
    assert [rolling.advance(12).old.tolist() for _ in range(4)] == [[False] * 3] * 3 + [[True] * 3]
    flats.renewed = [1]
    ages = [rolling.advance(12).old.tolist()]
    flats.renewed = []
    ages += [rolling.advance(12).old.tolist() for _ in range(3)]
    assert ages == [[True, False, True]] * 3 + [[True, True, True]]


def test_windows_are_the_last_frames_of_the_stream_asked_for():
    flats = Flats(2)
    parts, advance = [], flats.advance
    flats.advance = lambda frames: parts.append(advance(frames)) or parts[-1]
    rolling = RollingWindows(flats, "noisy", 41)
    for frames in (41, 12, 64):
        windows = rolling.advance(frames)
        assert torch.equal(windows.spikes, torch.cat([p.noisy for p in parts], 1)[:, -41:])
        assert torch.equal(windows.light, torch.cat([p.light for p in parts], 1)[:, -41:])


@pytest.mark.parametrize("mode", LEARNED)
def test_a_run_leaves_weights_and_a_curve(small, tmp_path, mode):
    weights = weights_after(tmp_path, mode)
    assert all(bool(torch.isfinite(w).all()) for w in weights.values())
    curve = json.loads((tmp_path / "curve.json").read_text())
    assert [point["step"] for point in curve] == [4] and np.isfinite(curve[0]["network_db"])
    assert (tmp_path / "curve.png").stat().st_size > 0 and (tmp_path / "last.pt").exists()
    training = load_reconstructor(tmp_path / f"{mode}.pt")[2]
    assert training["steps"] == 5 and f"--mode {mode}" in training["command"] and "--width 12" in training["command"]


def test_the_denoisers_streams_serve(tmp_path, monkeypatch):
    """As they are, but of few textures and units."""
    monkeypatch.setattr(Lesson, "held_out", HeldOut(streams=2, passes=1))
    few = {"textures": 4, "units": 1}

    class SmallBank(Bank):
        @classmethod
        def drawn(cls, seed, device, **_):
            return super().drawn(seed, device, **few)

    monkeypatch.setattr(training, "Bank", SmallBank)
    assert all(bool(torch.isfinite(w).all()) for w in weights_after(tmp_path).values())
    assert 5 < json.loads((tmp_path / "curve.json").read_text())[0]["tfp41_db"] < 60


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device on this machine")
@pytest.mark.parametrize("mode", LEARNED)
def test_a_network_learns_on_a_gpu(tmp_path, mode):
    """To weights that load on a processor."""
    weights = weights_after(tmp_path, mode, device="cuda", patch=32)
    assert all(w.device.type == "cpu" and bool(torch.isfinite(w).all()) for w in weights.values())


def test_same_seed_same_weights(small, tmp_path):
    first, again = (weights_after(tmp_path / name) for name in ("a", "b"))
    other = weights_after(tmp_path / "c", seed=1)
    assert same(first, again) and not same(first, other)


def test_a_stopped_run_goes_on_from_where_it_was(small, tmp_path, monkeypatch):
    done = training.share_done
    monkeypatch.setattr(training, "share_done", lambda config, run: 1.0 if run.step == 3 else done(config, run))
    before = weights_after(tmp_path)
    monkeypatch.setattr(training, "share_done", done)
    after = weights_after(tmp_path)
    record = load_reconstructor(tmp_path / "spk2img-clean.pt")[2]
    assert record["resumed_at"] == [3] and record["steps"] == 5 and not same(before, after)
    run = Run.begin(lesson_of("spk2img-clean")[1])
    run.load(tmp_path / "last.pt")
    assert float(run.optimiser.state_dict()["state"][0]["step"]) == 5  # the moments came along


def test_the_run_of_another_mode_or_width_is_refused(small, tmp_path):
    weights_after(tmp_path)
    for other in ({"mode": "ssml"}, {"width": 24}):
        with pytest.raises(InputError, match=r"last\.pt"):
            weights_after(tmp_path, **other)


def test_young_streams_do_not_teach(small, tmp_path, monkeypatch):
    """While no stream is old enough no weight changes."""

    class Young(Flats):
        def advance(self, frames):
            self.renewed = list(range(self.count))
            return super().advance(frames)

    monkeypatch.setattr(training_source, "SimulatedStreams", Young)
    torch.manual_seed(0)
    first = lesson_of("ssml")[1]["student"].state_dict()
    assert same({k: w.half().float() for k, w in first.items()}, weights_after(tmp_path, "ssml"))
