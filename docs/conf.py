"""Settings of the site: `make docs` builds it into `build/site`.

The source folder is the root of the repository, so that links between the pages of docs/, diagrams/
and models/ lead on the site where they lead on a code host.
"""

from __future__ import annotations

import os
import sys
from importlib.metadata import version as version_of
from pathlib import Path

ROOT = Path(__file__).parents[1]
SITE = Path(__file__).parent / "site"
# The machinery of the site, and examples that notebooks import.
sys.path[:0] = [str(SITE), str(ROOT)]

from kernels import fingerprint, kernel_settings  # noqa: E402
from local_mathjax import NAME, bundled  # noqa: E402
from palette import furo_variables  # noqa: E402

project = "drake_rnn"
author = "the drake_rnn developers"
version = version_of("drake-rnn")
# Between releases, pages tell more than the last version has.
changes = (ROOT / "CHANGELOG.md").read_text().partition("## [Unreleased]\n")[2]
release = f"after {version}" if changes.partition("\n## ")[0].strip() else version

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
    # In docs/site/:
    "caption_levels",
    "default_role",
    "plain_types",
    "playback_links",
    "search_texts",
    "source_pages",
    "unit_signs",
]

root_doc = "docs/index"
include_patterns = [
    *("README.md", "CONTRIBUTING.md", "CHANGELOG.md"),
    *("COMPATIBILITY.md", "SECURITY.md", "CODE_OF_CONDUCT.md", "notebooks/*.md"),
    *("docs/*.md", "docs/*/*.md", "docs/*/*.rst"),
    *("diagrams/README.md", "diagrams/campaigns/README.md", "diagrams/experiments/README.md"),
    "models/README.md",
]
exclude_patterns = [".*", "build", "dist", "out", "**.egg-info", "docs/site"]
# References that lead nowhere are warnings, and warnings stop the build.
nitpicky = True
# A name in single backticks is code in docstrings; one that is public is a link, too.
default_role = "name"

# -- Pages -------------------------------------------------------------------------------------

myst_enable_extensions = ["amsmath", "attrs_block", "colon_fence", "dollarmath"]
# Formulas as code hosts write them: a fenced block of the language `math`.
myst_fence_as_directive = ["math"]
# Anchors of headings as on a code host, for all levels.
myst_heading_anchors = 6

# -- Notebooks ---------------------------------------------------------------------------------

# What was run once is run again only after a change, of the notebook or of the package.
nb_execution_mode = "cache"
nb_execution_cache_path = str(ROOT / "build" / "notebooks" / fingerprint(ROOT / "drake_rnn"))
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True
# Kernels inherit these: figures are shown as notebooks show them, and there is no warning of a
# connection that does not leave the machine, nor a history.
os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"
os.environ["IPYTHONDIR"] = str(kernel_settings(ROOT / "build" / "ipython"))

# -- Reference from the code -------------------------------------------------------------------

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_typehints_format = "short"
autodoc_default_options = {"members": True}
napoleon_numpy_docstring = False
napoleon_use_rtype = False
python_use_unqualified_type_names = True
add_module_names = False
# Attributes stand in the text of a class, as they are written, and not once more below it.
napoleon_use_ivar = True
# Names of types that are no classes.
nitpick_ignore = [("py:class", name) for name in ("Metric", "Number", "Size", "Task", "the state")]
# Classes of others, and their typing.
nitpick_ignore_regex = [
    ("py:.*", r"(numpy|np|npt|pydrake|jax|pydantic|pathlib|collections|typing|types|abc)(\..*)?"),
]

# -- Looks -------------------------------------------------------------------------------------

html_theme = "furo"
html_title = f"drake_rnn {release}"
# Of several versions, search engines are to show the one that Read the Docs names.
html_baseurl = os.environ.get("READTHEDOCS_CANONICAL_URL", "")
templates_path = [str(SITE / "templates")]
html_static_path = [str(SITE / "static"), str(bundled())]
mathjax_path = NAME
html_css_files = ["site.css"]
html_extra_path = [str(SITE / "root")]
if (played := ROOT / "build" / "gallery").is_dir():
    html_extra_path.append(str(played))
html_theme_options = {
    "light_css_variables": furo_variables(dark=False),
    "dark_css_variables": furo_variables(dark=True),
    "navigation_with_keys": True,
}
# Results of a search are ordered, and have excerpts, without a server.
html_search_scorer = str(SITE / "search.js")
html_show_search_summary = False
html_show_sphinx = False
html_show_copyright = False
html_copy_source = False
html_show_sourcelink = False
pygments_style = "friendly"
pygments_dark_style = "github-dark"
