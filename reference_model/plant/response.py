"""Response of a robot in a state under actuator torques."""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca

from reference_model.plant.gears import Transmitted

__all__ = ["Response"]

#: Output of no gears.
NOTHING = Transmitted(ca.SX(0, 1), ca.SX(0, 1), ca.SX(1, 1), ca.SX(1, 1))


@dataclass(frozen=True)
class Response:
    """Response of the robot in a state under actuator torques.

    Attributes:
        acceleration: generalised accelerations, base first, rows x 1.
        friction: friction at the joints [N m or N], n x 1.
        loads: of the bearings, rows `balance.LOADS`, 4 x n.
        rates: of the effects' states.
        residual: largest residual of the loop of loads and friction, relative to 1 + the forces.
        margin: distance of each joint from a change of stick and slip, n x 1; see `sticking_plant`.
        power: of actuators, effects and a held base, minus dissipation in links and gears [W].
        motors: accelerations of the separate motor coordinates [rad/s^2 or m/s^2], m x 1.
        gears: output of their gears.
        outer: rates of the states of force effects on bodies.
        force: of the effects on the joints, friction among them [N m or N], n x 1.
        drive: torque of the actuators at the joints [N m or N], n x 1.
        gap: residual of the equations for assumed accelerations and forces; see `Plant.implicit`.
    """

    acceleration: ca.SX
    friction: ca.SX
    loads: ca.SX
    rates: ca.SX
    residual: ca.SX
    margin: ca.SX | None = None
    power: ca.SX = field(default_factory=lambda: ca.SX(1, 1))
    motors: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    gears: Transmitted = NOTHING
    outer: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    force: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    drive: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    gap: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
