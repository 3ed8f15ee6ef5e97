"""Columns of effects that change a flexible link: forces on its modes, and the resulting joint torques.

The motion of the modes is computed with the link of the robot file. With the changed link, it leaves forces
in the equations of base, joints and modes. The modes respond to them with the changed stiffness and damping;
the further change of velocities is neglected (`missing_physics.evaluation.vibration.response`). If the effect
changes a parameter of a beam, the motion of the modes is integrated again.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses.term import Term
from missing_physics.inference.kept import step_of
from missing_physics.inference.torques.runs import Run
from missing_physics.standard.prediction import Along
from reference_model.dynamics.tree import flexible_bodies
from reference_model.effects.structure import StructureEffect
from reference_model.evaluation.model import RobotModel
from robot_model import Robot

__all__ = ["of_link"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Unit:
    """Changes along one motion per unit of an effect's parameter.

    Attributes:
        forces: residual of the equations of motion, shape (N, rows).
        stiffness, damping: changes of the modes' matrices, shape (s, s) each.
    """

    forces: Array
    stiffness: Array
    damping: Array


def of_link(term: Term, effect: StructureEffect, run: Run) -> Array:
    """Columns of an effect that changes a flexible link, see `columns.columns_of`.

    If the recordings are linearised at a beam parameter that the effect changes, they are linear in it.
    """
    (p,) = effect.parameters
    value = term.parameters[p.name]
    number = f"{term.at}.{effect.beam_number}"
    place = run.model.inertial_names.index(number) if number in run.model.inertial_names else None
    if place is not None and run.along.inertial[place] != 0.0:
        slope = run.rows.inertial[:, :, place]
        return np.stack([slope * value, slope] if term.free else [slope * value], axis=2)
    step = step_of(term, p)
    if place is not None:
        first, second = (_with_beam_parameter(run, place, each) for each in (value, value + step))
    else:
        unit = _unit(run, effect, term.at)
        first, second = (_joint_torques(run, unit, each) for each in (value, value + step))
    columns = [first, (second - first) / step] if term.free else [first]
    return run.rows.nuisance.removed(run.reduce(np.stack(columns, axis=2)))


def _with_beam_parameter(run: Run, place: int, value: float) -> Array:
    """Joint torques due to a beam parameter that is zero in the linearisation, shape (N, n)."""
    numbers = run.along.inertial.copy()
    numbers[place] = value
    return Along.of(run.model, run.motion, numbers).needed - run.along.needed


def _joint_torques(run: Run, unit: _Unit, value: float) -> Array:
    """Joint torques due to a value of an effect's parameter, shape (N, n)."""
    before = run.along.response
    assert before is not None
    response = before.with_elasticity(
        before.stiffness + value * unit.stiffness, before.damping + value * unit.damping
    )
    return response.at_joints(value * unit.forces[:, :, None])[:, :, 0]


def _unit(run: Run, effect: StructureEffect, link: str) -> _Unit:
    key = effect.id, link
    if key not in run.reshaped:
        run.reshaped[key] = _made(run, effect, link)
    found = run.reshaped[key]
    assert isinstance(found, _Unit)
    return found


def _made(run: Run, effect: StructureEffect, link: str) -> _Unit:
    (p,) = effect.parameters
    along, motion = run.along, run.motion
    changed = _changed(run.model.robot, effect, link)
    state = motion.position, motion.velocity, motion.acceleration
    after, before = (
        model.inverse_dynamics(*state, base=along.base, inner=along.inner, inertial=along.inertial)
        for model in (changed, run.model)
    )
    elastic = zip(changed.elasticity(along.inertial), run.model.elasticity(along.inertial))
    stiffness, damping = ((one - other) / p.typical for one, other in elastic)
    return _Unit((after - before) / p.typical, stiffness, damping)


@lru_cache
def _changed(robot: Robot, effect: StructureEffect, link: str) -> RobotModel:
    """The model with a typical value of the effect's parameter."""
    (p,) = effect.parameters
    values = {p.name: p.typical}
    other = effect.changed(robot, link, values)
    bodies = flexible_bodies(other)
    bodies[link] = effect.reshaped(bodies[link], values)
    return RobotModel(other, bodies=bodies, beams=True)
