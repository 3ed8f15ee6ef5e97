"""Presentation of a diagnosis: the HTML report, the rerun file and the printed summary.

Each is loaded on first use: a command that prints a table needs neither Plotly nor rerun.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from missing_physics.reporting.outputs import write_outputs
    from missing_physics.reporting.pages.html_report import write_html
    from missing_physics.reporting.pages.plot import figure_of
    from missing_physics.reporting.terminal.console import PlainConsole
    from missing_physics.reporting.terminal.summary import print_summary
    from missing_physics.reporting.viewer.file import write_rerun

__all__ = ["PlainConsole", "figure_of", "print_summary", "write_html", "write_outputs", "write_rerun"]

_HOME = {
    "PlainConsole": "terminal.console",
    "figure_of": "pages.plot",
    "print_summary": "terminal.summary",
    "write_html": "pages.html_report",
    "write_outputs": "outputs",
    "write_rerun": "viewer.file",
}


def __getattr__(name: str) -> Any:
    """A name of this package, loaded on demand with the libraries that it needs."""
    if name not in _HOME:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
