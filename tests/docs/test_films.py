"""Films of the pages: the command below each makes it, and it plays where a browser plays H.264."""

from __future__ import annotations

import shlex
from pathlib import Path

import av
import pytest
from PIL import Image

from scenes.catalogue import SCENES
from spikecam_env.cli.main import understood
from spikecam_env.cli.scenes import FILM_FPS, Scenes
from spikecam_env.envs.registration import MUJOCO_NAMES
from spikecam_env.envs.tasks import TASKS
from tools.films import documented
from tools.site.films import as_directives, poster_of
from tools.site.pages import filled_in

FILMS = documented()


def test_the_gallery_has_a_film_of_every_scene_and_of_every_task() -> None:
    assert {film.stem for film in FILMS} == {*SCENES, *TASKS, *MUJOCO_NAMES}


@pytest.mark.parametrize("film", FILMS, ids=lambda film: film.stem)
def test_a_film_has_the_size_and_length_that_its_command_gives_it(film: Path) -> None:
    command = understood(shlex.split(FILMS[film].command)[1:])
    with av.open(str(film)) as opened:
        [video] = opened.streams.video
        pictures, codec = video.frames, video.codec_context
        assert (codec.name, codec.pix_fmt) == ("h264", "yuv420p")
        assert Image.open(poster_of(film)).size == (codec.width, codec.height)
        print(f"{film.name}: {pictures} pictures, {pictures / float(video.average_rate):.1f} s")
        if isinstance(command, Scenes):
            assert pictures == len(range(0, command.frames, command.every))
            assert ((codec.height, codec.width), video.average_rate) == (command.size, FILM_FPS)
        assert str(command.film) == film.name


def test_films_that_follow_each_other_are_a_gallery_and_a_link_in_a_sentence_stays_one() -> None:
    line = "[fan](films/fan.mp4): `spikecam scenes fan --film fan.mp4`"
    assert as_directives(f"{line}\n{line}\n").count("{film} films/fan.mp4") == 2
    assert as_directives(f"{line}\n{line}\n").count("{container} films") == 1
    assert as_directives("See [fan](films/fan.mp4).\n") == "See [fan](films/fan.mp4).\n"


def test_a_task_s_page_has_its_rows_of_the_scores_and_no_other_s() -> None:
    page = filled_in("<!-- generated: task Catch -->", "tasks/catch.md")
    assert "autoclass:: spikecam_env.envs.tasks.catch.Catch" in page
    assert page.count("| Catch-v1 |") >= 2 and "| Track-v1 |" not in page
