"""How much of the robot's inertia an explanation leaves.

Masses and inertias are free in every fit, with a weak prior. Where a motion hardly tells them, an effect may
come out best that needs a robot without inertia: an actuator, say, that delivers one constant torque whatever
is asked of it. Joints that feel next to none of the nominal inertia are no explanation.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from reference_model.passive.base_motion import BaseMotion

__all__ = ["Lightness"]

Array = NDArray[np.float64]

#: Instants of a recording at which the inertia is looked at.
INSTANTS = 8


class Lightness:
    """Smallest part of the nominal inertia that is felt along any direction of the joints' rates."""

    def __init__(self, dynamics: MotionDynamics, columns: NDArray[np.int_], directions: Array) -> None:
        """Along one motion.

        Args:
            dynamics: of the nominal robot.
            columns: places of P' inertial numbers among those of the model.
            directions: change of these per unit of each of the B combinations, shape (P', B).
        """
        self.dynamics, self.columns, self.directions = dynamics, columns, directions

    def __call__(self, nuisance: Array) -> float:
        """Smallest ratio of kinetic energies, changed to nominal; not positive for no physical robot.

        Args:
            nuisance: values of the combinations, shape (B,).
        """
        if not nuisance.any():
            return 1.0
        changed = self._nominal + self._changes @ nuisance
        try:
            felt = np.linalg.solve(self._felt(self._nominal), self._felt(changed))
            return float(np.linalg.eigvals(felt).real.min())
        except np.linalg.LinAlgError:
            return 0.0

    def _felt(self, matrix: Array) -> Array:
        """Of the joints, a free base going along and flexible links undeformed: shape (K, n, n)."""
        start = self.dynamics.model.tree.offset
        joints = slice(start, start + len(self.dynamics.model.joints))
        own = matrix[:, joints, joints]
        if not self.dynamics.model.free_base:
            return own
        aside = matrix[:, :6, joints]
        return np.asarray(own - aside.transpose(0, 2, 1) @ np.linalg.solve(matrix[:, :6, :6], aside))

    @cached_property
    def _nominal(self) -> Array:
        return self._matrix(self.dynamics.model.inertial)

    @cached_property
    def _changes(self) -> Array:
        """Derivative by each combination, in which the mass matrix is linear: shape (K, rows, rows, B)."""
        columns = []
        for direction in self.directions.T:
            moved = self.dynamics.model.inertial.copy()
            moved[self.columns] += direction
            columns.append(self._matrix(moved) - self._nominal)
        return np.stack(columns, axis=-1)

    def _matrix(self, inertial: Array) -> Array:
        position = self.dynamics.motion.position
        rows = np.linspace(0, len(position) - 1, INSTANTS).astype(int)
        model = self.dynamics.model
        base = BaseMotion.at_rest(np.array([1.0, 0.0, 0.0, 0.0]), INSTANTS) if model.free_base else None
        return model.mass_matrix(position[rows], base=base, inertial=inertial)
