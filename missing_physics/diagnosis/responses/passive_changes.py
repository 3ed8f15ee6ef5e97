"""What is missing from base and flexible links, as changes of their equations along a recorded motion.

Each change says, for values of its numbers, what it adds to the linear equations of
`responses/passive_course.py`, and what it adds, without approximation in the numbers, to the rows of the
equations of motion from which torques follow.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.dynamics.inverse import Passive
from missing_physics.diagnosis.modal.response import ModalResponse
from missing_physics.diagnosis.responses.passive_course import Deviation, Equations, PassiveCourse, skew
from reference_model.effects.catalogue import UsedEffect, get_effect
from reference_model.effects.structure import StructureEffect
from reference_model.evaluation.model import RobotModel
from reference_model.plant.acting import bodies_with
from robot_model import EffectUse, InputError

__all__ = ["CHANGES", "Change", "Masses", "Rows", "change_of"]

Array = NDArray[np.float64]
Values = Mapping[str, float]

STIFFENING = "centrifugal_stiffening"


@dataclass(frozen=True)
class Rows:
    """The equations of motion at a deviating motion.

    Attributes:
        inertia: of the p velocities that follow and of whatever a change adds, shape (N, p, p).
        coupling: rows of the joints by these accelerations, shape (N, n, p).
        needed: rows of the p without their accelerations, shape (N, p).
        torque: the same of the joints, shape (N, n).
    """

    inertia: Array
    coupling: Array
    needed: Array
    torque: Array


class Change(ABC):
    """A change of one robot along one motion.

    Args:
        course: the motion.
        place: where the effect sits.
    """

    def __init__(self, course: PassiveCourse, place: str) -> None:
        self.course, self.place = course, place

    @abstractmethod
    def equations(self, values: Values) -> Equations:
        """The linear equations at these values, w that of the change."""

    @abstractmethod
    def rows(self, values: Values, moved: Deviation) -> Rows:
        """The whole equations at a deviating motion."""

    def answering(self, response: ModalResponse, values: Values) -> ModalResponse:
        """How joints and modes answer small further forces."""
        return response

    def _described(self, moved: Deviation) -> Rows:
        """Without the change."""
        return self._of(self.course, moved)

    def _of(self, course: PassiveCourse, moved: Deviation) -> Rows:
        """Of any robot with these coordinates."""
        needed, mass, own, joints = course.needed(moved), course.mass, course.rows, course.joints
        return Rows(mass[:, own][:, :, own], mass[:, joints][:, :, own], needed[:, own], needed[:, joints])


class Damping(Change):
    """Other damping ratios of all modes of a link."""

    def __init__(self, course: PassiveCourse, place: str) -> None:
        super().__init__(course, place)
        if course.along.inner is None:
            raise InputError("no link bends.")
        body = next((b for b in course.model.tree.bodies if b.name == place), None)
        if body is None or body.flexible is None:
            raise InputError(f"link '{place}' is rigid.")
        self._unit = np.zeros(course.modes)
        self._unit[body.modal : body.modal + body.modes] = 2 * body.flexible.frequencies

    def equations(self, values: Values) -> Equations:
        course, still = self.course, self.course.still
        inner, f = course.along.inner, course.free
        assert inner is not None
        added = values["damping_ratio"] * self._unit
        lossy, force = still.lossy.copy(), np.zeros_like(still.force)
        lossy[:, f:, f:] += np.diag(added)
        force[:, f:] = inner.modal_rates * added
        return replace(still, lossy=lossy, force=force)

    def rows(self, values: Values, moved: Deviation) -> Rows:
        f, inner = self.course.free, self.course.along.inner
        assert inner is not None
        found = self._described(moved)
        rates = inner.modal_rates + moved.rates[:, f:]
        needed = found.needed.copy()
        needed[:, f:] += values["damping_ratio"] * self._unit * rates
        return replace(found, needed=needed)

    def answering(self, response: ModalResponse, values: Values) -> ModalResponse:
        return replace(response, damping=response.damping + np.diag(values["damping_ratio"] * self._unit))


class Stiffening(Change):
    """A share of a beam's foreshortening, which is left out of its description.

    The rows of the equations of motion are taken for linear in it, between those of the described robot and
    those of the one whose beam has all of it: what is left is of second order in the bending. What it does to
    the deviation that it causes is of second order in its strength, and left out.
    """

    def __init__(self, course: PassiveCourse, place: str) -> None:
        super().__init__(course, place)
        whole = EffectUse.model_validate({"effect": STIFFENING, "at": place, "strength": 1.0})
        effect, along = get_effect(STIFFENING), course.along
        assert isinstance(effect, StructureEffect)
        stiffer = effect.changed(course.model.robot, place, whole.parameters)
        self._whole = PassiveCourse(along, RobotModel(stiffer))
        given: Passive = {"base": along.base, "inner": along.inner, "inertial": along.about}
        rows = [model.inverse_dynamics(*along.state, **given) for model in (course.model, self._whole.model)]
        self._added = (rows[1] - rows[0])[:, course.rows]

    def equations(self, values: Values) -> Equations:
        return replace(self.course.still, force=values["strength"] * self._added)

    def rows(self, values: Values, moved: Deviation) -> Rows:
        strength = values["strength"]
        none, whole = self._of(self.course, moved), self._of(self._whole, moved)
        mixed = {k: getattr(none, k) + strength * (getattr(whole, k) - getattr(none, k)) for k in vars(none)}
        return Rows(**mixed)


class Carried(Change):
    """A point mass at a node of a link that bends, of whose mass the equations of motion are linear.

    The matrices of the robot with one kilogram there tell those with any other mass.
    """

    def __init__(self, course: PassiveCourse, place: str) -> None:
        super().__init__(course, place)
        if all(link.name != place for link in course.model.robot.flexible_links):
            raise InputError(f"link '{place}' is rigid.")
        self._with_one: dict[tuple[float, ...], tuple[PassiveCourse, Array]] = {}

    def _unit(self, values: Values) -> tuple[PassiveCourse, Array]:
        """The robot with one kilogram, and what it needs more along the foretold motion."""
        point = {axis: values[axis] for axis in "xyz"}
        key = tuple(point.values())
        if key not in self._with_one:
            course, along = self.course, self.course.along
            effect = get_effect("payload")
            used = UsedEffect(effect, self.place, {"mass": 1.0, **point})
            robot = course.model.robot
            other = PassiveCourse(along, RobotModel(robot, bodies=bodies_with(robot, [used])))
            given: Passive = {"base": along.base, "inner": along.inner, "inertial": along.about}
            rows = [m.inverse_dynamics(*along.state, **given) for m in (course.model, other.model)]
            self._with_one[key] = other, (rows[1] - rows[0])[:, course.rows]
        return self._with_one[key]

    def equations(self, values: Values) -> Equations:
        other, needed = self._unit(values)
        mass, still = values["mass"], self.course.still
        mixed = {k: v + mass * (getattr(other.still, k) - v) for k, v in vars(still).items() if k != "force"}
        return Equations(**mixed, force=mass * needed)

    def rows(self, values: Values, moved: Deviation) -> Rows:
        none, one = self._of(self.course, moved), self._of(self._unit(values)[0], moved)
        return Rows(**{k: v + values["mass"] * (getattr(one, k) - v) for k, v in vars(none).items()})


class Wheels(Change):
    """Wheels on a free base, without imbalance."""

    def __init__(self, course: PassiveCourse, place: str) -> None:
        super().__init__(course, place)
        if not course.free:
            raise InputError("the base does not move.")
        self._time = course.along.motion.time

    def _momentum(self, values: Values) -> tuple[Array, Array]:
        """Momentum and its rate, shape (N, 3) each."""
        first, torque = (np.array([values[f"{w}_{a}"] for a in "xyz"]) for w in ("momentum", "torque"))
        drag, time = values["drag"], self._time[:, None]
        fading = np.exp(-drag * time)
        risen = -np.expm1(-drag * time) / drag if drag > 0 else time
        momentum = fading * first + risen * torque
        return momentum, torque - drag * momentum

    def equations(self, values: Values) -> Equations:
        still, omega = self.course.still, self.course.twist[:, 3:]
        momentum, rate = self._momentum(values)
        lossy, force = still.lossy.copy(), np.zeros_like(still.force)
        lossy[:, 3:6, 3:6] -= skew(momentum[self.course.at])
        force[:, 3:6] = np.cross(omega, momentum) + rate
        return replace(still, lossy=lossy, force=force)

    def rows(self, values: Values, moved: Deviation) -> Rows:
        found = self._described(moved)
        momentum, rate = self._momentum(values)
        needed = found.needed.copy()
        needed[:, 3:6] += np.cross(self.course.twist[:, 3:] + moved.rates[:, 3:6], momentum) + rate
        return replace(found, needed=needed)


class Slosh(Change):
    """A mass on springs in a free base, taken out of the base's own; three coordinates u in base axes.

    The equation of the liquid is divided by its mass.
    """

    def __init__(self, course: PassiveCourse, place: str) -> None:
        super().__init__(course, place)
        base = course.along.base
        if not course.free or base is None:
            raise InputError("the base does not move.")
        self._omega, self._turning = base.angular_velocity, base.angular_acceleration
        self._pulled = base.linear_acceleration

    def _place(self, values: Values) -> Array:
        return np.array([values[axis] for axis in "xyz"])

    def _at_place(self, at: Array) -> Array:
        """Foretold acceleration of the tank, base axes [m/s^2], shape (N, 3)."""
        omega = self._omega
        return self._pulled + np.cross(self._turning, at) + np.cross(omega, np.cross(omega, at))

    def _turned(self, samples: NDArray[np.int_] | slice) -> Array:
        """omegad x + omega x omega x as matrices, shape (K, 3, 3)."""
        turn = skew(self._omega[samples])
        return np.asarray(skew(self._turning[samples]) + turn @ turn)

    def equations(self, values: Values) -> Equations:
        still, course, at = self.course.still, self.course, self._place(values)
        mass, omega = values["mass"], 2 * np.pi * values["frequency"]
        q, p, d = len(course.at), course.size, course.modes
        inertia, lossy = np.zeros((q, p + 3, p + 3)), np.zeros((q, p + 3, p + 3))
        elastic = np.zeros((q, p + 3, d + 3))
        inertia[:, :p, :p], lossy[:, :p, :p], elastic[:, :p, :d] = still.inertia, still.lossy, still.elastic
        lever = skew(at)
        spread = np.vstack([np.eye(3), lever])  # a force at the tank on the base's rows
        coriolis, turned = 2 * skew(self._omega[course.at]), self._turned(course.at)
        inertia[:, :6, p:] = mass * spread
        lossy[:, :6, p:] = mass * spread @ coriolis
        elastic[:, :6, d:] = mass * spread @ turned
        pulled = self._at_place(at)
        elastic[:, 3:6, d:] -= mass * skew(pulled[course.at])  # u x a
        inertia[:, p:, :6] = spread.T
        inertia[:, p:, p:] = np.eye(3)
        # rate of the deviating twist is no acceleration, and the tank turns otherwise
        linear, angular = course.twist[course.at, :3], course.twist[course.at, 3:]
        turn = skew(angular)
        arm = np.cross(angular, at)
        by_rate = -(skew(arm) + turn @ lever)
        lossy[:, p:, :3], lossy[:, p:, 3:6] = turn, by_rate - skew(linear)
        lossy[:, p:, p:] = coriolis + 2 * values["damping_ratio"] * omega * np.eye(3)
        elastic[:, p:, d:] = turned + omega**2 * np.eye(3)
        force = np.zeros((len(still.force), p + 3))
        force[:, p:] = pulled
        return Equations(inertia, lossy, elastic, force)

    def rows(self, values: Values, moved: Deviation) -> Rows:
        course, at = self.course, self._place(values)
        p, d = course.size, course.modes
        own = self._described(Deviation(moved.rates[:, :p], moved.shapes[:, :d]))
        mass, w = values["mass"], 2 * np.pi * values["frequency"]
        u, rate, omega = moved.shapes[:, d:], moved.rates[:, p:], self._omega + moved.rates[:, 3:6]
        samples = len(u)
        spread = np.vstack([np.eye(3), skew(at)])
        inertia = np.zeros((samples, p + 3, p + 3))
        inertia[:, :p, :p] = own.inertia
        inertia[:, :6, p:], inertia[:, p:, :6], inertia[:, p:, p:] = mass * spread, spread.T, np.eye(3)
        relative = 2 * np.cross(omega, rate) + np.einsum("tij,tj->ti", self._turned(slice(None)), u)
        needed = np.zeros((samples, p + 3))
        needed[:, :p] = own.needed
        needed[:, :6] += mass * relative @ spread.T
        needed[:, 3:6] += mass * np.cross(u, self._at_place(at))
        springs = 2 * values["damping_ratio"] * w * rate + w**2 * u
        needed[:, p:] = np.cross(omega, np.cross(omega, at)) + relative + springs
        coupling = np.pad(own.coupling, ((0, 0), (0, 0), (0, 3)))
        return Rows(inertia, coupling, needed, own.torque)


class Masses(Change):
    """Other masses, first moments and inertias, to first order: a number for each of some combinations."""

    def __init__(self, course: PassiveCourse, directions: Array) -> None:
        """Evaluate the regressor.

        Args:
            course: the motion.
            directions: change of all inertial numbers by each combination, shape (P, B).
        """
        super().__init__(course, "")
        along = course.along
        regressor = course.model.regressor(
            *along.state, base=along.base, inner=along.inner, inertial=along.about
        )
        self._added = regressor @ directions

    def equations(self, values: Values) -> Equations:
        added = self._added @ np.array(list(values.values()))
        return replace(self.course.still, force=added[:, self.course.rows])

    def rows(self, values: Values, moved: Deviation) -> Rows:
        added, found = self._added @ np.array(list(values.values())), self._described(moved)
        return replace(
            found,
            needed=found.needed + added[:, self.course.rows],
            torque=found.torque + added[:, self.course.joints],
        )


#: How each effect changes the equations.
CHANGES: Mapping[str, Callable[[PassiveCourse, str], Change]] = MappingProxyType(
    {
        STIFFENING: Stiffening,
        "modal_damping": Damping,
        "payload": Carried,
        "reaction_wheel": Wheels,
        "slosh": Slosh,
    }
)


def change_of(effect: str, course: PassiveCourse, place: str) -> Change | None:
    """The change that an effect is; None where the robot cannot have it there."""
    try:
        return CHANGES[effect](course, place)
    except InputError:
        return None
