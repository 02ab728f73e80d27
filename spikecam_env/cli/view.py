"""`spikecam view`: a scene, a recording or an episode in rerun's viewer, with time to scrub."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import tyro

from spikecam_env.checked import checked_memory
from spikecam_env.cli.camera import CameraOptions
from spikecam_env.cli.options import Size
from spikecam_env.cli.reading import ReadingOptions
from spikecam_env.cli.without_effect import WithoutEffect
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.numbers import Count, Seed

if TYPE_CHECKING:
    from spikecam_env.cli.live.streams import Stream

FRAMES = 4000
"""Of a scene, and at most of an episode, where nothing else is asked for."""
SIZE = (250, 400)
ENDING = ".rrd"


@dataclass
class ViewCommand:
    """Look at a scene, a recording or an episode: noisy and denoised pictures, rates of pixels, statistics; of an
    episode reward and gaze too.  In rerun's viewer (pip install 'spikecam-env[view]'), or as a file for it.

    example:  spikecam view fan
              spikecam view recording.dat --flip --pixels 100,200 120,40 --save recording.rrd
              spikecam view Track-v1 --policy oracle --save track.rrd
    """

    what: tyro.conf.Positional[str]
    """A scene of `spikecam scenes`, a file as `spikecam denoise` takes it, or an environment, e.g. Track-v1."""
    save: Path | None = None
    """Write a recording (.rrd) instead of opening the viewer: `rerun FILE` or https://rerun.io/viewer opens it."""
    pixels: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ROW,COLUMN ...")] = ()
    """Pixels of which to plot the rate; default: the middle one."""
    frames: Count | None = None
    """Frames to show; default: 4000 of a scene or an episode, all of a file."""
    every: Count = 40
    """Frames of a picture, for a scene or a file; an environment gives one a step."""
    denoise: bool = True
    """Show the online denoiser's picture (`best`) too."""
    policy: str = "oracle"
    """Policy of an episode: oracle, nothing, random, classical, an agent's name or its file (.pt)."""
    split: Literal["train", "test"] = "test"
    """Training or test episodes of a task of version 1."""
    seed: Seed = 0
    """Seed of the scene and the camera's unit, or of the episode."""
    size: Size | None = None
    """Rows and columns of a scene or an environment; default: 250 x 400, or the environment's own."""
    camera: CameraOptions = field(default_factory=CameraOptions)
    reading: ReadingOptions = field(default_factory=ReadingOptions)

    without_effect: ClassVar = (
        WithoutEffect(("policy", "split"), lambda c: not c.is_episode, "{what} is no environment"),
        WithoutEffect(("seed", "size", "camera"), lambda c: c.is_file, "{what} is a file, of what a camera saw"),
        WithoutEffect(("reading",), lambda c: not c.is_file, "{what} is no file"),
        WithoutEffect(("every",), lambda c: c.is_episode, "{what} gives a picture a step"),
        WithoutEffect(("split",), lambda c: not c.has_splits, "{what} has no training and test episodes"),
    )

    @property
    def is_episode(self) -> bool:
        """Whether it is an environment."""
        from spikecam_env.cli.live.episodes import is_environment

        return is_environment(self.what)

    @property
    def has_splits(self) -> bool:
        """Whether it has training and test episodes."""
        from spikecam_env.cli.live.episodes import has_splits

        return has_splits(self.what)

    @property
    def is_file(self) -> bool:
        """Whether it is none of the names."""
        from scenes.catalogue import SCENES

        return not self.is_episode and self.what not in SCENES and bool(Path(self.what).suffix)

    def run(self) -> None:
        from spikecam_env.cli.live.rerun_log import recorded, watched
        from spikecam_env.cli.live.timeline import entries, pixel
        from spikecam_env.whole import whole_file

        self._check_place()
        with self._stream() as stream:
            rows, columns = stream.shape
            texts = self.pixels or (f"{rows // 2},{columns // 2}",)
            pixels = tuple(dict.fromkeys(pixel(text, stream.shape) for text in texts))
            shown = entries(stream, pixels, self.denoise)
            if self.save is None:
                watched(stream.title, stream.frame_rate_hz, shown)
                return
            checked_memory(2 * rows * columns * -(-stream.frames // self.every), f"pictures of {stream.frames} frames")
            content = recorded(stream.title, stream.frame_rate_hz, shown)
            with whole_file(self.save) as beside:
                beside.write_bytes(content)
        print(f"wrote {self.save}; `rerun {self.save}` shows it")

    def _check_place(self) -> None:
        from spikecam_env.cli.files import check_place
        from spikecam_env.cli.screen.window import has_display

        if self.save is None and not has_display():
            raise InputError(f"there is no display for rerun's viewer; write a file with --save FILE{ENDING}")
        check_place("save", self.save, ENDING)

    @contextmanager
    def _stream(self) -> Iterator[Stream]:
        from scenes.catalogue import SCENES
        from spikecam_env.cli.live.episodes import environment
        from spikecam_env.cli.live.players import player
        from spikecam_env.cli.live.streams import of_episode, of_recording
        from spikecam_env.envs.registration import ALL_TASKS, ENVIRONMENTS

        ids = (*ENVIRONMENTS, *ALL_TASKS)
        if self.what in SCENES:
            yield self._scene()
        elif self.is_episode:
            acting = player(self.policy, self.what)
            size = {} if self.size is None else {"shape": self.size}
            env = environment(self.what, acting, model=self.camera.load(), split=self.split, **size)
            try:
                yield of_episode(self.what, env, acting, self.seed, self.frames or FRAMES)
            finally:
                env.close()
        elif self.is_file:
            yield of_recording(self.what, self.frames, self.every, **self.reading.options())
        else:
            names = (*SCENES, *(name.rpartition("/")[2] for name in ids))
            raise unknown_name("scene, file or environment", self.what, names)

    def _scene(self) -> Stream:
        from spikecam_env.cli.live.streams import of_scene
        from spikecam_env.cli.named_scene import scene_named
        from spikecam_env.sensor import SpikeSensor

        model, shape = self.camera.load(), self.size or SIZE
        scene = scene_named(self.what, shape, self.seed, model.frame_rate_hz)
        sensor = SpikeSensor(model, shape, self.seed, engine="auto")
        return of_scene(self.what, scene, sensor, self.frames or FRAMES, self.every)
