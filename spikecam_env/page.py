"""Reports as one HTML file: style, tables and pictures inside it; nothing is fetched and nothing runs.

Text is plain and is escaped, here as in the templates beside the modules (`*.html.jinja`); `Markup` is HTML already.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

import matplotlib as mpl
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parent),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
"""By their paths from this folder."""


def page(title: str, parts: Iterable[str]) -> str:
    """The whole file, of parts that are HTML already."""
    return TEMPLATES.get_template("page.html.jinja").render(title=title, parts=[Markup(part) for part in parts])


def element(tag: str, text: str, class_: str = "") -> Markup:
    """An element that holds text."""
    named = f' class="{class_}"' if class_ else ""
    return Markup(f"<{tag}{named}>{{}}</{tag}>").format(text)


def table(
    head: Sequence[str], rows: Iterable[Sequence[str]], *, numbers: Sequence[int] = (), classes: Sequence[str] = ()
) -> Markup:
    """A table that scrolls by itself where the page is narrow.

    Args:
        head: names of the columns.
        rows: texts.
        numbers: columns aligned right.
        classes: of each row, in order.
    """
    return Markup(_part("table", head, list(rows), numbers, classes))


def captioned(image: str, caption: str) -> Markup:
    """An image above its caption."""
    return Markup(_part("captioned", Markup(image), caption))


def _part(name: str, *arguments: object) -> str:
    return str(getattr(TEMPLATES.get_template("parts.html.jinja").module, name)(*arguments))


def picture(drawn: Figure, alt: str, *, form: str = "svg", dpi: int = 110) -> Markup:
    """A matplotlib figure as an image inside the page, the same bytes for the same figure.

    Args:
        drawn: the figure.
        alt: its text for those who do not see it.
        form: "svg" or "png".
        dpi: of a PNG.
    """
    held = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "spikecam", "svg.fonttype": "path"}):
        drawn.savefig(held, format=form, dpi=dpi, metadata={"Date": None} if form == "svg" else None)
    kind = "svg+xml" if form == "svg" else form
    data = base64.b64encode(held.getvalue()).decode("ascii")
    return Markup('<img alt="{}" src="data:image/{};base64,{}">').format(alt, kind, data)
