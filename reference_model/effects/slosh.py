"""Slosh: a fraction of the base's mass is a liquid that moves in its tank."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
from pydantic import ValidationError

from reference_model.effects.base import Extent, Parameter
from reference_model.effects.structure import StructureEffect
from robot_model import Base, InputError, Joint, Link, Robot, SprungMass

__all__ = ["Slosh"]

#: Name of the link that represents the liquid, with a number from the second tank on.
NAME = "slosh"

#: Highest starting frequency [Hz]: liquids in tanks of decimetres under slight acceleration, or held by
#: surface tension alone, are slower.
HIGHEST = 1.5

#: Starting mass, small compared with most bases [kg].
MASS = 1.0


class Slosh(StructureEffect):
    """A mass on springs in the base, equal in all directions, taken from the base's own mass.

    With springs at rest mass, centre of mass and inertia are those of the description. It represents the
    first mode of a liquid in a tank; a pendulum of the same frequency is equivalent for small amplitudes.
    It starts at rest at its place. On a fixed base it has no effect.
    """

    id = "slosh"
    title = "Fuel slosh"
    place = "base"
    parameters = (
        Parameter("mass", "kg", "moving mass", 0.0, 1e4, 5.0, absent=0.0),
        Parameter("frequency", "1/s", "its natural frequency with the base held", 1e-3, 50.0, 0.3),
        Parameter("damping_ratio", "-", "its damping ratio with the base held", 0.0, 2.0, 0.02, default=0.01),
        *(
            Parameter(axis, "m", f"{axis} of its place in the base's frame", -50.0, 50.0, 0.5, default=0.0)
            for axis in ("x", "y", "z")
        ),
    )
    equation = (
        "a_place + udd + 2 omega x ud + omegad x u + omega x (omega x u) = -2 damping_ratio w ud - w^2 u, "
        "w = 2 pi frequency, u in base axes, all times mass on the base"
    )
    source = "Ibrahim, Liquid Sloshing Dynamics (2005), ch. 5; NASA SP-106 (1966), ch. 6"
    signature = "a slow oscillation of the base after a slew, at a frequency that no link or joint has"
    confused_with = ("link_flexibility", "base_motion", "reaction_wheel", "modal_damping", "inertia")
    experiment = (
        "stop the arm in other poses: a link's frequency changes, the liquid's hardly; empty the tank"
    )
    essential = ("frequency",)
    needs = ("angular_velocity",)
    #: A tank is within the base, whose frame is near its middle; liquids of low viscosity in tanks
    #: without baffles have damping ratios of 0.005 to 0.05 (NASA SP-106, ch. 4).
    priors: ClassVar[Mapping[str, tuple[float, float]]] = {
        **dict.fromkeys(("x", "y", "z"), (0.0, 0.5)),
        "damping_ratio": (0.02, 0.05),
    }

    def changed(self, robot: Robot, at: str, p: Mapping[str, float]) -> Robot:
        if p["mass"] == 0:
            return robot
        place = np.array([p[axis] for axis in ("x", "y", "z")])
        taken = {link.name for link in robot.links} | {joint.name for joint in robot.joints}
        name = next(n for n in (NAME, *(f"{NAME}{k}" for k in range(2, len(taken) + 3))) if n not in taken)
        liquid = SprungMass(mass=p["mass"], frequency=p["frequency"], damping_ratio=p["damping_ratio"])
        tank = Joint(
            name=f"{name}_place", kind="fixed", parent="base", child=name, origin=tuple(place.tolist())
        )
        return robot.model_copy(
            update={
                "base": _without(robot.base, p["mass"], place),
                "links": (*robot.links, Link(name=name, sprung=liquid)),
                "joints": (*robot.joints, tank),
            }
        )

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        """Frequencies spaced by the resolution of a recording: a quarter of a period over its length."""
        damping, place = self.parameter("damping_ratio").typical, dict.fromkeys("xyz", 0.0)
        apart = 0.25 / max(extent.duration, 1.0)
        return tuple(
            {"mass": MASS, "frequency": float(frequency), "damping_ratio": damping, **place}
            for frequency in apart * np.arange(1, max(int(HIGHEST / apart), 1) + 1)
        )


def _without(base: Base, mass: float, place: np.ndarray) -> Base:
    """A free base without a point mass; a fixed one unchanged, since its mass does not matter."""
    if base.kind == "fixed":
        return base
    left = base.mass - mass
    centre = np.asarray(base.center_of_mass, dtype=float)
    moved = (base.mass * centre - mass * place) / left if left > 0 else centre
    arms = [(base.mass, centre), (-mass, place), (-left, moved)]
    central = base.inertia_matrix + sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in arms)
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    given = {
        **base.model_dump(),
        "mass": left,
        "center_of_mass": tuple(moved.tolist()),
        "inertia": tuple(float(central[pair]) for pair in pairs),
    }
    try:
        return Base.model_validate(given)
    except ValidationError:
        raise InputError(
            f"the base ({base.mass:g} kg) cannot lose {mass:g} kg at {place.tolist()}; lower the mass, or "
            "move its place nearer to the base's centre of mass."
        ) from None
