"""Pages are filled in as Sphinx reads them: the reference, and links to files that are no pages.

<!-- generated: commands -->        the command line reference
<!-- generated: api MODULE -->      public names of a module
<!-- generated: formats -->         the table of file formats
<!-- generated: benchmarks -->      speed by version
<!-- generated: settings -->        settings of a diagnosis
<!-- generated: parameters CLASS --> a table of its parameters
<!-- generated: task NAME -->       a task: the docstring of its class, and its scores
<!-- generated: page FILE -->       a page at the root
<!-- generated: part FILE TITLE --> a section of it, without its title

A link to a file of the repository becomes a download of it; a link to a folder, its name.  A link called by the name
of its page is called by the title of the page.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path, PurePosixPath

from tools.site import benchmarks, commands, parameter_table, settings, tasks
from tools.site.docstrings import as_restructured
from tools.site.films import as_directives
from tools.site.public import docstring_of, home_of, kind_of, names_of
from tools.site.sections import section

ROOT = Path(__file__).resolve().parents[2]
GENERATED = re.compile(r"^<!-- generated: (?P<what>\w+) ?(?P<of>[\w. ]*) -->$", re.MULTILINE)
LINK = re.compile(r"(?<!!)\[(?P<text>[^\]]*)\]\((?P<path>[^)#:\s]+)(?P<anchor>#[^)\s]*)?\)")
PAGES = {"README.md": "index.md", "CHANGELOG.md": "project/changelog.md", "CONTRIBUTING.md": "project/contributing.md"}
"""Files at the root that are pages of the site under another name."""


def filled_in(text: str, page: str) -> str:
    """The Markdown of a page as Sphinx is to read it.

    Args:
        text: the page.
        page: its path below docs, e.g. `reference/index.md`.
    """
    folder = PurePosixPath(page).parent
    whole = as_directives(GENERATED.sub(lambda found: generated(found["what"], found["of"], folder), text))
    return LINK.sub(lambda found: _link(found, folder), whole)


def generated(what: str, of: str, folder: PurePosixPath) -> str:
    """Markdown that stands for a comment of this module's docstring.

    Args:
        what: first word of the comment, e.g. `api`.
        of: the words after it, e.g. the name of a module.
        folder: of the page, below docs.
    """
    made: dict[str, Callable[[], str]] = {
        "api": lambda: "\n".join(_module(of)),
        "benchmarks": benchmarks.page,
        "commands": commands.page,
        "formats": _formats,
        "page": lambda: _from_root(of, folder),
        "parameters": lambda: parameter_table.page(of),
        "part": lambda: _from_root(of.partition(" ")[0], folder, of.partition(" ")[2]),
        "settings": settings.page,
        "task": lambda: tasks.page(of),
    }
    return made[what]()


def _formats() -> str:
    """The changelog's table of formats, which a test holds against the code."""
    [table] = re.findall(r"(?:^\|.*\n)+", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    return str(table)


def _from_root(file: str, folder: PurePosixPath, title: str = "") -> str:
    """A page at the root, or a section of it, for a page in a folder of docs: its links begin there."""
    text = (ROOT / file).read_text(encoding="utf-8")
    inside = section(text, title) if title else text
    return LINK.sub(lambda found: _moved(found, ROOT / "docs" / folder), inside)


def _moved(found: re.Match[str], folder: Path) -> str:
    path = found["path"] if "://" in found["path"] else os.path.relpath(ROOT / found["path"], folder)
    return f"[{found['text']}]({path}{found['anchor'] or ''})"


def _module(module: str) -> list[str]:
    """Sphinx's directives for a module and its public names, each with its docstring."""
    docstring = import_module(module).__doc__ or ""
    lines = [
        f"## {module}",
        "",
        "```{eval-rst}",
        f".. py:module:: {module}",
        "",
        *as_restructured(docstring),
        "```",
        "",
    ]
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
            text = ["   " + line for line in as_restructured(docstring_of(module, name))]
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
