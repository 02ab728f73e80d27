"""The documentation as a site: `make docs`.  Additions of this repository are in tools/site."""

import inspect
import sys
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.util.inspect import stringify_signature

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from spikecam_env import __version__  # noqa: E402
from tools.site import films  # noqa: E402
from tools.site.docstrings import TASK_SECTIONS, as_restructured  # noqa: E402
from tools.site.pages import filled_in  # noqa: E402

project = "spikecam-env"
author = "the spikecam-env authors"
copyright = author
version = release = __version__
language = "en"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode", "sphinx_copybutton"]
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
autodoc_type_aliases = {name: name for name in ("Floats", "Pictures", "Spikes", "Masks")}  # of attributes
napoleon_numpy_docstring = False
napoleon_use_param = False  # entries such as `rows, columns: size` have two names
napoleon_use_rtype = False
napoleon_custom_sections = [(title, "returns_style") for title in TASK_SECTIONS]
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
    lines[:] = as_restructured("\n".join(lines), attribute=what in ("attribute", "data", "property"))


def read_signature(app, what, name, value, options, arguments, returned):
    """Types as they are written: `NDArray[np.float32]`, and not the class that this name stands for."""
    if what not in ("class", "function", "method"):
        return None
    try:
        signature = inspect.signature(value)
    except (TypeError, ValueError):  # of a class from elsewhere
        return None
    given = [p for p in signature.parameters.values() if p.name != "self"]
    arguments = stringify_signature(signature.replace(parameters=given), show_return_annotation=False)
    returned = signature.return_annotation
    return arguments, returned if what != "class" and isinstance(returned, str) else ""


def setup(app):
    films.setup(app)
    app.add_lexer("csv", TextLexer)  # Pygments has none
    app.connect("source-read", read_page)
    app.connect("autodoc-process-docstring", read_docstring, priority=400)  # before Napoleon
    app.connect("autodoc-process-signature", read_signature)
