"""Poses as MJCF gives them: a place, and an orientation in one of five ways."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_model.formats.mjcf.defaults import ORIENTATIONS
from robot_model.formats.mjcf.settings import Settings
from robot_model.formats.parts.markup import Element
from robot_model.formats.parts.poses import Pose, about, from_quaternion, shifted

__all__ = ["along", "pose_of"]

Array = NDArray[np.float64]


def pose_of(element: Element, settings: Settings) -> Pose:
    """Pose of an element in the frame around it."""
    place = element.numbers("pos", 3, (0.0, 0.0, 0.0))
    given = [key for key in ORIENTATIONS if key in element.attributes]
    if len(given) > 1:
        element.fault(f"has an orientation in {given[0]}= and in {given[1]}=; give one")
    if not given:
        return shifted(place)
    return Pose(place, _rotation(element, given[0], settings))


def _rotation(element: Element, key: str, settings: Settings) -> Array:
    if key == "quat":
        return from_quaternion(_not_zero(element, key, element.numbers(key, 4)))
    if key == "axisangle":
        *axis, angle = element.numbers(key, 4)
        return about(_unit(_not_zero(element, key, np.array(axis))), angle * settings.per_angle)
    if key == "euler":
        return _from_euler(element.numbers(key, 3) * settings.per_angle, settings.euler)
    if key == "zaxis":
        return along(_not_zero(element, key, element.numbers(key, 3)))
    figures = element.numbers(key, 6)
    x = _unit(_not_zero(element, key, figures[:3]))
    y = _unit(_not_zero(element, key, figures[3:] - (x @ figures[3:]) * x))
    return np.column_stack([x, y, np.cross(x, y)])


def _from_euler(angles: Array, order: str) -> Array:
    """Rotations about the axes of `order` one after the other: small letters turn with the body."""
    rotation = np.eye(3)
    for angle, letter in zip(angles, order):
        turn = about(np.eye(3)["xyz".index(letter.lower())], float(angle))
        rotation = rotation @ turn if letter.islower() else turn @ rotation
    return rotation


def along(direction: Array) -> Array:
    """The smallest rotation that turns the z axis into a direction, shape (3, 3)."""
    target = _unit(direction)
    axis = np.cross([0.0, 0.0, 1.0], target)
    if not axis.any():
        return np.eye(3) if target[2] > 0 else np.diag([1.0, -1.0, -1.0])
    return about(_unit(axis), float(np.arctan2(np.linalg.norm(axis), target[2])))


def _unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)


def _not_zero(element: Element, key: str, vector: Array) -> Array:
    if not np.linalg.norm(vector) > 0:
        element.fault(f"has {key}= of zero length")
    return vector
