"""Settings of the documentation site.

Build it with `sphinx-build -W -c docs . build/site`: the source folder is that of the repository, so links
between the documents, README.md and CONTRIBUTING.md are the same there and on the site.
"""

import os
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
os.environ["TQDM_DISABLE"] = "1"  # no progress bars in what the tutorial prints
sys.path[:0] = [str(ROOT), str(ROOT / "docs")]

from wavefront.version import VERSION  # noqa: E402

project = "wavefront"
author = "the wavefront developers"
copyright = "the wavefront developers, MIT license"
version = release = VERSION

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_gallery.gen_gallery",
    "sphinx-mathjax-offline",  # formulas without another server
]
root_doc = "docs/index"
include_patterns = ["docs/**", "README.md", "CONTRIBUTING.md", "CHANGELOG.md", "benchmarks/README.md"]
exclude_patterns = [".[!.]*", ".[!.]*/**", "build/**", "docs/tutorial/**", "docs/_templates/**"]
exclude_patterns += [f"docs/generated/**/*.{ending}" for ending in ("py", "ipynb", "zip")]
templates_path = [str(ROOT / "docs" / "_templates")]
default_role = "py:obj"
suppress_warnings = ["config.cache"]  # sphinx-gallery's settings hold functions

html_theme = "furo"
html_title = f"wavefront {VERSION}"
html_additional_pages = {"index": "to_the_index.html"}
html_show_sphinx = False
html_copy_source = False

myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
myst_dmath_allow_digits = myst_dmath_allow_space = False

autosummary_generate = True
autodoc_typehints = "none"  # numpydoc's sections say what an argument is
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

sphinx_gallery_conf = {
    "examples_dirs": "docs/tutorial",
    "gallery_dirs": "docs/generated/tutorial",
    "filename_pattern": r"/\d\d_",
    "ignore_pattern": r"tracer\.py",
    "within_subsection_order": "FileNameSortKey",
    "image_scrapers": ("saved_pictures.scraper",),
    "reset_modules": (),
    "capture_repr": (),
    "min_reported_time": 1e9,
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "abort_on_example_error": True,
    "remove_config_comments": True,
    "write_computation_times": False,
    "plot_gallery": "True",
}

LINKED = re.compile(r"^- \[.*?\]\((\S+?)(?:#\S*)?\)", re.MULTILINE)
TUTORIAL = re.compile(r"\]\((docs/|)tutorial/README\.rst\)")
TOCTREE = "\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{pages}\n```\n"


def links_to_the_tutorial(app, docname, source):
    """Point links to the tutorial's scripts to the pages that sphinx-gallery makes of them."""
    source[0] = TUTORIAL.sub(r"](\1generated/tutorial/index.rst)", source[0])
    if docname == "docs/generated/tutorial/index":
        source[0] = (
            re.sub(r"<(\d\w+)\.py>`_", r"<\1.html>`_", source[0])
            .replace("<tracer.py>`_", "<09_the_library.html>`_")
            .replace("<../algorithm.md>`_", "<../../algorithm.html>`_")
            .replace("<../gallery.md>`_", "<../../gallery.html>`_")
        )


def contents_from_lists(app, docname, source):
    """Give the start page a table of contents for each section of pages.md: the pages of its list."""
    if docname != root_doc:
        return
    text = source[0]
    lists = (ROOT / "docs" / "pages.md").read_text("utf-8")
    lists = TUTORIAL.sub(r"](\1generated/tutorial/index.rst)", lists)
    for section in re.split(r"^## ", lists, flags=re.MULTILINE)[1:]:
        caption = section.partition("\n")[0]
        pages = "\n".join(dict.fromkeys(_page_of(link) for link in LINKED.findall(section)))
        text += TOCTREE.format(caption=caption, pages=pages)
    source[0] = text + TOCTREE.format(caption="All", pages="/docs/pages")


def _page_of(link: str) -> str:
    """Return the name of the page, from the root of the site, to which a link of pages.md leads."""
    path = (ROOT / "docs" / link).resolve().relative_to(ROOT)
    return f"/{path.with_suffix('').as_posix()}"


def setup(app):
    """Connect what this file adds to Sphinx."""
    app.connect("source-read", links_to_the_tutorial, priority=400)
    app.connect("source-read", contents_from_lists)
