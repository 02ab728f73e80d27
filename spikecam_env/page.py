"""Reports as one HTML file: style, tables and pictures inside it; nothing is fetched and nothing runs.

Text given to these functions is plain and is escaped here; only `parts` and `body` are HTML already.
"""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Iterable, Sequence

import matplotlib as mpl
from matplotlib.figure import Figure

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1060px; margin: 2em auto; padding: 0 1em; color: #222;
       overflow-wrap: break-word }
h1 { font-size: 1.5em; line-height: 1.3 } h2 { font-size: 1.15em; margin-top: 2em } h3 { font-size: 1em }
table { border-collapse: collapse; margin: .7em 0 }
td, th { padding: .25em .8em .25em 0; border-bottom: 1px solid #ddd; text-align: left; vertical-align: top }
.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap }
.wide { overflow-x: auto; max-width: 100% }
img { max-width: 100% } figure { margin: 1em 0 } figcaption { color: #555 }
pre { background: #f5f5f5; padding: .7em 1em; overflow-x: auto; font-size: .9em }
tr.identified td:nth-child(2) { color: #14663a } tr.assumed td:nth-child(2) { color: #8a5a00 }
tr.not td:nth-child(2) { color: #9a1c1c }
.warn { background: #fff4d6; padding: .5em 1em }
@media (max-width: 600px) {
  .optional { display: none }
  .stack thead { display: none } .stack, .stack tbody, .stack tr { display: block }
  .stack tr { border-bottom: 1px solid #bbb; padding: .3em 0 } .stack td { display: flex; border: 0; gap: .8em }
  .stack td::before { content: attr(data-label); flex: 0 0 7em; color: #666; text-align: left; white-space: normal }
  .stack td.n { text-align: left; white-space: normal }
}
"""


def page(title: str, parts: Iterable[str], style: str = "") -> str:
    """The whole file; `style` is CSS beside STYLE."""
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><title>{html.escape(title)}</title>'
        f"<style>{STYLE}{style}</style></head>\n<body>\n" + "\n".join(parts) + "\n</body></html>\n"
    )


def element(tag: str, text: str, **attributes: str) -> str:
    """An element that holds plain text; `class_` is its class."""
    named = "".join(f' {key.rstrip("_")}="{html.escape(value)}"' for key, value in attributes.items())
    return f"<{tag}{named}>{html.escape(text)}</{tag}>"


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    numbers: Sequence[int] = (),
    classes: Sequence[str] = (),
    stack: bool = False,
    optional: Sequence[int] = (),
) -> str:
    """A table of plain text that scrolls by itself where the page is narrow.

    Args:
        head: names of the columns.
        rows: cells of each row.
        numbers: columns aligned right.
        classes: of each row, in order.
        stack: on narrow screens a row becomes a block of lines, one a cell, each with its column's name.
        optional: columns that narrow screens do without.
    """

    def cell(text: str, column: int, tag: str) -> str:
        named = ["n"] * (column in numbers) + ["optional"] * (column in optional)
        attributes = {"class_": " ".join(named)} if named else {}
        if stack and tag == "td":
            attributes["data-label"] = head[column]
        return element(tag, text, **attributes)

    def line(cells: Sequence[str], tag: str, class_: str = "") -> str:
        inner = "".join(cell(text, i, tag) for i, text in enumerate(cells))
        return f'<tr class="{html.escape(class_)}">{inner}</tr>' if class_ else f"<tr>{inner}</tr>"

    body = "".join(line(row, "td", classes[i] if i < len(classes) else "") for i, row in enumerate(rows))
    opening = '<table class="stack">' if stack else "<table>"
    top = f"<thead>{line(head, 'th')}</thead>" if any(head) else ""
    return f'<div class="wide">{opening}{top}<tbody>{body}</tbody></table></div>'


def picture(drawn: Figure, alt: str, *, form: str = "svg", dpi: int = 110) -> str:
    """A matplotlib figure as an image inside the page, `svg` or `png`; the same bytes for the same figure."""
    held = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "spikecam", "svg.fonttype": "path"}):
        drawn.savefig(held, format=form, dpi=dpi, metadata={"Date": None} if form == "svg" else None)
    kind = "svg+xml" if form == "svg" else form
    data = base64.b64encode(held.getvalue()).decode("ascii")
    return f'<img alt="{html.escape(alt)}" src="data:image/{kind};base64,{data}">'


def captioned(image: str, caption: str) -> str:
    """An image (HTML) above its caption (plain text)."""
    return f"<figure>{image}<figcaption>{html.escape(caption)}</figcaption></figure>"
