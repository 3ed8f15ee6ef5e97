"""A controller uses the nominal robot file, whatever effects the robot has."""

from __future__ import annotations

import numpy as np
import pytest
from quick_ones import quick_places

from reference_model.plant.closed_loop import Plant
from reference_model.plant.truth import truth_of
from robot_model import ComputedTorque, EffectUse, Robot, load_robot


def effect(name: str, at: str, **parameters: float) -> EffectUse:
    return EffectUse.model_validate({"effect": name, "at": at, **parameters})


def controlled(name: str, model: str = "rigid") -> Robot:
    controller = ComputedTorque(kp=20.0, kd=9.0, model=model)
    return load_robot(name).model_copy(update={"controller": controller, "effects": ()})


CASES = [
    (controlled("two_link_arm"), effect("base_motion", "base", compliance=1e-4, mass=50.0, inertia=5.0)),
    (controlled("two_link_arm"), effect("link_flexibility", "link1", period=0.1)),
    (controlled("six_joint_space_arm"), effect("slosh", "base", mass=20.0, frequency=0.5)),
    (controlled("six_joint_space_arm"), effect("link_flexibility", "link3", period=0.1)),
    (controlled("flexible_space_robot"), effect("slosh", "base", mass=100.0, frequency=0.5)),
    (controlled("flexible_space_robot", "full"), effect("slosh", "base", mass=100.0, frequency=0.5)),
    (controlled("flexible_space_robot", "full"), effect("modal_damping", "link2", damping_ratio=0.1)),
    (controlled("flexible_space_robot", "full"), effect("link_flexibility", "link1", period=0.3)),
]


@pytest.mark.parametrize(("robot", "use"), quick_places(CASES, 0, 1, 2, 5))
def test_the_command_is_that_of_the_nominal_robot_in_the_measured_state(robot: Robot, use: EffectUse) -> None:
    real, described = Plant(robot.with_effects(use)), Plant(robot)
    rng = np.random.default_rng(5)
    state = 0.1 * rng.normal(size=real.layout.size)
    parts = real.layout.split(state)
    believed = np.zeros(described.layout.size)
    own = described.layout.split(believed)
    for name, part in own.items():
        if name in ("modal", "modal_rates"):
            for link in robot.flexible_links:
                there = real.tree.bodies[real.tree.index(link.name)]
                here = described.tree.bodies[described.tree.index(link.name)]
                rows = slice(there.modal, there.modal + there.modes)
                part[here.modal : here.modal + here.modes] = parts[name][rows]
        else:
            part[:] = parts[name][: len(part)]  # of a fixed base nothing
    goal = [rng.normal(size=real.layout.joints) for _ in range(3)]
    found, expected = (
        np.asarray(p.command(0.0, x, *goal)) for p, x in ((real, state), (described, believed))
    )
    # The same expressions of the same numbers.
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_a_robot_without_structure_effects_is_unchanged() -> None:
    robot = load_robot("six_joint_space_arm")
    assert truth_of(robot).robot is robot
