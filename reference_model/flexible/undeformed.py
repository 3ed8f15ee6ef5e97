"""A robot whose flexible links do not deform: the model of a controller that assumes rigid links."""

from __future__ import annotations

import numpy as np

from reference_model.flexible.body import flexible_body
from robot_model import Link, Robot

__all__ = ["undeformed", "undeformed_link"]


def undeformed(robot: Robot) -> Robot:
    """The same robot with every flexible link as a rigid one of the same mass properties, undeformed."""
    if not robot.flexible_links:
        return robot
    links = tuple(undeformed_link(link) if link.flexible else link for link in robot.links)
    return robot.model_copy(update={"links": links})


def undeformed_link(link: Link) -> Link:
    """A rigid link with mass, centre of mass and inertia of a flexible one with its hub and tip body."""
    body = flexible_body(link)
    centre = body.first_moment / body.mass
    central = body.inertia - body.mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))  # Steiner
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return Link(
        name=link.name,
        mass=body.mass,
        center_of_mass=tuple(centre.tolist()),
        inertia=tuple(float(central[pair]) for pair in pairs),
    )
