"""Joints without an encoder on a free base: their motion follows from how the base turns.

With the whole robot's angular momentum about its centre of mass at zero, as after a start from rest, a free
base of rigid links turns at w = A(q) qd, whatever torques and friction act at the joints. A gyro therefore
tells as many of the joints' rates as it has axes,

    qd_u = A_u^+ (w - A_k qd_k)      (k: joints with an encoder, u: those without),

and their integral the positions, from where the recorded reference begins, or the described position. White
noise of the gyro becomes a random walk of such a position. A recorded attitude gives the same without a walk,
and takes the gyro's bias away where both are there. The masses and inertias of the robot file are taken for
true meanwhile.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.diagnosis.dynamics.base_rates import GYRO, covered
from reference_model.evaluation.model import RobotModel
from reference_model.passive.base_motion import BaseMotion
from robot_model import InputError, Recording

__all__ = ["FromBase", "joints_from_base"]

Array = NDArray[np.float64]

#: A base's attitude in the order of the quaternion's numbers.
ATTITUDE = tuple(f"base.attitude.{part}" for part in "wxyz")
#: Largest ratio of the surest to the least sure combination of joint rates that a gyro tells.
CONDITION = 1e3
#: Turning of the base per turning of a joint below which nothing is to be seen of it.
NOTHING = 1e-7
#: Positions are integrated until they change by less than this [rad or m], in at most so many rounds.
SETTLED, ROUNDS = 1e-10, 200


@dataclass(frozen=True)
class FromBase:
    """A recording with the positions that the base's turning tells.

    Attributes:
        recording: with `JOINT.position` of every joint.
        noise: standard deviation per sample of white noise of the added positions, by channel.
        walk: standard deviation per sample of white noise of their rates, by joint.
        words: how they were found.
    """

    recording: Recording
    noise: Mapping[str, float]
    walk: Mapping[str, float]
    words: str


def joints_from_base(model: RobotModel, recording: Recording, noise: Mapping[str, float]) -> FromBase | None:
    """The positions that no encoder tells; None where every joint has one, or no base tells of any.

    Args:
        model: the nominal robot.
        recording: as read.
        noise: standard deviation of white noise by channel.

    Raises:
        InputError: the base tells of fewer joints than lack an encoder, or not of these.
    """
    names = [joint.name for joint in model.robot.moving_joints]
    known = [k for k, name in enumerate(names) if _encoder(recording, name) is not None]
    unknown = [k for k in range(len(names)) if k not in known]
    axes = [axis for axis, channel in enumerate(GYRO) if _there(recording, channel)]
    attitude = all(_there(recording, channel) for channel in ATTITUDE)
    if not unknown or not model.free_base or model.tree.inner or not (axes or attitude):
        return None
    lacking = ", ".join(names[k] for k in unknown)
    count = 3 if attitude else len(axes)
    source = recording.source or "the recording"
    if len(unknown) > count:
        raise InputError(
            f"{source} has no position of {lacking}: {len(unknown)} joints, and how the base turns "
            f"gives {count} equation{'s' if count > 1 else ''} of momentum at every instant; record "
            f"the position of at least {len(unknown) - count} of them, or more axes of a gyro."
        )
    turning = _Turning(recording, noise, axes, attitude)
    position = _Momentum(model, recording, known, unknown, turning.axes).integrated(turning.rate)
    if position is None:
        raise InputError(
            f"{source} has no position of {lacking}, and the base does not determine them: it turns in the "
            "same way, or not at all, whichever of them moves; record their positions."
        )
    found, gain, beside = position
    encoders = np.array([noise.get(_encoder(recording, names[k]) or "", 0.0) for k in known])
    white = np.hypot(turning.angle_noise * gain, np.abs(beside) @ np.nan_to_num(encoders))
    added = {f"{names[k]}.position": found[:, column] for column, k in enumerate(unknown)}
    walk = turning.noise * gain
    return FromBase(
        recording.with_channels(added),
        dict(zip(added, map(float, white))),
        {names[k]: float(walk[column]) for column, k in enumerate(unknown)},
        f"{lacking} ha{'ve' if len(unknown) > 1 else 's'} no encoder: the motion is what {turning.words} and "
        "momentum make of it, with the masses and inertias of the robot file, after a start from rest"
        f"{turning.remark}.",
    )


def _encoder(recording: Recording, joint: str) -> str | None:
    for quantity in ("motor_position", "position"):
        if _there(recording, f"{joint}.{quantity}"):
            return f"{joint}.{quantity}"
    return None


def _there(recording: Recording, channel: str) -> bool:
    return channel in recording and bool(covered(recording, channel).sum() > 0.5 * len(recording))


def _whole(recording: Recording, channel: str) -> Array:
    values = recording[channel]
    good = np.isfinite(values)
    return np.asarray(np.interp(recording.time, recording.time[good], values[good]))


class _Turning:
    """The base's angular velocity as recorded.

    Attributes:
        axes: of the base that are known.
        rate: about them [rad/s], shape (N, axes); NaN where nothing was recorded.
        noise: standard deviation of its white noise per sample.
        angle_noise: standard deviation of the white noise of the angle that it is the rate of.
        words, remark: of what it was made, and what is to be known of it.
    """

    def __init__(
        self, recording: Recording, noise: Mapping[str, float], axes: list[int], attitude: bool
    ) -> None:
        time = recording.time
        self.axes, self.noise, self.angle_noise, self.remark = axes or [0, 1, 2], 0.0, 0.0, ""
        turned = None
        if attitude:
            quaternion = np.column_stack([_whole(recording, channel) for channel in ATTITUDE])
            turned = _rate_of(time, quaternion)[:, self.axes]
        if not axes:
            assert turned is not None
            sigma = np.sqrt(np.mean([noise.get(channel, 0.0) ** 2 for channel in ATTITUDE]))
            self.rate, self.angle_noise, self.words = turned, 2.0 * float(sigma), "the base's attitude"
            return
        channels = [GYRO[axis] for axis in axes]
        gyro = np.column_stack([_whole(recording, channel) for channel in channels])
        self.noise = float(np.sqrt(np.mean([noise.get(channel, 0.0) ** 2 for channel in channels])))
        self.words = "the base's gyro"
        if turned is None:
            self.remark = "; a bias of the gyro would show as friction (a recorded attitude takes it away)"
        else:
            gyro = gyro - _drift(time, gyro - turned)
            self.words = "the base's gyro and attitude"
        # what is interpolated is as noisy below a filter's cut-off as fewer samples make it
        sparse = [covered(recording, c).sum() / np.isfinite(recording[c]).sum() for c in channels]
        self.noise *= float(np.sqrt(np.mean(sparse)))
        missing = np.any([~covered(recording, channel) for channel in channels], axis=0)
        self.rate = np.where(missing[:, None], np.nan, gyro)


def _rate_of(time: Array, quaternion: Array) -> Array:
    """Angular velocity in body axes, shape (N, 3), of an attitude w, x, y, z, shape (N, 4)."""
    jumps = np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0  # both signs are the same attitude
    sign = np.where(np.concatenate([[0], np.cumsum(jumps)]) % 2, -1.0, 1.0)
    unit = quaternion * (sign / np.linalg.norm(quaternion, axis=1))[:, None]
    rate = make_interp_spline(time, unit, k=3)(time, 1)
    w, vector = unit[:, :1], unit[:, 1:]
    return np.asarray(2.0 * (w * rate[:, 1:] - rate[:, :1] * vector - np.cross(vector, rate[:, 1:])))


def _drift(time: Array, rate: Array) -> Array:
    """Constant part of a rate [rad/s], shape (axes,), by a line through its integral."""
    angle = make_interp_spline(time, rate, k=3).antiderivative()(time)
    centred = time - time.mean()
    return np.asarray(centred @ angle / (centred @ centred))


class _Momentum:
    """w = A(q) qd along a recording."""

    def __init__(
        self, model: RobotModel, recording: Recording, known: list[int], unknown: list[int], axes: list[int]
    ) -> None:
        self._model, self._time = model, recording.time
        self._known, self._unknown, self._axes = known, unknown, axes
        names = [joint.name for joint in model.robot.moving_joints]
        self._position = np.empty((len(recording), len(names)))
        for k, joint in enumerate(model.robot.moving_joints):
            encoder = _encoder(recording, names[k]) if k in known else None
            reference = f"{names[k]}.reference_position"
            if encoder is not None:
                self._position[:, k] = _whole(recording, encoder)
            elif _there(recording, reference):
                self._position[:, k] = _whole(recording, reference)[0]
            else:
                self._position[:, k] = joint.initial_position
        moving = make_interp_spline(self._time, self._position[:, known], k=3)
        self._rates = moving(self._time, 1)

    def integrated(self, turning: Array) -> tuple[Array, Array, Array] | None:
        """Positions (N, u), rate noise per noise of the turning (u,), and by known positions (u, k).

        Picard's iteration; None where the turning does not tell these joints.
        """
        missing = np.isnan(turning.sum(axis=1))
        good = np.flatnonzero(~missing)
        filled = np.column_stack([np.interp(self._time, self._time[good], c[good]) for c in turning.T])
        first = self._position[0, self._unknown].copy()
        for _ in range(ROUNDS):
            inverse, beside = self._inverse()
            if inverse is None:
                return None
            rate = np.einsum("nij,nj->ni", inverse, filled) - np.einsum("nij,nj->ni", beside, self._rates)
            found = first + make_interp_spline(self._time, rate, k=3).antiderivative()(self._time)
            change = float(np.abs(found - self._position[:, self._unknown]).max())
            self._position[:, self._unknown] = found
            if not np.isfinite(change):
                return None
            if change < SETTLED:
                gain = np.sqrt(np.mean(np.sum(inverse**2, axis=2), axis=0))
                found = np.where(missing[:, None], np.nan, found)
                return found, gain, np.sqrt(np.mean(beside**2, axis=0))
        return None

    def _inverse(self) -> tuple[Array | None, Array]:
        """A_u^+, shape (N, u, axes), and A_u^+ A_k, shape (N, u, k); None where A_u does not tell."""
        base = BaseMotion.at_rest(np.array([1.0, 0.0, 0.0, 0.0]), len(self._position))
        z = self._model.mass_matrix(self._position, base=base)[:, :6]
        central = z[:, 3:] - z[:, 3:, :3] @ np.linalg.solve(z[:, :3, :3], z[:, :3])
        turned = -np.linalg.solve(central[:, :, 3:6], central[:, :, 6:])[:, self._axes]
        own = turned[:, :, self._unknown]
        size = np.sqrt(np.mean(np.sum(own**2, axis=1), axis=0))
        if size.min() < NOTHING:
            return None, np.zeros(0)
        singular = np.linalg.svd(own / size, compute_uv=False)
        if singular[:, -1].min() * CONDITION < singular[:, 0].max():
            return None, np.zeros(0)
        inverse = np.linalg.pinv(own)
        return inverse, inverse @ turned[:, :, self._known]
