"""The HTML report: one file that needs no network, opens from a disk and prints.

All text is autoescaped; figures are JSON that cannot close its script element. As a second barrier the page
has a content security policy that allows no requests, and only the two scripts written by this module, by
their
digests: injected code would not run.
"""

from __future__ import annotations

import base64
import hashlib
import os
from functools import cache
from importlib import resources

from jinja2 import Environment, PackageLoader, StrictUndefined
from plotly.offline import get_plotlyjs

from missing_physics.reporting.elements.selection import short_names
from missing_physics.reporting.sections import SECTIONS
from missing_physics.results.result import Result
from robot_model import Robot, write_atomically

__all__ = ["asset", "environment", "policy", "render_html", "write_html"]


def write_html(result: Result, robot: Robot, path: str | os.PathLike[str]) -> None:
    """Write the report of `result` for the nominal `robot` to `path` atomically.

    Raises:
        InputError: the folder cannot be written.
    """
    write_atomically(path, render_html(result, robot))


def render_html(result: Result, robot: Robot) -> str:
    """The report as text."""
    names = short_names(result)
    made = [maker(result, robot) for maker in SECTIONS]
    library, script = get_plotlyjs().replace("</script", "<\\/script"), asset("figures.js")
    return (
        environment()
        .get_template("report.html")
        .render(
            robot=robot,
            recordings=[names[name] for name in result.diagnosis.recordings],
            validation=[names[name] for name in result.diagnosis.validation],
            sections=[section for section in made if section is not None],
            style=asset("style.css"),
            library=library,
            script=script,
            policy=policy(library, script),
        )
    )


@cache
def environment() -> Environment:
    """The templates of this package, with every text escaped."""
    return Environment(
        loader=PackageLoader("missing_physics.reporting"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def asset(name: str) -> str:
    """Text of a file among the templates."""
    return resources.files("missing_physics.reporting").joinpath("templates", name).read_text("utf-8")


def policy(*scripts: str) -> str:
    """No request of any kind; scripts only by digest; styles that plotly writes; pictures it makes itself."""
    digests = " ".join(f"'sha256-{_digest(script)}'" for script in scripts)
    return (
        f"default-src 'none'; script-src {digests}; style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
