"""Notebooks are the tutorials of today, run, with their pictures inside."""

from __future__ import annotations

import base64
import io
import json
import re
from typing import Any

import pytest
from PIL import Image

from tools.notebooks import NAMES, NOTEBOOKS, TUTORIALS, Cell, cells_of, executed, notebook
from tools.page_blocks import COMMANDS, PYTHON, blocks_of, command_lines

MOST_BYTES = 500_000
"""Of a notebook, its pictures included."""


def page(name: str) -> str:
    return (TUTORIALS / f"{name}.md").read_text(encoding="utf-8")


def committed(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((NOTEBOOKS / f"{name}.ipynb").read_text(encoding="utf-8"))
    return found


def sources(cells: list[dict[str, Any]]) -> list[tuple[str, str]]:
    return [(cell["cell_type"], "".join(cell["source"])) for cell in cells]


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_is_its_tutorial_of_today(name: str) -> None:
    today = json.loads(notebook(cells_of(page(name))))
    assert sources(committed(name)["cells"]) == sources(today["cells"]), f"python -m tools.notebooks {name}"


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_has_every_block_of_code_and_every_command_of_its_tutorial(name: str) -> None:
    blocks = [b for b in blocks_of(page(name)) if b.kind in (PYTHON, COMMANDS) and "not run" not in b.marks]
    code = [text for kind, text in sources(committed(name)["cells"]) if kind == "code"]
    assert len(code) == len(blocks)
    for block, text in zip(blocks, code, strict=True):
        shown = block.code if block.kind == PYTHON else "".join(f"!{line}\n" for line in command_lines(block.code))
        assert f"{text}\n" == shown


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_shows_its_pictures_and_is_small(name: str) -> None:
    outputs = [output for cell in committed(name)["cells"] for output in cell.get("outputs", ())]
    pictures = [output["data"]["image/png"] for output in outputs if "data" in output]
    size = (NOTEBOOKS / f"{name}.ipynb").stat().st_size
    print(f"{name}: {len(pictures)} pictures, {size} bytes")
    assert size < MOST_BYTES and len(pictures) == page(name).count("savefig(")
    for picture in pictures:
        assert min(Image.open(io.BytesIO(base64.b64decode(picture))).size) > 100
    assert not any(output["output_type"] == "error" for output in outputs)


@pytest.mark.parametrize("name", NAMES)
def test_a_tutorial_leads_to_its_notebook_whose_links_lead_somewhere(name: str) -> None:
    assert f"](../notebooks/{name}.ipynb)" in page(name)
    text = "\n".join(text for kind, text in sources(committed(name)["cells"]) if kind == "markdown")
    links = re.findall(r"\]\(([^)#\s]+)", text)
    assert links and not [link for link in links if not link.startswith("http") and not (NOTEBOOKS / link).exists()]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["first_camera"])
def test_a_notebook_runs(name: str) -> None:
    """The cells are those of its page, which `test_pages.py` runs: one of them says whether cells run."""
    ran = executed(cells_of(page(name)), small=True)
    assert sum(output["output_type"] == "display_data" for cell in ran for output in cell.outputs) == page(name).count(
        "savefig("
    )


def test_a_command_that_fails_stops_a_notebook() -> None:
    (block,) = blocks_of("```bash\nspikecam denoise nothing.h5\n```\n")
    with pytest.raises(RuntimeError, match=r"nothing\.h5"):
        executed([Cell("!spikecam denoise nothing.h5", block)])
