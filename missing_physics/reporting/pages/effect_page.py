"""An effect's page: one self-contained HTML file, with a plot of the effect in a simulation."""

from __future__ import annotations

import os

from missing_physics.reporting.pages.html_report import asset, environment, policy
from reference_model.effects.base import Effect
from reference_model.effects.page import PLACES, facts, picture_of, range_of
from robot_model import write_atomically

__all__ = ["render_effect", "write_effect"]


def write_effect(effect: Effect, path: str | os.PathLike[str]) -> None:
    """Write the page to `path` atomically.

    Raises:
        InputError: the folder cannot be written.
    """
    write_atomically(path, render_effect(effect))


def render_effect(effect: Effect) -> str:
    """The page as text; only the picture, which belongs to this package, is not escaped."""
    picture = picture_of(effect)
    return (
        environment()
        .get_template("effect.html")
        .render(
            effect=effect,
            place=PLACES[effect.place].split(";")[0],
            facts=facts(effect),
            range_of=range_of,
            picture=picture.read_text("utf-8") if picture is not None else "",
            style=asset("style.css"),
            policy=policy(),
        )
    )
