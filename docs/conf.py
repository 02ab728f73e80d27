"""The documentation as a site: `make docs`.  What is special to this repository is in tools/site."""

import inspect
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path

from pygments.lexers.special import TextLexer

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from spikecam_env import __version__  # noqa: E402
from tools.site import films  # noqa: E402
from tools.site.docstrings import rendered  # noqa: E402
from tools.site.pages import filled_in  # noqa: E402
from tools.site.signatures import signature_of  # noqa: E402

project = "spikecam-env"
author = "the spikecam-env authors"
copyright = author
version = release = __version__
language = "en"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "sphinx_copybutton"]
exclude_patterns = ["_build"]
myst_enable_extensions = ["deflist"]
myst_heading_anchors = 4
myst_links_external_new_tab = True
highlight_language = "text"
nitpicky = True
# Types in signatures: of numpy, torch and others no index is at hand, and a bare name may be that of many things.
nitpick_ignore_regex = [("py:.*", ".*")]
suppress_warnings = ["ref.python"]

autodoc_member_order = "bysource"
autodoc_inherit_docstrings = False
python_maximum_signature_line_length = 80
toc_object_entries_show_parents = "hide"

html_theme = "furo"
html_title = f"spikecam-env {version}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["films.js"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {"top_of_page_buttons": []}
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
pygments_style = "friendly"
pygments_dark_style = "github-dark"


def read_page(app, docname, source):
    source[0] = filled_in(source[0], f"{docname}.md")


def read_docstring(app, what, name, value, options, lines):
    lines[:] = rendered("\n".join(lines), arguments(value))


def read_signature(app, what, name, value, options, signature, return_annotation):
    if what in ("class", "function", "method"):
        return signature_of(value, bound=what == "method" and not inspect.ismethod(value))
    return None


def arguments(value):
    """Names that a docstring may explain as `name: meaning`."""
    names = {f.name for f in fields(value)} if is_dataclass(value) else set()
    try:
        return names | set(inspect.signature(value).parameters)
    except (TypeError, ValueError):  # what is built in has none
        return names


def setup(app):
    films.setup(app)
    app.add_lexer("csv", TextLexer)  # Pygments has none
    app.connect("source-read", read_page)
    app.connect("autodoc-process-docstring", read_docstring)
    app.connect("autodoc-process-signature", read_signature)
