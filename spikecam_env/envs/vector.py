"""Many spike cameras stepped in one call.

    env = gymnasium.make_vec("spikecam_env/RotatingDisk-v0", num_envs=64, vectorization_mode="vector_entry_point")

The environments live in this process, each on one of a few threads for good (OpenGL's contexts belong to a thread);
observations are computed for all streams at once.  The bits are those of as many single environments.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace
from difflib import get_close_matches
from functools import partial
from inspect import Parameter, signature
from typing import Any, TypeVar

import numpy as np
from gymnasium.envs.registration import load_env_creator
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from spikecam_env.checked import checked_count
from spikecam_env.envs.cameras_on_host import HostCameras
from spikecam_env.envs.observations import Blocks, Spikes, replaced, restarted, with_rows, with_state
from spikecam_env.envs.registration import MAX_EPISODE_STEPS
from spikecam_env.envs.spike_camera import SpikeCameraEnv, in_turn
from spikecam_env.envs.vector_infos import batched
from spikecam_env.envs.vector_inputs import (
    checked_actions,
    checked_limit,
    checked_mode,
    checked_models,
    checked_options,
    checked_seeds,
)
from spikecam_env.envs.workers import Workers
from spikecam_env.errors import InputError, NotReadyError, unknown_name
from spikecam_env.threads import as_many

__all__ = ["SpikeCameraVectorEnv", "batched"]

T = TypeVar("T")
Outcome = tuple[float, bool, bool, dict[str, Any]]
"""(reward, terminated, truncated, info) of one environment."""
Step = tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]
"""(observation, reward, terminated, truncated, info) of all."""


class SpikeCameraVectorEnv(VectorEnv[Any, Any, Any]):
    """N environments of one class; observation, action, info and options as of one, with a leading axis N.

    `autoreset_mode` says when the next episode begins where one is over.  In every mode the bits are those of
    gymnasium's `SyncVectorEnv`.

    - NEXT_STEP: with the next step, whose action is not used and whose reward is 0.
    - SAME_STEP: at once; `info` has `final_obs` and `final_info` of the episode that is over.
    - DISABLED: with `reset(options={"reset_mask": over})`, before which a step is refused.

    `envs` are the single environments, to look at; they expose the block, and the observation is made of the blocks
    of all at once.  A vector environment can be pickled and copied.

    Args:
        single: makes one environment: a class or its entry point.
        num_envs: N.
        models: N models (presets, TOML paths, SensorModels), one an environment; default: all have `model`.
        max_episode_steps: after which an episode is truncated; -1 is never, None the id's own, as of `gymnasium.make`.
        autoreset_mode: an `AutoresetMode` or its value: "NextStep", "SameStep", "Disabled".
        workers: threads; default NUMBA_NUM_THREADS, N at most.
        render_mode: as `single` has it.
        device: a torch device: cameras, planar scenes and observations ("spikes", "multibinary", "tfp", "rate") are on
            it; actions may be tensors, and all that is returned but info are tensors (`envs.cameras_on_device`).
        options: all else, obs and obs_state too: as `single` has them.

    Raises:
        InputError: as of `single`; for an argument out of range, seeds, options, models and actions that are not N, and
            for the denoiser on a device in SAME_STEP mode.
        NotReadyError: for a step before the first reset or, where DISABLED, of an episode that is over, and for
            anything after `close`.

    Example:
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
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        workers: int | None = None,
        render_mode: str | None = None,
        device: Any = None,
        **options: Any,
    ) -> None:
        self.num_envs = checked_count(num_envs, "num_envs")
        usual = MAX_EPISODE_STEPS if options.get("steps", 0) is None else None  # an id of a scene has no end of its own
        self.max_episode_steps = checked_limit(max_episode_steps, usual)
        self.autoreset_mode = checked_mode(autoreset_mode)
        self.metadata = self.metadata | {"autoreset_mode": self.autoreset_mode}
        self.render_mode = render_mode
        threads = as_many(None if workers is None else checked_count(workers, "workers"), self.num_envs)
        make: Any = load_env_creator(single) if isinstance(single, str) else single
        options |= {"render_mode": render_mode, "threads": options.get("threads", 1)}
        self.envs = _made(make, options, checked_models(models, self.num_envs))
        one = self.envs[0]
        self.observation, self.obs_state, self._view = one.observation, one.obs_state, one.view
        self.single_observation_space, self.single_action_space = one.observation_space, one.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        for env in self.envs:
            env.observe(Spikes())
        self._cameras: Any = HostCameras(self.envs, threads) if device is None else self._on(device)
        self.device: Any = self._view.device
        self._workers = Workers(threads)
        self._state: Any = None
        self._seen: Any = None  # the last observation, where a part of it may be given again
        self._over = np.zeros(self.num_envs, bool)
        self._steps = np.zeros(self.num_envs, int)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | Sequence[dict[str, Any] | None] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """New episodes everywhere, or where a mask selects.

        Args:
            seed: s for s, s + 1, ..., or N seeds; None goes on with the generators as they are.
            options: of one environment, given to each; or N of them.  With "reset_mask", (N,) bool, episodes begin
                where it is true; the others stay as they are, and the last observation of them is returned.

        Returns:
            (observation of all, info of those whose episode begins).

        Raises:
            InputError: for unusable seeds and options.
            NotReadyError: for a mask before the first whole reset, and after `close`.
        """
        self._open()
        which, own = checked_options(options, self.num_envs)
        seeds = checked_seeds(seed, self.num_envs)
        if not which.all():
            self._check_part()
        state, self._state = self._state, None  # after a reset that fails nothing can be stepped
        numbers = np.flatnonzero(which).tolist()
        self.each(lambda n: self.envs[n].begin(seed=seeds[n], options=own[n]), numbers)
        rows, first, infos = self._first_blocks(which)
        self._state = first if which.all() else replaced(state, first, which)
        seen = rows if which.all() else with_rows(self._seen, rows, which)
        return self._cameras.returned(self._kept(seen)), batched(infos)

    def step(self, actions: ArrayLike) -> Step:
        """A step of every environment.

        Args:
            actions: (N, numbers) in [-1, 1]; values beyond are cut.

        Raises:
            InputError: for actions of another shape or type, or that are not finite; nothing is stepped then.
            NotReadyError: before the first reset, after `close`, and, where DISABLED, where an episode is over.
        """
        self._open()
        self._check_steppable()
        given = checked_actions(actions, self.action_space.shape or ())
        fresh = self._over & (self.autoreset_mode is AutoresetMode.NEXT_STEP)
        self.each(lambda n: self.envs[n].begin(), np.flatnonzero(fresh).tolist())
        for n in np.flatnonzero(~fresh).tolist():
            self.envs[n].turn(given[n])
        if fresh.any():
            self._state = restarted(self.observation, self._view, self._state, fresh)
        self._steps = np.where(fresh, 0, self._steps + 1)
        seen, rewards, terminated, truncated, infos = self._next_blocks(fresh)
        self._over = terminated | truncated
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._over.any():
            seen, infos = self._with_next_episodes(seen, infos)
        return *map(self._cameras.returned, (self._kept(seen), rewards, terminated, truncated)), batched(infos)

    def render(self) -> tuple[Any, ...] | None:
        """N pictures (H, W, 3) uint8, or None without a render mode."""
        return None if self.render_mode is None else tuple(env.render() for env in self.envs)

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """An attribute of every environment, called where it can be; as of gymnasium's vector environments."""

        def of(n: int) -> Any:
            attribute = self.envs[n].get_wrapper_attr(name)
            return attribute(*args, **kwargs) if callable(attribute) else attribute

        self._open()
        return tuple(self.each(of, range(self.num_envs)))

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of every environment; see `call`."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of every environment.

        Args:
            name: any.
            values: a list or tuple of N, or one value for all.

        Raises:
            InputError: for a list of another length.
        """
        each = list(values) if isinstance(values, (list, tuple)) else [values] * self.num_envs
        if len(each) != self.num_envs:
            raise InputError(f"values are {len(each)}; give one an environment, {self.num_envs}, or one for all")
        for env, value in zip(self.envs, each, strict=True):
            env.set_wrapper_attr(name, value)

    def each(self, work: Callable[[int], T], numbers: Sequence[int]) -> list[T]:
        """Work of the numbers of environments, each done on the thread of its environment; see `Workers.each`."""
        return self._workers.each(work, numbers)

    @property
    def np_random_seed(self) -> Any:
        """N seeds of the environments' generators."""
        return self.get_attr("np_random_seed")

    @property  # type: ignore[misc]  # read alone, as of gymnasium's vectors of environments
    def np_random(self) -> Any:
        """N generators."""
        return self.get_attr("np_random")

    def close_extras(self, **kwargs: Any) -> None:
        """Close every environment on its thread, and end the threads; `waits=False` does not wait for that."""
        self._workers.close(lambda n: self.envs[n].close(), range(self.num_envs), **kwargs)

    def __del__(self) -> None:
        if hasattr(self, "_workers") and not self.closed:
            with suppress(RuntimeError):  # at the end of the program there are no threads any more
                self.close(waits=False)

    def _on(self, device: Any) -> Any:
        """The cameras on a torch device."""
        from spikecam_env.envs.cameras_on_device import DeviceCameras, check_on_device  # torch takes seconds

        check_on_device(self.observation, self.render_mode)
        if self.autoreset_mode is AutoresetMode.SAME_STEP and not self.observation.begins_alone:
            raise InputError(f"autoreset_mode is SameStep and obs {_law(self)}; on a device take NextStep, or 'tfp'")
        cameras = DeviceCameras(self.envs, device)
        self._view = replace(self._view, device=cameras.device)
        return cameras

    def _next_blocks(
        self, fresh: NDArray[np.bool_]
    ) -> tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], list[dict[str, Any]]]:
        """The next block of all, and infos by environment; fresh (N,): which episodes begin with it."""
        numbers = range(self.num_envs)
        blocks = self._cameras.exposed(self.each, numbers)
        picture, self._state = self.observation.step(blocks, self._state)
        outcomes = self._by_scene(lambda n: self._outcome(n, bool(fresh[n])), numbers)
        rewards, terminated, truncated, infos = (list(values) for values in zip(*outcomes, strict=True))
        late = False if self.max_episode_steps is None else self._steps >= self.max_episode_steps
        seen = self._observed(picture, blocks, self._state, infos)
        return (
            seen,
            np.array(rewards, np.float64),
            np.array(terminated, bool),
            np.array(truncated, bool) | (late & ~fresh),
            infos,
        )

    def _first_blocks(self, which: NDArray[np.bool_]) -> tuple[Any, Any, list[dict[str, Any]]]:
        """Observations, their state, and infos of the episodes that begin; infos are empty where none does."""
        numbers = np.flatnonzero(which).tolist()
        self._over[which], self._steps[which] = False, 0
        blocks = self._cameras.exposed(self.each, numbers)
        picture, state = self.observation.step(blocks, self.observation.start(self._view, len(numbers)))
        own = self._by_scene(lambda n: self.envs[n].begun()[1], numbers)
        seen = self._observed(picture, blocks, state, own)
        infos: list[dict[str, Any]] = [{} for _ in self.envs]
        for n, info in zip(numbers, own, strict=True):
            infos[n] = info
        return seen, state, infos

    def _with_next_episodes(self, seen: Any, infos: list[dict[str, Any]]) -> tuple[Any, list[dict[str, Any]]]:
        """Observation and infos of a step, after which the next episodes begin at once."""
        over = self._over.copy()
        final = self._cameras.returned(seen)
        self.each(lambda n: self.envs[n].begin(), np.flatnonzero(over).tolist())
        rows, state, first = self._first_blocks(over)
        self._state = replaced(self._state, state, over)
        for n in np.flatnonzero(over).tolist():
            first[n] = {"final_obs": _row(final, n), "final_info": infos[n]} | first[n]
        return with_rows(seen, rows, over), [a if b else c for a, b, c in zip(first, over, infos, strict=True)]

    def _observed(self, picture: Any, blocks: Blocks, state: Any, infos: Sequence[dict[str, Any]]) -> Any:
        """The observation of some streams; the age of the picture and what else the law says go into infos."""
        age = np.broadcast_to(self.observation.age(state), (len(infos),)).astype(np.float64)
        for info, its, more in zip(infos, age.tolist(), self.observation.info(blocks, state), strict=True):
            info.update(more, age=its)
        return with_state(picture, [info["gaze"] for info in infos], age) if self.obs_state else picture

    def _outcome(self, n: int, fresh: bool) -> Outcome:
        if fresh:
            return 0.0, False, False, self.envs[n].begun()[1]
        _, reward, terminated, truncated, info = self.envs[n].outcome()
        return reward, terminated, truncated, info

    def _kept(self, seen: Any) -> Any:
        """The observation, kept for a reset of a part; where that is the way to go on, as a copy."""
        disabled = self.autoreset_mode is AutoresetMode.DISABLED
        self._seen = deepcopy(seen) if disabled else seen
        return seen

    def _by_scene(self, work: Callable[[int], T], numbers: Sequence[int]) -> list[T]:
        """As `each`; on this thread where no scene needs its own."""
        return (self.each if any(self.envs[n].renders for n in numbers) else in_turn)(work, numbers)

    def _open(self) -> None:
        if self.closed:
            raise NotReadyError("the environments are closed; make new ones")

    def _check_steppable(self) -> None:
        if self._state is None:
            raise NotReadyError("the environments have no scene yet; call reset first")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._over.any():
            raise NotReadyError(
                f"the episodes of environments {np.flatnonzero(self._over).tolist()} are over and autoreset_mode is "
                "Disabled; call reset(options={'reset_mask': terminated | truncated}) first"
            )

    def _check_part(self) -> None:
        """Raise an error where a part of the environments cannot be reset."""
        if self._state is None:
            raise NotReadyError("the environments have no scene yet; call reset without reset_mask first")
        if self.device is not None and not self.observation.begins_alone:
            raise InputError(f"reset_mask selects some and obs is {_law(self)}; on a device reset all of them")


def _made(make: Callable[..., SpikeCameraEnv], options: dict[str, Any], own: list[dict[str, Any]]) -> list[Any]:
    """Environments with these options, and others of their own."""
    try:
        envs = [make(**{**options, **its}) for its in own]
    except (TypeError, InputError) as error:
        keywords = list(signature(SpikeCameraVectorEnv.__init__).parameters.values())
        names = [one.name for one in keywords if one.kind is Parameter.KEYWORD_ONLY]
        for name in options:
            if repr(name) in str(error) and get_close_matches(name, names):
                raise unknown_name("keyword of a vector environment", name, names) from error
        raise
    for env in envs:
        _check_phases(env)
    return envs


def _law(env: SpikeCameraVectorEnv) -> str:
    return type(env.observation).__name__


def _row(values: Any, n: int) -> Any:
    """Of stream n."""
    return {name: value[n] for name, value in values.items()} if isinstance(values, dict) else values[n]


def _check_phases(env: Any) -> None:
    """Raise InputError for an environment whose `step` or `reset` does more than its parts, which are called here."""
    kind = type(env)
    for name, parts in (("step", "turn, outcome"), ("reset", "begin, begun")):
        if getattr(kind, name, None) is not getattr(SpikeCameraEnv, name):
            raise InputError(
                f"{kind.__name__} has a {name} of its own, which a vector environment would not call; override "
                f"{parts} instead"
            )


def whose_keyword(name: str) -> str:
    """A hint for a keyword of vector environments alone; nothing for others."""
    single, vector = (set(signature(kind.__init__).parameters) for kind in (SpikeCameraEnv, SpikeCameraVectorEnv))
    if name not in vector - single - {"single", "options"}:
        return ""
    return 'it is of vector environments: gymnasium.make_vec(id, vectorization_mode="vector_entry_point", ...)'


def __getattr__(name: str) -> Any:
    """Entry points of vector environments: `spikecam_env.envs.vector:MODULE.CLASS` is the vector of `MODULE:CLASS`.

    gymnasium looks a vector environment up as an attribute of a module, by text, so that specifications can be written
    to files; every class of environments thus has one, and none has to be declared.
    """
    module, dot, single = name.rpartition(".")
    if not dot:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return partial(SpikeCameraVectorEnv, f"{module}:{single}")
