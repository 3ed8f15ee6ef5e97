"""Changes of base and flexible links along a known joint motion, against simulations of the changed robot."""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.motion.estimate import Motion
from missing_physics.diagnosis.responses.passive_channels import PassiveResponses
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.catalogue import get_effect
from reference_model.evaluation.model import RobotModel
from reference_model.passive.prescribed import prescribed
from robot_model import EffectUse, Recording, Robot, load_robot

Array = NDArray[np.float64]

SPIN = {"momentum_x": 5.0, "momentum_y": -3.0, "momentum_z": 4.0, "torque_x": 0.1, "torque_z": -0.2}
LIQUID = {"mass": 80.0, "frequency": 0.6, "damping_ratio": 0.02, "x": 0.2, "y": 0.1, "z": -0.2}
FLEXIBLE, RIGID, SLEWING = "flexible_space_robot", "six_joint_space_arm", "flexible_space_robot_planar"
CASES: tuple[tuple[str, str, str, dict[str, float]], ...] = (
    (FLEXIBLE, "modal_damping", "link2", {"damping_ratio": 0.05}),
    (FLEXIBLE, "reaction_wheel", "base", SPIN),
    (SLEWING, "centrifugal_stiffening", "link2", {"strength": 0.7}),
    (FLEXIBLE, "slosh", "base", LIQUID),
    (FLEXIBLE, "payload", "link2", {"mass": 6.0, "x": 6.0}),
    (RIGID, "reaction_wheel", "base", SPIN),
    (RIGID, "slosh", "base", {**LIQUID, "mass": 12.0}),
)
#: Matrices that hold for a 128th of the motion leave that part of what a change does, twice for two moves.
ERRS = 0.03
#: What channels are compared on: those of the base and of the link that bends.
LINK = ("link2.strain.1", "link2.tip_acceleration.y", "base.angular_velocity.z")
SEEN = {FLEXIBLE: LINK, SLEWING: LINK, RIGID: ()}
#: Ways of the joints [rad] beside the small waves: a beam stiffens where it slews.
SLEWS = {SLEWING: (1.5, 0.5)}


@lru_cache(maxsize=3)
def moving(shipped: str) -> tuple[Robot, Array, tuple[Array, Array, Array]]:
    """A robot without effects, time, and a motion of its joints from rest."""
    robot = load_robot(shipped).model_copy(update={"effects": ()})
    time = np.linspace(0.0, 4.0, 401)
    speeds = 2.0 + 0.5 * np.arange(len(robot.moving_joints))
    turns, amplitude = speeds * time[:, None], 0.04 / speeds
    # (1 - cos)^2 starts with three derivatives of nothing
    wave, slope, bend = 1.0 - np.cos(turns), np.sin(turns), np.cos(turns)
    position = amplitude * wave**2
    velocity = amplitude * speeds * 2 * wave * slope
    acceleration = amplitude * speeds**2 * 2 * (slope**2 + wave * bend)
    if shipped in SLEWS:
        ways, turn, phase = np.array(SLEWS[shipped]), 2 * np.pi / 4.0, 2 * np.pi / 4.0 * time[:, None]
        position = position + ways * (phase - np.sin(phase)) / (2 * np.pi)
        velocity = velocity + ways * turn * (1.0 - np.cos(phase)) / (2 * np.pi)
        acceleration = acceleration + ways * turn**2 * np.sin(phase) / (2 * np.pi)
    return robot, time, (position, velocity, acceleration)


@lru_cache(maxsize=3)
def dynamics(shipped: str) -> MotionDynamics:
    robot, time, (position, velocity, acceleration) = moving(shipped)
    rate = 1.0 / (time[1] - time[0])
    motion = SimpleNamespace(
        time=time,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        low_pass=SimpleNamespace(rate=rate),
    )
    return MotionDynamics(RobotModel(robot), cast(Motion, motion))


def term(effect: str, at: str, values: dict[str, float]) -> Term:
    known = get_effect(effect)
    return Term(known, at, {**{p.name: p.default or 0.0 for p in known.parameters}, **values})


def simulated(shipped: str, *uses: EffectUse) -> Recording:
    robot, time, state = moving(shipped)
    return prescribed(robot.with_effects(*uses), time, *state)


def apart(found: Any, true: Any) -> float:
    return float(np.sqrt(np.mean((np.asarray(found) - true) ** 2) / np.mean(np.asarray(true) ** 2)))


@pytest.mark.parametrize(("shipped", "effect", "at", "values"), CASES)
def test_what_it_adds_is_what_simulations_of_both_robots_differ_by(
    shipped: str, effect: str, at: str, values: dict[str, float]
) -> None:
    use = EffectUse.model_validate({"effect": effect, "at": at, **values})
    robot, one, other = moving(shipped)[0], simulated(shipped, use), simulated(shipped)
    outputs, seen = PassiveResponses(dynamics(shipped)).shown(term(effect, at, values), SEEN[shipped])
    true = np.column_stack([one[f"{j.name}.torque"] - other[f"{j.name}.torque"] for j in robot.moving_joints])
    assert apart(outputs[:, :, 0], true) < ERRS
    for k, channel in enumerate(SEEN[shipped]):
        assert apart(seen[:, k, 0], one[channel] - other[channel]) < ERRS, channel


@pytest.mark.parametrize(("shipped", "effect", "at", "values"), CASES[:4])
def test_its_derivatives_are_those_of_what_it_adds(
    shipped: str, effect: str, at: str, values: dict[str, float]
) -> None:
    responses, here = PassiveResponses(dynamics(shipped)), term(effect, at, values)
    outputs, _ = responses.shown(here)
    for k, parameter in enumerate(here.estimated):
        step = 1e-3 * max(abs(here.parameters[parameter.name]), parameter.typical)
        ends = []
        for sign in (1.0, -1.0):
            moved = {**here.parameters, parameter.name: here.parameters[parameter.name] + sign * step}
            if moved[parameter.name] < 0.0 == parameter.lower:
                continue
            ends.append((sign, responses.shown(term(effect, at, moved))[0][:, :, 0]))
        if len(ends) < 2:
            continue
        slope = (ends[0][1] - ends[1][1]) / (2 * step)
        # The sum of errors of two differences, of first and of second order in steps of 1e-4 and 1e-3.
        assert apart(outputs[:, :, 1 + k], slope) < 5e-3, parameter.name
