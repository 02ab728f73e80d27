"""Pictures by name: of a constant light, at the stream's ends, and the errors of unusable input."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from denoiser.networks.reconstructor_recipe import LEARNED, WIDTH_STEP, ReconstructorRecipe, reconstructor_recipe
from denoiser.reconstruct import RECONSTRUCTORS, reconstruct, reconstruct_many
from denoiser.reconstruct.pictures import PLAIN, light, window_about
from denoiser.weights import load_reconstructor, save_weights
from spikecam_env.errors import InputError
from spikecam_env.streams import middleTFI, middleTFP

SPIKES = (np.random.default_rng(0).random((60, 10, 14)) < 0.3).astype(np.uint8)
NARROW = {name: reconstructor_recipe(name, WIDTH_STEP) for name in LEARNED}


@pytest.fixture
def untrained(tmp_path):
    """name -> (network, checkpoint): random weights of a fixed seed, as float16 holds them."""
    found = {}
    for name, recipe in NARROW.items():
        torch.manual_seed(0)
        save_weights(tmp_path / f"{name}.pt", name, recipe, recipe.network(), {"steps": 0})
        found[name] = (load_reconstructor(tmp_path / f"{name}.pt")[1], tmp_path / f"{name}.pt")
    return found


def given(name, untrained):
    return {} if name in PLAIN else {"weights": untrained[name][1]}


@pytest.mark.parametrize("name", RECONSTRUCTORS)
def test_pictures_have_the_shape_of_a_frame_and_are_light(untrained, name):
    """Whatever the size: that of the pyramids divides neither 10 nor 14."""
    pictures = reconstruct_many(name, SPIKES, [0, 30, 59], **given(name, untrained))
    assert pictures.shape == (3, 10, 14) and pictures.dtype == np.float32
    assert np.isfinite(pictures).all() and pictures.min() >= 0 and pictures.max() <= 1
    assert np.array_equal(reconstruct(name, SPIKES, 30, **given(name, untrained)), pictures[1])


def test_the_plain_ones_are_those_of_the_streams():
    assert np.array_equal(reconstruct("tfp21", SPIKES, 30), middleTFP(SPIKES, 30, 21))
    assert np.array_equal(reconstruct("tfp41", SPIKES, 30), middleTFP(SPIKES, 30, 41))
    assert np.array_equal(reconstruct("tfi", SPIKES, 30), middleTFI(SPIKES, 30))


@pytest.mark.parametrize("name", LEARNED)
def test_a_picture_depends_on_the_41_frames_about_it_alone(untrained, name):
    before = reconstruct(name, SPIKES, 30, **given(name, untrained))
    for changed, same in ((slice(0, 10), True), (slice(51, 60), True), (slice(10, 11), False), (slice(50, 51), False)):
        other = SPIKES.copy()
        other[changed] ^= 1
        assert np.array_equal(reconstruct(name, other, 30, **given(name, untrained)), before) == same, changed


@pytest.mark.parametrize("name", LEARNED)
def test_a_pixel_counts_about_itself_alone(untrained, name):
    """A changed pixel changes the picture within twelve pixels, and not a hundred away: networks see no whole frame."""
    wide = np.concatenate([SPIKES] * 8, axis=2)
    other = wide.copy()
    other[:, 5, 4] ^= 1
    change = np.abs(
        reconstruct(name, wide, 30, **given(name, untrained)) - reconstruct(name, other, 30, **given(name, untrained))
    )
    assert change[:, :12].any() and not change[:, 100:].any()


@pytest.mark.parametrize("length", [1, 3, 15, 41, 60])
def test_the_stream_is_mirrored_at_its_ends(length):
    stream = np.arange(length, dtype=np.uint8)[:, None, None]
    for t in (0, length // 2, length - 1):
        folded = np.arange(t - 20, t + 21) % (2 * length)
        expected = np.minimum(folded, 2 * length - 1 - folded)
        assert window_about(stream, t)[:, 0, 0].tolist() == expected.tolist()


def test_a_short_stream_has_pictures(untrained):
    for name in RECONSTRUCTORS:
        assert reconstruct(name, SPIKES[:3], 2, **given(name, untrained)).shape == (10, 14)


@pytest.mark.parametrize("name", LEARNED)
def test_weights_come_back_to_half_precision(untrained, tmp_path, name):
    torch.manual_seed(0)
    made, (back, path) = NARROW[name].network(), untrained[name]
    for key, weight in made.state_dict().items():
        found = back.state_dict()[key]
        assert found.dtype == torch.float32 and torch.equal(found, weight.half().float())
    recipe, _, training = load_reconstructor(path)
    assert recipe == NARROW[name] and training == {"steps": 0}
    assert ReconstructorRecipe.from_dict(recipe.to_dict()) == recipe


@pytest.mark.parametrize("name", LEARNED)
def test_what_ships_is_small(name):
    """At most 0.5 million parameters, which is 1 MB in float16."""
    parameters = sum(p.numel() for p in LEARNED[name].network().parameters())
    print(f"{name}: {parameters / 1e6:.3f} M")
    assert 0.3e6 < parameters <= 0.5e6


def test_spk2imgnet_of_width_144_has_the_publications_size():
    """3.91 million parameters (table 1 of the DnSS paper), within 10 %."""
    parameters = sum(p.numel() for p in reconstructor_recipe("spk2img-clean", 144).network().parameters())
    assert abs(parameters / 3.91e6 - 1) < 0.1


def test_bfloat16_changes_a_picture_by_little(untrained):
    for name in LEARNED:
        network, window = untrained[name][0], window_about(SPIKES, 30)
        error = np.abs(light(network, window) - light(network, window, "bfloat16")).max()
        print(f"{name}: {error:.5f}")
        assert error < 0.02  # eight bits of mantissa through a dozen layers


def refused(match, *args, **options):
    with pytest.raises(InputError, match=match) as caught:
        reconstruct(*args, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["tfp", "TFI", "spk2img", "", None, 3])
def test_an_unknown_name_is_refused(name):
    refused("reconstructor", name, SPIKES, 3)


@pytest.mark.parametrize("t", [-1, 60, 1.5, None, True, "3"])
@pytest.mark.parametrize("name", ["tfi", "ssml"])
def test_a_frame_outside_the_stream_is_refused(untrained, name, t):
    refused("frame", name, SPIKES, t, **given(name, untrained))


@pytest.mark.parametrize("name", ["tfi", "ssml"])
@pytest.mark.parametrize("shape", [(0, 8, 8), (4, 0, 8), (4, 8), (4, 8, 8, 1)])
def test_a_stream_without_pixels_is_refused(untrained, name, shape):
    refused("shape", name, np.zeros(shape, np.uint8), 0, **given(name, untrained))


def test_odd_values_are_refused(untrained):
    refused("value 2", "ssml", SPIKES * 2, 30, **given("ssml", untrained))
    refused("float", "ssml", SPIKES.astype(np.float32), 30, **given("ssml", untrained))
    refused("precision", "ssml", SPIKES, 30, precision="half", **given("ssml", untrained))


def test_a_checkpoint_of_another_architecture_is_refused(untrained):
    refused("holds the network ssml", "spk2img-clean", SPIKES, 30, weights=untrained["ssml"][1])


def test_a_missing_checkpoint_is_named(tmp_path):
    refused(r"nowhere\.pt", "ssml", SPIKES, 30, weights=tmp_path / "nowhere.pt")


def test_a_checkpoint_written_anew_is_read_anew(untrained, tmp_path):
    import os

    path = untrained["ssml"][1]
    before = reconstruct("ssml", SPIKES, 30, weights=path)
    torch.manual_seed(1)
    save_weights(path, "ssml", NARROW["ssml"], NARROW["ssml"].network(), {})
    os.utime(path, ns=(1, 1))  # file systems may count time in seconds
    assert not np.array_equal(reconstruct("ssml", SPIKES, 30, weights=path), before)


ODD_FILES = {
    "another format": lambda data: data.update(format="spikecam-denoiser/1"),
    "no recipe": lambda data: data.pop("recipe"),
    "another width": lambda data: data["recipe"].update(width=24),
    "a width of no meaning": lambda data: data["recipe"].update(width=13),
    "a width that fills memory": lambda data: data["recipe"].update(width=10**6),
    "an unknown architecture": lambda data: data["recipe"].update(architecture="unet"),
    "a weight of NaN": lambda data: next(iter(data["state_dict"].values())).fill_(float("nan")),
    "a changed weight": lambda data: next(iter(data["state_dict"].values())).add_(1),
    "no digest": lambda data: data.pop("sha256"),
    "a missing weight": lambda data: data["state_dict"].popitem(),
    "training of text": lambda data: data.update(training="long"),
}


@pytest.mark.parametrize("name", ODD_FILES)
def test_an_odd_checkpoint_is_refused_in_one_line(untrained, name):
    path = untrained["ssml"][1]
    data = torch.load(path, weights_only=True)
    ODD_FILES[name](data)
    torch.save(data, path)
    refused(r"ssml\.pt", "ssml", SPIKES, 30, weights=path)


@pytest.mark.parametrize("width", [0, 13, 264, 1.5, True, "12"])
def test_a_width_out_of_range_is_refused(width):
    with pytest.raises(InputError, match="width"):
        reconstructor_recipe("ssml", width)
