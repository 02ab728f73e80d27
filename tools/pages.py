"""The committed pages of diagnoses, and every figure about them in the docs.

    python -m tools.pages                    pages whose code or command has changed; three minutes a page
    python -m tools.pages --only wall --anew

Each page states the code that made it (`spikecam_env/code_version.py`); one whose code is today's is kept, so that a
run that was stopped goes on.  Blocks of figures (`tools/figure_blocks.py`) are made of the files beside the pages
(`tools/stated_diagnosis.py`) and written into every document that has a place for them.
"""

from __future__ import annotations

import json
import re
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import tyro

from spikecam_env.cli.main import run
from spikecam_env.code_version import code_version
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.gap.diagnose import diagnose
from spikecam_env.gap.ladder import Ladder, ladder
from spikecam_env.gap.report.page import write_report
from spikecam_env.gap.report.reproduce import version_of_code
from spikecam_env.version import __version__
from spikecam_env.whole import check_file, whole_file, write_text_whole
from tools.figure_blocks import diagnosis_block, filled, ladder_block, ladder_short_block, short_block
from tools.page_blocks import PAGES as PAGES_OF_DOCS
from tools.real_recordings import REAL
from tools.stated_diagnosis import StatedDiagnosis

REPOSITORY = Path(__file__).parents[1]
DOCS = REPOSITORY / "docs"
LADDER_MADE_BY = ("spikecam_env.gap.ladder", "spikecam_env.campaign")
"""Modules that make the ladder and the campaign that it climbs."""


@dataclass(frozen=True)
class RealPage:
    """The diagnosis of a real recording."""

    name: str
    """Of the campaign."""
    file: str
    """Of the recording."""
    options: str
    """Of its import."""
    page: Path
    model: str = "scsim"

    @property
    def campaign_command(self) -> str:
        """How the campaign is made, as the page shows it; REAL is the folder of the real recordings, wherever it is."""
        return f"spikecam campaign import REAL {self.name} {self.options}"

    def lacking(self, data: Path) -> str:
        """Why it cannot be made here; empty where it can."""
        return "" if (data / self.file).is_file() else f"there is no {data / self.file}"

    def is_fresh(self) -> bool:
        """Whether today's code made the page, by today's commands."""
        beside = self.page.with_suffix(".json")
        if not beside.is_file():
            return False
        stated = json.loads(beside.read_text(encoding="utf-8"))
        return (stated["version"], stated["campaign_command"]) == (version_of_code(), self.campaign_command)

    def make(self, data: Path, jobs: int) -> None:
        """Import, diagnose, write the page."""
        check_file(self.page)
        with tempfile.TemporaryDirectory() as folder:
            campaign = str(Path(folder, self.name))
            done_by_command(["campaign", "import", str(data), campaign, *self.options.split()])
            found = replace(diagnose(campaign, self.model, jobs=jobs), campaign=self.name)
            write_report(found, self.page, self.campaign_command)
            StatedDiagnosis.of(found, self.campaign_command).write(self.page)

    def blocks(self) -> dict[str, str]:
        """Figures of the page by the names of their blocks."""
        stated = StatedDiagnosis.read(self.page)
        return {self.name: diagnosis_block(stated), f"{self.name}, short": short_block(stated)}


@dataclass(frozen=True)
class LadderFigure:
    """The ladder from one preset to a simulated campaign of another."""

    name: str = "ladder"
    first: str = "ideal"
    truth: str = "physical"
    seed: int = 3
    """Of the campaign."""
    figure: Path = DOCS / "ladder.png"
    figures: Path = DOCS / "ladder.json"

    def lacking(self, data: Path) -> str:
        """Nothing: the campaign is simulated."""
        return ""

    def is_fresh(self) -> bool:
        """Whether today's code made it."""
        return self.figures.is_file() and self.stated()["version"] == self.version()

    def stated(self) -> dict[str, Any]:
        """The figures beside the picture."""
        found: dict[str, Any] = json.loads(self.figures.read_text(encoding="utf-8"))
        return found

    def version(self) -> str:
        """Today's."""
        return f"spikecam-env {__version__}, code {code_version(*LADDER_MADE_BY)}"

    def make(self, data: Path, jobs: int) -> None:
        """Simulate, climb, write the picture and its figures."""
        for path in (self.figure, self.figures):
            check_file(path)
        with tempfile.TemporaryDirectory() as folder:
            campaign = str(Path(folder, "known"))
            done_by_command(["campaign", "simulate", campaign, "--model", self.truth, "--seed", str(self.seed)])
            made = replace(ladder(campaign, self.first, jobs=jobs, progress=True), campaign="known")
            made.write(Path(folder, "ladder"))
            with whole_file(self.figure) as beside:
                shutil.copyfile(Path(folder, "ladder", "ladder.png"), beside)
            write_text_whole(self.figures, json.dumps(self.figures_of(made), indent=1) + "\n")

    def figures_of(self, made: Ladder) -> dict[str, Any]:
        """Figures that are written beside the picture."""
        return {**made.to_json(), "first": self.first, "truth": self.truth, "version": self.version()}

    def blocks(self) -> dict[str, str]:
        """Figures of the ladder by the names of their blocks."""
        found = self.stated()
        return {self.name: ladder_block(found), f"{self.name}, short": ladder_short_block(found)}


WALL = RealPage(
    "wall",
    "wall.npz",
    "--label wall.npz=unknown --frame-rate-hz 20000 --rows 110 200 --columns 15 355 --holdout-share 0.5",
    DOCS / "wall_diagnosis.html",
)
MAPS = RealPage(
    "maps",
    "flat_335lux_maps.npz",
    "--label flat_335lux_maps.npz=relative --frame-rate-hz 20000",
    DOCS / "flat_maps_diagnosis.html",
)
PAGES: tuple[RealPage | LadderFigure, ...] = (WALL, MAPS, LadderFigure())


def done_by_command(words: Sequence[str]) -> None:
    """Run a `spikecam` command, which says itself why it fails.

    Raises:
        InputError: where it fails.
    """
    if run(list(words)):
        raise InputError(f"spikecam {' '.join(words)} failed")


def documents() -> list[Path]:
    """Where blocks of figures stand."""
    return [p for p in PAGES_OF_DOCS if re.search("^<!-- figures: ", p.read_text("utf-8"), re.MULTILINE)]


def all_blocks() -> dict[str, str]:
    """Every block of every page, by name."""
    return {name: text for page in PAGES for name, text in page.blocks().items()}


def write_blocks(say: Callable[[str], None] = print) -> None:
    """Write the figures into the documents."""
    blocks = all_blocks()
    for path in documents():
        text = path.read_text(encoding="utf-8")
        if filled(text, blocks) != text:
            write_text_whole(path, filled(text, blocks))
            say(f"{path.relative_to(REPOSITORY)}: figures written")


def main(data: Path = REAL, only: tuple[str, ...] = (), jobs: int = 1, anew: bool = False) -> None:
    """Make the pages whose code has changed, and write their figures into the docs.

    Args:
        data: folder of the real recordings; pages whose recording is not there are kept as they are.
        only: names of pages to look at: wall, maps, ladder.
        jobs: simulations at a time, which change no figure.
        anew: make pages that are up to date too.
    """
    by_name = {page.name: page for page in PAGES}
    for name in only:
        if name not in by_name:
            raise unknown_name("page", name, by_name)
    for name in only or by_name:
        page = by_name[name]
        lacking, started = page.lacking(data), time.perf_counter()
        if page.is_fresh() and not anew:
            print(f"{name}: up to date")
        elif lacking:
            print(f"{name}: kept as it is, though its code has changed: {lacking}")
        else:
            page.make(data, jobs)
            print(f"{name}: made in {time.perf_counter() - started:.0f} s")
    write_blocks()


if __name__ == "__main__":
    tyro.cli(main)
