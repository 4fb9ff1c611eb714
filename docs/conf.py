"""Sphinx: ``make docs`` builds the site from these pages, the docstrings and the contracts."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import generated  # noqa: E402

import ridgebayes as rb  # noqa: E402

project = "ridgebayes"
author = "The ridgebayes authors"
version = release = rb.__version__
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
    "sphinx_design",
    "sphinx_copybutton",
]
exclude_patterns = ["_build", "_generated", "gallery"]
html_theme = "pydata_sphinx_theme"
html_title = "ridgebayes"
html_theme_options = {"show_prev_next": False, "secondary_sidebar_items": ["page-toc"]}
html_show_sourcelink = False
# Pages without others below them have nothing for the left.
html_sidebars = {"start": [], "changelog": []}

# Scripts of the gallery are not run here: `make gallery` stores their figures, each script shows
# its own, and tests hold the figures against the scripts.
sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "examples",
    "plot_gallery": False,
    "filename_pattern": ".",
    "within_subsection_order": "FileNameSortKey",
    "notebook_extensions": {},
    "write_computation_times": False,
    "show_signature": False,
    "thumbnail_size": (600, 340),
}
html_static_path = ["_static"]
html_extra_path = ["_generated/extra"]
html_css_files = ["site.css"]

# Notebooks are shown as they are stored; tests run them.
nb_execution_mode = "off"
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3

autodoc_typehints = "none"  # the docstrings have types, with shapes and units
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True  # a default is shown by its name
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
nitpick_ignore_regex = [
    # Other packages: nothing is fetched from their sites.
    (
        r"py:.*",
        r"(abc|arviz|collections|concurrent|emcee|matplotlib|numpy|os|pandas|scipy|typing|xarray)\..*",
    ),
]

generated.write_pages(HERE / "_generated")
generated.write_report(HERE / "_generated" / "extra")
generated.write_names(HERE / "names")
generated.copy_notebooks(HERE.parent / "notebooks", HERE / "notebooks")
