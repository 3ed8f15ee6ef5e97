"""How a free base and the tips of flexible links accelerate otherwise where joints and modes move otherwise.

A changed motion of joints and modes leaves the momentum what it was: a free base makes up for it by its
twist, and for the force that it takes by its acceleration. What the changed pose does is left out: it turns
accelerations, and is second to what velocities and accelerations do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from reference_model.evaluation.model import BaseMotion
from reference_model.passive.inner_motion import InnerMotion

__all__ = ["AccelerationRows"]

Array = NDArray[np.float64]

#: Step of a central difference by a velocity; exact, as accelerations are of second order in velocities.
STEP = 1e-2


@dataclass(frozen=True)
class _Moved:
    """Joints, base and links with one velocity or acceleration changed."""

    position: Array
    velocity: Array
    acceleration: Array
    base: BaseMotion | None
    inner: InnerMotion | None


class AccelerationRows:
    """At K of the samples of a motion; g joints and modes.

    Args:
        dynamics: along the motion.
        samples: shape (K,).
    """

    def __init__(self, dynamics: MotionDynamics, samples: NDArray[np.int_]) -> None:
        self._model, self._about = dynamics.model, dynamics.about
        passive = dynamics.passive_at(samples)
        position, velocity, acceleration = (part[samples] for part in dynamics.state)
        self._still = _Moved(position, velocity, acceleration, passive["base"], passive["inner"])
        self._size = dynamics.motion_response.inertia.shape[1]
        self._twist: Array = np.zeros((len(samples), 6, self._size))
        self._answer: Array = np.zeros((len(samples), 6, 2 * self._size))
        if self._still.base is not None:
            z = self._model.mass_matrix(position, **passive)[:, :6]
            self._twist = -np.asarray(np.linalg.solve(z[:, :, :6], z[:, :, 6:]))
            bias = self._by_rates(self._base_force)
            self._answer[:, :, : self._size] = -np.linalg.solve(z[:, :, :6], bias)
            self._answer[:, :, self._size :] = self._twist

    def base(self) -> Array:
        """Acceleration of a free base's origin, its axes, by [velocities; accelerations], (K, 3, 2 g)."""
        return self._answer[:, :3]

    def tip(self, link: str) -> Array:
        """Acceleration of a flexible link's tip in its own axes by the same, shape (K, 3, 2 g)."""

        def felt(moved: _Moved) -> Array:
            return self._model.node_motion(
                link,
                moved.position,
                moved.velocity,
                moved.acceleration,
                base=moved.base,
                inner=moved.inner,
                inertial=self._about,
            ).acceleration

        own = np.concatenate([self._by_rates(felt), self._by_accelerations(felt)], axis=2)
        return own if self._still.base is None else own + self._by_base(felt) @ self._answer

    def _base_force(self, moved: _Moved) -> Array:
        """Force and moment at the base that the motion needs, shape (K, 6)."""
        joints = moved.position, moved.velocity, moved.acceleration
        return self._model.inverse_dynamics(
            *joints, base=moved.base, inner=moved.inner, inertial=self._about
        )[:, :6]

    def _by_rates(self, told: Callable[[_Moved], Array]) -> Array:
        """Derivative by velocities of joints and modes, the base's twist with them, (K, rows, g)."""
        columns = []
        for k in range(self._size):
            ends = [told(self._faster(k, step)) for step in (STEP, -STEP)]
            columns.append((ends[0] - ends[1]) / (2 * STEP))
        return np.stack(columns, axis=2)

    def _faster(self, k: int, step: float) -> _Moved:
        still, base = self._still, self._still.base
        velocity, inner = _more(still.velocity, still.inner, "modal_rates", k, step)
        if base is not None:
            base = replace(
                base,
                linear_velocity=base.linear_velocity + step * self._twist[:, :3, k],
                angular_velocity=base.angular_velocity + step * self._twist[:, 3:, k],
            )
        return replace(still, velocity=velocity, base=base, inner=inner)

    def _by_accelerations(self, told: Callable[[_Moved], Array]) -> Array:
        """Derivative by accelerations of joints and modes, that of the base held, (K, rows, g)."""
        before, columns = told(self._still), []
        for k in range(self._size):
            still = self._still
            acceleration, inner = _more(still.acceleration, still.inner, "modal_accelerations", k, 1.0)
            columns.append(told(replace(still, acceleration=acceleration, inner=inner)) - before)
        return np.stack(columns, axis=2)

    def _by_base(self, told: Callable[[_Moved], Array]) -> Array:
        """Derivative by the base's acceleration, (K, rows, 6)."""
        before, columns, base = told(self._still), [], self._still.base
        assert base is not None
        for part in ("linear_acceleration", "angular_acceleration"):
            for axis in np.eye(3):
                moved = replace(base, **{part: getattr(base, part) + axis})
                columns.append(told(replace(self._still, base=moved)) - before)
        return np.stack(columns, axis=2)


def _more(
    joints: Array, inner: InnerMotion | None, part: str, k: int, step: float
) -> tuple[Array, InnerMotion | None]:
    """Number k of joints and then modes raised by `step`."""
    if k < joints.shape[1]:
        raised = joints.copy()
        raised[:, k] += step
        return raised, inner
    assert inner is not None
    modal = np.array(getattr(inner, part))
    modal[:, k - joints.shape[1]] += step
    return joints, replace(inner, **{part: modal})
