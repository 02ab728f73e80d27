"""A vector environment on a device against the one of the processor: the same spikes, rewards, ends and pictures.

On a processor the same code runs as on a GPU.  Light is painted by other code, which rounds otherwise (1e-6 of full
scale rms, `tests/scenes/test_planes_on_device.py`): a few spikes in a million are a frame off.  Of the same light the
bits are the same (`tests/sensor/test_light_on_device.py`).
"""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
import torch

import spikecam_env.envs  # noqa: F401 - registers
from denoiser.observation import Rate
from spikecam_env.errors import InputError

DEVICE = "cuda" if torch.cuda.is_available() else "cpu"
DISK, TRACK = "spikecam_env/RotatingDisk-v0", "spikecam_env/Track-v1"
STEPS = 12
MOVED = 2e-5
"""Bits that differ, most: one spike that is a frame off is two of 450 000, or one pixel of 22 000 TFP pictures."""


def vector(name: str, device: str | None = DEVICE, count: int = 3, **options):
    options = {"shape": (22, 26), "frames_per_step": 20} | options
    return gymnasium.make_vec(name, count, "vector_entry_point", device=device, **options)


def played(env, seed: int = 5, tensors: bool = False) -> list[tuple]:
    """(observation, reward, terminated, truncated) of a reset and STEPS steps, and the gaze."""
    rng = np.random.default_rng(1)
    seen, info = env.reset(seed=seed)
    found = [(seen, *np.zeros((3, env.num_envs)), info["gaze"])]
    for _ in range(STEPS):
        actions = rng.uniform(-1, 1, env.action_space.shape).astype(np.float32)
        *step, info = env.step(torch.from_numpy(actions).to(DEVICE) if tensors else actions)
        found.append((*step, info["gaze"]))
    env.close()
    return found


@pytest.mark.parametrize("obs", ["spikes", "multibinary", "tfp"])
@pytest.mark.parametrize("name", [DISK, TRACK])
def test_all_is_as_on_the_processor(name: str, obs: str) -> None:
    options = {"obs": obs, "max_episode_steps": 5} if name == DISK else {"obs": obs}
    wanted = played(vector(name, None, **options))
    found = played(vector(name, **options), tensors=True)
    for (seen, *ours, our_gaze), (pictures, *theirs, their_gaze) in zip(found[1:], wanted[1:], strict=True):
        assert all(isinstance(value, torch.Tensor) and value.device.type == DEVICE for value in (seen, *ours))
        assert seen.cpu().numpy().dtype == pictures.dtype
        for value, other in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(value.cpu().numpy(), other, strict=True)
        np.testing.assert_array_equal(our_gaze, their_gaze)
    apart = float(np.mean([a[0].cpu().numpy() != b[0] for a, b in zip(found, wanted, strict=True)]))
    print(f"{1e6 * apart:.1f} in a million differ")
    assert apart < (MOVED if obs != "tfp" else 20 * MOVED)
    assert name == TRACK or any(theirs[3].any() for theirs in wanted)  # episodes begin anew on the way


def test_denoised_pictures_are_those_of_the_processor_to_a_grey_level() -> None:
    """The two denoisers differ by 1e-5, a grey level is 4e-3; in bfloat16 they differ by more than one."""
    wanted = played(vector(DISK, None, obs=Rate("best"), max_episode_steps=7))
    found = played(vector(DISK, obs="rate", max_episode_steps=7))
    apart = [np.abs(a[0].cpu().numpy().astype(int) - b[0]) for a, b in zip(found, wanted, strict=True)]
    print(f"{np.mean(apart):.2g} grey levels on average, {np.max(apart)} at most")
    assert np.mean(apart) < 0.1 and np.max(apart) < 8


def test_the_state_beside_the_picture_is_a_tensor_too() -> None:
    env = vector(DISK, obs="tfp", obs_state=True)
    seen, _ = env.reset(seed=0)
    env.close()
    assert {name: (value.device.type, value.dtype) for name, value in seen.items()} == {
        "picture": (DEVICE, torch.uint8),
        "gaze": (DEVICE, torch.float32),
        "age": (DEVICE, torch.float32),
    }


def test_scenes_in_space_are_painted_on_the_host() -> None:
    options = {"obs": "spikes", "scene": "collage", "shape": (22, 26)}
    wanted = played(vector("spikecam_env/Scene-v0", None, 2, **options))
    found = played(vector("spikecam_env/Scene-v0", DEVICE, 2, **options))
    assert all(np.array_equal(a[0].cpu().numpy(), b[0]) for a, b in zip(found, wanted, strict=True))


def test_what_has_no_place_on_a_device_is_refused() -> None:
    with pytest.raises(InputError, match="may be 'spikes'"):
        vector(DISK, obs="isi")
    with pytest.raises(InputError, match="render_mode"):
        vector(DISK, obs="spikes", render_mode="rgb_array")
    with pytest.raises(InputError, match="device"):
        vector(DISK, "cuda:99")
    env = vector(DISK, obs="spikes")
    with pytest.raises(InputError, match="another model"):
        env.reset(seed=0, options={"model": "ideal"})
    assert len(env.reset(seed=0)[0]) == 3
    env.close()
