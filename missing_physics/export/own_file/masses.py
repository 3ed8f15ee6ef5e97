"""Mass properties of a file's link for which it and all bodies fixed to it have the found mass properties."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.export.content import BodyNumbers, Content
from robot_model import InputError
from robot_model.editing import Source
from robot_model.formats.parts.mass import Mass
from robot_model.input.fields import inertia_fault

__all__ = ["Placed", "changed_bodies", "same"]

Array = NDArray[np.float64]

#: Relative difference below which numbers are equal: digits of a robot file.
SAME = 1e-9


@dataclass(frozen=True)
class Placed:
    """A body of the file with its new mass properties.

    Attributes:
        name: in the file.
        mass: [kg].
        centre: in the file's frame of the body [m], shape (3,).
        inertia: about it in that frame's axes [kg m^2], shape (3, 3).
    """

    name: str
    mass: float
    centre: Array
    inertia: Array


def same(one: float | Array, other: float | Array, scale: float = 0.0) -> bool:
    """Whether two numbers, or arrays relative to their largest entry, are equal to the digits of a file."""
    size = max(float(np.abs(one).max()), float(np.abs(other).max()), scale)
    return float(np.abs(np.asarray(one) - np.asarray(other)).max()) <= SAME * size


def changed_bodies(content: Content, source: Source) -> Iterator[Placed]:
    """Bodies whose mass properties differ from those of the file.

    Changes of a rigid group of bodies are assigned to the one that moves, which has the name of the link.

    Raises:
        InputError: the mass properties that remain for that one are not physically consistent.
    """
    for name, target in content.bodies.items():
        group, own = source.groups.get(name), source.links.get(name)
        if group is None or own is None:
            raise InputError(
                f"the file has no link '{name}' that robot '{content.robot.name}' has; give the file that "
                "was diagnosed, with its overlay."
            )
        there = _ten(group.mass)
        wanted = _ten(target)
        reach = max(float(np.abs(target.centre).max()), 1e-3)
        if same(there[0], wanted[0]) and all(
            same(a, b, target.mass * reach**k)
            for k, a, b in ((1, there[1], wanted[1]), (2, there[2], wanted[2]))
        ):
            continue
        mine = _ten(own.mass)
        mass = mine[0] + wanted[0] - there[0]
        moment, about = mine[1] + wanted[1] - there[1], mine[2] + wanted[2] - there[2]
        found = _body(mass, moment, about, own.name)
        turned = own.frame.rotation
        yield Placed(
            own.name,
            found.mass,
            turned.T @ (found.centre - own.frame.place),
            turned.T @ found.inertia @ turned,
        )


def _ten(body: BodyNumbers | Mass | None) -> tuple[float, Array, Array]:
    """Mass, first moment and inertia about the frame's origin."""
    if body is None:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    c = np.asarray(body.centre, dtype=float)
    return (
        body.mass,
        body.mass * c,
        np.asarray(body.inertia) + body.mass * (c @ c * np.eye(3) - np.outer(c, c)),
    )


def _body(mass: float, moment: Array, about: Array, name: str) -> BodyNumbers:
    if mass <= 0.0:
        raise InputError(
            f"link '{name}' would weigh {mass:.4g} kg, since what was found is lighter than what is fixed to "
            "it; export without --into, or correct the masses of the file and diagnose again."
        )
    centre = moment / mass
    inertia = about - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    if fault := inertia_fault(inertia):
        raise InputError(
            f"link '{name}' would be no real body without what is fixed to it ({fault}); export without "
            "--into."
        )
    return BodyNumbers(mass, centre, inertia)
