"""A page of a diagnosis, read back: its sentence, its version, and paragraphs and tables by section."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path


@dataclass(frozen=True)
class Table:
    """Text of its cells.  head: of the columns, empty where it has none."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def without(self, *columns: str) -> Table:
        """The table without columns of these names."""
        kept = [i for i, name in enumerate(self.head or self.rows[0]) if not self.head or name not in columns]
        return Table(
            tuple(self.head[i] for i in kept if self.head), tuple(tuple(row[i] for i in kept) for row in self.rows)
        )


@dataclass(frozen=True)
class Text:
    """A paragraph, a heading, code or a line of a list, by its tag: p, h3, pre or li."""

    tag: str
    text: str


Part = Text | Table


@dataclass(frozen=True)
class Page:
    """What a page says.  verdict: its heading; sections: parts in order, by the section's anchor."""

    verdict: str
    sentence: str
    subject: str
    sections: dict[str, list[Part]]

    @property
    def version(self) -> str:
        """The version and the code that made it, as the page says it; empty where it does not."""
        said = re.search(r"spikecam-env \S+, code \w+", self.subject)
        return said[0] if said else ""

    @property
    def about(self) -> str:
        """What was compared with what, without the seconds that it took."""
        return self.subject.rpartition(". ")[0]

    def texts(self, section: str, tag: str) -> list[str]:
        """Texts of a section with this tag."""
        return [p.text for p in self.sections.get(section, ()) if isinstance(p, Text) and p.tag == tag]

    def tables(self, section: str) -> list[Table]:
        """Tables of a section."""
        return [p for p in self.sections.get(section, ()) if isinstance(p, Table)]


def read_page(path: Path) -> Page:
    """Read a page that `spikecam diagnose` wrote.  Raises OSError where there is none."""
    reader = _Reader()
    reader.feed(path.read_text(encoding="utf-8"))
    reader.close()
    verdict, sentence, subject = [part.text for part in reader.sections.pop("") if isinstance(part, Text)][:3]
    return Page(verdict, sentence, subject, reader.sections)


_TEXTS = ("h1", "h3", "p", "pre", "li")


@dataclass
class _Reader(HTMLParser):
    """Collects parts as tags close; what stands before the first section has the anchor ""."""

    sections: dict[str, list[Part]] = field(default_factory=lambda: {"": []})
    section: str = ""
    said: str = ""
    head: tuple[str, ...] = ()
    rows: list[tuple[str, ...]] = field(default_factory=list)
    cells: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "section":
            self.section = dict(attrs).get("id") or ""
            self.sections[self.section] = []
        elif tag == "table":
            self.head, self.rows = (), []
        elif tag == "tr":
            self.cells = []
        if tag in (*_TEXTS, "td", "th"):
            self.said = ""

    def handle_data(self, data: str) -> None:
        self.said += data

    def handle_endtag(self, tag: str) -> None:
        if tag in ("td", "th"):
            self.cells.append(self.said)
        elif tag == "tr":
            self.rows.append(tuple(self.cells))
        elif tag == "thead":
            self.head = self.rows.pop()
        elif tag == "table":
            self.sections[self.section].append(Table(self.head, tuple(self.rows)))
        elif tag in _TEXTS:
            self.sections[self.section].append(Text(tag, self.said))
