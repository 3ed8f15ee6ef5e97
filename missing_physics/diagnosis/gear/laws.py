"""Laws of gears and links for the gap between two encoders, in parameters that the gap determines.

Elasticity is the catalogue's (`reference_model.effects.joint_elasticity`), and so are the errors of encoders.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from missing_physics.hypotheses import Term
from reference_model.effects.base import Effect, Parameter
from reference_model.effects.catalogue import get_effect
from reference_model.effects.gear_spring import DAMPING

__all__ = [
    "BACKLASH",
    "BENDING",
    "ELASTICITY",
    "HYSTERESIS",
    "OF_GEARS",
    "OPTIONAL",
    "keys_of",
    "parameters_of",
]


class _Play(Effect):
    """The gap jumps by the play when the torque changes sign, smoothed by the flight time of the flanks."""

    id, title, place = "backlash", "Backlash", "joint"
    parameters = (
        Parameter("half_width", "rad", "half of the play", 0.0, 1.0, 5e-4, absent=0.0, linear=True),
        Parameter("flight", "N m", "torque below which the flanks are in flight", 1e-9, 1e9, 1.0),
    )
    essential = ("half_width",)
    equation = "gap = -half_width * tanh(T / flight)"
    source = "Nordin and Gutman, Automatica 38 (2002) 1633-1649"
    signature = "a gap that jumps where the torque changes its sign"
    experiment = "preload the joint to one side"


class _Hysteresis(Effect):
    """A spring with internal friction: T = K e + T_h z + D ed, travel dz = de - |de| z; the gap is -e."""

    id, title, place = "gear_hysteresis", "Gear hysteresis", "joint"
    parameters = (
        Parameter("torque", "N m", "half the height of the loop", 0.0, 1e5, 2.0, absent=0.0),
        Parameter("travel", "rad", "twist over which it builds up", 1e-8, 1.0, 1e-4),
        Parameter("stiffness", "N m/rad", "torque per twist along the flanks", 1.0, 1e9, 2e4),
        DAMPING,
    )
    essential = ("torque", "travel", "stiffness")
    equation = "T = stiffness * e + torque * z + damping * ed, travel * dz = de - |de| * z, gap = -e"
    source = "Dahl, Aerospace Corp. TOR-0158(3107-18)-1 (1968)"
    signature = "twist against torque runs round a loop"
    experiment = "hold the output and run loops of several sizes at two speeds"


class _Bending(Effect):
    """Structure between the encoders bends in proportion to the joint's acceleration."""

    id, title, place = "link_flexibility", "Link flexibility", "link"
    parameters = (
        Parameter(
            "static_deflection", "s^2", "gap per acceleration", 0.0, 1.0, 1e-5, absent=0.0, linear=True
        ),
    )
    equation = "gap = -static_deflection * acceleration"
    source = "Shabana, Dynamics of Multibody Systems (2005), ch. 5"
    signature = "a gap in proportion to the acceleration"
    experiment = "repeat with another payload"


ELASTICITY = get_effect("joint_elasticity")
#: Optional parameters of a spring; damping is not optional, as every gear has some.
OPTIONAL = frozenset({"cubic_stiffness"})
BACKLASH, HYSTERESIS, BENDING = _Play(), _Hysteresis(), _Bending()
#: Effects that are driven by the torque through the gear.
OF_GEARS = frozenset({ELASTICITY.id, BACKLASH.id, HYSTERESIS.id})
#: Parameters that are not reported, since they only describe the gap.
UNSTATED = frozenset({"flight"})
#: Parameters of friction inside a gear that belong to its spring.
OF_SPRING = frozenset({"stiffness", "damping"})


def keys_of(terms: Sequence[Term]) -> frozenset[tuple[str, str]]:
    """Effects and places that terms represent: friction inside a gear includes the gear's spring."""
    hysteresis = {(ELASTICITY.id, term.at) for term in terms if term.effect is HYSTERESIS}
    return frozenset({term.key for term in terms} | hysteresis)


def parameters_of(key: tuple[str, str], terms: Sequence[Term]) -> Mapping[str, tuple[Term, Parameter]]:
    """The term and its parameter for each parameter of a reported effect."""
    own = [term for term in terms if term.key == key]
    hysteresis = [term for term in terms if (ELASTICITY.id, term.at) == key and term.effect is HYSTERESIS]
    if hysteresis:
        return {name: (hysteresis[0], HYSTERESIS.parameter(name)) for name in sorted(OF_SPRING)}
    hidden = UNSTATED | (OF_SPRING if own[0].effect is HYSTERESIS else frozenset())
    held = {name for name, low, high in own[0].limits if low == high}
    stated = [p for p in own[0].effect.estimated if p.name not in hidden]
    return {p.name: (own[0], p) for p in stated if p.name not in held or p.name == "order"}
