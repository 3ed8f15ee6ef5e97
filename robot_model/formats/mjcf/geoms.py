"""Mass properties of primitive geoms of uniform density."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from robot_model.formats.mjcf.orientation import along, pose_of
from robot_model.formats.mjcf.settings import Settings
from robot_model.formats.parts.markup import Element
from robot_model.formats.parts.mass import Mass
from robot_model.formats.parts.poses import Pose

__all__ = ["geom_mass"]

Array = NDArray[np.float64]
#: Volume [m^3] and moments of inertia per mass [m^2] of a shape with these sizes [m].
Shape = Callable[[Array], tuple[float, tuple[float, float, float]]]

#: Where a geom gives neither mass nor density [kg/m^3].
DENSITY = 1000.0

TYPES = ("sphere", "capsule", "ellipsoid", "cylinder", "box", "plane", "hfield", "mesh", "sdf")


def _sphere(size: Array) -> tuple[float, tuple[float, float, float]]:
    (r,) = size
    return 4 / 3 * np.pi * r**3, (0.4 * r**2,) * 3


def _ellipsoid(size: Array) -> tuple[float, tuple[float, float, float]]:
    a, b, c = size
    return 4 / 3 * np.pi * a * b * c, ((b**2 + c**2) / 5, (a**2 + c**2) / 5, (a**2 + b**2) / 5)


def _box(size: Array) -> tuple[float, tuple[float, float, float]]:
    a, b, c = size
    return 8 * a * b * c, ((b**2 + c**2) / 3, (a**2 + c**2) / 3, (a**2 + b**2) / 3)


def _cylinder(size: Array) -> tuple[float, tuple[float, float, float]]:
    r, h = size
    across = (3 * r**2 + 4 * h**2) / 12
    return 2 * np.pi * r**2 * h, (across, across, r**2 / 2)


def _capsule(size: Array) -> tuple[float, tuple[float, float, float]]:
    """A cylinder of half length h between two half spheres, whose centres of mass are 3/8 r outside."""
    r, h = size
    cylinder, sphere = 2 * np.pi * r**2 * h, 4 / 3 * np.pi * r**3
    whole = cylinder + sphere
    ends = 0.4 * r**2 + h**2 + 0.75 * h * r
    across = (cylinder * (3 * r**2 + 4 * h**2) / 12 + sphere * ends) / whole
    return whole, (across, across, (cylinder * r**2 / 2 + sphere * 0.4 * r**2) / whole)


#: Shapes with their numbers of sizes.
SHAPES: Mapping[str, tuple[int, Shape]] = {
    "sphere": (1, _sphere),
    "ellipsoid": (3, _ellipsoid),
    "box": (3, _box),
    "cylinder": (2, _cylinder),
    "capsule": (2, _capsule),
}


def geom_mass(geom: Element, settings: Settings) -> Mass | str | None:
    """Mass of a geom, in the frame around it; None for no mass; a clause where it depends on a mesh.

    Raises:
        InputError: sizes that are missing or not positive, a negative mass or density.
    """
    kind = geom.choice("type", TYPES, "sphere")
    low, high = settings.groups
    if not low <= geom.number("group", 0.0) <= high or kind in ("plane", "hfield"):
        return None
    mass = geom.number("mass", 0.0) if "mass" in geom.attributes else None
    density = geom.number("density", DENSITY)
    if (mass or 0.0) < 0 or density < 0:
        geom.fault("has a negative mass or density")
    if mass == 0 or (mass is None and density == 0):
        return None
    if kind in ("mesh", "sdf") or "mesh" in geom.attributes:
        return f"takes its mass from a mesh (line {geom.line}), and meshes are not read"
    if geom.attributes.get("shellinertia", "false").strip() == "true":
        return f"takes its mass from a shell (shellinertia in line {geom.line}), which is not computed"
    size, pose = _size_and_pose(geom, kind, settings)
    volume, moments = SHAPES[kind][1](size)
    weight = density * volume if mass is None else mass
    return Mass(weight, np.zeros(3), np.diag(moments) * weight).seen_from(pose)


def _size_and_pose(geom: Element, kind: str, settings: Settings) -> tuple[Array, Pose]:
    """Sizes and pose of a geom; ``fromto`` gives place, direction and half length at once."""
    count, size = SHAPES[kind][0], geom.several("size", 3)
    if "fromto" in geom.attributes and kind != "sphere":
        ends = geom.numbers("fromto", 6).reshape(2, 3)
        way = ends[0] - ends[1]
        half = np.linalg.norm(way) / 2
        if not half > 0:
            geom.fault("has fromto= between two points that are the same")
        size = np.array([*[size[0]] * (count - 1), half]) if size.size else size
        pose = Pose(ends.mean(axis=0), along(way))
    else:
        pose = pose_of(geom, settings)
    if size.size < count or not (size[:count] > 0).all():
        geom.fault(f"is a {kind}, which needs {count} positive numbers in size=")
    return size[:count], pose
