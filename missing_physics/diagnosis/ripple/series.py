"""A recording above the band of its motion: the residual of a robot file, and what waves would add to it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.evaluation.band import Band, low_passed
from missing_physics.evaluation.joint_motion import JointMotion
from missing_physics.evaluation.prediction import predicted
from missing_physics.hypotheses import Term
from missing_physics.standard.bending import model_of
from reference_model.effects.along import EffectAlong, SensorAlong
from reference_model.effects.base import JointEffect, JointSignals, SensorEffect
from robot_model import Recording, Robot

__all__ = ["HIGHEST", "Fast", "fast"]

Array = NDArray[np.float64]

#: End of the band, as a part of the sampling rate: interpolation between samples is exact to a percent there.
HIGHEST = 0.2
#: Cut-off of the filter of the positions, as a part of the sampling rate.
SMOOTHING = 0.25
#: Inertias are evaluated so many times per period of the motion's band.
SLOW = 4.0


@dataclass(frozen=True, eq=False)
class Fast:
    """One recording and what a robot file predicts of its torques; N samples, n joints.

    Attributes:
        robot: the file.
        source: name of the recording.
        motion: of the joints.
        torque: predicted, shape (N, n) [N m or N].
        residual: recorded minus predicted torque, zero where a joint is near rest or has no torque,
            shape (N, n).
        slow: end of the motion's band [Hz].
        compared: joints that are compared in the band of the motion, shape (n,): others are held.
        zeros: what is added to the positions to have them about the zeros of the first recording, shape (n,)
            [rad or m].
    """

    robot: Robot
    source: str
    motion: JointMotion
    torque: Array
    residual: Array
    slow: float
    compared: NDArray[np.bool_]
    zeros: Array

    @property
    def position(self) -> Array:
        """Positions about the zeros of the first recording, shape (N, n)."""
        return self.motion.position + self.zeros

    @property
    def known(self) -> NDArray[np.bool_]:
        """Samples in which each joint slides and has a torque, shape (N, n)."""
        known = (self.motion.shares > 0.5) & np.isfinite(self.motion.torque)
        return np.asarray(known & self.compared)

    def of_joint(self, term: Term, effect: JointEffect) -> Array:
        """Torque that an effect at a joint takes, and its derivatives, shape (N, 1 + P)."""
        k, motion = self._place(term), self.motion
        joint = self.robot.drives[k]
        along = EffectAlong(
            effect,
            gear_ratio=joint.actuator.gear_ratio if joint.actuator else 1.0,
            transition=float(motion.sign_speed[k]),
            directed=True,
        )
        zero = np.zeros(motion.time.size)
        known = {
            "time": motion.time,
            "position": self.position[:, k],
            "velocity": motion.velocity[:, k],
            "acceleration": motion.acceleration[:, k],
            "torque": self._slow[:, k],
            "temperature": motion.temperature[:, k],
        }
        signals = [known.get(name, zero) for name in JointSignals.CHANNELS]
        rows = np.column_stack([*signals, motion.direction[:, k]])
        force, slopes = along.evaluate(rows, term.parameters, [p.name for p in term.free])
        return -np.column_stack([force, slopes])

    def of_encoder(self, term: Term, effect: SensorEffect) -> Array:
        """Torque that an encoder's error makes up, and its derivatives, at all joints, shape (N, n, 1 + P).

        Above the band of the motion an error acts through the acceleration that it seems to be.
        """
        k, motion, along = self._place(term), self.motion, SensorAlong(effect)
        since = motion.time - motion.time[0]
        given = since, self.position[:, k], motion.velocity[:, k], term.parameters
        error = np.column_stack([along.error(*given), along.jacobian(*given, [p.name for p in term.free])])
        seeming = make_interp_spline(motion.time, error, k=5)(motion.time, 2)
        return np.asarray(-self._inertia[:, :, k, None] * seeming[:, None, :])

    @cached_property
    def inertial(self) -> Array:
        """Part of the predicted torque that accelerates the bodies, shape (N, n)."""
        return np.asarray(np.einsum("nij,nj->ni", self._inertia, self.motion.acceleration))

    @property
    def recorded(self) -> Array:
        """Recorded torque where a joint slides, else zero, shape (N, n) [N m or N]."""
        return np.where(
            np.isfinite(self.motion.torque), self.residual + self.torque * self.motion.shares, 0.0
        )

    @cached_property
    def in_band(self) -> tuple[Array, Array]:
        """Energies of `inertial` and residual in the motion's band [N^2 m^2 s or N^2 s], shape (n,) each."""
        pair = self.inertial * self.motion.shares, self.residual
        slow = (low_passed(one, rate=self.motion.rate, cutoff=self.slow) for one in pair)
        first, second = (np.sum(one**2, axis=0) / self.motion.rate for one in slow)
        return first, second

    @cached_property
    def _slow(self) -> Array:
        """Predicted torque in the band of the motion, without the noise of encoders above, shape (N, n)."""
        return low_passed(self.torque, rate=self.motion.rate, cutoff=self.slow)

    def _place(self, term: Term) -> int:
        return [drive.name for drive in self.robot.drives].index(term.joint)

    @cached_property
    def _inertia(self) -> Array:
        """Mass matrix along the motion, shape (N, n, n)."""
        motion = self.motion
        count = max(8, int(SLOW * self.slow * (motion.time[-1] - motion.time[0])))
        at = np.unique(np.linspace(0, motion.time.size - 1, min(count, motion.time.size)).astype(int))
        state = (part[at] for part in (motion.position, motion.velocity, motion.acceleration))
        inertia = model_of(self.robot).motion_jacobians(*state)[2]
        return np.asarray(make_interp_spline(motion.time[at], inertia, k=1)(motion.time))


def fast(robot: Robot, recording: Recording, slow: float, compared: NDArray[np.bool_]) -> Fast | None:
    """A recording above a band that ends at `slow` [Hz]; None where it is sampled too slowly for that.

    Args:
        robot, recording, slow, compared: see `Fast`.
    """
    sampling = (recording.time.size - 1) / float(recording.time[-1] - recording.time[0])
    band = Band(HIGHEST * sampling, SMOOTHING * sampling)
    if band.torque < 2.0 * slow:
        return None
    motion = JointMotion.of(robot, recording, band)
    torque = predicted(robot, motion).torque
    smooth = low_passed(np.nan_to_num(motion.torque), rate=motion.rate, cutoff=band.motion)
    residual = np.where(np.isfinite(motion.torque), (smooth - torque) * motion.shares, 0.0)
    zeros = np.zeros(torque.shape[1])
    return Fast(robot, recording.source, motion, torque, residual, slow, compared, zeros)
