"""The robot file with the findings in it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from missing_physics.bodies.written import body_of, rounded
from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.preparation.setup import InertialBasis
from missing_physics.diagnosis.terms.real_bodies import nearest_real
from missing_physics.diagnosis.terms.term import Term
from missing_physics.results.result import Finding
from reference_model.effects.base import GearEffect
from reference_model.effects.catalogue import get_effect
from reference_model.evaluation.model import RobotModel
from robot_model import EffectUse, Robot

__all__ = [
    "augmented_robot",
    "rounded",
    "uses_of",
    "with_combinations",
    "with_findings",
    "with_inertial",
    "with_masses",
]

Array = NDArray[np.float64]

#: Masses that a regression moved are others than in the robot file where chance does it this rarely.
SURELY_OTHERS = 0.01


def augmented_robot(robot: Robot, terms: Sequence[Term]) -> Robot:
    """`robot` with exactly these effects: the nominal ones re-estimated, the findings added.

    What the robot lists of its gears stays: it is no term of the torque.
    """
    gears = [use for use in robot.effects if isinstance(get_effect(use.effect), GearEffect)]
    return robot.model_copy(update={"effects": (*uses_of(terms), *gears)})


def uses_of(terms: Sequence[Term]) -> tuple[EffectUse, ...]:
    """Terms as a robot file holds them."""
    return tuple(
        EffectUse(effect=t.effect.id, at=t.at, **{k: rounded(v) for k, v in t.own.items()}) for t in terms
    )


def with_findings(robot: Robot, findings: Sequence[Finding]) -> Robot:
    """An augmented robot, with what was found between encoders in it as well."""
    there = {(use.effect, use.at) for use in robot.effects}
    return robot.with_effects(
        *(
            EffectUse(effect=f.effect, at=f.location, **{k: e.value for k, e in f.parameters.items()})
            for f in findings
            if (f.effect, f.location) not in there
        )
    )


def with_masses(robot: Robot, basis: InertialBasis, best: Explanation) -> tuple[Robot, str]:
    """`robot` with the masses of an explanation, where these are known to be others.

    Returns:
        As `with_combinations`.
    """
    size, told = best.nuisance.size, best.view.told
    if told is not None:
        return with_combinations(robot, basis, told.values, told.covariance)
    if size == 0 or best.regression.wald_p_value(np.arange(size)) > SURELY_OTHERS:
        return robot, ""
    return with_combinations(robot, basis, best.nuisance, best.regression.covariance())


def with_combinations(
    robot: Robot, basis: InertialBasis, values: Array, covariance: Array
) -> tuple[Robot, str]:
    """`robot` with other mass properties, and a sentence when those of no real bodies are.

    Where the change of fewest numbers is none of real bodies, others that the data tell as little are moved
    with them (`terms/real_bodies.py`).

    Args:
        basis: the combinations.
        values: of these, shape (B,).
        covariance: of all that was estimated, the combinations first, shape (K, K).
    """
    directions = basis.first(values.size)
    found, remark = with_inertial(robot, basis.names, directions @ values)
    if not remark:
        return found, ""
    model, size = RobotModel(robot), values.size
    change = nearest_real(
        basis.names,
        model.inertial[basis.columns],
        directions,
        basis.scale,
        values,
        covariance[:size, :size],
    )
    return (robot, remark) if change is None else with_inertial(robot, basis.names, change)


def with_inertial(robot: Robot, names: Sequence[str], change: Array) -> tuple[Robot, str]:
    """`robot` with changed inertial numbers, and a sentence when they would not be physical.

    Args:
        names: inertial numbers as in `RobotModel.inertial_names`.
        change: what is added to each, shape (len(names),).
    """
    model = RobotModel(robot)
    numbers = dict(zip(model.inertial_names, model.inertial))
    for name, delta in zip(names, change):
        numbers[name] += float(delta)
    data = robot.model_dump(mode="python")
    bodies = [data["base"]] if model.free_base else []
    bodies += list(data["links"])
    labels = (["base"] if model.free_base else []) + [link.name for link in robot.links]
    for label, body in zip(labels, bodies):
        body.update(body_of(numbers, label))
    for joint in data["joints"]:
        reflected = numbers.get(f"{joint['name']}.reflected_inertia", 0.0)
        before = robot.joint(joint["name"]).actuator
        if before is not None and reflected >= 0:
            joint["actuator"] = {
                **joint["actuator"],
                "rotor_inertia": rounded(reflected / before.gear_ratio**2),
            }
    data["links"] = tuple(bodies[-len(robot.links) :])
    try:
        return Robot.model_validate(data), ""
    except ValidationError:
        return robot, (
            "the re-estimated mass properties are not those of real bodies one by one (the data fix only "
            "combinations of them), so the augmented robot keeps the nominal ones"
        )
