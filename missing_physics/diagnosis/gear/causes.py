"""Causes that compete to explain the gap between two encoders.

Each cause gives columns, so that the gap is their sum with coefficients, and says what the coefficients
mean. A cause may come in several shapes (which torque, which travel of a hysteresis); the data choose, and
shapes that the data cannot choose between widen the stated intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.gear.gap import Gap, shifted
from missing_physics.diagnosis.gear.hysteresis import dahl, lagging

__all__ = ["Cause", "Meaning", "causes_of", "cubic_spring", "exact_delay", "hysteresis_of"]

Array = NDArray[np.float64]

#: Travel in which a hysteresis builds up, as parts of the motion's or torque's range.
TRAVELS = (0.01, 0.03, 0.1, 0.3)
#: Of a torque's range, only travels above this are tried in pairs of causes.
COARSE = 0.05
#: A sign of the torque is smoothed over these parts of its range: flanks take time to meet.
SMOOTHED = (0.01, 0.03, 0.1)
#: Damping over stiffness beyond this is no gear's: its twist would creep [s].
SLOWEST_TWIST = 0.01
#: A cycle over position is looked for when the motion covers this much of it [rad of the cycle].
SEEN_CYCLE = np.pi
#: Delays below this are linearised [s].
SMALL_DELAY = 1e-6


@dataclass(frozen=True)
class Meaning:
    """One parameter: its name, unit, and how it follows from the coefficient c.

    It is c, or with K the stiffness that the gap shows (one over the coefficient of the wind-up) `factor` c
    K^`power`. The stiffness itself is the `inverse` of its coefficient. What is `relative` is a known
    parameter times K^`power`, and c the change of its logarithm. `most` limits c K.
    """

    name: str
    unit: str
    inverse: bool = False
    power: int = 0
    factor: float = 1.0
    relative: bool = False
    most: float = np.inf


@dataclass(frozen=True)
class Cause:
    """One effect in one shape.

    Attributes:
        effect: catalogue id.
        location: where.
        shape: in words, for the ladder.
        meanings: of the coefficients.
        columns: full-rate columns of one recording, shape (N, k).
        positive: the first coefficient must be positive to be this effect.
        known: parameters that belong to the shape: name to (value, unit).
        torque: which torque drives it. Known parameters of such a cause are as the torque sees them: a travel
            is K times that of the twist, a cubic stiffness is divided by K^3.
        fine: a shape that is tried once its effect is in; pairs of causes are tried without it.
        trials: shapes among which it was chosen by the data; its evidence must beat their number.
    """

    effect: str
    location: str
    shape: str
    meanings: tuple[Meaning, ...]
    columns: Callable[[Gap], Array]
    positive: bool = False
    known: tuple[tuple[str, float, str], ...] = ()
    torque: str | None = None
    fine: bool = False
    trials: int = 1

    @property
    def key(self) -> tuple[str, str]:
        """Shapes of the same effect at the same place share it."""
        return self.effect, self.location


def causes_of(gaps: Sequence[Gap], *, prismatic: bool) -> tuple[Cause, ...]:
    """Every cause that the recordings of one joint could show."""
    unit = "m" if prismatic else "rad"
    torque = "N" if prismatic else "N m"
    return (
        *_sensing(gaps),
        *_cycles(gaps, unit, prismatic=prismatic),
        *_elastic(gaps, torque, unit),
        *_lost_motion(gaps, unit, torque),
        *_bending(gaps),
    )


def _sensing(gaps: Sequence[Gap]) -> Iterator[Cause]:
    channel = f"{gaps[0].joint}.position"
    yield Cause("sensor_gain", channel, "", (Meaning("gain_error", "-"),), lambda g: g.position[:, None])
    yield exact_delay(channel, 0.0)
    # measured(t) = true(t (1 + rate))
    yield Cause(
        "clock_drift",
        channel,
        "",
        (Meaning("rate", "s/s"),),
        lambda g: (g.time * g.velocity)[:, None],
    )


def hysteresis_of(
    joint: str, name: str, size: float, torque: str, unit: str, *, height: float = 0.0, slope: float = 0.0
) -> Cause:
    """Friction T_h inside the gear, e = (T - T_h z)/K, with z built up over a travel of the torque.

    Args:
        joint: its name.
        name: of the torque.
        size: K times the travel of the twist [N m or N].
        torque, unit: of the joint.
        height: T_h, where it is known, for the exact law; zero for Dahl's [N m or N].
        slope: when not zero, this amplitude's change by the logarithm of the size is a column too [rad or m].
    """
    meanings = [Meaning("torque", torque, power=1)]
    if slope:
        meanings.append(Meaning("travel", unit, relative=True, power=-1))
    return Cause(
        "gear_hysteresis",
        joint,
        f"over {size:.3g} {torque} of {name} torque",
        tuple(meanings),
        lambda gap: lagging(gap.smooth(gap.torques[name]), size, height=height, slope=slope),
        positive=True,
        known=(("travel", size, unit),),
        torque=name,
    )


def exact_delay(channel: str, around: float) -> Cause:
    """Delay linearised around a value: exact there, so that two rounds give the exact delay."""

    def columns(gap: Gap) -> Array:
        if abs(around) < SMALL_DELAY:
            return -gap.velocity[:, None]
        return shifted(gap, around)[:, None] / around

    return Cause("sensor_delay", channel, "", (Meaning("delay", "s"),), columns)


def _cycles(gaps: Sequence[Gap], unit: str, *, prismatic: bool) -> Iterator[Cause]:
    """Once and twice per turn of the joint's encoder and of the motor's; sliding joints have none known."""
    if prismatic:
        return
    joint, ratio = gaps[0].joint, gaps[0].gear_ratio
    low = min(float(g.position.min()) for g in gaps)
    high = max(float(g.position.max()) for g in gaps)
    orders = {(f"{joint}.position", k) for k in (1.0, 2.0)}
    if ratio > 1.0:
        orders |= {(f"{joint}.motor_position", k * ratio) for k in (1.0, 2.0)}
    for channel, order in sorted(orders):
        if order * (high - low) >= SEEN_CYCLE and _within_band(gaps, order):
            yield Cause(
                "encoder_eccentricity",
                channel,
                f"order {order:.4g}",
                (Meaning("cosine", unit), Meaning("sine", unit)),
                _cycle(order),
                known=(("order", order, "-"),),
            )


def _cycle(order: float) -> Callable[[Gap], Array]:
    return lambda g: np.column_stack([np.cos(order * g.position), np.sin(order * g.position)])


def _within_band(gaps: Sequence[Gap], order: float) -> bool:
    """Whether the filter lets the cycle through at the median speed."""
    typical = float(np.median(np.abs(np.concatenate([g.velocity for g in gaps]))))
    return order * typical / (2 * np.pi) < gaps[0].along.motion.low_pass.cutoff


def _elastic(gaps: Sequence[Gap], torque: str, unit: str) -> Iterator[Cause]:
    """Wind-up of a gear, d = -T / K; with T = K e + K3 e^3 + D ed, e = -d, to first order also of the others.

    Inverted, e = T/K - (K3/K^4) T^3 - (D/K^2) Td.
    """
    stiffness = Meaning("stiffness", f"{torque}/{unit}", inverse=True)
    cubic = Meaning("cubic_stiffness", f"{torque}/{unit}^3", power=4, factor=-1.0)
    damping = _damping(f"{torque} s/{unit}")
    for name in gaps[0].torques:
        for more, words, columns in (
            ((), "", (_wind_up(name),)),
            ((cubic,), ", with a cubic part", (_wind_up(name), _wind_up(name, 3))),
            ((damping,), ", with damping", (_wind_up(name), _winding(name))),
            (
                (damping, cubic),
                ", with damping and a cubic part",
                (_wind_up(name), _winding(name), _wind_up(name, 3)),
            ),
        ):
            yield Cause(
                "joint_elasticity",
                gaps[0].joint,
                f"{name} torque{words}",
                (stiffness, *more),
                _side_by_side(columns),
                positive=True,
                torque=name,
                fine=damping in more,
            )


def _damping(unit: str) -> Meaning:
    return Meaning("damping", unit, power=2, factor=-1.0, most=SLOWEST_TWIST)


def cubic_spring(before: Cause, hardening: float, *, slope: float = 0.0) -> Cause:
    """The spring of `before` without truncation: e of T = K e + K3 e^3 + D ed.

    With x + b x^3 = T, b = K3/K^3, it is e = x/K - (D/K^2) Td / (1 + 3 b x^2)^2 to first order in D.

    Args:
        before: a spring with a cubic part.
        hardening: b.
        slope: when not zero, this compliance's change by the logarithm of b is a column too.
    """
    named = {meaning.name: meaning for meaning in before.meanings}
    name, damped = before.torque, "damping" in named
    unit = before.known[0][2] if before.known else named["cubic_stiffness"].unit
    meanings = [named["stiffness"], *([named["damping"]] if damped else [])]
    if slope:
        meanings.append(Meaning("cubic_stiffness", unit, relative=True, power=3))
    assert name is not None
    return replace(
        before,
        meanings=tuple(meanings),
        columns=lambda gap: _hardened(gap, name, hardening, slope=slope, damped=damped),
        known=(("cubic_stiffness", hardening, unit),),
    )


def _hardened(gap: Gap, name: str, hardening: float, *, slope: float, damped: bool) -> Array:
    """Columns of `cubic_spring`: x by Cardano's formula, dx/dlog b = -b x^3/(1 + 3 b x^2)."""
    root = np.sqrt(3 * hardening)
    x = 2 / root * np.sinh(np.arcsinh(1.5 * root * gap.torques[name]) / 3)
    stiffer = 1 + 3 * hardening * x**2
    columns = [-x]
    if damped:
        columns.append(_winding(name)(gap) / stiffer**2)
    if slope:
        columns.append(slope * hardening * x**3 / stiffer)
    return np.column_stack(columns)


def _side_by_side(columns: Sequence[Callable[[Gap], Array]]) -> Callable[[Gap], Array]:
    return lambda g: np.column_stack([column(g) for column in columns])


def _wind_up(name: str, power: int = 1) -> Callable[[Gap], Array]:
    return lambda g: -(g.torques[name] ** power)


def _winding(name: str) -> Callable[[Gap], Array]:
    """Rate of the filtered torque: its noise would hide it otherwise."""
    return lambda g: -np.gradient(g.smooth(g.torques[name]), g.time)


def _lost_motion(gaps: Sequence[Gap], unit: str, torque: str) -> Iterator[Cause]:
    """Backlash jumps with a sign; hysteresis follows it over some travel and forgets speed.

    Over a travel of the motion the joint lags behind the motor, which is what friction behind the gear makes
    of its play; over a travel of the torque the twist lags behind it, which friction inside the gear makes.
    """
    joint, width, lag = gaps[0].joint, (Meaning("half_width", unit),), (Meaning("amplitude", unit),)
    yield Cause("backlash", joint, "sign of the velocity", width, _jump, positive=True)
    travel = max(float(np.ptp(g.position)) for g in gaps) or 1.0
    for length in (part * travel for part in TRAVELS):
        shape = f"over {length:.3g} {unit} of motion"
        known = (("travel", length, unit),)
        yield Cause("gear_hysteresis", joint, shape, lag, _lag(length), positive=True, known=known)
    for name in gaps[0].torques:
        span = max(float(np.ptp(g.smooth(g.torques[name]))) for g in gaps) or 1.0
        if any(_both_signs(g.smooth(g.torques[name])) for g in gaps):
            for part in SMOOTHED:
                shape = f"sign of the {name} torque, over {part:.0%} of its range"
                flank = _flank(name, part * span)
                fine = part > SMOOTHED[0]
                yield Cause("backlash", joint, shape, width, flank, positive=True, torque=name, fine=fine)
        for part in TRAVELS:
            friction = hysteresis_of(joint, name, part * span, torque, unit)
            yield replace(friction, fine=part < COARSE)


def _both_signs(values: Array) -> bool:
    return bool(values.min() < 0 < values.max())


def _jump(gap: Gap) -> Array:
    return -np.tanh(gap.velocity / gap.transition)[:, None]


def _flank(name: str, smoothed: float) -> Callable[[Gap], Array]:
    return lambda g: -np.tanh(g.smooth(g.torques[name]) / smoothed)[:, None]


def _lag(travel: float) -> Callable[[Gap], Array]:
    """Dahl's state driven by the motion."""
    return lambda gap: -dahl(gap.position, travel)[:, None]


def _bending(gaps: Sequence[Gap]) -> Iterator[Cause]:
    """A part in proportion to the joint's acceleration: structure that bends between the two encoders."""
    child = gaps[0].along.joints[gaps[0].index].child
    yield Cause(
        "link_flexibility",
        child,
        "in proportion to the acceleration",
        (Meaning("static_deflection", "s^2"),),
        lambda g: -g.acceleration[:, None],
    )
