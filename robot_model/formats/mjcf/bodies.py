"""Nested bodies as a tree of links."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import add

import numpy as np

from robot_model.formats.mjcf.defaults import MAIN, Defaults
from robot_model.formats.mjcf.geoms import geom_mass
from robot_model.formats.mjcf.joints import is_free, read_joint
from robot_model.formats.mjcf.orientation import pose_of
from robot_model.formats.mjcf.settings import Settings
from robot_model.formats.parts.draft import DraftJoint, DraftLink
from robot_model.formats.parts.markup import Element
from robot_model.formats.parts.mass import Mass, nearest_realisable
from robot_model.formats.parts.notes import Notes, listed
from robot_model.formats.parts.poses import IDENTITY, Pose, shifted
from robot_model.formats.parts.trees import check_count
from robot_model.input.fields import inertia_fault

__all__ = ["WORLD", "Bodies"]

#: Name of the body that does not move.
WORLD = "world"

CHAIN = "body {}: has several joints, so massless links named after them are put in between"
GRAVCOMP = "gravcomp of body {}: the force that compensates its weight is left out"
SCENERY = "body {}: scenery that does not move, left out"

#: Content of a body that would need other programs or files to be read.
UNREAD = ("composite", "flexcomp", "replicate", "attach")


@dataclass
class Bodies:
    """Reads the bodies of a model; links and joints are collected in the order of the file.

    Attributes:
        settings, defaults: of the model.
        notes: assumptions and omissions.
        links, joints: the parts found.
        root: the link that becomes the base.
        free: the base floats.
        pose: of the base in the inertial frame.
    """

    settings: Settings
    defaults: Defaults
    notes: Notes
    links: list[DraftLink] = field(default_factory=list)
    joints: list[DraftJoint] = field(default_factory=list)
    root: str = WORLD
    free: bool = False
    pose: Pose = IDENTITY

    def read(self, model: Element) -> None:
        """All bodies of a model. Raises `InputError`."""
        top = [
            item
            for world in model.all("worldbody")
            for item in self._contents(world, world.attributes.get("childclass", MAIN), IDENTITY)
            if item[0].tag == "body"
        ]
        floating = [
            item for item in top if any(is_free(joint) for joint in self._own_joints(item[0], item[2]))
        ]
        if not floating:
            self.links.append(DraftLink(WORLD, model.where))
            for body, frame, inherited in top:
                self._body(body, WORLD, frame, inherited)
            return
        self._check_alone(top, floating)
        body, frame, inherited = floating[0]
        self.root, self.free = _name(body, len(self.links)), True
        self.pose = frame @ pose_of(body, self.settings)
        self._body(body, "", IDENTITY, inherited)

    def _check_alone(
        self, top: list[tuple[Element, Pose, str]], floating: list[tuple[Element, Pose, str]]
    ) -> None:
        """A robot is one tree: nothing else may move where its base floats."""
        if len(floating) > 1:
            names = listed(f"'{_name(body, 0)}'" for body, _, _ in floating)
            floating[1][0].fault(
                f"floats, but a robot has one free base, and {names} would be several; keep one"
            )
        for body, _, _ in top:
            if body is floating[0][0]:
                continue
            if next(_joints_within(body), None) is not None:
                body.fault(
                    f"moves beside {floating[0][0].label}, which floats; a robot is one tree: keep one"
                )
            self.notes.add(SCENERY, f"'{_name(body, 0)}'")

    def _contents(self, around: Element, childclass: str, frame: Pose) -> Iterator[tuple[Element, Pose, str]]:
        """Content of a body with frames resolved: element, frame around it, class that it inherits."""
        for child in around.children:
            if child.tag == "frame":
                inner = child.attributes.get("childclass", childclass)
                yield from self._contents(child, inner, frame @ pose_of(child, self.settings))
            elif child.tag in UNREAD:
                child.fault("is not read; let MuJoCo write the model out (mj_saveLastXML) and give that file")
            else:
                yield child, frame, childclass

    def _own_joints(self, body: Element, inherited: str) -> list[Element]:
        childclass = body.attributes.get("childclass", inherited)
        found = (item for item in self._contents(body, childclass, IDENTITY))
        return [
            self._joint(element, inner)
            for element, _, inner in found
            if element.tag in ("joint", "freejoint")
        ]

    def _joint(self, element: Element, childclass: str) -> Element:
        return element if element.tag == "freejoint" else self.defaults.resolved(element, childclass)

    def _body(self, body: Element, parent: str, frame: Pose, inherited: str) -> None:
        """A body and all within it; `frame` is around its element, in the parent link's frame."""
        check_count(self.links, body.file)
        name = _name(body, len(self.links))
        childclass = body.attributes.get("childclass", inherited)
        contents = list(self._contents(body, childclass, IDENTITY))
        if body.number("gravcomp", 0.0):
            self.notes.add(GRAVCOMP, f"'{name}'")
        joints = [(e, f, c) for e, f, c in contents if e.tag in ("joint", "freejoint")]
        pose = frame @ pose_of(body, self.settings)
        offset = self._chain(body, name, parent, pose, joints)
        link = self._massive(body, name, contents)
        self.links.append(_moved(link, offset))
        for child, inner, inside in contents:
            if child.tag == "body":
                self._body(child, name, offset @ inner, inside)

    def _chain(
        self, body: Element, name: str, parent: str, pose: Pose, found: list[tuple[Element, Pose, str]]
    ) -> Pose:
        """Add the joints that carry a body; returns the body's frame in the frame of its link.

        The joints of a body move it one after the other, each carried by those before it.
        """
        elements = [(self._joint(element, inherited), frame) for element, frame, inherited in found]
        if any(is_free(element) for element, _ in elements):
            if len(elements) > 1 or parent:
                elements[0][0].fault(
                    "lets its body float, which only a body in the world may do, and with no other joint"
                )
            return IDENTITY
        if not elements:
            if parent:
                self.joints.append(DraftJoint(f"{name}_fixed", body.where, "fixed", parent, name, pose))
            return IDENTITY
        if len(elements) > 1:
            self.notes.add(CHAIN, f"'{name}'")
        inner = pose
        for count, (element, frame) in enumerate(elements):
            joint_name = element.attributes.get("name") or _unnamed(name, count, len(elements))
            placed = read_joint(element, frame, joint_name, self.settings, self.notes)
            last = count == len(elements) - 1
            child = name if last else f"{joint_name}_link"
            self.joints.append(replace(placed.joint, parent=parent, child=child, pose=inner @ placed.pose))
            if not last:
                self.links.append(DraftLink(child, element.where, Mass(0.0, np.zeros(3), np.zeros((3, 3)))))
            parent, inner = child, shifted(-placed.place)
        return inner

    def _massive(self, body: Element, name: str, contents: list[tuple[Element, Pose, str]]) -> DraftLink:
        """The link of a body, with its mass in the body's frame."""
        inertials = [(element, frame) for element, frame, _ in contents if element.tag == "inertial"]
        use = self.settings.from_geoms
        if inertials and use != "true":
            found: Mass | str | None = self._stated(*inertials[0])
        elif use == "false":
            found = "has no <inertial>"
        else:
            geoms = ((self.defaults.resolved(e, c), f) for e, f, c in contents if e.tag == "geom")
            found = _total((geom_mass(geom, self.settings), frame) for geom, frame in geoms)
        label = f"{body.where}: body '{name}'"
        if found is None:
            gap = f"{label} has no <inertial>, nor geoms that weigh anything"
            return DraftLink(name, body.where, gap=gap, marker=True)
        if isinstance(found, str):
            return DraftLink(name, body.where, gap=f"{label} {found}")
        mass = self._bounded(found)
        if not (fault := inertia_fault(mass.inertia)):
            return DraftLink(name, body.where, mass)
        corrected = replace(mass, inertia=nearest_realisable(mass.inertia))
        return DraftLink(name, body.where, mass, fault=f"{label}: {fault}", corrected=corrected)

    def _stated(self, inertial: Element, frame: Pose) -> Mass | str:
        mass = inertial.number("mass")
        if mass < 0:
            inertial.fault(f"has a negative mass, {mass:g} kg")
        pose = frame @ pose_of(inertial, self.settings)
        if "fullinertia" in inertial.attributes:
            xx, yy, zz, xy, xz, yz = inertial.numbers("fullinertia", 6)
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        elif "diaginertia" in inertial.attributes:
            inertia = np.diag(inertial.numbers("diaginertia", 3))
        else:
            return "has an <inertial> without diaginertia and fullinertia"
        return Mass(mass, np.zeros(3), inertia).seen_from(pose)

    def _bounded(self, mass: Mass) -> Mass:
        """A mass as changed by the compiler's settings."""
        set_ = self.settings
        if not (set_.least_mass or set_.least_moment or set_.balance):
            return mass
        moments, axes = np.linalg.eigh(mass.inertia)
        moments = np.maximum(moments, set_.least_moment)
        if set_.balance and moments[0] + moments[1] < moments[2]:
            moments = np.full(3, moments.mean())
        return Mass(max(mass.mass, set_.least_mass), mass.centre, axes @ np.diag(moments) @ axes.T)


def _moved(link: DraftLink, offset: Pose) -> DraftLink:
    if offset is IDENTITY:
        return link
    mass = link.mass.seen_from(offset) if link.mass else None
    corrected = link.corrected.seen_from(offset) if link.corrected else None
    return replace(link, mass=mass, corrected=corrected, frame=offset)


def _total(parts: Iterator[tuple[Mass | str | None, Pose]]) -> Mass | str | None:
    """All masses together; a clause where one is not known."""
    found = list(parts)
    unknown = next((mass for mass, _ in found if isinstance(mass, str)), None)
    known = [mass.seen_from(pose) for mass, pose in found if isinstance(mass, Mass)]
    return unknown or (reduce(add, known) if known else None)


def _name(body: Element, count: int) -> str:
    return body.attributes.get("name") or f"body{count}"


def _unnamed(body: str, count: int, of: int) -> str:
    return f"{body}_joint" if of == 1 else f"{body}_joint{count + 1}"


def _joints_within(body: Element) -> Iterator[Element]:
    for child in body.children:
        if child.tag in ("joint", "freejoint"):
            yield child
        elif child.tag in ("body", "frame"):
            yield from _joints_within(child)
