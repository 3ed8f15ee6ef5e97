"""What the three effects in a gear share: one spring and damper, which one of them states."""

from __future__ import annotations

import casadi as ca

from reference_model.effects.base import GearSignals, Parameter, Values

__all__ = ["DAMPING", "SPRING_STATED", "STIFFEST", "STIFFNESS_RANGE", "damper", "shared_stiffness"]

#: Credible stiffness of a gear: a toy servo's to a telescope's axis [N m/rad or N/m].
STIFFNESS_RANGE = (1.0, 1e9)
STIFFEST = STIFFNESS_RANGE[1]

#: Says of `stiffness` and `damping` where an effect that needs a spring leaves them to another one.
SPRING_STATED = "0 where `joint_elasticity` at the same joint states it"

DAMPING = Parameter(
    "damping", "N m s/rad", "damping of the twist", 0.0, 1e7, 10.0, absent=0.0, linear=True, default=0.0
)


def shared_stiffness(meaning: str) -> Parameter:
    """Stiffness of an effect that can lean on `joint_elasticity`."""
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
    """D times the rate, as far as the flanks are in contact [N m or N]."""
    return p["damping"] * s.contact * s.rate
