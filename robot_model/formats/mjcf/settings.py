"""Settings of the whole model: ``<compiler>`` and ``<option>``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robot_model.formats.parts.markup import Element
from robot_model.formats.parts.notes import Notes

__all__ = ["Settings", "read_settings"]

#: Joint forces that flags switch off.
FORCES = ("spring", "damper", "frictionloss")

#: Values of a boolean attribute.
YES_NO = ("true", "false")

FLUID = "<option> gives density or viscosity: the forces of a surrounding fluid are left out"


@dataclass(frozen=True)
class Settings:
    """Settings of the compiler.

    Attributes:
        per_angle: radians per unit of the file's angles.
        euler: order of Euler angles, small letters for axes that turn with the body.
        autolimits: a range is a limit even where ``limited`` is not given.
        from_geoms: ``true``, ``false`` or ``auto``: whether mass comes from geoms.
        groups: lowest and highest group of geoms that weigh something.
        least_mass, least_moment: lower bounds of bodies' masses [kg] and principal moments [kg m^2].
        total_mass: all masses are scaled to this sum, unless it is not positive [kg].
        balance: impossible moments of inertia are replaced by their mean.
        gravity: [m/s^2].
        disabled: forces of joints that are switched off: ``spring``, ``damper``, ``frictionloss``.
    """

    per_angle: float = np.pi / 180
    euler: str = "xyz"
    autolimits: bool = True
    from_geoms: str = "auto"
    groups: tuple[float, float] = (0, 5)
    least_mass: float = 0.0
    least_moment: float = 0.0
    total_mass: float = -1.0
    balance: bool = False
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    disabled: frozenset[str] = frozenset()


def read_settings(root: Element, notes: Notes) -> Settings:
    """The settings of a model; of attributes that are given again, the last counts."""
    compiler, option, flag = (
        _together(root, *path) for path in (("compiler",), ("option",), ("option", "flag"))
    )
    if compiler.attributes.get("coordinate", "local") != "local":
        compiler.fault('has coordinate="global", which MuJoCo itself no longer reads; use local coordinates')
    euler = compiler.attributes.get("eulerseq", "xyz").strip()
    if len(euler) != 3 or euler.strip("xyzXYZ"):
        compiler.fault(f'has eulerseq="{euler[:20]}"; it takes three letters of x, y, z, X, Y and Z')
    degrees = compiler.choice("angle", ("degree", "radian"), "degree") == "degree"
    low, high = map(float, compiler.numbers("inertiagrouprange", 2, (0.0, 5.0)))
    x, y, z = map(float, option.numbers("gravity", 3, Settings.gravity))
    if flag.choice("gravity", ("enable", "disable"), "enable") == "disable":
        x = y = z = 0.0
    if option.number("density", 0.0) or option.number("viscosity", 0.0):
        notes.add(FLUID)
    return Settings(
        per_angle=np.pi / 180 if degrees else 1.0,
        euler=euler,
        autolimits=compiler.choice("autolimits", YES_NO, "true") == "true",
        from_geoms=compiler.choice("inertiafromgeom", (*YES_NO, "auto"), "auto"),
        groups=(low, high),
        least_mass=compiler.number("boundmass", 0.0),
        least_moment=compiler.number("boundinertia", 0.0),
        total_mass=compiler.number("settotalmass", -1.0),
        balance=compiler.choice("balanceinertia", YES_NO, "false") == "true",
        gravity=(x, y, z),
        disabled=frozenset(name for name in FORCES if flag.attributes.get(name, "").strip() == "disable"),
    )


def _together(root: Element, *path: str) -> Element:
    """All elements at a path as one."""
    found = [root]
    for tag in path:
        found = [child for element in found for child in element.all(tag)]
    attributes = {key: value for element in found for key, value in element.attributes.items()}
    last = found[-1] if found else root
    return Element(path[-1], attributes, last.file, last.line)
