"""The notebook runs, and the site navigation lists existing pages."""

from __future__ import annotations

import runpy
import warnings
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]


def listed(entries: object) -> list[str]:
    """Files of a navigation, at any depth."""
    if isinstance(entries, str):
        return [entries]
    values = entries.values() if isinstance(entries, dict) else entries
    return [name for value in values for name in listed(value)]  # type: ignore[attr-defined]


def test_the_site_navigation_lists_exactly_the_existing_pages() -> None:
    pages = listed(yaml.safe_load((ROOT / "mkdocs.yml").read_text("utf-8"))["nav"])
    made = {"docs/notebook.md"}  # of docs/notebook.py
    assert [page for page in pages if page not in made and not (ROOT / page).is_file()] == []
    own = {f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md")}
    assert own - set(pages) == set()


@pytest.mark.proof
def test_the_notebook_finds_the_simulated_friction(capsys: pytest.CaptureFixture[str]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        left = runpy.run_path(str(ROOT / "docs" / "notebook.py"))
    friction = left["friction"]
    assert (friction.effect, friction.location) == ("coulomb_friction", "pivot")
    assert friction.parameters["torque"].value == pytest.approx(0.35, rel=0.02)
    assert "<mujoco" in capsys.readouterr().out
    assert any(
        "joint 'pivot'" in words
        for words in left["edited_file"](left["content"], left["folder"] / "pendulum.urdf").changed
    )
