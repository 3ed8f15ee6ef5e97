"""The pages of the documentation site, collected from the repository.

    python docs/pages.py

Copies pages and pictures into ``build/pages`` with the same relative paths, so that links work, and runs the
notebook ``docs/notebook.py``. MkDocs builds the site from them (`make site`); no network is needed.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

__all__ = ["PAGES", "main"]

ROOT = Path(__file__).resolve().parents[1]
PAGES = ROOT / "build" / "pages"
#: Copied content: pages and pictures of these folders, and top-level pages.
FOLDERS, TOP = ("docs", "examples", "reports/evidence"), ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")
ENDS = (".md", ".svg", ".png")


def main() -> None:
    """See the module."""
    shutil.rmtree(PAGES, ignore_errors=True)
    found = [ROOT / name for name in TOP]
    found += [path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.suffix in ENDS]
    for path in found:
        target = PAGES / path.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target)
    notebook()


def notebook() -> None:
    """Run the notebook and write it as a page."""
    made = PAGES / "docs" / "notebook.ipynb"
    run = [sys.executable, "-m"]
    subprocess.run(
        [*run, "jupytext", "--quiet", "--to", "ipynb", "-o", made, ROOT / "docs" / "notebook.py"], check=True
    )
    subprocess.run(
        [*run, "nbconvert", "--log-level=ERROR", "--execute", "--to", "markdown", made], check=True
    )
    made.unlink()


if __name__ == "__main__":
    main()
