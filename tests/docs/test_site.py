"""The site is built without a warning, has every public name, and needs nothing from elsewhere."""

from __future__ import annotations

import re
import subprocess
import sys
import zlib
from importlib import import_module
from pathlib import Path

import pytest
from in_browser import BROWSER, laid_out

from scenes.catalogue import SCENES
from spikecam_env import __version__
from spikecam_env.envs.registration import MUJOCO_NAMES
from spikecam_env.envs.tasks import TASKS
from tools.page_blocks import ROOT
from tools.site.public import MODULES, home_of, kind_of, names_of

pytestmark = pytest.mark.slow
OPTIONS = ("--fail-on-warning", "--keep-going", "--fresh-env", "--quiet")
FETCHED = re.compile(r"<(?:script|link|img|iframe|source)\b[^>]*?(?:src|href)=\"(?:https?:)?//[^\"]+\"")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built as `make docs` builds it."""
    assert " ".join(OPTIONS) in (ROOT / "Makefile").read_text(encoding="utf-8")
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", *OPTIONS, "-b", "html", ROOT / "docs", out]
    done = subprocess.run([str(word) for word in command], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return out


def test_every_public_name_has_a_place_of_its_own(site: Path) -> None:
    head, listed = (site / "objects.inv").read_bytes().split(b"zlib.\n")
    assert head.startswith(b"# Sphinx inventory version 2")
    known = {line.split()[0] for line in zlib.decompress(listed).decode().splitlines() if " py:" in line}
    for module in MODULES:
        for name in names_of(module):
            if home_of(module, name) == module and kind_of(getattr(import_module(module), name)) != "module":
                assert f"{module}.{name}" in known


def test_no_page_fetches_anything(site: Path) -> None:
    for page in site.rglob("*.html"):
        assert not FETCHED.findall(page.read_text(encoding="utf-8")), page.name
    for sheet in site.rglob("*.css"):
        assert not re.findall(r"url\([\"']?(?:https?:)?//|@import", sheet.read_text(encoding="utf-8")), sheet.name


def test_a_word_can_be_searched_for(site: Path) -> None:
    index = (site / "searchindex.js").read_text(encoding="utf-8")
    assert "with_effect" in index and "crosstalk" in index


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_no_code_is_cut_no_page_is_wider_than_the_screen_and_films_play(site: Path) -> None:
    laid = laid_out(site, (1280, 400))
    if not laid:
        pytest.skip("Chromium did not render")
    desk = [page for page in laid if page.width == 1280]
    print(f"{len(desk)} pages, {sum(p.blocks for p in desk)} blocks, {sum(p.films for p in desk)} films")
    assert not [(page.page, page.cut) for page in desk if page.cut]
    assert not [(page.page, page.page_width) for page in laid if page.page_width > page.width]
    assert not [(page.page, page.still) for page in desk if page.still]
    films = {page.page: page.films for page in desk}
    assert films["gallery.html"] == len(SCENES) + len(TASKS) + len(MUJOCO_NAMES)
    assert all(films[f"tasks/{kind.__module__.rpartition('.')[2]}.html"] == 1 for kind in TASKS.values())
    highlighted = [page for page in desk if page.page.startswith(("tutorials/", "howto/")) and page.blocks]
    assert all(page.copied == page.blocks for page in highlighted)


def test_the_start_page_and_the_first_of_the_tutorials_say_how_to_install(site: Path) -> None:
    for page in ("index.html", "install.html"):
        assert "pip install" in re.sub(r"<[^>]+>", "", (site / page).read_text(encoding="utf-8"))
    [tutorials] = re.findall(
        r"\{toctree\}\n:caption: Tutorials\n:hidden:\n\n(\w+)", (ROOT / "docs/index.md").read_text("utf-8")
    )
    assert tutorials == "install"


def test_every_page_shows_the_version_and_public_names_lead_to_their_source(site: Path) -> None:
    assert f"spikecam-env {__version__}" in (site / "index.html").read_text(encoding="utf-8")
    assert "_modules/spikecam_env/sensor/model.html" in (site / "reference/api/sensor.html").read_text(encoding="utf-8")
