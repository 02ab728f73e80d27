"""Many spike cameras stepped in one call.

    env = gymnasium.make_vec("spikecam_env/RotatingDisk-v0", num_envs=64, vectorization_mode="vector_entry_point")

The environments live in this process, each on one of a few threads for good (OpenGL's contexts belong to a thread);
what agents see is computed for all streams at once.  The bits are those of as many single environments.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from copy import deepcopy
from dataclasses import replace
from importlib import import_module
from itertools import chain
from typing import Any, TypeVar

import numpy as np
from gymnasium.envs.registration import load_env_creator
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from spikecam_env.checked import checked_count
from spikecam_env.envs.observations import Blocks, Spikes, restarted, with_state
from spikecam_env.envs.registration import MAX_EPISODE_STEPS
from spikecam_env.envs.spike_camera import SpikeCameraEnv, expose, in_turn
from spikecam_env.errors import InputError, NotReadyError
from spikecam_env.threads import as_many

T = TypeVar("T")
Outcome = tuple[float, bool, bool, dict[str, Any]]
"""(reward, terminated, truncated, info) of one environment."""


class SpikeCameraVectorEnv(VectorEnv[Any, Any, Any]):
    """N environments of one class; observation, action, info and options as of one, with a leading axis N.

    Autoreset     NEXT_STEP: the step after the end of an episode begins the next one; its action is not used, its
                  reward is 0.  As gymnasium's `SyncVectorEnv`, whose bits these are.
    Seeds         `reset(seed=s)`: s, s + 1, ...; or a list of N.

    single              makes one environment: a class or its entry point
    num_envs            N
    models              N models (presets, TOML paths, SensorModels), one an environment; default: all have `model`
    max_episode_steps   after which an episode is truncated; -1 is never; None is the id's own, as of `gymnasium.make`
    device              a torch device: cameras, planar scenes and observations ("spikes", "multibinary", "tfp", "rate")
                        are there; actions may be tensors, and all but info are tensors there
                        (`envs.cameras_on_device`)
    workers             threads; default NUMBA_NUM_THREADS, N at most
    options             all else, obs and obs_state too: as `single` has them

    `envs` are the single environments, to look at; theirs is the block, what is made of it is made for all at once.
    Errors: InputError as of `single`, for models that are not N, and actions of another shape; NotReadyError for a step
    before the first reset, and for anything after `close`.

    >>> from spikecam_env.envs.rotating_disk import RotatingDiskEnv
    >>> cameras = SpikeCameraVectorEnv(RotatingDiskEnv, 2, shape=(16, 24))
    >>> spikes, infos = cameras.reset(seed=0)
    >>> spikes.shape
    (2, 40, 16, 24)
    >>> cameras.close()
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["rgb_array"],
        "render_fps": 25,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        single: str | Callable[..., SpikeCameraEnv],
        num_envs: int = 1,
        *,
        models: Sequence[Any] | None = None,
        max_episode_steps: int | None = None,
        workers: int | None = None,
        render_mode: str | None = None,
        device: Any = None,
        **options: Any,
    ) -> None:
        self.num_envs = checked_count(num_envs, "num_envs")
        self.max_episode_steps = _limit_of(max_episode_steps, options)
        self.render_mode = render_mode
        make: Any = load_env_creator(single) if isinstance(single, str) else single
        options |= {"render_mode": render_mode, "threads": options.get("threads", 1)}
        self.envs: list[SpikeCameraEnv] = [make(**{**options, **own}) for own in _own_models(models, self.num_envs)]
        for env in self.envs:
            _check_phases(env)
        self._workers = [
            ThreadPoolExecutor(1, thread_name_prefix=f"spikecam-envs-{n}")
            for n in range(as_many(workers, self.num_envs))
        ]
        self._process = os.getpid()
        one = self.envs[0]
        self.observation, self.obs_state, self._view = one.observation, one.obs_state, one.view
        self.single_observation_space, self.single_action_space = one.observation_space, one.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        for env in self.envs:
            env.observation, env.obs_state = Spikes(), False
        self._there: Any = None if device is None else import_module("spikecam_env.envs.cameras_on_device")
        if self._there is not None:
            self._there.check_on_device(self.observation, render_mode)
            self._cameras = self._there.DeviceCameras(self.envs, device)
            self._view = replace(self._view, device=self._cameras.device)
        self._seen: Any = None
        self._over = np.zeros(self.num_envs, bool)
        self._steps = np.zeros(self.num_envs, int)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """New episodes everywhere; `options` are given to each."""
        self._open()
        seeds = _seeds(seed, self.num_envs)
        numbers = range(self.num_envs)
        self._each(lambda n: self.envs[n].begin(seed=seeds[n], options=options), numbers)
        self._seen = self.observation.start(self._view, self.num_envs)
        self._over[:], self._steps[:] = False, 0
        seen, _, _, _, info = self._exposed(np.ones(self.num_envs, bool))
        return seen, info

    def step(
        self, actions: ArrayLike
    ) -> tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Every environment a step further; where an episode was over, the first block of the next."""
        self._open()
        if self._seen is None:
            raise NotReadyError("the environments have no scene yet; call reset first")
        given = np.asarray(actions) if self._there is None else self._there.on_host(actions)
        if given.shape[:1] != (self.num_envs,):
            raise InputError(
                f"actions have shape {given.shape}; they must be one an environment, ({self.num_envs}, ...)"
            )
        fresh = self._over.copy()
        self._each(lambda n: self.envs[n].begin(), np.flatnonzero(fresh).tolist())
        for n in np.flatnonzero(~fresh).tolist():
            self.envs[n].turn(given[n])
        if fresh.any():
            self._seen = restarted(self.observation, self._view, self._seen, fresh)
        self._steps = np.where(fresh, 0, self._steps + 1)
        return self._exposed(fresh)

    def render(self) -> tuple[Any, ...] | None:
        """N pictures (H, W, 3) uint8, or None without a render mode."""
        return None if self.render_mode is None else tuple(env.render() for env in self.envs)

    def close_extras(self, **kwargs: Any) -> None:
        """Close every environment on its thread, and end the threads."""
        if self._process != os.getpid():  # a fork has no threads, and what they hold is not its own
            return
        self._each(lambda n: self.envs[n].close(), range(self.num_envs))
        for worker in self._workers:
            worker.shutdown()

    def _exposed(
        self, fresh: NDArray[np.bool_]
    ) -> tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """The next block of all, and what follows; fresh (N,): which episodes begin with it."""
        blocks = self._blocks() if self._there is None else self._cameras.exposed(self._each)
        picture, self._seen = self.observation.step(blocks, self._seen)
        age = np.broadcast_to(self.observation.age(self._seen), (self.num_envs,)).astype(np.float64)
        numbers = range(self.num_envs)
        each = self._each if any(env.renders for env in self.envs) else in_turn
        outcomes = each(lambda n: self._outcome(n, bool(fresh[n])), numbers)
        rewards, terminated, truncated, infos = zip(*outcomes, strict=True)
        late = False if self.max_episode_steps is None else self._steps >= self.max_episode_steps
        ends = np.array(terminated, bool), np.array(truncated, bool) | (late & ~fresh)
        self._over = ends[0] | ends[1]
        info = batched(infos) | {"age": age, "_age": np.ones(self.num_envs, bool)}
        seen = with_state(picture, info["gaze"], age) if self.obs_state else picture
        if self._there is None:
            return seen, np.array(rewards, np.float64), *ends, info
        of_agents = seen, np.array(rewards, np.float64), *ends
        return *map(self._cameras.tensors, of_agents), info

    def _blocks(self) -> Blocks:
        """The next block of all, in memory of its own."""
        spikes = np.empty((self.num_envs, self._view.frames_per_step, *self._view.shape), np.uint8)
        expose(self.envs, outs=list(spikes), threads=len(self._workers), each=self._each)
        return Blocks(spikes, [env.blocks.light[0] for env in self.envs], self._view.frame_rate_hz)

    def _outcome(self, n: int, fresh: bool) -> Outcome:
        if fresh:
            return 0.0, False, False, self.envs[n].begun()[1]
        _, reward, terminated, truncated, info = self.envs[n].outcome()
        return reward, terminated, truncated, info

    def _each(self, work: Callable[[int], T], numbers: Sequence[int]) -> list[T]:
        """What `work` of each of these environments returns, done on its own thread.  Raises what the first that fails
        raises, when all are done."""
        shares: dict[int, list[int]] = {}
        for n in numbers:
            shares.setdefault(n % len(self._workers), []).append(n)
        futures = {n: self._workers[n].submit(in_turn, work, share) for n, share in shares.items()}
        wait(futures.values())
        done = {n: iter(future.result()) for n, future in futures.items()}
        return [next(done[n % len(self._workers)]) for n in numbers]

    def _open(self) -> None:
        if self.closed:
            raise NotReadyError("the environments are closed; make new ones")


def _check_phases(env: Any) -> None:
    """Raise InputError for an environment whose `step` or `reset` does more than its parts, which are called here."""
    kind = type(env)
    for name, parts in (("step", "turn, outcome"), ("reset", "begin, begun")):
        if getattr(kind, name, None) is not getattr(SpikeCameraEnv, name):
            raise InputError(
                f"{kind.__name__} has a {name} of its own, which a vector environment would not call; override "
                f"{parts} instead"
            )


def batched(infos: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Infos of N environments as gymnasium's vectors have them: by name an array (N, ...), and as `_name` who has it.

    Numbers and arrays are 0 where there is none; dictionaries are dictionaries of such; anything else is an object.

    >>> infos = batched([{"on_target": True}, {"on_target": False, "episode_number": 7}])
    >>> infos["episode_number"].tolist(), infos["_episode_number"].tolist()
    ([0, 7], [False, True])
    """
    together: dict[str, Any] = {}
    alike = all(info.keys() == infos[0].keys() for info in infos)
    for name in infos[0] if alike else dict.fromkeys(chain.from_iterable(infos)):
        values = [info.get(name, MISSING) for info in infos]
        has = np.ones(len(infos), bool) if alike else np.array([value is not MISSING for value in values])
        together[name], together[f"_{name}"] = _batched_values(values, has), has
    return together


MISSING = object()


def _batched_values(values: list[Any], has: NDArray[np.bool_]) -> Any:
    """values: N, MISSING where not has."""
    first = values[int(has.argmax())]
    if isinstance(first, dict):
        return batched([{} if value is MISSING else value for value in values])
    if type(first) not in (int, float, bool) and not isinstance(first, (np.number, np.ndarray)):
        array = np.full(len(values), None, dtype=object)
        array[has] = [value for value in values if value is not MISSING]
        return array
    nothing = np.zeros_like(first)
    return np.array([nothing if value is MISSING else value for value in values], dtype=nothing.dtype)


def _limit_of(steps: int | None, options: dict[str, Any]) -> int | None:
    """Steps after which episodes are truncated; None: they end by themselves."""
    if steps is None and options.get("steps", 0) is None:  # an id of a scene, which leaves the end to others
        return MAX_EPISODE_STEPS
    return None if steps is None or steps == -1 else checked_count(steps, "max_episode_steps")


def _seeds(seed: int | Sequence[int | None] | None, count: int) -> list[int | None]:
    if seed is None:
        return [None] * count
    seeds: list[int | None] = list(range(seed, seed + count)) if isinstance(seed, int) else list(seed)
    if len(seeds) != count:
        raise InputError(f"seed has {len(seeds)} numbers; it must be one an environment, {count}, or one for all")
    return seeds


def _own_models(models: Sequence[Any] | None, count: int) -> list[dict[str, Any]]:
    if models is None:
        return [{}] * count
    if isinstance(models, str) or len(models) != count:
        raise InputError(f"models are {len(models)}; they must be one an environment, {count}")
    return [{"model": model} for model in deepcopy(list(models))]
