"""A local Ray cluster of two workers writes the bytes of one process, even when a worker is killed."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_dataset import LONG, bytes_in, small_plan
from test_build import kill_first_writer

from spikecam_env.datasets import build
from spikecam_env.errors import InputError


@pytest.mark.slow
def test_two_workers_one_killed_write_the_bytes_of_one_process(tmp_path: Path, whole: dict[str, bytes]) -> None:
    killed = kill_first_writer(tmp_path)
    built = build(small_plan(LONG), tmp_path, jobs=2, ray="local")
    assert killed() and built.made == 3
    assert bytes_in(tmp_path) == whole


@pytest.mark.parametrize("address", ["127.0.0.1:9", "head:x", "ray://127.0.0.1:9"])
def test_an_address_without_a_cluster_is_refused_at_once_and_nothing_is_written(tmp_path: Path, address: str) -> None:
    with pytest.raises(InputError, match=f"no Ray cluster answers at '{address}'"):
        build(small_plan(), tmp_path / "new" / "dataset", ray=address)
    assert not list(tmp_path.iterdir())


def test_without_ray_the_message_says_what_to_install(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "ray", None)
    with pytest.raises(InputError, match=r"pip install 'spikecam-env\[ray\]'"):
        build(small_plan(), tmp_path / "dataset", ray="local")
    assert not list(tmp_path.iterdir())
