"""What a motion needs of its actuators, as coarsely as a comparison across wrong units and signs allows.

Every joint's recorded torque u is held against a model so generous that hardly any physics breaks it:

    u = k dynamic + f1 qd + f2 sgn(qd) + f3 sgn(qd) exp(-(qd/v)^2) + K q + free,

with u the part that the recorded channel makes (of a voltage without the back-EMF, which the motion makes and
f1 holds), `dynamic` the nominal robot's torque without gravity; k a scale between one tenth and ten (gains of
sensors and actuators up to the catalogue's limits, other masses); friction that takes power and a spring that
pulls back (f1, f2, f3, K not negative, of any size); and freely a constant and gravity in any direction.
Where that leaves nearly everything unexplained, the channel is no measurement of this joint's torque; but for
a joint that its drive holds while others move it. It gives way to them, and its torque pulls back:

    u = k dynamic - c q - d qd + free,

with c and d, the drive's stiffness and damping, not negative, and no more damping than a stiff drive has.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.hypotheses.extents import STANDSTILL

__all__ = ["Needs"]

Array = NDArray[np.float64]

#: Speed, as a part of the highest, over which friction may fall from its static level.
STRIBECK = 0.1
#: Rows that are looked at at most.
MOST_ROWS = 4000
#: Damping of a drive that holds a joint, as a part of its stiffness: the time within which it answers [s].
ANSWERS = 0.25


@dataclass(frozen=True)
class Needs:
    """One motion of n joints, filtered and decimated to R rows.

    Attributes:
        measured: recorded torque [N m or N], shape (R, n); NaN columns where unknown.
        dynamic: torque that the nominal robot needs without gravity, shape (R, n).
        signed: per joint what only takes power or pulls back: friction and a spring, shape (R, n, 4).
        free: per joint a constant and gravity along three axes, shape (R, n, 4).
        held: per joint torques of a drive that holds it, without damping and with most, shape (R, n, 2).
    """

    measured: Array
    dynamic: Array
    signed: Array
    free: Array
    held: Array
    _kept: dict[tuple[str, int, int], Array] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def of(cls, dynamics: MotionDynamics) -> Needs:
        """What `dynamics.motion` needs and what its actuators gave."""
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
        told = motion.torque if motion.drive is None else motion.drive
        unknown = np.where(np.isfinite(told).all(axis=0), 1.0, np.nan)
        kept = motion.low_pass.reduce
        rows = [kept(part) for part in (np.nan_to_num(told), dynamic, signed, free, held)]
        thin = slice(None, None, max(1, len(rows[0]) // MOST_ROWS))
        measured, dynamic, signed, free, held = (part[thin] for part in rows)
        return cls(measured * unknown, dynamic, signed, free, held)

    @property
    def known(self) -> tuple[int, ...]:
        """Joints whose torques were recorded."""
        return tuple(int(k) for k in np.flatnonzero(np.isfinite(self.measured).all(axis=0)))

    def left(
        self, joint: int, scale: tuple[float, float], *, of: int | None = None, sign: float = 1.0
    ) -> float:
        """Part of the torque's energy that the model leaves, constant and gravity apart; may exceed one.

        Args:
            joint: whose needs are held against a torque.
            scale: between which k may lie; not negative.
            of: under which joint's name the torque was recorded; the joint itself when left out.
            sign: of the recorded torque.
        """
        other = joint if of is None else of
        columns, u = self._reduced("driven", joint, other)
        return _left(columns, sign * u, self.measured[:, other], scale)

    def left_if_held(self, joint: int, scale: tuple[float, float]) -> float:
        """As `left`, of a joint that its drive holds against what others do to it.

        Args:
            joint: of the torque.
            scale: between which k may lie; not negative.
        """
        return _left(*self._reduced("held", joint, joint), self.measured[:, joint], scale)

    def undriven(self, joint: int) -> float:
        """Part of the energy of `dynamic` that no friction, spring, gravity or constant torque makes.

        A motion with nothing else at its joint leaves little; one that a drive makes leaves much, but where
        it is a single sine, which a spring could make as well.
        """
        columns, _ = self._reduced("driven", joint, joint)
        return _left(columns[:, 1:], -columns[:, 0], self.dynamic[:, joint])

    def scale(self, joint: int, *, sign: float = 1.0) -> float:
        """The k of best fit, not negative."""
        columns, u = self._reduced("driven", joint, joint)
        return float(_fitted(columns, sign * u)[0])

    def _reduced(self, model: str, joint: int, of: int) -> tuple[Array, Array]:
        """Columns of a model and a torque, with what is free projected out of both, shape (C, M) and (C,).

        By an orthogonal transformation of the rows to as many as there are columns, which keeps every sum
        of squares.

        Args:
            model: of a joint that is "driven" or "held".
            joint: whose needs they are.
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
    """Part of the energy of a reduced series that columns leave, none of them negative; see `_fitted`.

    Nothing is left of a constant, as of a joint that nothing drives: of `whole`, before it was reduced, no
    more than rounding.
    """
    energy = float(u @ u)
    if energy <= (np.finfo(float).eps * MOST_ROWS) ** 2 * float(whole @ whole):
        return 0.0
    apart = u - columns @ _fitted(columns, u, first)
    return float(apart @ apart) / energy


def _fitted(columns: Array, u: Array, first: tuple[float, float] = (0.0, np.inf)) -> Array:
    """Factors of columns by least squares, not negative, that of the first within its ends, shape (C,)."""
    size = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    bounds = np.array([first, *[(0.0, np.inf)] * (len(size) - 1)]).T
    bounds[1, 0] = max(bounds[1, 0], bounds[0, 0] * (1 + 1e-9))
    found = lsq_linear(columns / size, u, (bounds * size).clip(max=np.inf), method="bvls")
    return np.asarray(found.x / size)


def _basis(columns: Array) -> Array:
    """Orthonormal columns that span `columns`."""
    left, singular, _ = np.linalg.svd(columns / np.sqrt(len(columns)), full_matrices=False)
    return np.asarray(left[:, singular > 1e-9 * max(float(singular[0]), 1e-300)])
