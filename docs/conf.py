"""How the pages are built: ``pip install -e '.[docs]'``, then ``sphinx-build -W --keep-going docs docs/_build/html``.

Sphinx, since the API of pymoo, NumPy, SciPy and PyVista is read in it: numpydoc's docstrings, links between projects,
galleries made of scripts; MyST, since all other text here is Markdown.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

from elsewhere import PACKAGE, SOURCE, TYPES, URLS, linkcode_resolve  # noqa: F401, since Sphinx calls the last

project = "meshsimp_pymoo"
author = "the meshsimp_pymoo contributors"
project_copyright = author
release = version = PACKAGE["Version"]

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.extlinks",
    "sphinx.ext.linkcode",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "elsewhere",
    "pictures",
    "tables",
]
exclude_patterns = ["_build", "_ext", "examples", "gallery/*.ipynb"]
# A name of ours that is spelled out leads somewhere; other words between backticks may be anything.
nitpicky = True
nitpick_ignore_regex = [(r"py:.*", r"(?!meshsimp_pymoo\.).*")]
default_role = "py:obj"

# {repo}`tests/record/record.py` is a link to a file of the repository; a test looks whether it is there.
extlinks = {"repo": (f"{SOURCE}/%s", "%s")}
extlinks_detect_hardcoded_links = True

myst_enable_extensions = ["attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 120

templates_path = ["_templates"]
autosummary_generate = True
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # numpydoc says them in words, as parameters
numpydoc_show_class_members = False
numpydoc_xref_param_type = True
numpydoc_xref_ignore = "all"
numpydoc_xref_aliases = TYPES

copybutton_prompt_text = "$ "
copybutton_selector = "div:not(.highlight-output) > div.highlight pre"
copybutton_exclude = ".linenos, .gp, .go"

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "abort_on_example_error": True,
    "capture_repr": (),
    "thumbnail_size": (600, 420),
    "download_all_examples": False,
    "min_reported_time": 3600,
    "remove_config_comments": True,
    "within_subsection_order": "pictures.place",
    "show_signature": False,
    "write_computation_times": False,
}

html_theme = "pydata_sphinx_theme"
html_title = project
html_static_path = ["_static"]
html_css_files = ["custom.css"]
html_favicon = "_static/logo.svg"
html_show_sourcelink = False
html_sidebars = {"start": [], "contributing": []}  # no section is around them
html_theme_options = {
    "logo": {"text": project, "image_light": "_static/logo.svg", "image_dark": "_static/logo.svg"},
    "github_url": URLS["Source"],
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "header_links_before_dropdown": 7,
    "navbar_persistent": ["search-button"],
    "secondary_sidebar_items": {"**": ["page-toc"], "gallery/index": []},
    "footer_start": ["copyright"],
    "footer_end": ["sphinx-version"],
}
