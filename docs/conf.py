"""Sphinx configuration of the manual (`make docs`); works offline."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import generated

project = "polarsim"
author = "the polarsim contributors"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "matplotlib.sphinxext.plot_directive"]
templates_path: list[str] = []
exclude_patterns = ["generated.py", "paper"]

html_theme = "furo"
html_title = "polarsim"
html_static_path = ["static"]
html_css_files = ["tables.css"]
html_show_sourcelink = False
html_copy_source = False
html_show_copyright = False
smartquotes = False  # keep the dashes of options

myst_heading_anchors = 4
myst_links_external_new_tab = True

# Docstrings are plain text: words in single backticks are code, and `generated` escapes all other markup.
default_role = "literal"
autodoc_default_options = {"members": True, "undoc-members": True, "member-order": "bysource"}
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
maximum_signature_line_length = 100
napoleon_google_docstring = False
napoleon_use_param = False
napoleon_use_rtype = False
add_module_names = False

# Each build runs the code of the gallery to create its images.
plot_include_source = True
plot_html_show_source_link = False
plot_html_show_formats = False
plot_formats = [("png", 110)]
plot_rcparams = {"figure.figsize": (7, 4), "savefig.bbox": "tight", "font.size": 9}


def setup(app):
    """Connect the generators of text and the conversion of docstrings."""
    app.connect("source-read", generated.fill_page)
    app.connect("autodoc-process-docstring", generated.plain_docstring, priority=400)  # before napoleon reads it
    app.connect("autodoc-skip-member", generated.without_inherited)
    return {"parallel_read_safe": True}
