"""The site is built without a warning, has every public name, and needs nothing from elsewhere."""

from __future__ import annotations

import re
import subprocess
import sys
import zlib
from importlib import import_module
from pathlib import Path

import pytest

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
