"""Write the notebooks of the pages as files that Colab, Deepnote and Jupyter open, or run them.

``python docs/make_notebooks.py`` writes ``notebooks/NAME.ipynb`` of each page: a first cell that
installs the package, then the cells of the page, without outputs; links lead to the site.
``python docs/make_notebooks.py --run WHEEL`` runs them, each in an environment that has nothing but
what Jupyter needs and the first cell installs, the wheel in place of what PyPI has.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import time
import tomllib
import venv
from pathlib import Path
from posixpath import normpath
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "notebooks"
#: Pages that are notebooks, in the order in which they are to be read; a module and its extra, or a
#: program, that a page needs beside the package.
PAGES = {
    "docs/notebooks/tracking.md": "",
    "docs/notebooks/own_law.md": "jax",
    "docs/notebooks/contact.md": "dot",
    "notebooks/shield.md": "",
    "notebooks/campaign.md": "",
}
URLS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["urls"]
#: Longest time of a notebook [s].
MOST = 180.0
_CELL = re.compile(r"^```\{code-cell\} ipython3\n(.*?)^```$\n?", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\]\((?!https?:)([^)#]*)(#[^)]*)?\)")
# On Colab and Deepnote these install; where all is there they do nothing.
_INSTALL = {
    "": """\
from importlib.util import find_spec

if find_spec("drake_rnn") is None:
    %pip install --quiet drake-rnn""",
    "jax": """\
from importlib.util import find_spec

if find_spec("drake_rnn") is None or find_spec("jax") is None:
    %pip install --quiet "drake-rnn[jax]\"""",
    "dot": """\
from importlib.util import find_spec
from shutil import which

if find_spec("drake_rnn") is None:
    %pip install --quiet drake-rnn
if which("dot") is None:
    !apt-get install -qq -y graphviz > /dev/null""",
}


def notebook_of(page: str) -> dict[str, Any]:
    """Return the notebook of a page, in the format of Jupyter, without outputs."""
    text = (ROOT / page).read_text().split("---\n", 2)[2].strip() + "\n"
    head, *rest = _CELL.split(text)
    title, _, opening = head.strip().partition("\n")
    cells = [_markdown(f"{title}\n\n{_badges(page)}"), _code(_INSTALL[PAGES[page]])]
    for number, part in enumerate((opening, *rest)):
        if part := part.strip():
            cells.append(_code(part) if number % 2 else _markdown(_with_whole_links(page, part)))
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    cells = [{"id": f"cell-{number}", **cell} for number, cell in enumerate(cells)]
    return {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}


def _badges(page: str) -> str:
    """Return the links that open a notebook in a browser."""
    place = (
        f"{URLS['Repository'].removeprefix('https://')}/blob/main/notebooks/{Path(page).stem}.ipynb"
    )
    colab = f"https://colab.research.google.com/github/{place.partition('/')[2]}"
    return f"[Open in Colab]({colab}) · [Open in Deepnote](https://deepnote.com/launch?url=https://{place})"


def _with_whole_links(page: str, text: str) -> str:
    """Return a text whose links to other pages lead to the site."""

    def whole(link: re.Match[str]) -> str:
        place = normpath(str(Path(page).parent / link[1])) if link[1] else page
        site = f"{URLS['Documentation']}/en/stable/{place.removesuffix('.md')}.html"
        return f"]({site}{link[2] or ''})"

    return _LINK.sub(whole, text)


def _markdown(text: str) -> dict[str, Any]:
    return {"cell_type": "markdown", "metadata": {}, "source": text.splitlines(keepends=True)}


def _code(text: str) -> dict[str, Any]:
    source = text.splitlines(keepends=True)
    return {
        "cell_type": "code",
        "execution_count": None,
        "metadata": {},
        "outputs": [],
        "source": source,
    }


def text_of(page: str) -> str:
    """Return the text of a notebook's file."""
    return json.dumps(notebook_of(page), indent=1, ensure_ascii=False) + "\n"


def run(page: str, wheel: Path, folder: Path) -> float:
    """Run a notebook in a new environment, and return how long it took without it [s].

    Args:
        page: The page.
        wheel: What is installed where the first cell asks for the package.
        folder: Folder for the environment.

    Raises:
        SystemExit: If a cell fails.
    """
    venv.create(folder / "venv", with_pip=True)
    python = folder / "venv" / "bin" / "python"
    # With an extra, pip takes no address as a constraint; this version is found in the folder.
    constraint = folder / "constraint.txt"
    constraint.write_text(f"drake-rnn=={wheel.name.split('-')[1]}\n")
    jupyter = ("ipykernel", "nbclient", "nbformat")
    install = (python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    subprocess.run((*install, *jupyter), check=True)
    links = f"{wheel.resolve().parent} {os.environ.get('PIP_FIND_LINKS', '')}".strip()
    file = folder / f"{Path(page).stem}.ipynb"
    file.write_text(text_of(page))
    # As a service in the web has it: nothing of this folder, and the first cell finds the wheel.
    surroundings = {
        **{name: value for name, value in os.environ.items() if not name.startswith("PYTHON")},
        "PIP_CONSTRAINT": str(constraint),
        "PIP_FIND_LINKS": links,
        "PIP_DISABLE_PIP_VERSION_CHECK": "1",
        "PATH": f"{python.parent}:{os.environ['PATH']}",
    }
    surroundings.pop("MPLBACKEND", None)
    began = time.monotonic()
    done = subprocess.run(
        (python.parent / "jupyter-execute", "--timeout=600", "--inplace", file),
        cwd=folder,
        env=surroundings,
        check=False,
    )
    if done.returncode:
        raise SystemExit(f"{page}: a cell fails, see above")
    return time.monotonic() - began


def main() -> None:
    """Write the notebooks, or run them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", type=Path, metavar="WHEEL", help="run them with this wheel")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="only notebooks of these names")
    options = parser.parse_args()
    pages = [page for page in PAGES if Path(page).stem in (options.only or {Path(page).stem})]
    for page in pages:
        if options.run is None:
            (FOLDER / f"{Path(page).stem}.ipynb").write_text(text_of(page))
            continue
        with TemporaryDirectory(prefix="notebook_") as folder:
            took = run(page, options.run, Path(folder))
        print(f"{took:6.1f} s  {page}", file=sys.stderr)
        if took > MOST:
            raise SystemExit(f"{page}: took {took:.0f} s, more than {MOST:g} s")


if __name__ == "__main__":
    main()
