"""Inertia: the description's mass properties of a link are wrong."""

from __future__ import annotations

import casadi as ca

from reference_model.effects.base import BodyEffect, BodyTerms, Parameter, Values

__all__ = ["Inertia"]

MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")


def _change(name: str, unit: str, meaning: str, bound: float, typical: float) -> Parameter:
    return Parameter(name, unit, meaning, -bound, bound, typical, absent=0.0, linear=True, default=0.0)


class Inertia(BodyEffect):
    """Changes of the ten inertial parameters of a link, about its frame's origin. All are linear.

    In most robots only combinations of them are identifiable; a diagnosis has to find these.
    """

    id = "inertia"
    title = "Wrong mass properties"
    place = "link"
    parameters = (
        _change("mass", "kg", "change of the mass", 1e4, 1.0),
        *(_change(f"first_moment_{a}", "kg m", f"change of mass times {a}", 1e4, 0.5) for a in "xyz"),
        *(_change(f"inertia_{m}", "kg m^2", f"change of I_{m} about the frame", 1e5, 0.2) for m in MOMENTS),
    )
    equation = "adds mass, first_moment and inertia to those of the link, about the origin of its frame"
    source = "Atkeson, An, Hollerbach, IJRR 5 (1986) 101-119"
    signature = "residuals with acceleration and pose that vanish at constant speed without gravity"
    confused_with = ("payload", "torque_gain", "load_dependent_friction", "gravity", "joint_elasticity")
    experiment = "a motion designed to excite all inertial combinations; a known payload fixes the scale"
    needs = ("torque",)
    simpler = ("payload",)

    def terms(self, p: Values) -> BodyTerms:
        xx, yy, zz, xy, xz, yz = (p[f"inertia_{m}"] for m in MOMENTS)
        rows = [ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz)]
        return BodyTerms(
            mass=ca.SX(p["mass"]),
            first_moment=ca.SX(ca.vertcat(*(p[f"first_moment_{a}"] for a in "xyz"))),
            inertia=ca.SX(ca.vertcat(*rows)),
        )
