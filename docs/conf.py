"""The docs as a site: `sphinx-build -W -n docs docs/_build/html`; nothing is fetched.

The pages of the reference that tables of the program decide (keys, commands, columns, exit codes)
are written into `reference/generated/` before each build, by `_tools`.
"""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from _tools.generate import write_pages  # noqa: E402
from tautwave import __version__  # noqa: E402

project = "tautwave"
author = "the tautwave authors"
copyright = f"{author}, Apache-2.0"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc", "sphinx.ext.intersphinx"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build", "examples", "**/examples/**", "reference/generated/keys/**"]
templates_path: list[str] = []

# -- Markdown ------------------------------------------------------------------------------------
myst_enable_extensions = ["deflist", "fieldlist", "colon_fence"]
myst_heading_anchors = 4
myst_links_external_new_tab = False

# -- the program's own docstrings ----------------------------------------------------------------
autosummary_generate = False  # numpydoc brings it along
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"
default_role = "code"  # docstrings are Markdown at heart: one backtick is code

# -- other people's names: inventories kept in the repo ------------------------------------------
intersphinx_mapping = {
    "python": ("https://docs.python.org/3.11", str(HERE / "_inventories" / "python.inv")),
}
intersphinx_timeout = 0.001
nitpick_ignore = [
    ("py:class", "pydantic.main.BaseModel"),  # no inventory of it is kept
]

# -- pages ---------------------------------------------------------------------------------------
html_theme = "furo"
html_title = f"tautwave {version}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["copy.js"]
html_copy_source = False
html_show_sphinx = False
highlight_language = "text"


def setup(app):  # type: ignore[no-untyped-def]
    """Write the generated pages before Sphinx looks for pages."""
    app.connect("config-inited", lambda *_: write_pages(HERE / "reference" / "generated"))
