"""The description on PyPI: README.md, whose links lead to the repository there.

All else that is built is said in `pyproject.toml`.
"""

import re
import tomllib
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def with_whole_links(text: str) -> str:
    """Return a page whose links to files of the repository are addresses of this version's."""
    repository, tag = PROJECT["urls"]["Repository"], f"v{PROJECT['version']}"
    text = re.sub(
        r"!\[([^\]]*)\]\((?!https:)([^)]+)\)",
        lambda link: f"![{link[1]}]({repository}/raw/{tag}/{link[2]})",
        text,
    )
    return re.sub(
        r"\]\((?!https:|#)([^)]+)\)", lambda link: f"]({repository}/blob/{tag}/{link[1]})", text
    )


if __name__ == "__main__":
    readme = with_whole_links((ROOT / "README.md").read_text(encoding="utf-8"))
    setup(long_description=readme, long_description_content_type="text/markdown")
