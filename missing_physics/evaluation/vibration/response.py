"""Response of a free base and flexible links to small forces along a motion, and the forces at joints.

No actuator acts on a free base and on modes of links. So forces f on the rows of inverse dynamics move both,
to first order

    M_pp a + C v + K u = -f_p,        force at the joints = f_j + M_jp a,

with the mass matrix along the motion, and stiffness K and damping C of the links. Neglected terms (Coriolis
terms of the deviations) are a few percent of the response at typical speeds of robots, and vanish with the
deviations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation.vibration.newmark import transition, vibrating
from reference_model.dynamics.tree import Tree

__all__ = ["Response"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Response:
    """The response of base and modes along one motion; N samples, n joints, s modes.

    Attributes:
        joints: rows of the joints among those of inverse dynamics.
        step: time between samples [s].
        base: M_xb M_bb^-1 for the rows x of joints and modes, shape (N, n + s, 6); none for a fixed one.
        mass: of the joints with the base free and modes held, shape (N, n, n).
        coupling: M_js with the base free, shape (N, n, s).
        modal: M_ss with the base free, shape (N, s, s).
        stiffness, damping: of the modes, shape (s, s) each.
    """

    joints: slice
    step: float
    base: Array
    mass: Array
    coupling: Array
    modal: Array
    stiffness: Array
    damping: Array

    @classmethod
    def of(cls, tree: Tree, mass: Array, elasticity: tuple[Array, Array], step: float) -> Response:
        """The response of a robot with these bodies and coordinates.

        Args:
            tree: bodies and coordinates.
            mass: matrix along the motion, shape (N, rows, rows).
            elasticity: stiffness and damping of the modes, shape (s, s) each.
            step: time between samples [s].
        """
        base, joints = tree.offset, len(tree.joints)
        moved = mass[:, base:, :base]
        eliminated = np.linalg.solve(mass[:, :base, :base], moved.transpose(0, 2, 1)).transpose(0, 2, 1)
        rest = mass[:, base:, base:] - eliminated @ moved.transpose(0, 2, 1)
        stiffness, damping = elasticity
        return cls(
            joints=slice(base, base + joints),
            step=step,
            base=np.asarray(eliminated),
            mass=rest[:, :joints, :joints],
            coupling=rest[:, :joints, joints:],
            modal=rest[:, joints:, joints:],
            stiffness=stiffness,
            damping=damping,
        )

    def with_elasticity(self, stiffness: Array, damping: Array) -> Response:
        """The response with other stiffness and damping of the modes, shape (s, s) each."""
        return replace(self, stiffness=stiffness, damping=damping)

    def at_joints(self, rows: Array) -> Array:
        """Forces at the joints due to forces on all rows, starting from rest, (N, rows, C) to (N, n, C)."""
        free = rows[:, self.joints.start :]
        if self.base.shape[2]:
            free = free - self.base @ rows[:, : self.joints.start]
        count = self.joints.stop - self.joints.start
        joints, modes = free[:, :count], free[:, count:]
        if not modes.shape[1]:
            return joints
        elasticity = self.stiffness, self.damping
        return joints + self.coupling @ vibrating(self.modal, *elasticity, -modes, self.step)[2]

    def free_vibration(self, *, every: float = np.inf, below: float = np.inf) -> tuple[Array, Array]:
        """Forces at the joints due to free vibration of modes from the start and from later instants.

        Initial deflections are one, initial rates the mode's frequency, so that both have the same energy.

        Args:
            every: time between these instants [s].
            below: modes with a frequency above this start at the first instant only [rad/s].

        Returns:
            Shape (N, n, V), and the instants with the mode of each column, (V, 2) integers.
        """
        count, modes, frequency = len(self.modal), len(self.stiffness), self.frequencies
        stride = max(1, round(every / self.step)) if np.isfinite(every) else count
        begun = [
            (k, mode, moving)
            for k in range(0, count, stride)
            for mode in range(modes)
            for moving in (False, True)
            if k == 0 or frequency[mode] < below
        ]
        starts: dict[int, list[int]] = {}
        for column, (k, _, _) in enumerate(begun):
            starts.setdefault(k, []).append(column)
        moved, answer = transition(self.modal, self.stiffness, self.damping, self.step)
        state = np.zeros((2 * modes, len(begun)))
        found = np.empty((*self.coupling.shape[:2], len(begun)))
        for k in range(count):
            for column in starts.get(k, ()):
                _, mode, moving = begun[column]
                state[mode + modes * moving, column] = frequency[mode] if moving else 1.0
            found[k] = -self.coupling[k] @ (answer[k] @ state)
            state = moved[k] @ state
        return found, np.array([(k, mode) for k, mode, _ in begun]).reshape(-1, 2)

    @property
    def inertia(self) -> Array:
        """Inertia of the modes with the base free, in the middle of the motion, shape (s, s)."""
        return np.asarray(self.modal[len(self.modal) // 2])

    @property
    def frequencies(self) -> Array:
        """Natural frequency of each mode with the base free, the others held, shape (s,) [rad/s]."""
        return np.sqrt(np.diag(self.stiffness) / np.diag(self.inertia))
