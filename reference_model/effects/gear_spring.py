"""The spring and damper that the three gear effects share; one of them states it."""

from __future__ import annotations

import casadi as ca

from reference_model.effects.base import GearSignals, Parameter, Values

__all__ = [
    "DAMPING",
    "SLOWEST_TWIST",
    "SPRING_STATED",
    "STIFFEST",
    "STIFFNESS_RANGE",
    "damper",
    "shared_stiffness",
]

#: Credible stiffness of a gear, from a toy servo to a telescope axis [N m/rad or N/m].
STIFFNESS_RANGE = (1.0, 1e9)
STIFFEST = STIFFNESS_RANGE[1]
#: Longest credible time constant of a gear's twist, damping over stiffness [s]: that of a rotor resonating on
#: it at 10 Hz with a third of critical damping. A slower gear would creep.
SLOWEST_TWIST = 0.01

#: Note on `stiffness` and `damping` of an effect that may use the spring of another one.
SPRING_STATED = "0 where `joint_elasticity` at the same joint states it"

DAMPING = Parameter(
    "damping", "N m s/rad", "damping of the twist", 0.0, 1e7, 10.0, absent=0.0, linear=True, default=0.0
)


def shared_stiffness(meaning: str) -> Parameter:
    """Stiffness of an effect that can use the spring of `joint_elasticity`."""
    return Parameter(
        "stiffness",
        "N m/rad",
        f"{meaning}; {SPRING_STATED}",
        0.0,
        STIFFEST,
        2e4,
        estimated=False,
        default=0.0,
    )


def damper(s: GearSignals, p: Values) -> ca.SX:
    """D times the rate times the degree of contact of the flanks [N m or N]."""
    return p["damping"] * s.contact * s.rate
