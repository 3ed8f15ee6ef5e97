"""The gap between a motor's encoder and a joint's encoder, and the signals on which it may depend.

The gap is ``d = position - motor_position``, both at the joint side of the gear. It is zero for a rigid robot
with ideal encoders. Everything here is at the full sampling rate until `Gap.reduce`, which filters and
decimates as for torques.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation.steps import mean_rounding_error
from missing_physics.motion.inverse import MotionDynamics
from missing_physics.recordings import estimate_noise, noise_of, sensor_of
from missing_physics.recordings.channels.estimates import resolution_of
from robot_model import Recording

__all__ = ["Gap", "gaps_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Gap:
    """One joint in one recording.

    Attributes:
        along: the recording's motion, torque and dynamics.
        index: of the joint among the moving ones.
        joint: name of the joint.
        difference: recorded position minus motor position, shape (N,) [rad or m].
        noise_floor: rms of the encoders' white noise, or rounding, after filtering [rad or m].
        steps: rms of the mean error due to the encoders' resolution, where their noise does not average it
            out; the filter removes it only if the motion crosses many steps [rad or m].
        torques: estimates of the torque that the gear transmits to the links, by name, shape (N,) each.
        viscous: excess of the motor's torque over that of the links, per velocity [N m s/rad or N s/m].
    """

    along: MotionDynamics
    index: int
    joint: str
    difference: Array
    noise_floor: float
    torques: Mapping[str, Array]
    viscous: float = 0.0
    steps: float = 0.0

    @property
    def time(self) -> Array:
        """Time [s], shape (N,)."""
        return self.along.motion.time

    @cached_property
    def position(self) -> Array:
        """Smoothed motor position at the joint side, shape (N,)."""
        return self.along.motion.position[:, self.index]

    @property
    def velocity(self) -> Array:
        """Joint velocity, shape (N,)."""
        return self.along.motion.velocity[:, self.index]

    @property
    def acceleration(self) -> Array:
        """Joint acceleration, shape (N,)."""
        return self.along.motion.acceleration[:, self.index]

    @property
    def link(self) -> str:
        """Name of the joint's child link."""
        return self.along.model.robot.moving_joints[self.index].child

    @property
    def gear_ratio(self) -> float:
        """Motor turns per joint turn."""
        actuator = self.along.model.robot.moving_joints[self.index].actuator
        return actuator.gear_ratio if actuator else 1.0

    @property
    def is_prismatic(self) -> bool:
        """Whether the joint slides."""
        return self.along.model.robot.moving_joints[self.index].kind == "prismatic"

    @property
    def unit(self) -> str:
        """Unit of the gap."""
        return "m" if self.is_prismatic else "rad"

    @property
    def transition(self) -> float:
        """Speed below which the sign of the velocity is not known."""
        return float(self.along.motion.transition[self.index])

    @cached_property
    def smooth(self) -> Mapping[str, Array]:
        """The filtered torques; noise would distort effects that are non-linear in them."""
        low_pass = self.along.motion.low_pass
        return {name: low_pass.smooth(torque) for name, torque in self.torques.items()}

    def reduce(self, values: Array) -> Array:
        """Filter and decimate along the first axis."""
        return self.along.motion.low_pass.reduce(values)


def gaps_of(
    along: Sequence[MotionDynamics], recordings: Sequence[Recording], fitted: int
) -> tuple[tuple[Gap, ...], ...]:
    """The gaps of all joints that have both encoders in all of the recordings, recording by recording.

    Args:
        along: motion and dynamics of each recording.
        recordings: the fitted ones first.
        fitted: number of recordings that are fitted.
    """
    found = []
    links = [_of_links(one, recording) for one, recording in zip(along, recordings)]
    for index in range(len(along[0].model.robot.moving_joints)):
        gaps = [_gap_of(*each, index) for each in zip(along, links, recordings)]
        present = tuple(gap for gap in gaps if gap is not None)
        if present and len(present) == len(along):
            found.append(_with_friction(present, fitted))
    return tuple(zip(*found))


def _difference(along: MotionDynamics, recording: Recording, index: int) -> Array | None:
    """Position minus motor position of one joint, shape (N,); None without both encoders."""
    joint, motion = along.model.robot.moving_joints[index].name, along.motion
    if f"{joint}.position" not in motion.others or f"{joint}.motor_position" not in recording:
        return None
    return np.asarray(motion.others[f"{joint}.position"] - motion.raw_position[:, index])


def _of_links(along: MotionDynamics, recording: Recording) -> Array:
    """Torque that the links need along the motion of the joints' encoders, without rotors, shape (N, n)."""
    motion, joints = along.motion, along.model.robot.moving_joints
    more = np.zeros_like(motion.position)
    for index in range(len(joints)):
        difference = _difference(along, recording, index)
        if difference is not None:
            more[:, index] = difference - difference.mean()
    moved = motion.moved(more) if more.any() else motion
    rotors = [joint.actuator.reflected_inertia if joint.actuator else 0.0 for joint in joints]
    torque = MotionDynamics(along.model, moved).torque
    return np.asarray(torque - np.array(rotors) * moved.acceleration)


def _gap_of(along: MotionDynamics, links: Array, recording: Recording, index: int) -> Gap | None:
    """The gap of one joint; None without both encoders."""
    joint, motion = along.model.robot.moving_joints[index].name, along.motion
    channels = f"{joint}.position", f"{joint}.motor_position"
    difference = _difference(along, recording, index)
    if difference is None:
        return None
    noise = {**estimate_noise(recording), **recording.noise}
    own = np.hypot(noise.get(channels[0], 0.0), recording.resolution.get(channels[0], 0.0) / np.sqrt(12.0))
    rounding = float(np.spacing(np.abs(motion.raw_position[:, index]).max(initial=1.0)))
    white = max(float(np.hypot(own, motion.position_noise[index])), rounding)
    steps = [_steps(along, recording, name) for name in channels]
    return Gap(
        along=along,
        index=index,
        joint=joint,
        difference=difference,
        noise_floor=white * motion.low_pass.noise_gain,
        torques=_torques(along, links, index),
        steps=float(np.linalg.norm(steps)),
    )


def _steps(along: MotionDynamics, recording: Recording, channel: str) -> float:
    """rms of the mean error due to an encoder's resolution."""
    sensor = sensor_of(along.model.robot, recording, channel)
    if sensor is not None:
        return mean_rounding_error(sensor.noise, sensor.resolution)
    step, white = resolution_of(recording, channel), recording.noise.get(channel, 0.0)
    if not white:  # an estimate includes the rounding
        white = float(np.sqrt(max(noise_of(recording, channel) ** 2 - step**2 / 12.0, 0.0)))
    return mean_rounding_error(white, step)


def _torques(along: MotionDynamics, links: Array, index: int) -> dict[str, Array]:
    """Torque through the gear, from each side.

    `link`: inverse dynamics of the links. It lacks friction behind the gear and whatever the model of the
    links lacks. `motor`: measured torque minus the torque that accelerates the rotor. It includes friction in
    front of the gear.
    """
    motion, actuator = along.motion, along.model.robot.moving_joints[index].actuator
    torques = {"link": links[:, index]}
    if np.isfinite(motion.torque[:, index]).all():
        rotor = actuator.reflected_inertia if actuator else 0.0
        torques["motor"] = motion.torque[:, index] - rotor * motion.acceleration[:, index]
    return torques


def _with_friction(gaps: Sequence[Gap], fitted: int) -> tuple[Gap, ...]:
    """Gaps with further torque estimates, in which friction, odd in velocity, is separated.

    ``motor - link = friction(velocity) + curve(position)`` is fitted. The curve stands for errors of the
    links' model (a counterbalance, a wrong mass), and is added to their torque (`link`). If friction is in
    front of the gear, it is subtracted from the motor's torque (`net`); if behind it, it is added to that of
    the links (`link and friction`). Torques of the links have no noise; those of the motor include everything
    else.
    """
    if any("motor" not in gap.torques for gap in gaps):
        return tuple(gaps)
    rows = [np.column_stack([_friction(gap), _curve(gap)]) for gap in gaps[:fitted]]
    columns = np.concatenate([gap.reduce(block) for gap, block in zip(gaps, rows)])
    excess = np.concatenate([g.reduce(g.torques["motor"] - g.torques["link"]) for g in gaps[:fitted]])
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    law = np.linalg.lstsq(columns / scale, excess, rcond=1e-8)[0] / scale
    found = []
    for gap in gaps:
        friction, link = _friction(gap) @ law[:2], gap.torques["link"] + _curve(gap) @ law[2:]
        motor = gap.torques["motor"]
        torques = {
            "link": link,
            "link and friction": link + friction,
            "net": motor - friction,
            "motor": motor,
        }
        found.append(replace(gap, torques=torques, viscous=float(law[1])))
    return tuple(found)


def _friction(gap: Gap) -> Array:
    return np.column_stack([np.tanh(gap.velocity / gap.transition), gap.velocity])


def _curve(gap: Gap) -> Array:
    """Columns of a parabola over position, shape (N, 3)."""
    return np.column_stack([np.ones(gap.position.size), gap.position, gap.position**2])
