"""Hidden effects and the ranges from which their parameters are drawn.

Magnitudes are relative to the joint and its motion, so that one table applies to a ball screw and a wrist:
torques to a hundredth of the actuator's limit, speeds to the maximum of the motion, lengths or angles to its
half range. Realistic sizes follow the sources cited on the pages of the effects.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from robot_model import Base, Link

__all__ = [
    "BODY",
    "BRIEF",
    "DRY",
    "HIDDEN",
    "JOINT",
    "MODIFIERS",
    "RARELY",
    "SENSOR",
    "Draw",
    "Scale",
    "bounded",
    "inertial_numbers",
]

Values = dict[str, float]
TURN = 2 * np.pi
#: A brief stop acts at positions where the reference motion is for this fraction of the time;
#: and the minimum depth of such a stop, as a fraction of the half range.
RARELY, SHALLOW = 0.04, 0.004


@dataclass(frozen=True)
class Scale:
    """Reference sizes at one joint.

    Attributes:
        torque: a hundredth of the actuator's limit [N m or N].
        speed: maximum speed of the reference motion [rad/s or m/s].
        low, high: range of the reference motion [rad or m].
        peak: largest torque that the nominal robot needs for the motion [N m or N].
        coulomb, viscous: nominal friction, zero if there is none.
        duration: duration of the recording [s].
        rarely: positions below and above which the motion spends the fraction `RARELY` of the time [rad or
        m].
    """

    torque: float
    speed: float
    low: float
    high: float
    peak: float
    coulomb: float
    viscous: float
    duration: float
    rarely: tuple[float, float] | None = None

    @property
    def sides(self) -> tuple[float, ...]:
        """Ends, -1 and +1, near which the motion stays only briefly."""
        if self.rarely is None:
            return (-1.0, 1.0)
        depths = self.rarely[0] - self.low, self.high - self.rarely[1]
        return tuple(side for side, depth in zip((-1.0, 1.0), depths) if depth > SHALLOW * self.span)

    @property
    def span(self) -> float:
        """Half range of the motion [rad or m]."""
        return max((self.high - self.low) / 2, 1e-9)


class Draw:
    """Random numbers."""

    def __init__(self, chance: np.random.Generator) -> None:
        self.chance = chance

    def decades(self, low: float, high: float) -> float:
        """Log-uniform."""
        return float(np.exp(self.chance.uniform(np.log(low), np.log(high))))

    def even(self, low: float, high: float) -> float:
        """Uniform."""
        return float(self.chance.uniform(low, high))

    def sign(self) -> float:
        """+1 or -1."""
        return 1.0 if self.chance.random() < 0.5 else -1.0

    def phased(self, amplitude: float) -> tuple[float, float]:
        """Cosine and sine part of an amplitude at a random phase."""
        phase = self.chance.uniform(0, TURN)
        return float(amplitude * np.cos(phase)), float(amplitude * np.sin(phase))


def bounded(value: float) -> float:
    """Rounded to six digits, as a person would write a number."""
    return float(f"{value:.6g}")


def _viscous(d: Draw, s: Scale) -> Values:
    return {"coefficient": s.torque * d.decades(0.6, 8.0) / s.speed}


def _quadratic_drag(d: Draw, s: Scale) -> Values:
    return {"coefficient": s.torque * d.decades(1.5, 8.0) / s.speed**2}


def _coulomb(d: Draw, s: Scale) -> Values:
    return {"torque": s.torque * d.decades(0.7, 6.0)}


def _stribeck(d: Draw, s: Scale) -> Values:
    sliding = s.torque * d.decades(1.0, 5.0)
    return {
        "coulomb_torque": sliding,
        "static_torque": sliding * d.even(1.25, 2.1),
        "stribeck_velocity": s.speed * d.decades(0.01, 0.15),
    }


def _lugre(d: Draw, s: Scale) -> Values:
    law = _stribeck(d, s)
    stiffness = law["static_torque"] / (s.span * d.decades(1e-3, 1e-2))
    return {**law, "bristle_stiffness": stiffness, "bristle_damping": stiffness * d.decades(3e-3, 2e-2)}


def _asymmetric(d: Draw, s: Scale) -> Values:
    return {
        "coulomb_difference": d.sign() * s.coulomb * d.even(0.05, 0.25),
        "viscous_difference": d.sign() * s.viscous * d.even(0.05, 0.25),
    }


def _load_dependent(d: Draw, s: Scale) -> Values:
    return {"coefficient": 0.0, "gear_share": d.decades(0.02, 0.12)}


def _order(d: Draw, s: Scale) -> float:
    """One to thirty periods over the range."""
    return TURN * d.decades(1.0, 30.0) / (2 * s.span)


def _position_dependent(d: Draw, s: Scale) -> Values:
    cosine, sine = d.phased(s.coulomb * d.even(0.08, 0.4))
    return {"cosine": cosine, "sine": sine, "order": _order(d, s)}


def _cable_spring(d: Draw, s: Scale) -> Values:
    return {
        "stiffness": s.torque * d.decades(0.6, 5.0) / s.span,
        "torque_at_zero": d.sign() * s.torque * d.decades(0.3, 2.0),
    }


def _end_stop(d: Draw, s: Scale) -> Values:
    side, depth = d.sign(), s.span * d.even(0.06, 0.25)
    end = s.high if side > 0 else s.low
    return {
        "stiffness": s.torque * d.decades(4.0, 25.0) / depth,
        "position": end - side * depth,
        "side": side,
    }


def _torque_gain(d: Draw, s: Scale) -> Values:
    return {"gain_error": d.sign() * d.decades(0.015, 0.08)}


def _torque_offset(d: Draw, s: Scale) -> Values:
    return {"torque": d.sign() * s.torque * d.decades(0.4, 4.0)}


def _torque_ripple(d: Draw, s: Scale) -> Values:
    cosine, sine = d.phased(s.torque * d.decades(0.4, 3.0))
    return {"cosine": cosine, "sine": sine, "order": _order(d, s)}


def _torque_saturation(d: Draw, s: Scale) -> Values:
    return {"limit": s.peak * d.even(0.6, 0.92)}


def _actuator_lag(d: Draw, s: Scale) -> Values:
    return {"time_constant": d.decades(1.5e-3, 2e-2)}


def _external_torque(d: Draw, s: Scale) -> Values:
    length = s.duration * d.even(0.08, 0.2)
    return {
        "torque": d.sign() * s.torque * d.decades(1.0, 6.0),
        "start": d.even(0.15, 0.7) * s.duration,
        "duration": length,
    }


def _brief_torque(d: Draw, s: Scale) -> Values:
    return {**_external_torque(d, s), "duration": s.duration * d.even(0.008, 0.045)}


def _brief_stop(d: Draw, s: Scale) -> Values:
    """A stop reached only where the motion reverses: less than a twentieth of the time."""
    side = s.sides[int(d.chance.integers(len(s.sides)))]
    depth, end = s.span * d.even(0.01, 0.03), s.high if side > 0 else s.low
    if s.rarely is not None:
        depth = min(depth, abs(end - s.rarely[1 if side > 0 else 0]))
    stiffness = s.torque * d.decades(4.0, 25.0) / depth
    return {"stiffness": stiffness, "position": end - side * depth, "side": side}


#: Effects at a joint.
JOINT: Mapping[str, Callable[[Draw, Scale], Values]] = MappingProxyType(
    {
        "viscous_friction": _viscous,
        "coulomb_friction": _coulomb,
        "stribeck_friction": _stribeck,
        "lugre_friction": _lugre,
        "asymmetric_friction": _asymmetric,
        "load_dependent_friction": _load_dependent,
        "position_dependent_friction": _position_dependent,
        "cable_spring": _cable_spring,
        "end_stop": _end_stop,
        "torque_gain": _torque_gain,
        "torque_offset": _torque_offset,
        "torque_ripple": _torque_ripple,
        "torque_saturation": _torque_saturation,
        "actuator_lag": _actuator_lag,
        "external_torque": _external_torque,
        "quadratic_drag": _quadratic_drag,
    }
)
#: Those that the second version of the draws hides; later additions must not change earlier draws.
HIDDEN = tuple(name for name in JOINT if name != "quadratic_drag")
#: A joint has at most one of these.
DRY = ("coulomb_friction", "stribeck_friction", "lugre_friction")
#: These modify nominal friction, which the joint must have.
MODIFIERS = ("asymmetric_friction", "position_dependent_friction")
#: Effects that act in less than a twentieth of the time.
BRIEF: Mapping[str, Callable[[Draw, Scale], Values]] = MappingProxyType(
    {"external_torque": _brief_torque, "end_stop": _brief_stop}
)


def _payload(d: Draw, link: Link) -> Values:
    if link.beam is not None:
        carried = link.beam.mass + link.beam.tip.mass
        tip = link.beam.nodes[-1]
        return {
            "mass": carried * d.decades(0.05, 0.4),
            **{axis: float(tip["xyz".index(axis)]) for axis in "xyz"},
        }
    where = 2 * np.asarray(link.center_of_mass) + d.chance.normal(0, 0.02, 3)
    x, y, z = (float(value) for value in where)
    return {"mass": link.mass * d.decades(0.05, 0.4), "x": x, "y": y, "z": z}


def _inertia(d: Draw, link: Link) -> Values:
    """All inertial parameters of the body scaled by one factor."""
    share = d.sign() * d.decades(0.04, 0.25)
    return {name: share * value for name, value in inertial_numbers(link).items()}


def inertial_numbers(link: Base | Link) -> Values:
    """Mass, first moments and inertia of a body about the origin of its frame, named as in `inertia`."""
    mass, centre = link.mass, np.asarray(link.center_of_mass)
    about = link.inertia_matrix + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    found = {"mass": mass} | {f"first_moment_{axis}": mass * float(x) for axis, x in zip("xyz", centre)}
    for one, other in ("xx", "yy", "zz", "xy", "xz", "yz"):
        found[f"inertia_{one}{other}"] = float(about["xyz".index(one), "xyz".index(other)])
    return found


#: Effects at a link.
BODY: Mapping[str, Callable[[Draw, Link], Values]] = MappingProxyType(
    {"payload": _payload, "inertia": _inertia}
)


def _sensor_offset(d: Draw, s: Scale, quantity: str) -> Values:
    size = s.torque * d.decades(0.4, 4.0) if quantity == "torque" else s.span * d.decades(0.005, 0.05)
    return {"offset": d.sign() * size}


def _sensor_gain(d: Draw, s: Scale, quantity: str) -> Values:
    return {"gain_error": d.sign() * d.decades(0.015, 0.08)}


def _sensor_delay(d: Draw, s: Scale, quantity: str) -> Values:
    return {"delay": d.decades(1e-3, 4.5e-3 if quantity == "position" else 1.2e-2)}


def _eccentricity(d: Draw, s: Scale, quantity: str) -> Values:
    cosine, sine = d.phased(s.span * d.decades(2e-4, 4e-3))
    return {"cosine": cosine, "sine": sine, "order": _order(d, s) / 3}


def _clock_drift(d: Draw, s: Scale, quantity: str) -> Values:
    return {"rate": d.sign() * d.decades(2e-4, 9e-4)}


#: Effects at a channel, with the quantities for which each is drawn.
SENSOR: Mapping[str, tuple[tuple[str, ...], Callable[[Draw, Scale, str], Values]]] = MappingProxyType(
    {
        "sensor_offset": (("torque", "position"), _sensor_offset),
        "sensor_gain": (("torque",), _sensor_gain),
        "sensor_delay": (("torque", "position"), _sensor_delay),
        "encoder_eccentricity": (("position",), _eccentricity),
        "clock_drift": (("torque",), _clock_drift),
    }
)
