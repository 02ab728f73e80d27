"""Films that play within a page.

A line that begins with a link to an .mp4 becomes that film, with the rest of the line below it; lines that follow each
other become a gallery.  The line is a link wherever else the page is read:

    [fan](films/fan.mp4): `spikecam scenes fan --film fan.mp4`

The film lies beside its poster, a JPEG of the same name.
"""

from __future__ import annotations

import posixpath
import re
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.util.docutils import SphinxDirective

FILM = re.compile(r"^\[(?P<name>[^\]]+)\]\((?P<path>[^)\s]+\.mp4)\)(?:: (?P<below>.*))?$")
SPIKECAM = re.compile(r"`(spikecam [^`]+)`")
SHOWN = re.compile(r"(?:^\[[^\]]+\]\([^)\s]+\.mp4\)(?:: .*)?$\n?)+", re.MULTILINE)
"""Lines of films that follow each other."""


@dataclass(frozen=True)
class Line:
    """A film as a line of a page."""

    name: str
    """By which the page calls it."""
    path: str
    """From the page's folder."""
    below: str
    """Markdown that is shown below the film."""

    @property
    def command(self) -> str:
        """The command that makes the film; empty where the line has none."""
        found = SPIKECAM.search(self.below)
        return found[1] if found else ""


def lines_of(text: str) -> list[Line]:
    """Films of a page, in its order."""
    found = (FILM.match(line) for line in text.splitlines())
    return [Line(m["name"], m["path"], m["below"] or "") for m in found if m]


def as_directives(text: str) -> str:
    """A page with its lines of films as the directives that `setup` adds to Sphinx."""
    return SHOWN.sub(lambda found: _gallery(lines_of(found[0])), text)


def poster_of(film: Path) -> Path:
    """The picture that is shown before a film plays."""
    return film.with_suffix(".jpg")


def setup(app: Any) -> None:
    """Add the directive, and how its node becomes HTML; other writers leave it out."""
    app.add_directive("film", FilmDirective)
    app.add_node(FilmNode, html=(_visit_html, _leave), **{other: (_skip, None) for other in ("latex", "text", "man")})


def _gallery(films: list[Line]) -> str:
    each = (f"```{{film}} {film.path}\n:name: {film.name}\n\n**{film.name}**\n\n{film.below}\n```\n" for film in films)
    return f"````{{container}} films\n{''.join(each)}````\n"


class FilmNode(nodes.General, nodes.Element):  # type: ignore[misc]
    """A film; `film` and `poster` are names among the site's downloads, `name` is its name on the page."""


class FilmDirective(SphinxDirective):
    """The film that its argument names, from the page's folder, and the text below it."""

    required_arguments = 1
    has_content = True
    option_spec: ClassVar = {"name": directives.unchanged}

    def run(self) -> list[nodes.Node]:
        """A figure: the film, and its caption."""
        found, whole = self.env.relfn2path(self.arguments[0])
        names = [found, posixpath.relpath(poster_of(Path(found)).as_posix())]
        if not Path(whole).is_file() or not poster_of(Path(whole)).is_file():
            raise self.error(f"{found} and its poster {names[1]} are not both there: python -m tools.films")
        for name in names:
            self.env.note_dependency(name)
        film, poster = (self.env.dlfiles.add_file(self.env.docname, name) for name in names)
        figure = nodes.container(classes=["film"])
        figure += FilmNode(film=film, poster=poster, name=self.options["name"])
        self.state.nested_parse(self.content, self.content_offset, figure)
        return [figure]


def _visit_html(writer: Any, node: FilmNode) -> None:
    film, poster = (posixpath.join(writer.builder.dlpath, node[part]) for part in ("film", "poster"))
    writer.body.append(
        f'<video src="{escape(film)}" poster="{escape(poster)}" aria-label="{escape(node["name"])}" '
        f'controls muted loop playsinline preload="none"><a href="{escape(film)}">{escape(node["name"])}</a></video>'
    )


def _leave(writer: Any, node: FilmNode) -> None:
    pass


def _skip(writer: Any, node: FilmNode) -> None:
    raise nodes.SkipNode
