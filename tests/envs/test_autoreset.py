"""The autoreset modes of the native vector environment against gymnasium's `SyncVectorEnv`, bit for bit."""

from __future__ import annotations

import copy
import os
import pickle
import subprocess
import sys
from typing import Any

import cloudpickle
import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import vector as wrappers

import spikecam_env.envs  # noqa: F401 - registers
from spikecam_env.envs.vector_infos import batched, rows
from spikecam_env.errors import InputError, NotReadyError
from tests.envs.kinds import DISK, KINDS

ENVS, STEPS = 3, 12
TRACK, FAN = "spikecam_env/Track-v1", KINDS[-1]
SMALL: dict[str, Any] = {"shape": (16, 24), "frames_per_step": 20}
ENDING: dict[str, Any] = {**SMALL, "max_gaze_rate_px_s": 20_000.0, "max_episode_steps": 5}
"""The disk leaves the picture within a few steps at this rate, so that episodes are terminated and truncated."""
MODES = tuple(AutoresetMode)
DEVICE = "cuda" if torch.cuda.is_available() else "cpu"
MOVED = {"spikes": 2 * 3 / (ENVS * 20 * 16 * 24), "tfp": 2 * 3 / (ENVS * 16 * 24)}
"""Values of a block that differ, most: three spikes that are a frame off, of which each is two bits, or two pixels."""


def native(name: str = DISK, mode: Any = AutoresetMode.SAME_STEP, **options: Any) -> Any:
    return gymnasium.make_vec(name, ENVS, "vector_entry_point", autoreset_mode=mode, **{**ENDING, **options})


def sync(name: str = DISK, mode: Any = AutoresetMode.SAME_STEP, **options: Any) -> Any:
    return gymnasium.make_vec(name, ENVS, "sync", {"autoreset_mode": mode}, **{**ENDING, **options})


def played(env: Any, steps: int = STEPS) -> list[Any]:
    """Everything that a vector environment returns; where it is DISABLED, episodes that are over begin by a mask."""
    rng, shape = np.random.default_rng(0), env.action_space.shape
    returned = [env.reset(seed=3)]
    for _ in range(steps):
        returned.append(env.step(rng.uniform(-1, 1, shape).astype(np.float32)))
        over = returned[-1][2] | returned[-1][3]
        if env.metadata["autoreset_mode"] is AutoresetMode.DISABLED and over.any():
            returned.append(env.reset(seed=[7, 8, 9], options={"reset_mask": over}))
    env.close()
    return returned


def same(ours: list[Any], theirs: list[Any]) -> None:
    assert len(ours) == len(theirs)
    for number, (a, b) in enumerate(zip(ours, theirs, strict=True)):
        assert data_equivalence(a, b, exact=True), f"call {number} differs"


@pytest.mark.parametrize("obs, state", [("spikes", False), ("tfp", True), ("tfi", False), ("frame1000", True)])
@pytest.mark.parametrize("mode", MODES)
def test_every_mode_has_the_bits_of_gymnasium_s_vector(mode: AutoresetMode, obs: str, state: bool) -> None:
    options = {"obs": obs, "obs_state": state, "ground_truth": state}
    ours = played(native(mode=mode, **options))
    ends = [step for step in ours if len(step) == 5]
    assert np.any([step[2] for step in ends]) and np.any([step[3] for step in ends]), "no episode ended"
    same(ours, played(sync(mode=mode, **options)))


@pytest.mark.slow
@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.DISABLED])
def test_rendered_scenes_and_tasks_begin_anew_with_the_same_bits(mode: AutoresetMode) -> None:
    fan = {"shape": (16, 16), "max_episode_steps": 2, "obs": "tfp"}
    same(played(native(FAN, mode, **fan), 3), played(sync(FAN, mode, **fan), 3))
    catch: dict[str, Any] = {"shape": (32, 32), "max_gaze_rate_px_s": None, "max_episode_steps": None, "obs": "tfp"}
    ours = played(native("spikecam_env/Catch-v1", mode, **catch), 50)
    assert any(np.any(step[2]) for step in ours if len(step) == 5), "no ball crossed"
    same(ours, played(sync("spikecam_env/Catch-v1", mode, **catch), 50))


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.DISABLED])
def test_denoised_streams_begin_anew_and_the_others_go_on(mode: AutoresetMode) -> None:
    """A batch may round float32 sums otherwise than one stream: by a grey level in few pixels."""
    options = {"obs": "rate", "frames_per_step": 40, "max_episode_steps": 3}
    for ours, theirs in zip(
        played(native(mode=mode, **options), 5), played(sync(mode=mode, **options), 5), strict=True
    ):
        off = np.abs(ours[0].astype(int) - theirs[0])
        assert off.max() <= 1 and (off > 0).mean() < 0.01
        np.testing.assert_array_equal(ours[-1]["age"], theirs[-1]["age"])


@pytest.mark.parametrize("obs", ["spikes", "tfp"])
@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.DISABLED])
def test_on_a_device_episodes_begin_anew_as_on_the_processor(mode: AutoresetMode, obs: str) -> None:
    """Light is painted by other code there, which rounds otherwise: a few spikes in a million are a frame off."""
    ours, theirs = (played(native(mode=mode, obs=obs, device=device)) for device in (DEVICE, None))
    for a, b in zip(ours, theirs, strict=True):
        assert isinstance(a[0], torch.Tensor) and a[0].device.type == DEVICE
        assert np.mean(a[0].cpu().numpy() != b[0]) < MOVED[obs]
        for one, other in zip(a[1:-1], b[1:-1], strict=True):
            np.testing.assert_array_equal(one.cpu().numpy(), other)
        assert a[-1].keys() == b[-1].keys()
        np.testing.assert_array_equal(a[-1]["gaze"], b[-1]["gaze"])
    final = [step[-1] for step in ours if "final_obs" in step[-1]]
    assert bool(final) is (mode is AutoresetMode.SAME_STEP)
    for info in final:
        assert all(isinstance(seen, torch.Tensor) for seen in info["final_obs"][info["_final_obs"]])


def test_the_denoiser_on_a_device_begins_episodes_with_the_next_step_only() -> None:
    with pytest.raises(InputError, match=r"autoreset_mode is SameStep and obs Rate; on a device take NextStep"):
        native(obs="rate", device="cpu")
    env = native(mode="Disabled", obs="rate", device="cpu")
    env.reset(seed=0)
    with pytest.raises(InputError, match="reset_mask selects some and obs is Rate"):
        env.reset(options={"reset_mask": np.array([True, False, False])})
    env.close()


@pytest.mark.parametrize("mode", MODES)
def test_the_mode_is_declared_and_may_be_given_by_its_value(mode: AutoresetMode) -> None:
    for given in (mode, mode.value):
        env = native(mode=given)
        assert env.metadata["autoreset_mode"] is mode and env.unwrapped.autoreset_mode is mode
        env.close()
    assert gymnasium.make_vec(DISK, 1, "vector_entry_point", **SMALL).metadata["autoreset_mode"] is MODES[0]


@pytest.mark.parametrize("mode", ["SAME", "next_step", 1, None, True])
def test_another_mode_is_refused_by_name(mode: Any) -> None:
    with pytest.raises(InputError, match=r"unknown autoreset_mode .* choose one of Disabled, NextStep, SameStep"):
        native(mode=mode)


def test_an_episode_that_is_over_is_not_stepped_where_autoreset_is_disabled() -> None:
    env = native(mode="Disabled", max_episode_steps=1)
    env.reset(seed=0)
    still = np.zeros((ENVS, 2), np.float32)
    env.step(still)
    with pytest.raises(NotReadyError, match=r"environments \[0, 1, 2\] are over .* call reset"):
        env.step(still)
    env.reset(options={"reset_mask": np.array([True, True, False])})
    with pytest.raises(NotReadyError, match=r"environments \[2\] are over"):
        env.step(still)
    env.reset(options={"reset_mask": np.array([False, False, True])})
    env.step(still)
    env.close()


def test_a_reset_of_a_part_leaves_the_caller_s_options_and_observations_alone() -> None:
    env = native(mode="Disabled", obs="tfp", obs_state=True)
    first, _ = env.reset(seed=0)
    wanted = {name: array.copy() for name, array in first.items()}
    for array in first.values():
        array[:] = 0
    options = {"reset_mask": np.array([True, False, False]), "light": 0.5}
    again, infos = env.reset(options=options)
    assert set(options) == {"reset_mask", "light"}
    for name, array in again.items():
        np.testing.assert_array_equal(array[1:], wanted[name][1:])
    assert infos["_frame"].tolist() == [True, False, False]
    env.close()


MASKS = [
    (np.zeros(ENVS, bool), "selects no environment"),
    (np.ones(ENVS + 1, bool), "must be true or false for each of 3 environments"),
    (np.ones(ENVS), "must be true or false"),
    ([1, 0, 1], "must be true or false"),
    ("yes", "must be true or false"),
    (None, "must be true or false"),
    (np.ones((ENVS, 1), bool), "must be true or false"),
]


@pytest.mark.parametrize("mask, message", MASKS)
def test_a_mask_of_another_form_is_refused_and_nothing_is_reset(mask: Any, message: str) -> None:
    env = native(mode="Disabled", obs="tfp")
    with pytest.raises(InputError, match=message):
        env.reset(options={"reset_mask": mask})
    env.reset(seed=0)
    before = env.unwrapped.envs[0].np_random.bit_generator.state
    with pytest.raises(InputError, match=message):
        env.reset(seed=1, options={"reset_mask": mask})
    assert env.unwrapped.envs[0].np_random.bit_generator.state == before
    env.step(np.zeros((ENVS, 2), np.float32))
    env.close()


def test_a_part_is_not_reset_before_the_whole() -> None:
    env = native(mode="Disabled")
    with pytest.raises(NotReadyError, match="call reset without reset_mask first"):
        env.reset(options={"reset_mask": np.array([True, False, False])})
    env.close()


def test_a_reset_that_fails_leaves_nothing_to_step() -> None:
    env = native()
    env.reset(seed=0)
    with pytest.raises(InputError):
        env.reset(options=[{}, {}, {"light": -1.0}])
    with pytest.raises(NotReadyError, match="call reset first"):
        env.step(np.zeros((ENVS, 2), np.float32))
    env.close()


def test_infos_of_a_vector_come_apart_as_they_were_put_together() -> None:
    infos = [
        {"a": 1.5, "b": np.array([1, 2]), "final_info": {"d": True}, "final_obs": np.zeros(3)},
        {"a": 2.5, "e": "text"},
        {"a": 0.5, "b": np.array([3, 4])},
    ]
    apart = rows(batched(infos), 3)
    assert data_equivalence(tuple(apart), tuple(infos), exact=True)
    assert [type(info["a"]) for info in apart] == [float] * 3


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(cloudpickle.dumps(env))])
@pytest.mark.parametrize("device", [None, "cpu"])
@pytest.mark.parametrize("begun", [False, True])
def test_a_copy_of_a_vector_goes_on_as_the_original_does(copied: Any, device: str | None, begun: bool) -> None:
    env = native(TRACK, shape=(24, 24), obs="tfp", device=device).unwrapped
    if begun:
        env.reset(seed=3)
    other = copied(env)
    if not begun:
        env.reset(seed=3)
        other.reset(seed=3)
    for _ in range(2):
        for ours, theirs in zip(
            *(it.step(np.full((ENVS, 2), 0.3, np.float32))[:4] for it in (env, other)), strict=True
        ):
            np.testing.assert_array_equal(np.asarray(ours), np.asarray(theirs))
    env.close()
    other.close()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_a_fork_is_refused_the_vector_of_its_parent_and_does_not_hang() -> None:
    program = (
        "import os, signal, gymnasium, spikecam_env.envs\n"
        "env = gymnasium.make_vec('spikecam_env/Track-v1', 2, 'vector_entry_point', shape=(16, 16))\n"
        "env.reset(seed=0)\n"
        "if os.fork() == 0:\n"
        "    signal.alarm(60)\n"
        "    try:\n        env.reset(seed=0)\n"
        "    except RuntimeError as error:\n        print(error, flush=True)\n"
        "    env.close()\n"
        "    os._exit(0)\n"
        "print(os.wait()[1], env.step(env.action_space.sample())[0].shape[0])\n"
    )
    printed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300).stdout
    assert "make others in this one" in printed and "0 2" in printed


def test_a_holder_that_closes_its_vector_in_a_garbage_collection_does_not_hang() -> None:
    """The collector clears weak references first, and threads that know their pool by one end then."""
    program = (
        "import gc, gymnasium, spikecam_env.envs\n"
        "class Holder:\n"
        "    def __init__(self, env): self.env, self.cycle = env, self\n"
        "    def __del__(self): self.env.close()\n"
        "env = gymnasium.make_vec('spikecam_env/RotatingDisk-v0', 3, 'vector_entry_point', shape=(16, 16))\n"
        "env.reset(seed=0)\n"
        "env.holder = Holder(env)\n"
        "del env\n"
        "gc.collect()\n"
        "print('collected')\n"
    )
    printed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300).stdout
    assert "collected" in printed


def test_attributes_of_the_environments_are_had_as_of_gymnasium_s_vector() -> None:
    ours, theirs = native(TRACK, shape=(24, 24)), sync(TRACK, shape=(24, 24))
    for env in (ours, theirs):
        env.reset(seed=5)
    assert ours.np_random_seed == theirs.np_random_seed == (5, 6, 7)
    assert [rng.random() for rng in ours.np_random] == [rng.random() for rng in theirs.np_random]
    for name in ("shape", "gaze", "max_gaze_rate_px_s"):
        assert ours.get_attr(name) == theirs.get_attr(name)
    assert ours.call("set_top_rate", 100.0) == theirs.call("set_top_rate", 100.0) == (None,) * 3
    ours.set_attr("reward", ["distance", "progress", "distance"])
    assert ours.get_attr("reward") == ("distance", "progress", "distance")
    ours.set_attr("note", "all")
    assert ours.get_attr("note") == ("all",) * 3
    with pytest.raises(InputError, match="values are 2; give one an environment, 3"):
        ours.set_attr("note", [1, 2])
    with pytest.raises(AttributeError, match="nothing_of_this_name"):
        ours.get_attr("nothing_of_this_name")
    for env in (ours, theirs):
        env.close()
    with pytest.raises(NotReadyError, match="closed"):
        ours.get_attr("shape")


WRAPPERS: dict[str, Any] = {
    "RecordEpisodeStatistics": wrappers.RecordEpisodeStatistics,
    "NormalizeObservation": wrappers.NormalizeObservation,
    "NormalizeReward": wrappers.NormalizeReward,
    "ClipAction": wrappers.ClipAction,
    "ClipReward": lambda env: wrappers.ClipReward(env, -0.1, 0.1),
    "FlattenObservation": wrappers.FlattenObservation,
    "RescaleObservation": lambda env: wrappers.RescaleObservation(env, 0.0, 1.0),
    "DtypeObservation": lambda env: wrappers.DtypeObservation(env, np.float32),
    "DictInfoToList": wrappers.DictInfoToList,
}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", WRAPPERS)
def test_gymnasium_s_wrappers_give_the_same_as_on_its_own_vector(name: str, mode: AutoresetMode) -> None:
    def steps(env: Any) -> Any:
        try:
            wrapped = WRAPPERS[name](env)
        except (ValueError, AssertionError) as error:  # the wrapper does not take this mode
            return str(error)
        rng, calls = np.random.default_rng(0), [wrapped.reset(seed=3)]
        for _ in range(4):  # no episode is over before: some wrappers take no mask
            actions = rng.uniform(-1, 1, (ENVS, 2)).astype(np.float32)
            calls.append(wrapped.step(actions))
        return [call[:-1] for call in calls], [without_time(call[-1]) for call in calls]

    options: dict[str, Any] = {"obs": "tfp", "max_gaze_rate_px_s": None}
    options["max_episode_steps"] = 6 if mode is AutoresetMode.DISABLED else 2
    ours, theirs = native(mode=mode, **options), sync(mode=mode, **options)
    a, b = steps(ours), steps(theirs)
    if isinstance(a, str):
        assert a == b or isinstance(b, str)
        return
    for one, other in zip(a[0], b[0], strict=True):
        for x, y in zip(one, other, strict=True):
            np.testing.assert_array_equal(np.asarray(x), np.asarray(y))
    if name != "DictInfoToList":
        assert data_equivalence(a[1], b[1], exact=True)
    ours.close()
    theirs.close()


def without_time(info: Any) -> Any:
    """Of an episode's statistics the seconds by the clock differ from run to run."""
    if isinstance(info, dict):
        return {name: without_time(value) for name, value in info.items() if name not in ("t", "_t", "episode_time")}
    return info
