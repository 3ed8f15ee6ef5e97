"""Effects that change the robot's structure: the description of the robot with these effects.

A controller keeps the original description; everything else is built from the result of these functions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from pydantic import ValidationError

from exudyn_model.bodies.flexible_link import flexible_link
from exudyn_model.bodies.mechanism import Mass
from exudyn_model.bodies.rotation import skew
from exudyn_model.effects.links.bending import bending
from robot_model import Base, EffectUse, InputError, Joint, Link, Robot, SprungMass, nearest

__all__ = ["STRUCTURES", "as_is", "parameters"]

Change = Callable[[Robot, EffectUse, Mapping[str, float]], Robot]

#: Parameters of the effects, with their defaults; None must be given.
PARAMETERS: Mapping[str, Mapping[str, float | None]] = MappingProxyType(
    {
        "link_flexibility": {"period": None, "damping_ratio": 0.005, "modes": 4.0},
        "modal_damping": {"damping_ratio": None},
        "centrifugal_stiffening": {"strength": None},
        "slosh": {"mass": None, "frequency": None, "damping_ratio": 0.01, "x": 0.0, "y": 0.0, "z": 0.0},
        "base_motion": {"compliance": None, "arm": 0.5, "damping": 1e-3, "mass": 0.0, "inertia": 0.0},
    }
)


def as_is(robot: Robot) -> Robot:
    """The description of the robot with its effects; other effects stay in it as effects.

    Raises:
        InputError: an effect with wrong parameters or at a wrong place, or that the robot cannot have.
    """
    order = list(STRUCTURES)
    uses = [use for use in robot.effects if use.effect in STRUCTURES]
    for use in sorted(uses, key=lambda use: order.index(use.effect)):
        robot = STRUCTURES[use.effect](robot, use, parameters(robot, use, PARAMETERS[use.effect]))
    return robot


def parameters(robot: Robot, use: EffectUse, known: Mapping[str, float | None]) -> Mapping[str, float]:
    """All parameters of an effect; raises `InputError` for unknown and missing ones."""
    where = f"robot '{robot.name}', effect '{use.effect}' at '{use.at}'"
    for name in use.parameters:
        if name not in known:
            raise InputError(f"{where}: unknown parameter '{name}'{nearest(name, known)}.")
    found = {**known, **use.parameters}
    for name, value in found.items():
        if value is None:
            raise InputError(f"{where}: parameter '{name}' is missing.")
    return {name: float(value) for name, value in found.items() if value is not None}


def _refused(robot: Robot, use: EffectUse, why: str) -> InputError:
    return InputError(f"robot '{robot.name}', effect '{use.effect}' at '{use.at}': {why}")


def _link(robot: Robot, use: EffectUse) -> Link:
    links = {link.name: link for link in robot.links}
    if use.at not in links:
        raise _refused(robot, use, f"it can sit at {', '.join(links)}{nearest(use.at, links)}.")
    return links[use.at]


def _base(robot: Robot, use: EffectUse) -> Base:
    if use.at != "base":
        raise _refused(robot, use, "it can sit at base.")
    return robot.base


def _exchanged(robot: Robot, link: Link) -> Robot:
    links = tuple(link if other.name == link.name else other for other in robot.links)
    return robot.model_copy(update={"links": links})


def _link_flexibility(robot: Robot, use: EffectUse, p: Mapping[str, float]) -> Robot:
    link = _link(robot, use)
    if p["period"] == 0:
        return robot
    if link.flexible:
        raise _refused(robot, use, "the link is flexible already.")
    try:
        made = bending(robot, link, p["period"], damping_ratio=p["damping_ratio"], modes=round(p["modes"]))
    except ValueError as why:
        raise _refused(robot, use, f"{why}.") from None
    return _exchanged(robot, made)


def _modal_damping(robot: Robot, use: EffectUse, p: Mapping[str, float]) -> Robot:
    link = _link(robot, use)
    body = link.beam or link.modal or link.sprung
    if body is None:
        raise _refused(robot, use, "the link has no modes to damp.")
    modes = flexible_link(link)
    ratios = np.diag(modes.damping) / (2 * modes.shapes.frequencies) + p["damping_ratio"]
    if ratios.min() < 0 or ratios.max() >= 1:
        raise _refused(robot, use, f"it leaves damping ratios of {ratios.min():.3g} to {ratios.max():.3g}.")
    update: dict[str, object] = {"damping_ratio": tuple(ratios.tolist()), "rayleigh": None}
    if body is link.sprung:
        update = {"damping_ratio": float(ratios[0])}
    kind = next(kind for kind in ("beam", "modal", "sprung") if getattr(link, kind) is body)
    return _exchanged(robot, link.model_copy(update={kind: body.model_copy(update=update)}))


def _centrifugal_stiffening(robot: Robot, use: EffectUse, p: Mapping[str, float]) -> Robot:
    link = _link(robot, use)
    if link.beam is None or link.beam.stiffening:
        raise _refused(robot, use, "the link is not a beam, or stiffens already.")
    if not 0 <= p["strength"] <= 1:
        raise _refused(robot, use, f"its strength is a share from 0 to 1, not {p['strength']:g}.")
    if p["strength"] == 0:
        return robot
    beam = link.beam.model_copy(update={"stiffening": True})
    return _exchanged(robot, link.model_copy(update={"beam": beam}))


def _slosh(robot: Robot, use: EffectUse, p: Mapping[str, float]) -> Robot:
    base = _base(robot, use)
    if p["mass"] == 0:
        return robot
    place = np.array([p["x"], p["y"], p["z"]])
    names = {link.name for link in robot.links} | {joint.name for joint in robot.joints}
    name, count = "slosh", 1
    while name in names:
        count += 1
        name = f"slosh{count}"
    liquid = SprungMass(mass=p["mass"], frequency=p["frequency"], damping_ratio=p["damping_ratio"])
    tank = Joint(name=f"{name}_place", kind="fixed", parent="base", child=name, origin=tuple(place.tolist()))
    if base.kind == "free":
        taken = Mass(-p["mass"], -p["mass"] * place, p["mass"] * skew(place) @ skew(place))
        why = f"the base ({base.mass:g} kg) has no {p['mass']:g} kg at {place.tolist()} to give."
        base = _weighing(robot, use, base, Mass.of(base) + taken, why)
    update = {
        "base": base,
        "links": (*robot.links, Link(name=name, sprung=liquid)),
        "joints": (*robot.joints, tank),
    }
    return robot.model_copy(update=update)


def _base_motion(robot: Robot, use: EffectUse, p: Mapping[str, float]) -> Robot:
    base = _base(robot, use)
    if p["compliance"] == 0:
        return robot
    if base.kind == "free":
        raise _refused(robot, use, "the base is free already.")
    whole = Mass.of(base) + Mass(p["mass"], np.zeros(3), p["inertia"] * np.eye(3))
    free = base.model_copy(update={"kind": "free"})
    why = "the base that moves has no mass or moments of inertia; give mass and inertia."
    made = _weighing(robot, use, free, whole, why)
    if not np.linalg.eigvalsh(made.inertia_matrix)[0] > 0:
        raise _refused(robot, use, why)
    return robot.model_copy(update={"base": made})


def _weighing(robot: Robot, use: EffectUse, base: Base, mass: Mass, why: str) -> Base:
    """The base with these mass properties; refused with `why` where no body can have them."""
    j = mass.central_inertia if mass.mass > 0 else mass.inertia
    given = {
        **base.model_dump(),
        "mass": mass.mass,
        "center_of_mass": tuple(mass.center.tolist()),
        "inertia": (j[0, 0], j[1, 1], j[2, 2], j[0, 1], j[0, 2], j[1, 2]),
    }
    try:
        return Base.model_validate(given)
    except ValidationError:
        raise _refused(robot, use, why) from None


#: Effects that change the description, in the order in which they do.
STRUCTURES: Mapping[str, Change] = MappingProxyType(
    {
        "link_flexibility": _link_flexibility,
        "base_motion": _base_motion,
        "slosh": _slosh,
        "modal_damping": _modal_damping,
        "centrifugal_stiffening": _centrifugal_stiffening,
    }
)
