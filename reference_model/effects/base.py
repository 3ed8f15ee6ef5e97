"""The interface of an effect: one left-out physical phenomenon, said once.

An effect is a small class in a file of its own: its equations as CasADi expressions, and everything else that
is known of it as data. Simulator, diagnosis, catalogue page and blind challenge all read that one class.

There are six kinds, by what they change:

* `JointEffect` adds a generalised force to one joint coordinate. Friction, harness springs and everything
  that happens inside an actuator are of this kind (an actuator effect adds *delivered minus commanded*).
* `GearEffect` lets motor and joint move apart, so that the motor becomes a coordinate of its own.
* `BodyEffect` changes the mass properties of a link or the gravity field.
* `structure.StructureEffect` changes what the robot is, `body_force.ForceEffect` pushes on one of its bodies.
* `SensorEffect` changes what a channel says, and no motion.

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
    """One number of an effect.

    Attributes:
        name: key in a robot file and in `diagnosis.json`.
        unit: for a revolute joint; a prismatic joint's is made from it (N m becomes N, rad becomes m).
        meaning: a phrase for people.
        lower, upper: bounds of what is physically credible.
        typical: order of magnitude; scales optimisation.
        absent: the value at which the effect has no influence, where there is one.
        linear: the contribution is linear in this number while the non-linear ones are held.
        estimated: a diagnosis estimates it; otherwise it stays at `default` unless a robot file sets it.
        default: value when a robot file leaves it out; None means it must be given.
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
        orders: strongest angular orders k of the residual, seen as cos(k position) [1/rad or 1/m].
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


class Effect(ABC):
    """Base of all effects; concrete classes set the class attributes and are used through one instance.

    Attributes:
        id, title: the name in robot files and results, and for people.
        place: what it sits at: a joint (its actuator included), a link, the base, or a channel.
        parameters: in the order of the catalogue page.
        equation, source: one line of plain mathematics, and literature.
        signature: how it shows in a recording.
        confused_with: ids of effects that can look alike.
        experiment: what separates it from those.
        family: effects of one joint of which at most one may be present share a family, e.g. "dry_friction".
        rung: position in the ladder of a family; the lowest that the data support is named.
        builds_on: ids of which one must be present at the same place before this one means anything.
        simpler: ids that can do part of the same; where one of them is supported it is named first.
        contains: ids of what it is without its essential sizes, with their parameters' names in it.
        needs: channels (quantities) without which it cannot be seen.
        essential: parameters without which it means nothing; if empty, all that are absent at no value.
        ordered: pairs of estimated parameters; a fit makes the first of them no smaller than the second.
        priors: mean and standard deviation of parameters of which something is known that no recording says.
        is_event: it happens once, so that what it does cannot be foretold in unseen stretches of time.
        standard: parameter of the standard model that it is; empty for all but a few.
        is_beyond: it acts beyond a place, which a recording may reach once.
        is_unknown: it is a curve without a known law.
        along: parameters of the standard model that are functions of the same variable.
        is_friction_law: it is summed into `JointSignals.friction`.
        is_modifier: it multiplies the friction law of its joint and means nothing without one.
        uses_torque: it uses the actuator torque (so it is a matter of the actuator), unless only through a
            parameter that is not estimated and absent by default.
        shares_torque: it takes or adds a share of the actuator's torque, which makes up for it.
        replaces_delay: it is late as a whole, so that the joint's torque has no other delay.
        cuts_torque: it cuts what a recorded torque commands, so that this is needed as it was recorded; other
            effects follow as well from what the motion needs, which has no noise.
        along_base: it follows from how a base turns, and is small: joints show it where no gyro does.
        beam_number: parameter of a beam that it adds to (`reference_model.flexible.beam_numbers`).
        along_link: it follows from where a point of a rigid link is: joints show it.
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
    shares_torque: ClassVar[bool] = False
    replaces_delay: ClassVar[bool] = False
    cuts_torque: ClassVar[bool] = False
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
    def turns_base(self) -> bool:
        """Whether a diagnosis searches for it in the gyros of a free base."""
        return self.place == "base" and not self.along_motion and "angular_velocity" in self.needs

    def defaults(self) -> dict[str, float]:
        """Values of the parameters that have a default."""
        return {p.name: p.default for p in self.parameters if p.default is not None}

    def bounds(self, extent: Extent) -> Mapping[str, tuple[float, float]]:
        """Bounds that a recording of this extent makes narrower than the catalogue's."""
        return {}

    def implausible(self, values: Mapping[str, float]) -> str:
        """Why these parameter values are no physics, though each is inside its bounds; else empty."""
        return ""

    def contradiction(self, values: Mapping[str, float]) -> str:
        """Why these parameter values exclude each other, with the values; else empty."""
        return ""

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        """Values of the non-linear estimated parameters to start a fit from; one empty mapping if none."""
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
    """Takes part in what a gear transmits between a motor that moves by itself and its joint.

    The torque is a spring's and a damper's, ``elastic + viscous``, of the twist. Where the effects of a joint
    are put together is `reference_model.plant.gears`.
    """

    place = "joint"
    #: Number of internal states.
    states: ClassVar[int] = 0

    def behind(self, s: GearSignals, p: Values) -> GearSignals:
        """What the spring sees of the motion between motor and joint: less the play of an effect with one."""
        return s

    @abstractmethod
    def elastic(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        """The part of the torque that a twist at rest keeps up [N m or N]; `z` has `states` rows."""

    def viscous(self, s: GearSignals, p: Values) -> ca.SX:
        """The part of the torque that comes of the rate of the twist [N m or N]."""
        return ca.SX(0.0)

    @abstractmethod
    def stored(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        """Energy kept in the gear [J]."""

    def loss(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        """Power turned into heat [W]."""
        return self.viscous(s, p) * s.rate

    def state_rate(self, s: GearSignals, p: Values, z: ca.SX) -> ca.SX:
        """Time derivative of `z`; effects without states return an empty column."""
        return ca.SX(0, 1)

    def first_loading(self, s: GearSignals, p: Values) -> ca.SX:
        """`z` when the gear was brought to its twist in one go from rest without load."""
        return ca.SX(0, 1)


class YieldingGear(GearEffect):
    """A gear whose twist follows from the transmitted torque: one encoder and the torque determine it."""

    @abstractmethod
    def twist(self, torque: ca.SX, rate: ca.SX, p: Values) -> ca.SX:
        """Of a gear far below its resonance, to first order in its damping [rad or m].

        Args:
            torque: that is transmitted [N m or N].
            rate: of it [N m/s or N/s].
            p: parameters.
        """


class BodyEffect(Effect):
    """Changes mass properties of a link, or the gravity field."""

    @abstractmethod
    def terms(self, p: Values) -> BodyTerms:
        """What is added, in the link's frame."""


class SensorEffect(Effect):
    """Changes what a channel says.

    Attributes:
        searched_in: quantities in whose channels a diagnosis searches for it.
    """

    place = "sensor"
    searched_in: ClassVar[frozenset[str]] = frozenset({"position"})

    @abstractmethod
    def error(self, s: SensorSignals, p: Values) -> ca.SX:
        """Measured minus true, to first order in the parameters, as an expression."""

    @abstractmethod
    def apply(
        self, time: NDArray[np.float64], values: NDArray[np.float64], p: Mapping[str, float]
    ) -> NDArray[np.float64]:
        """What the faulty sensor would have recorded of `values` sampled at `time`, without approximation."""
