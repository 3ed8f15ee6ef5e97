"""The torque that a robot file predicts along a recorded motion: inverse dynamics minus its effects."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation.vibration.response import Response
from missing_physics.standard.band import BandMotion
from reference_model.dynamics.inertial import BODY_NUMBERS
from reference_model.effects.along import EffectAlong
from reference_model.effects.base import BodyEffect, JointEffect
from reference_model.effects.body_force import ForceEffect
from reference_model.effects.catalogue import UsedEffect, used_effects
from reference_model.effects.pushing import BodySeries, ForceAlong
from reference_model.evaluation.coupled_effects import CoupledMotion
from reference_model.evaluation.drive_model import DriveModel
from reference_model.evaluation.model import RobotModel
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.inner_motion import InnerMotion
from robot_model import Drive, Robot

__all__ = ["Along", "coupled_motion", "force_of", "inertial_with_effects", "knows_links", "torque_of_effects"]

Array = NDArray[np.float64]

#: Most instants at which noise excites links in one recording; between them a vibration keeps its phase.
MOST_INSTANTS = 60
#: Modes up to this multiple of the end of the band are visible in it; they are filtered, not removed [-].
WIDER = 2.0
#: Temperature of a joint where none is recorded [K].
ROOM_TEMPERATURE = 293.15


@dataclass(frozen=True)
class Along:
    """A robot's dynamics along one motion.

    Attributes:
        model: of the robot.
        motion: of its joints.
        inertial: inertial parameters for the motion of the passive coordinates, shape (P,).
        base: motion of a free base, None when it is fixed.
        inner: motion of flexible links, None without any.
        response: response of a free base and flexible links to forces; None without them.
    """

    model: RobotModel
    motion: BandMotion
    inertial: Array
    base: BaseMotion | None
    inner: InnerMotion | None
    response: Response | None

    @classmethod
    def of(cls, model: RobotModel, motion: BandMotion, inertial: Array) -> Along:
        """Compute the motion of a free base and flexible links that follows from that of the joints."""
        state = motion.position, motion.velocity, motion.acceleration
        base, inner = model.reconstruct_passive(motion.time, *state, inertial=inertial)
        response: Response | None = None
        if base is not None or inner is not None:
            mass = model.mass_matrix(motion.position, base=base, inner=inner, inertial=inertial)
            response = Response.of(model.tree, mass, model.elasticity(inertial), 1.0 / motion.rate)
        return cls(model, motion, inertial, base, inner, response)

    @cached_property
    def needed(self) -> Array:
        """Torque at the joints by inverse dynamics, shape (N, n)."""
        state = self.motion.position, self.motion.velocity, self.motion.acceleration
        rows = self.model.inverse_dynamics(*state, base=self.base, inner=self.inner, inertial=self.inertial)
        start = self.model.tree.offset
        return rows[:, start : start + len(self.model.joints)]

    @property
    def regressor(self) -> Array:
        """Derivatives of the torque at the joints by the inertial parameters, shape (N, n, P)."""
        state = self.motion.position, self.motion.velocity, self.motion.acceleration
        return self.at_joints(
            self.model.regressor(*state, base=self.base, inner=self.inner, inertial=self.inertial)
        )

    def constant(self, regressor: Array) -> Array:
        """Torque of flexible links, extrapolated linearly to zero inertial parameters but gravity, (N, n)."""
        if self.inner is None:
            return np.zeros_like(self.motion.position)
        return np.asarray(self.needed - regressor[:, :, :-3] @ self.inertial[:-3])

    @cached_property
    def mass(self) -> Array:
        """Mass matrix of the joints, rotors included, shape (N, n, n); a free base follows them."""
        if self.response is not None:
            return self.response.mass
        matrix = self.model.mass_matrix(
            self.motion.position, base=self.base, inner=self.inner, inertial=self.inertial
        )
        start = self.model.tree.offset
        joints = slice(start, start + len(self.model.joints))
        return np.asarray(matrix[:, joints, joints])

    def body(self, link: str) -> tuple[BodySeries, Array]:
        """Motion of a rigid link, and the map from a wrench on it to all rows (`RobotModel.body_motion`)."""
        motion = self.motion
        return self.model.body_motion(
            link,
            motion.time,
            motion.position,
            motion.velocity,
            base=self.base,
            inner=self.inner,
            inertial=self.inertial,
        )

    def loads(self) -> Array:
        """Bearing loads, shape (N, n, 4)."""
        state = self.motion.position, self.motion.velocity, self.motion.acceleration
        return self.model.bearing_loads(*state, base=self.base, inner=self.inner, inertial=self.inertial)

    def vibration(self) -> tuple[Array, Array]:
        """Vibration of links that is not observed by encoders.

        Returns:
            Joint torques of links that vibrate from the start, or from later instants because encoder noise
            excites them, shape (N, n, V); and the standard deviation of the amplitude of each of these
            columns, (V,), infinite for the start.
        """
        motion, response = self.motion, self.response
        if self.inner is None or response is None:
            return np.zeros((*motion.position.shape, 0)), np.zeros(0)
        frequency = response.frequencies
        length = float(motion.time[-1] - motion.time[0])
        every = max(2.0 * np.pi / float(frequency.min()), length / MOST_INSTANTS)
        columns, begun = response.free_vibration(every=every, below=2.0 * np.pi * WIDER * motion.cutoff)
        # Density of the joints' acceleration noise at a mode's frequency; a mode's amplitude wanders with a
        # quarter of it, and deflections count by the mode's frequency.
        pushed = response.coupling / np.diag(response.inertia)
        density = frequency**4 * (motion.position_density @ np.mean(pushed**2, axis=0))
        wandering = np.sqrt(density * every / 4.0) / frequency
        return columns, np.where(begun[:, 0] == 0, np.inf, wandering[begun[:, 1]])

    def at_joints(self, rows: Array) -> Array:
        """Forces at the joints, (N, n, C), due to small forces on all rows of the dynamics, (N, rows, C)."""
        if self.response is not None:
            return self.response.at_joints(rows)
        start = self.model.tree.offset
        return rows[:, start : start + len(self.model.joints)]


def torque_of_effects(along: Along) -> Array:
    """Torque that the robot's effects at joints and rigid links require of the actuators, shape (N, n)."""
    model, motion = along.model, along.motion
    used = [u for u in used_effects(model.robot) if isinstance(u.effect, JointEffect)]
    total = _of_pushed_links(along)
    if not used:
        return total
    needed, loads = along.needed, along.loads()
    if isinstance(model, DriveModel):
        total -= coupled_motion(along, needed).forces(used)
    for k, joint in enumerate(model.robot.drives):
        own = [u for u in used if u.at == joint.name]
        signals = np.column_stack(
            [
                motion.time,
                motion.position[:, k],
                motion.velocity[:, k],
                motion.acceleration[:, k],
                needed[:, k],
                np.zeros(motion.time.size),
                loads[:, k],
                np.full(motion.time.size, ROOM_TEMPERATURE),
            ]
        )
        laws = [u for u in own if u.effect.is_friction_law]
        friction = sum((force_of(u, joint, signals, motion, k) for u in laws), np.zeros(motion.time.size))
        signals[:, 5] = friction
        rest = (force_of(u, joint, signals, motion, k) for u in own if u not in laws)
        total[:, k] = -(friction + sum(rest, np.zeros(motion.time.size)))
    return total


def knows_links(robot: Robot) -> bool:
    """Whether the poses of links relative to the base follow from the recorded positions."""
    return not (robot.transmissions or robot.flexible_links)


def _of_pushed_links(along: Along) -> Array:
    """Torque that balances the forces on rigid links at their positions, shape (N, n)."""
    model, motion = along.model, along.motion
    total = np.zeros_like(motion.velocity)
    for used in used_effects(model.robot):
        if not isinstance(used.effect, ForceEffect) or not used.effect.along_link:
            continue
        series, spread = along.body(used.at)
        wrench = ForceAlong(used.effect, model.robot).wrench(series, used.parameters)
        total -= along.at_joints(spread @ wrench[:, :, None])[:, :, 0]
    return total


def coupled_motion(along: Along, needed: Array) -> CoupledMotion:
    """The motion for effects at joints of transmissions; `needed` are the drives' torques, shape (N, n)."""
    model, motion = along.model, along.motion
    assert isinstance(model, DriveModel)
    moved = motion.position, motion.velocity, motion.acceleration
    return CoupledMotion(model, motion.time, *moved, needed, motion.transition)


def force_of(used: UsedEffect, joint: Drive, signals: Array, motion: BandMotion, k: int) -> Array:
    """Force of an effect on a joint, shape (N,).

    Args:
        used: the effect.
        joint: number k.
        signals: in the order of `JointSignals.CHANNELS`, shape (N, 11).
        motion: of all joints.
        k: number of the joint.
    """
    assert isinstance(used.effect, JointEffect)
    bearing = joint.bearing
    along = EffectAlong(
        used.effect,
        gear_ratio=joint.actuator.gear_ratio if joint.actuator else 1.0,
        bearing_arms=(bearing.radial_arm, bearing.axial_arm) if bearing else (0.0, 0.0),
        transition=float(motion.transition[k]),
        directed=not used.effect.states,
    )
    rows = signals if used.effect.states else np.column_stack([signals, motion.direction[:, k]])
    return along.torque(rows, used.parameters)


def inertial_with_effects(model: RobotModel) -> Array:
    """The inertial parameters of the robot, with its effects on bodies, beams and gravity, shape (P,)."""
    numbers = dict(zip(model.inertial_names, model.inertial))
    for used in used_effects(model.robot):
        if used.effect.beam_number:
            numbers[f"{used.at}.{used.effect.beam_number}"] += next(iter(used.parameters.values()))
        if not isinstance(used.effect, BodyEffect):
            continue
        terms = used.effect.terms({name: ca.SX(value) for name, value in used.parameters.items()})
        pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        ten = [
            terms.mass,
            *(terms.first_moment[k] for k in range(3)),
            *(terms.inertia[i, j] for i, j in pairs),
        ]
        body = [f"{used.at}.{number}" for number in BODY_NUMBERS]
        names = [*body, *(f"gravity.{axis}" for axis in "xyz")]
        for name, added in zip(names, [*ten, *(terms.gravity[k] for k in range(3))]):
            if name in numbers:
                numbers[name] += float(ca.DM(added))
    return np.array([numbers[name] for name in model.inertial_names])
