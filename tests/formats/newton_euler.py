"""Inverse dynamics directly from URDF and MJCF files, an independent implementation for the tests.

Nothing is merged, renamed or shifted here: every link of a URDF and every joint of an MJCF body is a segment
of its own, and all vectors are in inertial axes. Of MJCF only what the test files with a fixed base use is
known: ``<inertial>`` with principal axes or all six figures, cylinders, boxes and capsules.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

__all__ = ["Segment", "inverse_dynamics", "mjcf_segments", "urdf_segments"]

STILL = np.zeros(3)


@dataclass
class Segment:
    """A link behind one joint: pose in the parent's frame, axis, and inertia in its own frame."""

    name: str
    parent: str | None
    place: np.ndarray
    turn: Rotation
    joint: str | None = None
    axis: np.ndarray | None = None
    slides: bool = False
    mass: float = 0.0
    centre: np.ndarray = field(default_factory=lambda: STILL)
    inertia: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    reference: float = 0.0


def inverse_dynamics(
    segments: list[Segment],
    position: Mapping[str, float],
    velocity: Mapping[str, float],
    acceleration: Mapping[str, float],
    gravity: np.ndarray,
) -> dict[str, float]:
    """Force of each joint [N m or N]; `segments` with parents first. Newton and Euler in inertial axes."""
    motion: dict[str | None, tuple] = {None: (STILL, Rotation.identity(), STILL, STILL, -np.asarray(gravity))}
    world_axes, wrenches = {}, {}
    for s in segments:
        place, turn, omega, alpha, linear = motion[s.parent]
        arm = turn.apply(s.place)
        turn_here = turn * s.turn
        linear = linear + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm))
        place = place + arm
        if s.joint is not None:
            axis = turn_here.apply(s.axis / np.linalg.norm(s.axis))
            q = position[s.joint] - s.reference
            rate, rate_rate = velocity[s.joint], acceleration[s.joint]
            if s.slides:
                place, arm = place + axis * q, axis * q
                linear = linear + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm))
                linear = linear + 2 * np.cross(omega, axis * rate) + axis * rate_rate
            else:
                alpha = alpha + axis * rate_rate + np.cross(omega, axis * rate)
                omega = omega + axis * rate
                turn_here = Rotation.from_rotvec(axis * q) * turn_here
            world_axes[s.name] = axis
        motion[s.name] = (place, turn_here, omega, alpha, linear)
        lever = turn_here.apply(s.centre)
        inertia = turn_here.as_matrix() @ s.inertia @ turn_here.as_matrix().T
        force = s.mass * (linear + np.cross(alpha, lever) + np.cross(omega, np.cross(omega, lever)))
        moment = inertia @ alpha + np.cross(omega, inertia @ omega) + np.cross(lever, force)
        wrenches[s.name] = (force, moment)
    torques = {}
    for s in reversed(segments):
        force, moment = wrenches[s.name]
        if s.joint is not None:
            torques[s.joint] = float(world_axes[s.name] @ (force if s.slides else moment))
        if s.parent is not None:
            above_force, above_moment = wrenches[s.parent]
            arm = motion[s.name][0] - motion[s.parent][0]
            wrenches[s.parent] = (above_force + force, above_moment + moment + np.cross(arm, force))
    return torques


def numbers(element: ET.Element | None, key: str, default: str = "0 0 0") -> np.ndarray:
    return np.array((element.get(key, default) if element is not None else default).split(), dtype=float)


def urdf_segments(path: Path) -> list[Segment]:
    """Every link of a URDF; mimic joints are held at their offset."""
    root = ET.parse(path).getroot()
    joints = root.findall("joint")
    children = {joint.find("child").get("link"): joint for joint in joints}
    links = {link.get("name"): link for link in root.findall("link")}
    if any(joint.find("parent").get("link") == "world" for joint in joints):
        links.setdefault("world", ET.Element("link"))
    order = [name for name in links if name not in children]
    for name in order:
        order += [child for child, joint in children.items() if joint.find("parent").get("link") == name]
    return [urdf_segment(name, links[name], children.get(name)) for name in order]


def urdf_segment(name: str, link: ET.Element, joint: ET.Element | None) -> Segment:
    segment = Segment(name, None, STILL, Rotation.identity())
    if joint is not None:
        origin = joint.find("origin")
        segment.parent = joint.find("parent").get("link")
        segment.place = numbers(origin, "xyz")
        segment.turn = Rotation.from_euler("xyz", numbers(origin, "rpy"))
        if joint.get("type") != "fixed":
            segment.axis = numbers(joint.find("axis"), "xyz", "1 0 0")
            segment.slides = joint.get("type") == "prismatic"
            segment.joint = joint.get("name")
        if (mimic := joint.find("mimic")) is not None:
            axis = segment.axis / np.linalg.norm(segment.axis) * float(mimic.get("offset", 0))
            if segment.slides:
                segment.place = segment.place + segment.turn.apply(axis)
            else:
                segment.turn = segment.turn * Rotation.from_rotvec(axis)
            segment.joint, segment.axis = None, None
    if (inertial := link.find("inertial")) is not None:
        figures = inertial.find("inertia")
        xx, xy, xz, yy, yz, zz = (
            float(figures.get(k, 0)) for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        turn = Rotation.from_euler("xyz", numbers(inertial.find("origin"), "rpy")).as_matrix()
        segment.mass = float(inertial.find("mass").get("value"))
        segment.centre = numbers(inertial.find("origin"), "xyz")
        segment.inertia = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
    return segment


def mjcf_segments(path: Path) -> list[Segment]:
    """Every joint of every body of an MJCF file with a fixed base; angles in degrees."""
    root = ET.parse(path).getroot()
    sequence = root.find("compiler").get("eulerseq", "xyz")
    return list(mjcf_bodies(root.find("worldbody"), None, path.parent, sequence))


def mjcf_bodies(around: ET.Element, parent: str | None, folder: Path, sequence: str) -> Iterator[Segment]:
    for child in around:
        if child.tag == "include":
            yield from mjcf_bodies(ET.parse(folder / child.get("file")).getroot(), parent, folder, sequence)
        if child.tag != "body":
            continue
        name, inner = child.get("name"), parent
        place, turn = numbers(child, "pos"), mjcf_turn(child, sequence)
        for joint in child.findall("joint"):
            pivot, axis = numbers(joint, "pos"), numbers(joint, "axis", "0 0 1")
            slides = joint.get("type") == "slide"
            reference = float(joint.get("ref", 0)) * (1 if slides else np.pi / 180)
            label = f"{name} behind {joint.get('name')}"
            yield Segment(
                label,
                inner,
                place + turn.apply(pivot),
                turn,
                joint.get("name"),
                axis,
                slides,
                reference=reference,
            )
            place, turn, inner = -pivot, Rotation.identity(), label
        yield mjcf_body(Segment(name, inner, place, turn), child, sequence)
        yield from mjcf_bodies(child, name, folder, sequence)


def mjcf_turn(element: ET.Element, sequence: str) -> Rotation:
    if "quat" in element.attrib:
        return Rotation.from_quat(numbers(element, "quat")[[1, 2, 3, 0]])
    if "axisangle" in element.attrib:
        *axis, angle = numbers(element, "axisangle")
        return Rotation.from_rotvec(np.array(axis) / np.linalg.norm(axis) * np.radians(angle))
    if "zaxis" in element.attrib:
        return mjcf_along(numbers(element, "zaxis"))
    turn = Rotation.identity()
    for letter, angle in zip(sequence, numbers(element, "euler")):
        step = Rotation.from_euler(letter.lower(), angle, degrees=True)
        turn = turn * step if letter.islower() else step * turn
    return turn


def mjcf_along(direction: np.ndarray) -> Rotation:
    direction = direction / np.linalg.norm(direction)
    cross = np.cross([0, 0, 1], direction)
    return Rotation.from_rotvec(cross / np.linalg.norm(cross) * np.arccos(direction[2]))


def mjcf_body(segment: Segment, body: ET.Element, sequence: str) -> Segment:
    if (inertial := body.find("inertial")) is not None:
        segment.mass, segment.centre = float(inertial.get("mass")), numbers(inertial, "pos")
        turn = mjcf_turn(inertial, sequence).as_matrix()
        if "fullinertia" in inertial.attrib:
            xx, yy, zz, xy, xz, yz = numbers(inertial, "fullinertia")
            segment.inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            segment.inertia = turn @ np.diag(numbers(inertial, "diaginertia")) @ turn.T
        return segment
    (geom,) = body.findall("geom")
    return mjcf_geom(segment, geom)


def mjcf_geom(segment: Segment, geom: ET.Element) -> Segment:
    """One cylinder, box or capsule; the capsule's moments by slices, not by the formula under test."""
    size, turn = numbers(geom, "size"), np.eye(3)
    radius, half = size[0], size[-1]
    if "fromto" in geom.attrib:
        ends = numbers(geom, "fromto").reshape(2, 3)
        segment.centre, half = ends.mean(axis=0), np.linalg.norm(ends[1] - ends[0]) / 2
        turn = mjcf_along(ends[1] - ends[0]).as_matrix()
    if geom.get("type") == "box":
        segment.mass = 8000 * np.prod(size)
        a, b, c = size**2
        moments = np.array([b + c, a + c, a + b]) * segment.mass / 3
    else:
        rounded = geom.get("type") == "capsule"
        z, weights = np.polynomial.legendre.leggauss(40)
        pieces = [(z * half, weights * half, np.full(40, radius))]
        if rounded:
            z, weights = (z + 1) * radius / 2, weights * radius / 2
            pieces += [(side * (half + z), weights, np.sqrt(radius**2 - z**2)) for side in (1, -1)]
        areas = [(h, w * np.pi * r**2, r) for h, w, r in pieces]
        volume = sum(v.sum() for _, v, _ in areas)
        segment.mass = float(geom.get("mass", float(geom.get("density", 1000)) * volume))
        axial = sum((v * r**2 / 2).sum() for _, v, r in areas) / volume
        across = sum((v * (r**2 / 4 + h**2)).sum() for h, v, r in areas) / volume
        moments = np.array([across, across, axial]) * segment.mass
    segment.inertia = turn @ np.diag(moments) @ turn.T
    return segment
