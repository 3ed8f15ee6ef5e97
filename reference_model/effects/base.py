"""The interface of an effect: one physical phenomenon that a model may lack, defined once.

An effect is a small class in its own file: its equations as CasADi expressions, and all other facts about it
as data. Simulator, diagnosis, catalogue page and blind challenge all read that one class.

There are six kinds, by what they change:

* `JointEffect` adds a generalised force to one joint coordinate. Friction, harness springs and everything
  that happens inside an actuator are of this kind (an actuator effect adds *delivered minus commanded*).
* `GearEffect` separates motor and joint, so that the motor position becomes a coordinate.
* `BodyEffect` changes the mass properties of a link or the gravity field.
* `structure.StructureEffect` changes the structure of the robot, `body_force.ForceEffect` applies a force to
  one of its bodies.
* `SensorEffect` changes the values of a channel, and no motion.

Sign: the equation of motion of a joint is ``inverse dynamics(q, qd, qdd) = actuator torque + sum of
JointEffect.torque``; so friction returns a negative value at positive speed.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.effects.signals import GearSignals, JointSignals, SensorSignals, smooth_sign

__all__ = [
    "BodyEffect",
    "BodyTerms",
    "Effect",
    "Extent",
    "GearEffect",
    "GearSignals",
    "JointEffect",
    "JointSignals",
    "Parameter",
    "SensorEffect",
    "SensorSignals",
    "smooth_sign",
]

Values = Mapping[str, "ca.SX | float"]


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Attributes:
        name: key in a robot file and in `diagnosis.json`.
        unit: for a revolute joint; a prismatic joint's is derived from it (N m becomes N, rad becomes m).
        meaning: a phrase for people.
        lower, upper: physically credible bounds.
        typical: order of magnitude; scales optimisation.
        absent: the value at which the effect has no influence, where there is one.
        linear: the contribution is linear in this parameter while the nonlinear ones are fixed.
        estimated: a diagnosis estimates it; otherwise it stays at `default` unless a robot file sets it.
        default: value when a robot file omits it; None means it must be given.
    """

    name: str
    unit: str
    meaning: str
    lower: float
    upper: float
    typical: float
    absent: float | None = None
    linear: bool = False
    estimated: bool = True
    default: float | None = None


@dataclass(frozen=True)
class BodyTerms:
    """Additions to a link's mass properties, in the link's frame and about its origin.

    Attributes:
        mass: [kg].
        first_moment: mass times centre of mass, 3 rows [kg m].
        inertia: about the frame's origin, 3 x 3 [kg m^2].
        gravity: addition to the gravity vector, inertial frame, 3 rows [m/s^2].
        place: the point of the link that carries the mass, in the link's frame, 3 rows [m]; on a flexible
            link it moves with the nearest node. None fixes the additions in the link's frame.
    """

    mass: ca.SX | float = 0.0
    first_moment: ca.SX = field(default_factory=lambda: ca.SX.zeros(3))
    inertia: ca.SX = field(default_factory=lambda: ca.SX.zeros(3, 3))
    gravity: ca.SX = field(default_factory=lambda: ca.SX.zeros(3))
    place: ca.SX | None = None


@dataclass(frozen=True)
class Extent:
    """What a recording covers at one place; effects choose starting values from it.

    Attributes:
        position: lowest and highest position [rad or m].
        speed: largest speed [rad/s or m/s].
        slow: speed that one tenth of the moving samples stay below [rad/s or m/s].
        torque: rms of the actuator torque [N m or N].
        residual: rms of the unexplained torque [N m or N].
        duration: [s].
        sample_time: [s].
        gear_ratio: motor turns per joint turn.
        peak_torque: largest actuator torque [N m or N].
        windows: time windows in which the residual stands out, [(start, stop)] in s.
        orders: strongest angular orders k of the residual, as in cos(k position) [1/rad or 1/m].
        begin: time of the first sample [s].
    """

    position: tuple[float, float]
    speed: float
    slow: float
    torque: float
    residual: float
    duration: float
    sample_time: float
    gear_ratio: float = 1.0
    peak_torque: float = float("inf")
    windows: tuple[tuple[float, float], ...] = ()
    orders: tuple[float, ...] = ()
    begin: float = 0.0


class Effect(ABC):
    """Base of all effects; concrete classes set the class attributes and are used through one instance.

    Attributes:
        id, title: the name in robot files and results, and for people.
        place: its place: a joint, a joint's actuator, a link, the base, or a channel.
        parameters: in the order of the catalogue page.
        equation, source: one line of plain mathematics, and literature.
        signature: how it shows in a recording.
        confused_with: ids of effects that can look alike.
        experiment: how to separate it from those.
        family: effects at one joint that exclude each other share a family, e.g. "dry_friction".
        rung: position in the ladder of a family; the lowest that the data support is named.
        builds_on: ids; one of these effects must be present at the same place.
        simpler: ids of effects that explain part of the same; if the data support one, it is named first.
        contains: ids of its special cases without the essential parameters, with the names of their
            parameters in this effect.
        needs: channels (quantities) without which it cannot be observed.
        essential: parameters that must be given; if empty, all parameters without an absent value.
        ordered: pairs of estimated parameters; a fit makes the first of them no smaller than the second.
        priors: mean and standard deviation of parameters known from other sources than recordings.
        is_event: it happens once, so that it cannot be predicted in held-out stretches of time.
        standard: the parameter of the standard model that is identical to it; usually empty.
        is_beyond: it acts beyond a place, which a recording may reach once.
        is_unknown: it is a curve without a known law.
        along: parameters of the standard model that are functions of the same variable.
        is_friction_law: it is summed into `JointSignals.friction`.
        is_modifier: it multiplies the friction law of its joint and has no effect without one.
        uses_torque: it depends on the actuator torque (so it belongs to the actuator), unless only through a
            parameter that is not estimated and absent by default.
        per_torque: parameters that multiply the actuator's torque, of effects that use it.
        replaces_delay: it delays the torque, so that the joint's torque has no separate delay.
        cuts_torque: it clips the commanded torque, so that it needs the recorded torque; other effects can
            use the torque that the motion requires instead, which has no noise.
        adds_coordinates: it gives rigid bodies coordinates without encoders, which follow from the joints'
            motion and the bodies.
        along_base: its force follows from the rotation of the base, and is small: torques are searched only
            without gyro.
        along_link: its force follows from the position of a point of a rigid link: torques show it.
        beam_number: beam parameter that its parameter adds to (`reference_model.flexible.beam_numbers`).
        along_motion: it has regressors along a recorded joint motion.
    """

    id: ClassVar[str]
    title: ClassVar[str]
    place: ClassVar[Literal["joint", "actuator", "link", "base", "sensor"]]
    parameters: ClassVar[tuple[Parameter, ...]]
    equation: ClassVar[str]
    source: ClassVar[str]
    signature: ClassVar[str]
    confused_with: ClassVar[tuple[str, ...]] = ()
    experiment: ClassVar[str]
    family: ClassVar[str | None] = None
    rung: ClassVar[int] = 0
    builds_on: ClassVar[tuple[str, ...]] = ()
    simpler: ClassVar[tuple[str, ...]] = ()
    contains: ClassVar[Mapping[str, Mapping[str, str]]] = {}
    needs: ClassVar[tuple[str, ...]] = ()
    essential: ClassVar[tuple[str, ...]] = ()
    ordered: ClassVar[tuple[tuple[str, str], ...]] = ()
    priors: ClassVar[Mapping[str, tuple[float, float]]] = {}
    is_event: ClassVar[bool] = False
    standard: ClassVar[str] = ""
    is_beyond: ClassVar[bool] = False
    is_unknown: ClassVar[bool] = False
    along: ClassVar[tuple[str, ...]] = ()
    is_friction_law: ClassVar[bool] = False
    is_modifier: ClassVar[bool] = False
    uses_torque: ClassVar[bool] = False
    per_torque: ClassVar[tuple[str, ...]] = ()
    replaces_delay: ClassVar[bool] = False
    cuts_torque: ClassVar[bool] = False
    adds_coordinates: ClassVar[bool] = False
    along_base: ClassVar[bool] = False
    along_link: ClassVar[bool] = False
    beam_number: ClassVar[str] = ""
    along_motion: ClassVar[bool] = True

    def parameter(self, name: str) -> Parameter:
        """The parameter of that name; raises KeyError."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise KeyError(name)

    @property
    def estimated(self) -> tuple[Parameter, ...]:
        """Parameters a diagnosis estimates."""
        return tuple(parameter for parameter in self.parameters if parameter.estimated)

    @property
    def is_wave(self) -> bool:
        """Whether it is a wave over position whose angular order is estimated."""
        return any(parameter.name == "order" for parameter in self.estimated)

    @property
    def is_searched(self) -> bool:
        """Whether a diagnosis searches for it in torques; both engines simulate every effect."""
        return self.along_motion

    @property
    def is_beyond_standard(self) -> bool:
        """Whether no parameter of the standard model (friction, offsets, delays, bodies) contains it."""
        return not (self.standard or self.replaces_delay)

    @property
    def turns_base(self) -> bool:
        """Whether a diagnosis searches for it in the gyros of a free base."""
        return self.place == "base" and not self.along_motion and "angular_velocity" in self.needs

    def defaults(self) -> dict[str, float]:
        """Values of the parameters that have a default."""
        return {p.name: p.default for p in self.parameters if p.default is not None}

    def bounds(self, extent: Extent) -> Mapping[str, tuple[float, float]]:
        """Bounds narrower than the catalogue's for a recording of this extent."""
        return {}

    def implausible(self, values: Mapping[str, float]) -> str:
        """Why these parameter values are unphysical, though each is inside its bounds; else empty."""
        return ""

    def contradiction(self, values: Mapping[str, float]) -> str:
        """Why these parameter values exclude each other, with the values; else empty."""
        return ""

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        """Starting values of the nonlinear estimated parameters; one empty mapping if there are none."""
        return ({},)


class JointEffect(Effect):
    """Adds a generalised force to a joint coordinate."""

    #: Number of internal states.
    states: ClassVar[int] = 0

    @abstractmethod
    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        """Generalised force added to the joint [N m or N]; `z` has `states` rows."""

    def state_rate(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        """Time derivative of `z`; effects without states return an empty column."""
        return ca.SX(0, 1)

    def build_up(self, values: Mapping[str, float]) -> float:
        """Travel over which the force builds up after a rest or a reversal [rad or m]; 0 when at once."""
        return 0.0

    def initial_state(self, s: JointSignals, p: Values) -> ca.SX:
        """`z` at the first sample."""
        return ca.SX.zeros(self.states)


class GearEffect(Effect):
    """Contributes to the torque that a gear transmits between its motor, a coordinate of its own, and joint.

    The torque is that of a spring and a damper on the twist, ``elastic + viscous``. The effects of a joint
    are combined in `reference_model.plant.gears`.
    """

    place = "joint"
    #: Number of internal states.
    states: ClassVar[int] = 0

    def behind(self, s: GearSignals, p: Values) -> GearSignals:
        """The motion between motor and joint that acts on the spring, with the play subtracted, if any."""
        return s

    @abstractmethod
    def elastic(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        """The part of the torque that a constant twist maintains [N m or N]; `z` has `states` rows."""

    def viscous(self, s: GearSignals, p: Values) -> ca.SX:
        """The part of the torque due to the rate of the twist [N m or N]."""
        return ca.SX(0.0)

    @abstractmethod
    def stored(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        """Energy stored in the gear [J]."""

    def loss(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        """Dissipated power [W]."""
        return self.viscous(s, p) * s.rate

    def state_rate(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        """Time derivative of `z`; effects without states return an empty column."""
        return ca.SX(0, 1)

    def first_loading(self, s: GearSignals, p: Values) -> ca.SX:
        """`z` after the gear was brought to its twist in one direction from rest without load."""
        return ca.SX(0, 1)


class YieldingGear(GearEffect):
    """A gear whose twist follows from the transmitted torque: one encoder and the torque determine it."""

    @abstractmethod
    def twist(self, torque: ca.SX, rate: ca.SX, p: Values) -> ca.SX:
        """Twist of the gear far below its resonance, to first order in its damping [rad or m].

        Args:
            torque: transmitted torque [N m or N].
            rate: its rate [N m/s or N/s].
            p: parameters.
        """


class BodyEffect(Effect):
    """Changes mass properties of a link, or the gravity field."""

    @property
    def is_beyond_standard(self) -> bool:
        """Gravity is: the standard model estimates the bodies only."""
        return self.place == "base"

    @abstractmethod
    def terms(self, p: Values) -> BodyTerms:
        """Additions to the mass properties, in the link's frame."""


class SensorEffect(Effect):
    """Changes the values of a channel.

    Attributes:
        searched_in: quantities whose channels a diagnosis searches for it.
        same_as: quantities at which recordings do not distinguish it from an effect at the joint, with the id
            of that effect, which is searched for instead.
    """

    place = "sensor"
    searched_in: ClassVar[frozenset[str]] = frozenset({"position"})
    same_as: ClassVar[Mapping[str, str]] = {}

    @abstractmethod
    def error(self, s: SensorSignals, p: Values) -> ca.SX:
        """Measured minus true, to first order in the parameters, as an expression."""

    @abstractmethod
    def apply(
        self, time: NDArray[np.float64], values: NDArray[np.float64], p: Mapping[str, float]
    ) -> NDArray[np.float64]:
        """Recording of the faulty sensor, given true `values` sampled at `time`, without approximation."""
