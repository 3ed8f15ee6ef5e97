"""A flexible link by its modes, as plain numbers: nodes, shapes, masses, and the motion of a node.

A node at rho0 with shapes Phi, Psi is at ``rho = rho0 + Phi x`` in the link's frame, and rotated by the unit
quaternion along (1, Psi x / 2). Where bending shortens a beam, it moves by -1/2 x^T B x along the axis, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from exudyn_model.bodies.beam import Shapes, beam_nodes, beam_shapes, damping_of
from exudyn_model.bodies.imported import Imported, imported
from exudyn_model.bodies.moments import Points, Surplus
from exudyn_model.bodies.outriggers import outriggers
from exudyn_model.bodies.rotation import from_quaternion, skew
from exudyn_model.bodies.shortening import shortening
from robot_model import Beam, InputError, Link, ModalBody, SprungMass

__all__ = ["FlexibleLink", "NodeMotion", "flexible_link", "rigid_mass"]

Array = NDArray[np.float64]

#: Tolerated distance of a joint from a node, relative to the body's size.
NEAR = 1e-6
#: Number of cached bodies: more than any one robot has.
HELD = 64


@dataclass(frozen=True)
class NodeMotion:
    """A node of a bent link; vectors in the link's axes.

    Attributes:
        place: from the frame's origin [m], shape (3,).
        rotation: node to link axes, shape (3, 3).
        slide, turn: its velocity and angular velocity in the frame per modal rate, shape (3, s).
        slides, turns: the same at the present rates, shape (3,).
        slide_bias, turn_bias: its accelerations in the frame at zero modal accelerations, shape (3,).
    """

    place: Array
    rotation: Array
    slide: Array
    turn: Array
    slides: Array
    turns: Array
    slide_bias: Array
    turn_bias: Array


@dataclass(frozen=True, eq=False)
class FlexibleLink:
    """A flexible link.

    Attributes:
        name: of the link.
        nodes: undeformed places in the link's frame [m], shape (N, 3).
        shapes: its modes.
        damping: of the modal coordinates [1/s], shape (s, s).
        points: its masses, without hub.
        root: node at the inboard joint.
        tip: node of the tip channels.
        surplus: inertia in addition to that of its points; None where there is none.
        shortened: B of every node of a beam that stiffens, shape (N, s, s); None of others.
        rigid_frame: joints may sit anywhere on its frame, which does not deform.
    """

    name: str
    nodes: Array
    shapes: Shapes
    damping: Array
    points: Points
    root: int
    tip: int
    surplus: Surplus | None = None
    shortened: Array | None = None
    rigid_frame: bool = False

    @property
    def count(self) -> int:
        """Number of modal coordinates."""
        return len(self.shapes.frequencies)

    def moves(self, node: int) -> bool:
        """Whether a node moves in the link's frame."""
        return bool(self.shapes.translations[node].any() or self.shapes.rotations[node].any())

    def nearest(self, place: Array) -> int:
        """The node nearest to a place in the link's frame."""
        return int(np.argmin(np.linalg.norm(self.nodes - place, axis=1)))

    def node_at(self, place: Array) -> int:
        """The node at a place in the link's frame; raises `InputError` where there is none."""
        node = self.nearest(place)
        size = float(np.linalg.norm(np.ptp(self.nodes, axis=0)))
        if np.linalg.norm(self.nodes[node] - place) > NEAR * size:
            there, near = (np.round(value, 9).tolist() for value in (place, self.nodes[node]))
            raise InputError(
                f"link '{self.name}': a joint sits at {there}, which is no node of it; the nearest is {near}."
            )
        return node

    def motion(self, node: int, x: Array, v: Array) -> NodeMotion:
        """Motion of a node in the link's frame at modal coordinates `x` with rates `v`."""
        phi, psi = self.shapes.translations[node], self.shapes.rotations[node]
        angle, rate = psi @ x, psi @ v
        size = 1 + 0.25 * float(angle @ angle)
        turn = (psi + 0.5 * skew(angle) @ psi) / size
        turns = turn @ v
        place, slide, slide_bias = self.nodes[node] + phi @ x, phi, np.zeros(3)
        if self.shortened is not None and self.surplus is not None:
            axis, shape = self.surplus.axis, self.shortened[node]
            place = place - 0.5 * float(x @ shape @ x) * axis
            slide = phi - np.outer(axis, shape @ x)
            slide_bias = -float(v @ shape @ v) * axis
        return NodeMotion(
            place=place,
            rotation=from_quaternion(np.concatenate([[1.0], 0.5 * angle]) / np.sqrt(size)),
            slide=slide,
            turn=turn,
            slides=slide @ v,
            turns=turns,
            slide_bias=slide_bias,
            # rate x rate vanishes, so that only the denominator changes
            turn_bias=-0.5 * float(angle @ rate) / size * turns,
        )


def flexible_link(link: Link, strength: float = 1.0) -> FlexibleLink:
    """The modes and masses of a flexible link, its rigid hub left out.

    Args:
        link: its description.
        strength: fraction of its shortening that is included, for a beam that stiffens.

    Raises:
        InputError: the link has no such modes.
    """
    if link.modal is not None:
        return _modal(link.name, link.modal, _stamp(link.modal.file))
    if link.sprung is not None:
        return _sprung(link.name, link.sprung)
    assert link.beam is not None
    return _beam(link.name, link.beam, strength)


def rigid_mass(link: Link) -> tuple[float, Array, Array]:
    """Mass, first moment and inertia about the frame of an imported body, undeformed and without its hub."""
    assert link.modal is not None
    body = _read(link.name, link.modal, _stamp(link.modal.file))
    return body.mass, body.first_moment, body.inertia


def _stamp(file: str) -> tuple[int, int]:
    """A stamp that changes with the file, so that a changed file is read again."""
    try:
        state = Path(file).stat()
    except (OSError, ValueError):
        return 0, 0  # the reader reports the error
    return state.st_mtime_ns, state.st_size


@lru_cache(maxsize=HELD)
def _read(name: str, body: ModalBody, stamp: tuple[int, int]) -> Imported:
    return imported(name, body)


def _modal(name: str, body: ModalBody, stamp: tuple[int, int]) -> FlexibleLink:
    found = _read(name, body, stamp)
    return FlexibleLink(
        name,
        found.nodes,
        found.shapes,
        damping_of(body, found.shapes.frequencies),
        found.points,
        root=body.roots[0],
        tip=found.tip,
        surplus=found.surplus,
    )


@lru_cache(maxsize=HELD)
def _beam(name: str, beam: Beam, strength: float) -> FlexibleLink:
    shapes = beam_shapes(beam)
    nodes = beam_nodes(beam)
    places, masses, modes = [], [], []
    for k, node in enumerate(nodes):
        arms, each = outriggers(node)
        for arm, mass in zip([np.zeros(3), *arms], [node.mass - 6 * each, *[each] * 6]):
            places.append(node.position + arm)
            masses.append(mass)
            modes.append(shapes.translations[k] - skew(arm) @ shapes.rotations[k])
    positions = np.array([node.position for node in nodes])
    shortened = surplus = None
    if beam.stiffening:
        axis, weights = beam.axes[:, 0], np.array([node.mass for node in nodes])
        shortened = strength * shortening(beam, shapes)
        still = Surplus.none(len(shapes.frequencies))
        surplus = still.shortening(axis, weights, positions @ axis, shortened)
    return FlexibleLink(
        name,
        positions,
        shapes,
        damping_of(beam, shapes.frequencies),
        Points(np.array(places), sparse.csr_array(np.diag(masses)), np.array(modes)),
        root=0,
        tip=beam.elements,
        surplus=surplus,
        shortened=shortened,
    )


def _sprung(name: str, sprung: SprungMass) -> FlexibleLink:
    """The frame's origin, where the joint is, and the mass, whose displacements are its coordinates."""
    frequency = 2 * np.pi * sprung.frequency
    shape = np.eye(3) / np.sqrt(sprung.mass)
    shapes = Shapes(
        np.full(3, frequency),
        np.array([np.zeros((3, 3)), shape]),
        np.zeros((2, 3, 3)),
        np.zeros((0, 3)),
    )
    points = Points(np.zeros((1, 3)), sparse.csr_array([[sprung.mass]]), shape[None])
    damping = 2 * sprung.damping_ratio * frequency * np.eye(3)
    return FlexibleLink(name, np.zeros((2, 3)), shapes, damping, points, root=0, tip=1, rigid_frame=True)
