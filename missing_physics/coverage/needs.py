"""Torque that a motion needs, modelled coarsely enough to detect wrong units and signs.

Every joint's recorded torque u is compared with a model so flexible that it covers nearly any physics:

    u = k dynamic + f1 qd + f2 sgn(qd) + f3 sgn(qd) exp(-(qd/v)^2) + K q + free,

with u the part due to the recorded channel (for a voltage without the back-EMF, which is proportional to the
velocity and contained in f1); `dynamic` the nominal robot's torque without gravity; k a scale between one
tenth and ten (gains of sensors and actuators up to the catalogue's limits, wrong masses); dissipative
friction and a restoring spring (f1, f2, f3, K not negative); and free constant and gravity in any direction.
If that leaves nearly everything unexplained, the channel does not measure this joint's torque. The exception
is a joint held by its drive while others move. It yields to them, and its torque restores it:

    u = k dynamic - c q - d qd + free,

with c and d, the drive's stiffness and damping, not negative, and no more damping than a stiff drive has.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from missing_physics.hypotheses.extents import STANDSTILL
from missing_physics.motion.inverse import MotionDynamics

__all__ = ["Needs"]

Array = NDArray[np.float64]

#: Speed, as a fraction of the highest, over which friction may fall from its static level.
STRIBECK = 0.1
#: Most rows that are used.
MOST_ROWS = 4000
#: Largest damping over stiffness of a drive that holds a joint: its response time [s].
ANSWERS = 0.25


@dataclass(frozen=True)
class Needs:
    """One motion of n joints, filtered and decimated to R rows.

    Attributes:
        measured: recorded torque [N m or N], shape (R, n); NaN columns where unknown.
        dynamic: torque that the nominal robot needs without gravity, shape (R, n).
        signed: columns of each joint with non-negative factors: friction and a spring, shape (R, n, 4).
        free: columns of each joint with free factors: a constant and gravity along three axes, (R, n, 4).
        held: torques of a drive that holds each joint, without and with largest damping, shape (R, n, 2).
    """

    measured: Array
    dynamic: Array
    signed: Array
    free: Array
    held: Array
    _kept: dict[tuple[str, int, int], Array] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def of(cls, dynamics: MotionDynamics) -> Needs:
        """The torques that `dynamics.motion` needs, and the recorded ones."""
        motion = dynamics.motion
        count, joints = motion.position.shape
        gravity, acting = np.zeros((count, joints, 3)), np.array(dynamics.model.robot.gravity)
        if acting.any() and not dynamics.model.free_base:
            gravity = dynamics.gravity
        dynamic = dynamics.torque - gravity @ acting
        top = np.maximum(np.abs(motion.velocity).max(axis=0), 1e-12)
        speed = motion.velocity / top
        sign = np.tanh(speed / STANDSTILL)
        signed = np.stack([speed, sign, sign * np.exp(-((speed / STRIBECK) ** 2)), motion.position], axis=2)
        free = np.concatenate([np.ones((count, joints, 1)), gravity], axis=2)
        most = motion.position + ANSWERS * motion.velocity
        held = np.stack([-motion.position, -most], axis=2)
        torque = motion.torque if motion.drive is None else motion.drive
        unknown = np.where(np.isfinite(torque).all(axis=0), 1.0, np.nan)
        kept = motion.low_pass.reduce
        rows = [kept(part) for part in (np.nan_to_num(torque), dynamic, signed, free, held)]
        thin = slice(None, None, max(1, len(rows[0]) // MOST_ROWS))
        measured, dynamic, signed, free, held = (part[thin] for part in rows)
        return cls(measured * unknown, dynamic, signed, free, held)

    @property
    def known(self) -> tuple[int, ...]:
        """Indices of the joints whose torques were recorded."""
        return tuple(int(k) for k in np.flatnonzero(np.isfinite(self.measured).all(axis=0)))

    def left(
        self, joint: int, scale: tuple[float, float], *, of: int | None = None, sign: float = 1.0
    ) -> float:
        """Energy fraction of the torque that the model leaves unexplained, without constant and gravity.

        It may exceed one.

        Args:
            joint: the joint whose needs are compared.
            scale: bounds of k, not negative.
            of: the joint under whose name the torque was recorded; the joint itself when None.
            sign: of the recorded torque.
        """
        other = joint if of is None else of
        columns, u = self._reduced("driven", joint, other)
        return _left(columns, sign * u, self.measured[:, other], scale)

    def left_if_held(self, joint: int, scale: tuple[float, float]) -> float:
        """Like `left`, for a joint held by its drive while others move.

        Args:
            joint: the joint.
            scale: bounds of k, not negative.
        """
        return _left(*self._reduced("held", joint, joint), self.measured[:, joint], scale)

    def undriven(self, joint: int) -> float:
        """Energy fraction of `dynamic` that friction, spring, gravity and a constant torque do not explain.

        It is small for a free motion and large for a driven one, except for a single sine, which a spring
        could cause as well.
        """
        columns, _ = self._reduced("driven", joint, joint)
        return _left(columns[:, 1:], -columns[:, 0], self.dynamic[:, joint])

    def scale(self, joint: int, *, sign: float = 1.0) -> float:
        """The best-fitting k, not negative."""
        columns, u = self._reduced("driven", joint, joint)
        return float(_fitted(columns, sign * u)[0])

    def _reduced(self, model: str, joint: int, of: int) -> tuple[Array, Array]:
        """Columns of a model and a torque, with the free columns projected out, shape (C, M) and (C,).

        An orthogonal transformation reduces the rows to the number of columns and keeps all sums of squares.

        Args:
            model: "driven" or "held".
            joint: the joint whose needs are compared.
            of: the joint under whose name the torque was recorded.
        """
        key = model, joint, of
        if key not in self._kept:
            more = self.signed if model == "driven" else self.held
            columns = [self.dynamic[:, joint], more[:, joint], self.measured[:, of]]
            both, basis = np.column_stack(columns), _basis(self.free[:, joint])
            self._kept[key] = np.asarray(np.linalg.qr(both - basis @ (basis.T @ both), mode="r"))
        kept = self._kept[key]
        return kept[:, :-1], kept[:, -1]


def _left(columns: Array, u: Array, whole: Array, first: tuple[float, float] = (0.0, np.inf)) -> float:
    """Energy fraction of a reduced series left by columns with non-negative factors (`_fitted`).

    Zero if the reduced series is only rounding of the series before reduction, `whole`, such as a constant.
    """
    energy = float(u @ u)
    if energy <= (np.finfo(float).eps * MOST_ROWS) ** 2 * float(whole @ whole):
        return 0.0
    residual = u - columns @ _fitted(columns, u, first)
    return float(residual @ residual) / energy


def _fitted(columns: Array, u: Array, first: tuple[float, float] = (0.0, np.inf)) -> Array:
    """Non-negative least-squares factors of columns, the first within its bounds, shape (C,)."""
    size = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    bounds = np.array([first, *[(0.0, np.inf)] * (len(size) - 1)]).T
    bounds[1, 0] = max(bounds[1, 0], bounds[0, 0] * (1 + 1e-9))
    found = lsq_linear(columns / size, u, (bounds * size).clip(max=np.inf), method="bvls")
    return np.asarray(found.x / size)


def _basis(columns: Array) -> Array:
    """Orthonormal basis of the span of `columns`."""
    left, singular, _ = np.linalg.svd(columns / np.sqrt(len(columns)), full_matrices=False)
    return np.asarray(left[:, singular > 1e-9 * max(float(singular[0]), 1e-300)])
