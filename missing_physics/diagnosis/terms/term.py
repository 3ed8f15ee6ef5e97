"""Terms of an explanation, and what each contributes to the torque a model predicts.

A term is an effect at a place with parameter values. Along a known motion its contribution to the predicted
actuator torque is evaluated by the effect's own equations, at the full sampling rate and before the filter:

* a joint effect adds a generalised force T, so the actuator must deliver ``inverse dynamics - T``;
* a body effect changes the mass properties in which inverse dynamics is linear;
* a sensor effect e (measured minus true) of a position changes the motion at which inverse dynamics is taken,
  to first order by its exact derivatives: ``-(dID/dq e + dID/dqd e' + dID/dqdd e'')``;
* one of a torque sensor is added to what inverse dynamics predicts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.bodies.realisable import BODY_NUMBERS
from reference_model.effects.along import EffectAlong, SensorAlong
from reference_model.effects.base import (
    BodyEffect,
    Effect,
    JointEffect,
    Parameter,
    SensorEffect,
    SensorSignals,
)
from reference_model.effects.units import unit_at
from robot_model import Joint, Robot, unit_of

__all__ = [
    "BODY_NUMBERS",
    "Place",
    "Term",
    "body_terms",
    "channel_error",
    "depends_on",
    "in_order",
    "joint_torque",
    "sensor_error",
]

Array = NDArray[np.float64]

#: Relative difference of two numbers that are the same but for rounding.
EQUAL = 1e-9
#: Rounds in which what a sensor was shown is found from what it said, after the opposite error has undone
#: most of it: exactly a delay, a gain up to its square. Each round leaves of that what the effect makes it.
ROUNDS = 2


@dataclass(frozen=True)
class Term:
    """An effect at a place.

    Attributes:
        effect: catalogue entry.
        at: joint, link, `base` or channel.
        parameters: a value for every parameter of the effect.
        nominal: True when the nominal robot has it already.
        frozen: True keeps its parameters as they are.
        unseen: parameters on which the data hold no information; they stay as they are.
        narrowed: bounds of parameters that these data make narrower than the catalogue's.
        beside: numbers of the recordings that are estimated with it and are none of its parameters, as how
            a hidden mode moved at the first sample; their values are among `parameters`.
        held: parameters that runs in closed loop tell, with their standard deviations: a regression, which
            knows them less well, leaves them as they are.
    """

    effect: Effect
    at: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    nominal: bool = False
    frozen: bool = False
    narrowed: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    unseen: tuple[str, ...] = ()
    beside: tuple[Parameter, ...] = ()
    held: Mapping[str, float] = field(default_factory=dict)

    @property
    def released(self) -> Term:
        """The same term with no number held."""
        return replace(self, held={}) if self.held else self

    @property
    def key(self) -> tuple[str, str]:
        """What identifies a term within an explanation."""
        return (self.effect.id, self.at)

    @property
    def label(self) -> str:
        """`effect@place`."""
        return f"{self.effect.id}@{self.at}"

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the parameters that are estimated."""
        return tuple(p.name for p in self.estimated)

    @property
    def estimated(self) -> tuple[Parameter, ...]:
        """Parameters that are estimated; none of a frozen term."""
        if self.frozen:
            return ()
        return tuple(p for p in (*self.effect.estimated, *self.beside) if p.name not in self.unseen)

    @property
    def tied(self) -> tuple[tuple[str, str], ...]:
        """Pairs of parameters in order that are one number: the greater, not free, goes with the smaller."""
        return tuple(
            (greater, smaller)
            for greater, smaller in self.effect.ordered
            if greater in self.unseen and smaller in self.free and self.same(greater, smaller)
        )

    def same(self, greater: str, smaller: str) -> bool:
        """Whether two parameters in order stand at their bound, which is each other."""
        return self.parameters[greater] <= self.parameters[smaller] * (1.0 + EQUAL)

    @property
    def own(self) -> Mapping[str, float]:
        """Values of the effect's parameters alone."""
        others = {p.name for p in self.beside}
        return {name: value for name, value in self.parameters.items() if name not in others}

    @property
    def at_torque(self) -> bool:
        """Whether it is an error of a torque sensor."""
        return isinstance(self.effect, SensorEffect) and self.at.endswith(".torque")

    @property
    def scales_torque(self) -> bool:
        """Whether it can explain a recording by letting hardly any torque through."""
        if isinstance(self.effect, SensorEffect):
            return self.at_torque and depends_on(self.effect, "value")
        return isinstance(self.effect, JointEffect) and self.effect.uses_torque

    @property
    def is_linear(self) -> bool:
        """Whether its contribution is in proportion to its parameters.

        What a torque sensor adds is in proportion to the torque it was shown, not to what it said.
        """
        return all(p.linear for p in self.effect.parameters) and not self.at_torque

    @property
    def values(self) -> Array:
        """Values of the free parameters."""
        return np.array([self.parameters[name] for name in self.free], dtype=float)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the free parameters."""
        pairs = [self.narrowed.get(p.name, (p.lower, p.upper)) for p in self.estimated]
        return np.array([low for low, _ in pairs]), np.array([high for _, high in pairs])

    def at_values(self, values: Array) -> Term:
        """The same term with other values of its free parameters, put inside their bounds."""
        bounded = np.clip(values, *self.bounds)
        changed = {**self.parameters, **dict(zip(self.free, map(float, bounded)))}
        changed.update({greater: changed[smaller] for greater, smaller in self.tied})
        return replace(self, parameters=changed)

    def unit(self, robot: Robot, parameter: Parameter) -> str:
        """Unit of one of its parameters where it sits in `robot`."""
        place = self.at.split(".")[0]
        prismatic = any(joint.name == place and joint.kind == "prismatic" for joint in robot.joints)
        channel = unit_of(self.at, prismatic=prismatic) if "." in self.at else None
        return unit_at(parameter.unit, prismatic=prismatic, channel_unit=channel)


def in_order(terms: Sequence[Term]) -> Iterator[tuple[int, int]]:
    """Places, among the free parameters of all `terms`, of those in order: the greater and the smaller."""
    start = 0
    for term in terms:
        for greater, smaller in term.effect.ordered:
            if {greater, smaller} <= set(term.free):
                yield start + term.free.index(greater), start + term.free.index(smaller)
        start += len(term.free)


@dataclass(frozen=True)
class Place:
    """A joint as effects see it: gear ratio, bearing arms and the speed that counts as zero."""

    gear_ratio: float
    bearing_arms: tuple[float, float]
    transition: float

    @classmethod
    def of(cls, joint: Joint, transition: float) -> Place:
        """The place of `joint`; `transition` is the uncertainty of its speed [rad/s or m/s]."""
        bearing = joint.bearing
        return cls(
            gear_ratio=joint.actuator.gear_ratio if joint.actuator else 1.0,
            bearing_arms=(bearing.radial_arm, bearing.axial_arm) if bearing else (0.0, 0.0),
            transition=transition,
        )


@lru_cache(maxsize=512)
def _along(effect_id: str, effect: JointEffect, place: Place) -> EffectAlong:
    return EffectAlong(
        effect,
        gear_ratio=place.gear_ratio,
        bearing_arms=place.bearing_arms,
        transition=place.transition,
    )


def joint_torque(term: Term, place: Place, signals: Array) -> tuple[Array, Array]:
    """Generalised force of a joint effect and its derivative by the free parameters.

    Args:
        signals: shape (N, 11), in the order of `JointSignals.CHANNELS`.

    Returns:
        Force, shape (N,), and Jacobian, shape (N, number of free parameters).
    """
    effect = term.effect
    assert isinstance(effect, JointEffect)
    along = _along(effect.id, effect, place)
    count = len(term.free)
    names = (*term.free, *(greater for greater, _ in term.tied))
    force, jacobian = along.evaluate(signals, dict(term.parameters), names)
    for k, (_, smaller) in enumerate(term.tied):
        jacobian[:, term.free.index(smaller)] += jacobian[:, count + k]
    return force, jacobian[:, :count]


@lru_cache(maxsize=128)
def _sensor_along(effect_id: str, effect: SensorEffect) -> SensorAlong:
    return SensorAlong(effect)


@lru_cache(maxsize=128)
def depends_on(effect: SensorEffect, signal: str) -> bool:
    """Whether the error of a sensor depends on the `value` or the `rate` of what it measures."""
    signals = SensorSignals(*(ca.SX.sym(name) for name in ("time", "value", "rate")))
    symbols = {p.name: ca.SX.sym(p.name) for p in effect.parameters}
    return bool(ca.depends_on(effect.error(signals, symbols), getattr(signals, signal)))


def sensor_error(term: Term, time: Array, value: Array, rate: Array) -> tuple[Array, Array]:
    """Error of a channel and its first two time derivatives, with Jacobians by the free parameters.

    Returns:
        Errors, shape (3, N): the error, its rate and its second derivative; Jacobians, shape (3, N, k).
    """
    effect = term.effect
    assert isinstance(effect, SensorEffect)
    along = _sensor_along(effect.id, effect)
    parameters = dict(term.parameters)
    error = along.error(time, value, rate, parameters)
    jacobian = (
        along.jacobian(time, value, rate, parameters, term.free) if term.free else np.zeros((time.size, 0))
    )
    both = np.column_stack([error, jacobian])
    spline = make_interp_spline(time, both, k=5)
    stacked = np.stack([both, spline(time, 1), spline(time, 2)])
    return stacked[:, :, 0], stacked[:, :, 1:]


def channel_error(term: Term, time: Array, measured: Array) -> tuple[Array, Array]:
    """What the sensor of a measured channel added, and its derivative by the free parameters.

    The true channel is the one of which the effect makes the measured one, found by successive substitution.

    Returns:
        Measured minus true, shape (N,); Jacobian, shape (N, k).
    """
    effect = term.effect
    assert isinstance(effect, SensorEffect)
    parameters = dict(term.parameters)
    true = effect.apply(time, measured, {name: -value for name, value in parameters.items()})
    for _ in range(ROUNDS):
        true = true + measured - effect.apply(time, true, parameters)
    rate = np.gradient(true, time)
    jacobian = (
        _sensor_along(effect.id, effect).jacobian(time, true, rate, parameters, term.free)
        if term.free
        else np.zeros((time.size, 0))
    )
    return measured - true, jacobian


@lru_cache(maxsize=128)
def _body_function(effect_id: str, effect: BodyEffect) -> ca.Function:
    names = [p.name for p in effect.parameters]
    symbols = {name: ca.SX.sym(name) for name in names}
    terms = effect.terms(symbols)
    inertia = terms.inertia
    numbers = ca.vertcat(
        terms.mass,
        terms.first_moment,
        inertia[0, 0],
        inertia[1, 1],
        inertia[2, 2],
        inertia[0, 1],
        inertia[0, 2],
        inertia[1, 2],
        terms.gravity,
    )
    free = ca.vertcat(*(symbols[p.name] for p in effect.estimated))
    everything = ca.vertcat(*symbols.values())
    return ca.Function(effect_id, [everything], [ca.densify(numbers), ca.densify(ca.jacobian(numbers, free))])


def body_terms(term: Term) -> tuple[Array, Array]:
    """Additions to the ten numbers of a body and to gravity, and their derivative by the free parameters.

    Returns:
        Shape (13,) in the order of `BODY_NUMBERS` then gravity x y z, and shape (13, k).
    """
    effect = term.effect
    assert isinstance(effect, BodyEffect)
    function = _body_function(effect.id, effect)
    values, jacobian = function(np.array([term.parameters[p.name] for p in effect.parameters]))
    names = [p.name for p in effect.estimated]
    return np.asarray(values).ravel(), np.asarray(jacobian)[:, [names.index(name) for name in term.free]]
