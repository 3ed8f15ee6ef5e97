"""Effects that leave a link with impossible mass properties: rejected by both engines with one message."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

import exudyn_model
from missing_physics.cli import UNUSABLE_INPUT, main
from reference_model.simulation import simulate
from robot_model import EffectUse, InputError, Recording, Robot, load_robot

ENGINES: Mapping[str, Callable[[Robot], Recording]] = {
    "reference": simulate,
    "exudyn": exudyn_model.simulate,
}


def robot_with(name: str, at: str, *used: tuple[str, Mapping[str, float]]) -> Robot:
    """A shipped robot whose motion is over soon."""
    robot = load_robot(name)
    assert robot.reference is not None
    effects = [EffectUse.model_validate({"effect": effect, "at": at, **values}) for effect, values in used]
    short = robot.reference.model_copy(update={"duration": 0.02, "sample_rate": 100.0})
    return robot.with_effects(*effects).model_copy(update={"reference": short})


#: Mass properties of a link of `two_link_arm`, and how far they may be changed.
ARM = "two_link_arm"
MISTAKES: Mapping[str, tuple[Robot, str]] = {
    "payload": (
        robot_with(ARM, "link2", ("payload", {"mass": -50.0})),
        r"robot 'two_link_arm': with its effects, link 'link2' has a mass of -\d.* kg, and no mass is "
        "negative; correct the parameters of the payload or inertia there, or its own mass and inertia.",
    ),
    "two effects together": (
        robot_with(ARM, "link2", ("payload", {"mass": -50.0}), ("inertia", {"mass": -50.0})),
        "link 'link2' has a mass of -",
    ),
    "negative moment": (
        robot_with(ARM, "link2", ("inertia", {"inertia_zz": -500.0})),
        r"link 'link2' has mass properties that no body has \(inertia has a negative principal moment",
    ),
    "triangle inequality": (
        robot_with(ARM, "link2", ("inertia", {"inertia_zz": 500.0})),
        r"link 'link2' has mass properties that no body has \(inertia breaks the triangle inequality",
    ),
    "taken from the end": (
        robot_with(ARM, "link2", ("payload", {"mass": -0.9, "x": 0.45})),
        r"link 'link2' has mass properties that no body has \(inertia has a negative principal moment",
    ),
    "base": (
        robot_with("six_joint_space_arm", "base", ("inertia", {"mass": -9e3})),
        "the base has a mass of -",
    ),
    "flexible link, where it bends": (
        robot_with("flexible_space_robot_planar", "link2", ("payload", {"mass": -900.0, "x": 1.0})),
        "link 'link2' has a mass of -",
    ),
    "flexible link, beside its axis": (
        robot_with("flexible_space_robot_planar", "link2", ("payload", {"mass": -30.0, "x": 5.0, "y": 3.0})),
        r"link 'link2' has mass properties that no body has \(inertia has a negative principal moment",
    ),
    "flexible link, its hub": (
        robot_with("flexible_space_robot_planar", "link2", ("inertia", {"inertia_zz": -900.0})),
        "link 'link2' has mass properties that no body has",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_both_engines_refuse_impossible_bodies_with_the_same_message(mistake: str) -> None:
    robot, sentence = MISTAKES[mistake]
    messages = []
    for run in ENGINES.values():
        with pytest.raises(InputError, match=sentence) as refused:
            run(robot)
        messages.append(str(refused.value))
    assert messages[0] == messages[1]


def point_with_payload() -> Robot:
    """The arm with a point mass as its second link, and a payload at the same point."""
    place = (0.21, 0.13, 0.07)
    robot = robot_with(ARM, "link2", ("payload", {"mass": 0.3, **dict(zip("xyz", place))}))
    point = robot.link("link2").model_copy(update={"center_of_mass": place, "inertia": (0.0, 0.0, 0.0)})
    return robot.model_copy(update={"links": (robot.links[0], point)})


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "robot",
    [
        robot_with(ARM, "link2", ("payload", {"mass": -0.5, "x": 0.25})),
        robot_with(ARM, "link2", ("payload", {"mass": 0.0})),
        robot_with(ARM, "link2", ("payload", {"mass": -50.0}), ("inertia", {"mass": 50.0})),
        robot_with(ARM, "base", ("inertia", {"mass": -500.0})),
        point_with_payload(),
    ],
    ids=[
        "a part taken away",
        "nothing",
        "one undoes the other",
        "a fixed base has no mass that matters",
        "rounding",
    ],
)
def test_realisable_bodies_are_simulated(robot: Robot, engine: str) -> None:
    assert len(ENGINES[engine](robot)) == 3


def test_a_fit_may_pass_through_such_bodies() -> None:
    robot = robot_with(ARM, "link2", ("inertia", {"inertia_zz": 500.0}))
    assert np.isfinite(simulate(robot, any_bodies=True)["joint2.position"]).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_the_command_prints_one_line_and_writes_no_file(
    engine: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    overlay, out = tmp_path / "lighter.toml", tmp_path / "out.csv"
    overlay.write_text('[[effects]]\neffect = "payload"\nat = "link2"\nmass = -50.0\n')
    words = ["simulate", ARM, "--overlay", str(overlay), "--engine", engine, "--out", str(out)]
    monkeypatch.setattr("sys.argv", ["missing-physics", *words])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == UNUSABLE_INPUT
    assert capsys.readouterr().err.count("\n") == 1
    assert not out.exists()
