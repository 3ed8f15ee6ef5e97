"""A rigid link as a beam between its frame and the outermost joint on it, of the same total mass.

The link's mass has three parts: a uniform beam with 99 % of the mass that can lie along the line, a point
mass at the tip with 99 % of the mass that still can, and a rigid hub with the rest.
"""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from exudyn_model.bodies.beam import beam_nodes
from exudyn_model.bodies.mechanism import Mass, undeformed
from robot_model import Beam, Link, Robot
from robot_model.description.flexible import GeneralSection, TipBody

__all__ = ["bending"]

Array = NDArray[np.float64]

#: Elements of the beam, its material [Pa], and E/G.
ELEMENTS, YOUNG, TO_SHEAR = 12, 70e9, 2.6
#: The section's radius of gyration over the length: half of the link's own thickness, within these.
THINNEST, THICKEST = 1e-3, 1e-2
#: Fraction of the available mass that is used, and the least fraction of the link's mass [-].
PART, LEAST = 0.99, 1e-3


def bending(robot: Robot, link: Link, period: float, *, damping_ratio: float, modes: int) -> Link:
    """The link as a beam with hub and tip.

    Its stiffness gives the `period` [s] of vibration when clamped at its frame, by Rayleigh's
    (2 pi/T)^2 = 3 EI / (L^3 (m_carried + m_tip + 33/140 m_beam)).

    Raises:
        ValueError: with the reason, where nothing of the link can bend.
    """
    end = _end(robot, link)
    length = float(np.linalg.norm(end))
    if link.mass <= 0:
        raise ValueError("the link has no mass that could bend")
    spread, moment, gyration = _spread(link, length)
    whole = np.block([[spread, moment[:, None]], [moment, link.mass]])
    unit = _beam(end, 1.0, gyration, mass=1.0, tip=0.0, damping_ratio=0.0, modes=1)
    along = sum(
        (_second(node.position, node.mass, node.inertia) for node in beam_nodes(unit)), np.zeros((4, 4))
    )
    beam = PART / float(eigh(along, whole, eigvals_only=True).max())
    if beam <= LEAST * link.mass:
        raise ValueError("none of the link's mass lies along its axis; give it moments of inertia")
    point = _second(end, 1.0, np.zeros((3, 3)))
    tip = PART / float(eigh(point, whole - beam * along, eigvals_only=True).max())
    effective = _carried(robot, link.name) + tip + 33 / 140 * beam
    stiffness = (2 * pi / period) ** 2 * effective * length**3 / 3
    made = _beam(end, stiffness, gyration, mass=beam, tip=tip, damping_ratio=damping_ratio, modes=modes)
    left = whole - sum(
        (_second(node.position, node.mass, node.inertia) for node in beam_nodes(made)), np.zeros((4, 4))
    )
    return _hub(link, made, left)


def _end(robot: Robot, link: Link) -> Array:
    origins = [np.asarray(joint.origin, dtype=float) for joint in robot.joints if joint.parent == link.name]
    lengths = [float(np.linalg.norm(origin)) for origin in origins]
    if lengths and max(lengths) > 0:
        return origins[int(np.argmax(lengths))]
    end = 2 * np.asarray(link.center_of_mass, dtype=float)
    if not end.any():
        raise ValueError("the link has no length")
    return end


def _carried(robot: Robot, name: str) -> float:
    """Mass of everything outboard of a link [kg]."""
    own = [joint.child for joint in robot.joints if joint.parent == name]
    return sum(undeformed(robot.link(child)).mass + _carried(robot, child) for child in own)


def _spread(link: Link, length: float) -> tuple[Array, Array, float]:
    """sum m r r^T and sum m r of the link, with a least thickness; its section's radius over the length."""
    centre = np.asarray(link.center_of_mass, dtype=float)
    about = 0.5 * np.trace(link.inertia_matrix) * np.eye(3) - link.inertia_matrix
    thickness = np.sqrt(max(np.linalg.eigvalsh(about)[0], 0.0) / link.mass) / length
    if thickness < 2 * THINNEST:
        about = about + link.mass * (2 * THINNEST * length) ** 2 * np.eye(3)
    gyration = min(max(0.5 * thickness, THINNEST), THICKEST)
    return about + link.mass * np.outer(centre, centre), link.mass * centre, float(gyration)


def _second(place: Array, mass: float, inertia: Array) -> Array:
    """[sum m r r^T, sum m r; sum m r^T, m] of a small body, shape (4, 4)."""
    own = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    corner = mass * place[:, None]
    return np.block([[own + mass * np.outer(place, place), corner], [corner.T, mass]])


def _hub(link: Link, beam: Beam, left: Array) -> Link:
    mass = float(left[3, 3])
    spread = left[:3, :3]
    whole = Mass(mass, left[:3, 3], np.trace(spread) * np.eye(3) - spread)
    j = whole.central_inertia
    return Link(
        name=link.name,
        mass=mass,
        center_of_mass=tuple(whole.center.tolist()),
        inertia=tuple(float(j[pair]) for pair in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))),
        beam=beam,
    )


def _beam(
    end: Array,
    stiffness: float,
    gyration: float,
    *,
    mass: float,
    tip: float,
    damping_ratio: float,
    modes: int,
) -> Beam:
    length = float(np.linalg.norm(end))
    moment = stiffness / YOUNG
    area = moment / (gyration * length) ** 2
    along = end / length
    sideways = np.eye(3)[int(np.argmin(np.abs(end)))]
    sideways = sideways - (sideways @ along) * along
    return Beam(
        length=length,
        direction=tuple(end.tolist()),
        section_y=tuple(sideways.tolist()),
        section=GeneralSection(
            area=area, torsion_constant=2 * moment, second_moment_y=moment, second_moment_z=moment
        ),
        young=YOUNG,
        shear=YOUNG / TO_SHEAR,
        density=mass / (area * length),
        elements=ELEMENTS,
        tip=TipBody(mass=tip),
        damping_ratio=damping_ratio,
        modes=modes,
    )
