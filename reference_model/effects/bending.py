"""A rigid link as a beam: its mass is divided into a bending and a rigid part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from reference_model.flexible import flexible_body
from robot_model import Beam, InputError, Joint, Link, Robot
from robot_model.description.flexible import GeneralSection, TipBody

__all__ = ["bending_link", "carried_mass", "tip_of"]

Array = NDArray[np.float64]

#: Finite elements of the beam: the first two frequencies in a plane are then accurate to 0.2 %.
ELEMENTS = 12

#: Young's modulus [Pa], that of aluminium. Only its product with the section properties matters.
YOUNG = 70e9

#: Young's modulus over shear modulus at a Poisson's ratio of 0.3.
TO_SHEAR = 2.6

#: Largest and smallest radius of gyration of the section over the length. The first is so slender that
#: stretching and twisting are over 25 times faster than bending; no real link is thinner than the second.
GYRATION = (1e-3, 1e-2)

#: The section's radius of gyration relative to the link's own across its thinnest direction, so that its
#: inertia about the axis does not limit the beam's mass.
THIN = 0.5

#: Fraction of a uniform beam's mass that moves with its tip when a tip force bends it (Rayleigh).
TIP_SHARE = 33 / 140

#: Fraction of the available mass assigned to the beam: the rest keeps the hub a realisable body.
BENDS = 0.99

#: Below this fraction of the link's mass the beam is considered absent.
LEAST = 1e-3


def tip_of(robot: Robot, link: Link) -> Array:
    """End of the beam in the link's frame: the outermost joint it carries, else twice its mass centre."""
    carried = [np.asarray(joint.origin, dtype=float) for joint in _children(robot, link.name)]
    tip = max(carried, key=lambda place: float(np.linalg.norm(place)), default=np.zeros(3))
    if not tip.any():
        tip = 2 * np.asarray(link.center_of_mass, dtype=float)
    if not tip.any():
        raise InputError(
            f"link '{link.name}' has no length: no joint away from its frame, and its mass there."
        )
    return tip


def carried_mass(robot: Robot, link: str) -> float:
    """Mass of all bodies outboard of a link [kg]."""
    total = 0.0
    for joint in _children(robot, link):
        child = robot.link(joint.child)
        total += flexible_body(child).mass if child.flexible else child.mass
        total += carried_mass(robot, child.name)
    return total


def _children(robot: Robot, body: str) -> list[Joint]:
    return [joint for joint in robot.joints if joint.parent == body]


def bending_link(robot: Robot, link: Link, *, period: float, damping_ratio: float, modes: int) -> Link:
    """The link as a beam with a hub and a tip body of the same total mass.

    As much as possible of the link's mass is a uniform beam from its frame to the tip, then a point mass at
    the tip; the rest is the hub. Mass, centre of mass and inertia of the undeformed link are kept.

    Args:
        robot: the description.
        link: a rigid link of it.
        period: of its first bending mode, clamped at its frame, with all that it carries as a point mass at
            its tip, by Rayleigh's formula [s].
        damping_ratio: of all modes.
        modes: number of modes.

    Raises:
        InputError: the link is flexible already, or none of its mass can bend.
    """
    if link.flexible:
        raise InputError(f"link '{link.name}' is flexible already; change its description, or its damping.")
    if not link.mass > 0:
        raise InputError(f"link '{link.name}' has no mass that could bend; describe it as a beam.")
    end = tip_of(robot, link)
    length = float(np.linalg.norm(end))
    whole, gyration = _whole(link, length)
    share = _Share.of(link, whole, end, gyration)
    moved = carried_mass(robot, link.name) + share.tip + TIP_SHARE * share.beam
    bending = (2 * np.pi / period) ** 2 * moved * length**3 / 3  # E I, from 3 E I / L^3 = w^2 m
    beam = _beam(
        end, bending, gyration, mass=share.beam, tip=share.tip, modes=modes, damping_ratio=damping_ratio
    )
    bare = flexible_body(Link(name=link.name, beam=beam))
    return _with_hub(link, beam, whole - _pseudo_of(bare.mass, bare.first_moment, bare.inertia))


@dataclass(frozen=True)
class _Share:
    """Masses of beam and tip body [kg]."""

    beam: float
    tip: float

    @classmethod
    def of(cls, link: Link, whole: Array, end: Array, gyration: float) -> _Share:
        """The largest beam, then the largest tip body, for which the hub stays realisable."""
        trial = _beam(end, 1.0, gyration, mass=1.0, tip=0.0, modes=1, damping_ratio=0.0)
        unit = flexible_body(Link(name=link.name, beam=trial))
        rod = _pseudo_of(unit.mass, unit.first_moment, unit.inertia)
        beam = BENDS * _most(whole, rod)
        if not beam > LEAST * link.mass:
            raise InputError(
                f"link '{link.name}': none of its mass lies along the line from its frame to "
                f"{[round(float(x), 6) for x in end]}, so that nothing bends; give it moments of inertia, or "
                "describe it as a beam."
            )
        place = np.append(end, 1.0)
        return cls(beam, BENDS * _most(whole - beam * rod, np.outer(place, place)))


def _most(whole: Array, part: Array) -> float:
    """The largest multiple of `part` that leaves `whole` positive semi-definite when subtracted."""
    return float(1 / eigh(part, whole, eigvals_only=True)[-1])


def _whole(link: Link, length: float) -> tuple[Array, float]:
    """The link's pseudo-inertia, and the radius of gyration of its section over the length.

    A link thinner than the thinnest allowed section gets twice that section's thickness.
    """
    centre = np.asarray(link.center_of_mass, dtype=float)
    spread = np.trace(link.inertia_matrix) / 2 * np.eye(3) - link.inertia_matrix
    own = np.sqrt(max(float(np.linalg.eigvalsh(spread)[0]), 0.0) / link.mass) / length
    gyration = float(np.clip(THIN * own, *GYRATION))
    if own < GYRATION[0] / THIN:
        spread = spread + link.mass * (GYRATION[0] / THIN * length) ** 2 * np.eye(3)
    second = spread + link.mass * np.outer(centre, centre)
    moment = link.mass * centre[:, None]
    return np.block([[second, moment], [moment.T, np.array([[link.mass]])]]), gyration


def _pseudo_of(mass: float, first_moment: Array, inertia: Array) -> Array:
    """[sum m r r^T, sum m r; sum m r^T, m]: positive semi-definite for every realisable body, (4, 4).

    Wensing, Kim, Slotine, IEEE Robotics and Automation Letters 3 (2018) 60-67, eq. 9.
    """
    second = np.trace(inertia) / 2 * np.eye(3) - inertia
    return np.block([[second, first_moment[:, None]], [first_moment[None], np.array([[mass]])]])


def _with_hub(link: Link, beam: Beam, rest: Array) -> Link:
    mass, moment = float(rest[3, 3]), rest[:3, 3]
    centre = moment / mass
    central = rest[:3, :3] - np.outer(moment, moment) / mass
    inertia = np.trace(central) * np.eye(3) - central
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return Link(
        name=link.name,
        mass=mass,
        center_of_mass=tuple(centre.tolist()),
        inertia=tuple(float(inertia[pair]) for pair in pairs),
        beam=beam,
    )


def _beam(
    end: Array, bending: float, gyration: float, *, mass: float, tip: float, modes: int, damping_ratio: float
) -> Beam:
    """A round, slender beam to `end` with E I = `bending` [N m^2]."""
    length = float(np.linalg.norm(end))
    moment = bending / YOUNG
    area = moment / (gyration * length) ** 2
    across = np.eye(3)[int(np.abs(end).argmin())]
    across = across - (across @ end) / length**2 * end
    return Beam(
        length=length,
        direction=tuple(end.tolist()),
        section_y=tuple(across.tolist()),
        section=GeneralSection(
            area=area, torsion_constant=2 * moment, second_moment_y=moment, second_moment_z=moment
        ),
        young=YOUNG,
        shear=YOUNG / TO_SHEAR,
        density=mass / (area * length),
        elements=ELEMENTS,
        modes=modes,
        damping_ratio=damping_ratio,
        tip=TipBody(mass=tip),
    )
