"""What is filled in as Sphinx reads a page of docs: the reference, and links to files that are no pages.

<!-- generated: commands -->        the command line reference
<!-- generated: api MODULE -->      what a module offers
<!-- generated: formats -->         the table of file formats
<!-- generated: benchmarks -->      speed by version
<!-- generated: settings -->        settings of a diagnosis
<!-- generated: page FILE -->       a page at the root

A link to a file of the repository becomes a download of it; a link to a folder, its name.  A link called by the name
of its page is called by the title of the page.
"""

from __future__ import annotations

import os
import re
from importlib import import_module
from pathlib import Path, PurePosixPath

from tools.site import benchmarks, commands, settings
from tools.site.docstrings import rendered
from tools.site.public import docstring_of, home_of, kind_of, names_of

ROOT = Path(__file__).resolve().parents[2]
GENERATED = re.compile(r"^<!-- generated: (?P<what>\w+) ?(?P<of>[\w.]*) -->$", re.MULTILINE)
LINK = re.compile(r"(?<!!)\[(?P<text>[^\]]*)\]\((?P<path>[^)#:\s]+)(?P<anchor>#[^)\s]*)?\)")
PAGES = {"README.md": "index.md", "CHANGELOG.md": "project/changelog.md", "CONTRIBUTING.md": "project/contributing.md"}
"""Files at the root that are pages of the site under another name."""


def filled_in(text: str, page: str) -> str:
    """The Markdown of a page as Sphinx is to read it.  page: its path below docs, e.g. `reference/index.md`."""
    whole = GENERATED.sub(lambda found: generated(found["what"], found["of"]), text)
    return LINK.sub(lambda found: _link(found, PurePosixPath(page).parent), whole)


def generated(what: str, of: str = "") -> str:
    """The reference of the command line or of a module, tables of formats, benchmarks or settings, or a page at the
    root."""
    if what == "api":
        return "\n".join(_module(of))
    if what == "page":
        return _from_root(of)
    return {"commands": commands.page, "formats": _formats, "benchmarks": benchmarks.page, "settings": settings.page}[
        what
    ]()


def _formats() -> str:
    """The changelog's table of formats, which a test holds against the code."""
    [table] = re.findall(r"(?:^\|.*\n)+", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    return str(table)


def _from_root(file: str) -> str:
    """A page at the root as one of docs/project: its links begin there."""
    text = (ROOT / file).read_text(encoding="utf-8")
    return LINK.sub(lambda found: _moved(found, ROOT / "docs" / "project"), text)


def _moved(found: re.Match[str], folder: Path) -> str:
    path = found["path"] if "://" in found["path"] else os.path.relpath(ROOT / found["path"], folder)
    return f"[{found['text']}]({path}{found['anchor'] or ''})"


def _module(module: str) -> list[str]:
    """Sphinx's directives for a module and all that it offers, each with its docstring."""
    docstring = import_module(module).__doc__ or ""
    lines = [f"## {module}", "", "```{eval-rst}", f".. py:module:: {module}", "", *rendered(docstring), "```", ""]
    for name in names_of(module):
        value = getattr(import_module(module), name)
        kind = kind_of(value)
        directive = f".. auto{kind}:: {module}.{name}"
        if home_of(module, name) != module:
            lines += [
                "```{eval-rst}",
                f":py:obj:`{name} <{home_of(module, name)}.{name}>` is offered here too.",
                "```",
                "",
            ]
        elif kind == "data":
            text = ["   " + line for line in rendered(docstring_of(module, name))]
            lines += ["```{eval-rst}", f".. py:data:: {name}", f"   :module: {module}", "", *text, "```", ""]
        elif kind != "module":
            lines += ["```{eval-rst}", directive, *(["   :members:"] if kind == "class" else []), "```", ""]
    return lines


def _link(found: re.Match[str], folder: PurePosixPath) -> str:
    """The link where its target is a page or a file, else its text."""
    target = (ROOT / "docs" / folder / found["path"]).resolve()
    if not target.is_relative_to(ROOT) or not target.exists():
        return found[0]  # Sphinx says that it leads nowhere
    within = target.relative_to(ROOT).as_posix()
    if found["text"].strip("`") == target.name and target.suffix == ".md" and not found["anchor"]:
        return _link(LINK.match(f"[]({found['path']})") or found, folder)  # the page's title is put there
    if within in PAGES:
        up = "../" * len(folder.parts)
        return f"[{found['text']}]({up}{PAGES[within]}{found['anchor'] or ''})"
    return found["text"] if target.is_dir() else found[0]
