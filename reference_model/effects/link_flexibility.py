"""Link flexibility: a link described as rigid bends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from reference_model.effects.base import Parameter
from reference_model.effects.bending import bending_link
from reference_model.effects.structure import StructureEffect
from robot_model import Robot

__all__ = ["LinkFlexibility"]

#: Starting periods [s], from light links of ground robots to long booms in space, and damping ratio, which is
#: large, so that the resonances of neighbouring periods overlap.
PERIODS, DAMPED = tuple(np.geomspace(0.02, 2.0, 67).tolist()), 0.05


class LinkFlexibility(StructureEffect):
    """The link is a flexible uniform beam from its frame to the outermost joint that it carries.

    As much of the link's mass as its inertia allows lies along the beam; mass, centre of mass and inertia
    of the undeformed link are those of the description (a link thinner than a five-hundredth of its length
    counts as that thick). Without a joint on it the link ends at twice the distance of its centre of mass.
    The beam is round: it has the same stiffness in both planes. Other joints on the link must be at its frame
    or at a node of twelve elements.
    """

    id = "link_flexibility"
    title = "Link flexibility"
    place = "link"
    parameters = (
        Parameter(
            "period",
            "s",
            "of the first bending mode, clamped at the link's frame, its load as a point mass at its tip",
            0.0,
            1e3,
            0.2,
            absent=0.0,
        ),
        Parameter("damping_ratio", "-", "of all its modes", 0.0, 0.99, 0.01, default=0.005),
        Parameter("modes", "-", "number of modes", 1.0, 24.0, 4.0, estimated=False, default=4.0),
    )
    equation = (
        "xdd + 2 damping_ratio w xd + w^2 x = -(inertial coupling), "
        "3 E I / L^3 = (2 pi / period)^2 (m_carried + m_tip + 33/140 m_beam)"
    )
    source = (
        "Shabana, Dynamics of Multibody Systems (2005), ch. 5; Rayleigh's 33/140: Young and Budynas, Roark's "
        "Formulas for Stress and Strain (2002), table 16.1"
    )
    signature = "vibration after each stop at a frequency that falls with payload, strongest at tip and base"
    confused_with = ("joint_elasticity", "modal_damping", "slosh", "base_motion", "actuator_lag", "payload")
    experiment = (
        "let it ring down with the joint's brake on: an elastic gear is then at rest; repeat with another "
        "payload: the frequency is proportional to one over the root of its mass"
    )
    essential = ("period",)
    adds_coordinates = True
    #: Structures of metal or composite with bolted joints lose a few percent of critical damping.
    priors: ClassVar[Mapping[str, tuple[float, float]]] = {"damping_ratio": (0.0, 0.03)}

    def changed(self, robot: Robot, at: str, p: Mapping[str, float]) -> Robot:
        if p["period"] == 0:
            return robot
        bent = bending_link(
            robot,
            robot.link(at),
            period=p["period"],
            damping_ratio=p["damping_ratio"],
            modes=round(p["modes"]),
        )
        links = tuple(bent if link.name == at else link for link in robot.links)
        return robot.model_copy(update={"links": links})

    def stiffened(self, p: Mapping[str, float], than: Mapping[str, float]) -> tuple[float, float]:
        faster = than["period"] / p["period"]
        return faster**2, p["damping_ratio"] / than["damping_ratio"] * faster

    def contradiction(self, values: Mapping[str, float]) -> str:
        modes = values["modes"]
        return "" if modes == round(modes) else f"modes = {modes:g} is not a whole number"

    def grid(self, robot: Robot) -> Sequence[Mapping[str, float]]:
        return tuple({"period": period, "damping_ratio": DAMPED} for period in PERIODS)
