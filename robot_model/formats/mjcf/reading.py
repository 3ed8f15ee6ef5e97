"""Assembly of a model from its parts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from robot_model.formats.mjcf.actuators import with_actuators
from robot_model.formats.mjcf.bodies import Bodies
from robot_model.formats.mjcf.defaults import read_defaults
from robot_model.formats.mjcf.included import with_includes
from robot_model.formats.mjcf.left_out import with_equalities
from robot_model.formats.mjcf.settings import read_settings
from robot_model.formats.mjcf.tendons import transmissions_of
from robot_model.formats.parts.draft import Draft, DraftJoint, DraftLink
from robot_model.formats.parts.markup import Element
from robot_model.formats.parts.mass import Mass
from robot_model.formats.parts.notes import Notes
from robot_model.input.errors import InputError

__all__ = ["read_mjcf"]

CONTACTS = "contacts with the ground and between bodies are left out"


def read_mjcf(root: Element, path: Path) -> Draft:
    """The robot of a ``<mujoco>`` element in the file `path`. Raises `InputError`."""
    notes = Notes()
    model = with_includes(root, path)
    settings, defaults = read_settings(model, notes), read_defaults(model)
    bodies = Bodies(settings, defaults, notes)
    bodies.read(model)
    if len(bodies.links) < 2 and not bodies.free:
        root.fault("has no <body>")
    _check_unique("body", bodies.links)
    _check_unique("joint", bodies.joints)
    if bodies.free:
        notes.add(CONTACTS)
    transmissions = transmissions_of(bodies.joints, model, defaults, settings, notes)
    joints = with_actuators(bodies.joints, model, defaults, settings, notes, transmissions)
    return Draft(
        name=root.attributes.get("model", ""),
        root=bodies.root,
        links=tuple(_scaled(bodies.links, settings.total_mass)),
        joints=tuple(with_equalities(joints, model, defaults, notes, transmissions)),
        transmissions=transmissions,
        base="free" if bodies.free else "fixed",
        base_pose=bodies.pose,
        gravity=settings.gravity,
        notes=notes,
    )


def _check_unique(kind: str, parts: Iterable[DraftLink | DraftJoint]) -> None:
    seen: set[str] = set()
    for part in parts:
        if part.name in seen:
            raise InputError(f"{part.where}: {kind} '{part.name}' has a name that another one has already.")
        seen.add(part.name)


def _scaled(links: list[DraftLink], total: float) -> list[DraftLink]:
    """The links with masses that add up to `total` [kg], unless that is not positive."""
    if total <= 0:
        return links
    if gap := next((link.gap for link in links if link.gap and not link.marker), ""):
        raise InputError(
            f"{gap}, so that settotalmass cannot be followed; remove it, or give the body an <inertial>."
        )
    factor = total / max(sum(link.mass.mass for link in links if link.mass), np.finfo(float).tiny)
    return [
        replace(link, mass=_times(link.mass, factor), corrected=_times(link.corrected, factor))
        for link in links
    ]


def _times(mass: Mass | None, factor: float) -> Mass | None:
    return mass and Mass(mass.mass * factor, mass.centre, mass.inertia * factor)
