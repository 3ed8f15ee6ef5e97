"""A changed robot with additional coordinates, linearised along the motion of the nominal robot."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from missing_physics.motion.base.rates import Rates
from reference_model.evaluation.model import RobotModel
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.inner_motion import InnerMotion

__all__ = ["Changed", "Slope", "masses_of"]

Array = NDArray[np.float64]

#: Finite difference step of modal coordinates [sqrt(kg) m] and rates: a centimetre of a hundred kilograms.
SMALL = 0.1
#: Fields of a flexible body that depend on its elasticity only.
ELASTIC = frozenset({"stiffness", "damping", "frequencies"})


def masses_of(model: RobotModel) -> tuple[object, ...]:
    """Key that is equal for models differing only in their elasticity."""
    bodies = [body.flexible for body in model.tree.bodies if body.flexible is not None]
    shapes = [
        np.asarray(getattr(body, field.name)).tobytes()
        for body in bodies
        for field in fields(body)
        if field.name not in ELASTIC
    ]
    return model.robot.joints, model.inertial.tobytes(), *shapes


@dataclass(frozen=True)
class Slope:
    """Derivatives by a parameter of the quantities that depend on masses.

    Attributes:
        mass, forces, momentum: of the mass matrix, of inverse dynamics and of the momentum by deflections.
    """

    mass: Array
    forces: Array
    momentum: Array


class Changed:
    """The new modes of a changed robot, driven by the joint and base motion of the nominal robot.

    Args:
        model: of the changed robot, with the joints of the nominal one; undeformed, its bodies are the same.
        rates: of the nominal robot.

    Attributes:
        elasticity: stiffness and damping of its modes, shape (s, s) each.
    """

    def __init__(self, model: RobotModel, rates: Rates) -> None:
        self._model, some = model, rates.instants
        self._joints, inner = rates.along(some)
        base = rates.base
        self._base = BaseMotion(
            base.attitude[some],
            base.angular_velocity[some],
            base.linear_velocity[some],
            base.angular_acceleration[some],
            base.linear_acceleration[some],
        )
        measured = {body.name for body in rates.dynamics.model.tree.bodies}
        bodies = [body for body in model.tree.bodies if body.flexible is not None]
        known = [body.modal + k for body in bodies if body.name in measured for k in range(body.modes)]
        self._known = np.array(known, dtype=int)
        self._new = np.setdiff1d(np.arange(model.tree.modal), self._known)
        modes = np.zeros((3, len(self._joints[0]), model.tree.modal))
        if inner is not None:
            for part, own in zip(modes, (inner.modal, inner.modal_rates, inner.modal_accelerations)):
                part[:, self._known] = own
        none = np.zeros((len(self._joints[0]), 0))
        self._inner = InnerMotion(none, none, none, *modes)
        self._mass = model.mass_matrix(self._joints[0], base=self._base)
        self.elasticity = model.elasticity()
        self._weightless = np.append(model.inertial[:-3], np.zeros(3))

    def bending_as(self, model: RobotModel) -> Changed:
        """The same masses with the elasticity of another model; mass-dependent quantities are reused."""
        for kept in (self.inertia, self.force, self._turns):
            assert kept is not None
        found = copy(self)
        found.elasticity = model.elasticity()
        return found

    def slope(self, other: Changed, step: float) -> Slope:
        """Derivatives of mass-dependent quantities, by the difference to a robot one step away."""
        pairs = zip(self._mass_dependent, other._mass_dependent)
        return Slope(*((theirs - own) / step for own, theirs in pairs))

    def moved(self, slope: Slope, step: float) -> Changed:
        """The robot with its mass-dependent quantities extrapolated by a step along a slope."""
        found = copy(self)
        for name in ("_lever", "inertia", "force", "_turns"):
            found.__dict__.pop(name, None)
        parts = (slope.mass, slope.forces, slope.momentum)
        values = (own + step * part for own, part in zip(self._mass_dependent, parts))
        found._mass, found._forces, found._momentum_by_place = values
        return found

    @property
    def _mass_dependent(self) -> tuple[Array, Array, Array]:
        return self._mass, self._forces, self._momentum_by_place

    @property
    def _rows(self) -> slice:
        return slice(self._model.rows - self._model.tree.modal, self._model.rows)

    @cached_property
    def _lever(self) -> Array:
        """M_sb M_bb^-1, shape (G, s, 6)."""
        coupled = self._mass[:, :6, self._rows]
        return np.asarray(np.linalg.solve(self._mass[:, :6, :6], coupled).transpose(0, 2, 1))

    @cached_property
    def inertia(self) -> Array:
        """Inertia of the modes with the base free, shape (G, s, s)."""
        rows = self._rows
        return np.asarray(self._mass[:, rows, rows] - self._lever @ self._mass[:, :6, rows])

    @cached_property
    def _forces(self) -> Array:
        """Generalised forces that the motion needs, shape (G, rows)."""
        return self._model.inverse_dynamics(*self._joints, base=self._base, inner=self._inner)

    @cached_property
    def force(self) -> Array:
        """Forces of the nominal motion on the new modes, shape (G, s); zero on the known modes."""
        found = -self._forces[:, self._rows]
        found[:, self._known] = 0.0
        return found

    @cached_property
    def turning(self) -> tuple[Array, Array]:
        """Change of stiffness and damping of the new modes due to the rotation, shape (G, s, s) each.

        The base moves with the modes so that the momentum is conserved.
        """
        by_place, by_rate = (np.zeros_like(self.inertia) for _ in range(2))
        carried = self._momentum_by_place
        for k in self._new:
            moved = self._inner.modal.copy()
            moved[:, k] += SMALL
            moves = np.linalg.solve(self._mass[:, :6, :6], SMALL * carried[:, :, k, None])
            twist = np.asarray(-moves[:, :, 0])
            by_place[:, :, k] = self._change(twist, replace(self._inner, modal=moved))
            moved = self._inner.modal_rates.copy()
            moved[:, k] += SMALL
            by_rate[:, :, k] = self._change(
                -SMALL * self._lever[:, k], replace(self._inner, modal_rates=moved)
            )
        stiffness, damping = self.elasticity  # already included in inverse dynamics
        by_place[:, :, self._new] -= SMALL * stiffness[:, self._new]
        by_rate[:, :, self._new] -= SMALL * damping[:, self._new]
        return by_place / SMALL, by_rate / SMALL

    def _change(self, twist: Array, inner: InnerMotion) -> Array:
        """Change of the forces on the modes with the base free, shape (G, s)."""
        base = replace(
            self._base,
            linear_velocity=self._base.linear_velocity + twist[:, :3],
            angular_velocity=self._base.angular_velocity + twist[:, 3:],
        )
        change = self._model.inverse_dynamics(*self._joints, base=base, inner=inner) - self._forces
        return np.asarray(change[:, self._rows] - (self._lever @ change[:, :6, None])[:, :, 0])

    @cached_property
    def _momentum_by_place(self) -> Array:
        """Derivative of the total momentum by deflections of the new modes, shape (G, 6, s)."""
        found = np.zeros((len(self._mass), 6, self._model.tree.modal))
        before = self._momentum(self._inner.modal)
        for k in self._new:
            moved = self._inner.modal.copy()
            moved[:, k] += SMALL
            found[:, :, k] = (self._momentum(moved) - before) / SMALL
        return found

    def _momentum(self, modal: Array) -> Array:
        """Momentum M v about the base's origin in its axes, shape (G, 6): the forces at accelerations v."""
        position, velocity, _ = self._joints
        still = np.zeros_like(velocity)
        base = BaseMotion(
            self._base.attitude,
            np.zeros_like(self._base.angular_velocity),
            np.zeros_like(self._base.linear_velocity),
            self._base.angular_velocity,
            self._base.linear_velocity,
        )
        inner = replace(
            self._inner,
            modal=modal,
            modal_rates=np.zeros_like(modal),
            modal_accelerations=self._inner.modal_rates,
        )
        needed = self._model.inverse_dynamics(
            position, still, velocity, base=base, inner=inner, inertial=self._weightless
        )
        return np.asarray(needed[:, :6])

    def turned(self, places: Array, rates: Array) -> Array:
        """Angular rates of the base for deflections and rates of the modes, (G, s, C) each to (G, 3, C)."""
        by_place, by_rate = self._turns
        return np.asarray(by_place @ places + by_rate @ rates)

    @cached_property
    def _turns(self) -> tuple[Array, Array]:
        """Derivatives of the base's angular rates by deflections and rates of modes, shape (G, 3, s) each."""
        carried = np.concatenate([self._momentum_by_place, self._mass[:, :6, self._rows]], axis=2)
        both = -np.linalg.solve(self._mass[:, :6, :6], carried)[:, 3:]
        half = both.shape[2] // 2
        return np.asarray(both[:, :, :half]), np.asarray(both[:, :, half:])
