"""The constants of one flexible link that the recursion needs."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from reference_model.flexible.beam import beam_mesh, beam_modes
from reference_model.flexible.imported import imported_mesh, imported_modes, node_rotations
from reference_model.flexible.integrals import cleaned, scalar_mass, shape_integrals
from reference_model.flexible.mesh import ALL_SIX, Mesh, cross_matrices
from reference_model.flexible.modes import Keep, Modes, with_fixed_signs
from reference_model.flexible.surface import foreshortening, gauge_strain
from robot_model import Beam, InputError, Link, ModalBody

__all__ = ["FlexibleBody", "flexible_body"]

Matrix = NDArray[np.float64]

#: Bodies whose modes are held in memory at once: more than any one robot has.
CACHED_BODIES = 64

#: Tolerated distance of a joint from a node, relative to the body's size.
NODE_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class FlexibleBody:
    """Constants of one flexible link in its own axes, about its frame's origin; names as in docs/theory.md 2.

    N nodes, s modal coordinates, mass-normalised, in sqrt(kg) m. Mass, first moment and inertia are of the
    undeformed body with its rigid hub and its tip body. With clamped modes the root does not move in the
    link's frame; with free modes the frame is the mean-axis frame, in which it does. E, F, D and h
    are also sums over the points that make up the rotary inertia of a node and rotate with it (`integrals`).

    Attributes:
        mass: m [kg].
        first_moment: sum m rho0, shape (3,) [kg m].
        inertia: J0, shape (3, 3) [kg m^2].
        S0: sum m Phi, shape (3, s) [sqrt(kg)].
        S1: sum m rho0~ Phi + J Psi, shape (3, s) [sqrt(kg) m].
        E: sum m rho0~ phi_j~, shape (s, 3, 3) [sqrt(kg) m].
        F: sum m phi_j~ phi_l~, shape (s, s, 3, 3) [-].
        D: sum m phi_j~ Phi, shape (s, 3, s) [-].
        P: S1 without the contribution of such points, shape (3, s) [sqrt(kg) m]; zero for lumped masses.
        h: h[l, j] = sum m phi_l x phi_j, shape (s, s, 3) [-].
        modal_mass: unit matrix, shape (s, s).
        stiffness: squares of the frequencies, shape (s, s) [1/s^2].
        damping: shape (s, s) [1/s].
        frequencies: natural frequencies, increasing, shape (s,) [rad/s].
        nodes: undeformed positions rho0, shape (N, 3) [m].
        translations: Phi of every node, shape (N, 3, s) [1/sqrt(kg)].
        rotations: Psi of every node, shape (N, 3, s) [1/(m sqrt(kg))].
        node_masses: lumped masses of the nodes without hub, shape (N,) [kg].
        node_inertias: rotary inertias of the nodes without hub, shape (N, 3, 3) [kg m^2].
        root: index of the node at the inboard joint.
        tip: index of the node of the tip channels.
        strain: strain of each gauge, shape (gauges, s) [1/(m sqrt(kg))].
        axis: unit vector along the beam, shape (3,); None unless the beam stiffens.
        foreshortening: node k moves by -1/2 x^T foreshortening[k] x along `axis`, shape (N, s, s)
            [1/(m kg)]; None unless the beam stiffens.
    """

    mass: float
    first_moment: Matrix
    inertia: Matrix
    S0: Matrix
    S1: Matrix
    E: Matrix
    F: Matrix
    D: Matrix
    P: Matrix
    h: Matrix
    modal_mass: Matrix
    stiffness: Matrix
    damping: Matrix
    frequencies: Matrix
    nodes: Matrix
    translations: Matrix
    rotations: Matrix
    node_masses: Matrix
    node_inertias: Matrix
    root: int
    tip: int
    strain: Matrix
    axis: Matrix | None = None
    foreshortening: Matrix | None = None

    def __post_init__(self) -> None:
        for field in fields(self):  # it is shared through a cache
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @property
    def count(self) -> int:
        """Number of modal coordinates, s."""
        return len(self.frequencies)

    def without_hub(self, link: Link) -> FlexibleBody:
        """The same body without the rigid hub of its `link`."""
        center = np.asarray(link.center_of_mass)
        arm = cross_matrices(center)
        return replace(
            self,
            mass=self.mass - link.mass,
            first_moment=self.first_moment - link.mass * center,
            inertia=self.inertia - link.inertia_matrix + link.mass * arm @ arm,
        )

    def node_at(self, place: tuple[float, float, float]) -> int:
        """Index of the node at `place` in the link's frame [m].

        Raises:
            InputError: no node lies there.
        """
        gaps = np.linalg.norm(self.nodes - np.asarray(place), axis=1)
        node = int(gaps.argmin())
        if gaps[node] > NODE_TOLERANCE * _size(self.nodes):
            near = [round(float(x), 9) for x in self.nodes[node]]
            raise InputError(
                f"{list(place)} is no node of the flexible body; the nearest is node {node} at {near}."
            )
        return node


def flexible_body(link: Link) -> FlexibleBody:
    """The constants of a flexible link; computed once for each description.

    Raises:
        InputError: the file of a modal body cannot be used, or the body has no such modes.
        ValueError: the link is rigid.
    """
    if link.beam is not None:
        return _beam_body(link)
    if link.modal is not None:
        return _modal_body(link, _stamp(link.modal.file))
    if link.sprung is not None:
        return _sprung_body(link)
    raise ValueError(f"link '{link.name}' is rigid")


def _stamp(file: str) -> tuple[int, int]:
    """A stamp that changes with the file, so that a cached body is not reused for a changed file."""
    try:
        state = Path(file).stat()
    except (OSError, ValueError):
        return 0, 0  # the reader will report the error
    return state.st_mtime_ns, state.st_size


@lru_cache(maxsize=CACHED_BODIES)
def _beam_body(link: Link) -> FlexibleBody:
    beam = link.beam
    assert beam is not None
    mesh = beam_mesh(beam)
    modes = _settled(link, beam, mesh, beam_modes(beam, _keep(beam)))
    return _assembled(
        link,
        mesh,
        modes,
        rotations=modes.shapes.reshape(len(mesh.nodes), ALL_SIX, -1)[:, 3:],
        damping=_damping(link, beam, modes.squares),
        root=0,
        tip=beam.elements,
        strain=cleaned(gauge_strain(beam, modes.shapes)),
        axis=beam.axes[:, 0] if beam.stiffening else None,
        foreshortening=cleaned(foreshortening(beam, modes.shapes)) if beam.stiffening else None,
    )


@lru_cache(maxsize=CACHED_BODIES)
def _modal_body(link: Link, stamp: tuple[int, int]) -> FlexibleBody:
    body = link.modal
    assert body is not None
    where = f"link '{link.name}', modal.file {body.file}"
    mesh = imported_mesh(body, where)
    modes = _settled(link, body, mesh, imported_modes(body, mesh, _keep(body), where))
    return _assembled(
        link,
        mesh,
        modes,
        rotations=node_rotations(body, mesh, modes.shapes),
        damping=_damping(link, body, modes.squares),
        root=body.roots[0],
        tip=len(mesh.nodes) - 1 if body.tip is None else body.tip,
        strain=np.zeros((0, len(modes.squares))),
    )


@lru_cache(maxsize=CACHED_BODIES)
def _sprung_body(link: Link) -> FlexibleBody:
    """Two nodes at the frame's origin: one at the joint, and the mass, with a mode for each axis.

    With a single point its position rho0 + Phi x is exact for any displacement.
    """
    sprung = link.sprung
    assert sprung is not None
    masses = np.repeat([0.0, sprung.mass], 3)
    frequency = 2 * np.pi * sprung.frequency
    stiffness = np.diag(masses * frequency**2)
    mesh = Mesh(np.zeros((2, 3)), sparse.csr_array(np.diag(masses)), sparse.csr_array(stiffness), freedoms=3)
    shapes = np.vstack([np.zeros((3, 3)), np.eye(3) / np.sqrt(sprung.mass)])
    modes = Modes(np.full(3, frequency**2), shapes)
    return _assembled(
        link,
        mesh,
        modes,
        rotations=np.zeros((2, 3, 3)),
        damping=2 * sprung.damping_ratio * frequency * np.eye(3),
        root=0,
        tip=1,
        strain=np.zeros((0, 3)),
    )


def _keep(spec: Beam | ModalBody) -> Keep:
    if spec.highest_frequency is None:
        return Keep(count=spec.modes)
    return Keep(highest=(2 * np.pi * spec.highest_frequency) ** 2)


def _settled(link: Link, spec: Beam | ModalBody, mesh: Mesh, modes: Modes) -> Modes:
    """The modes, checked for number and with fixed signs; rounding errors become exact zeros."""
    found = len(modes.squares)
    if spec.modes is not None and found < spec.modes:
        raise InputError(f"link '{link.name}': modes = {spec.modes}, but the body has only {found} of them.")
    if found == 0:
        raise InputError(
            f"link '{link.name}': it has no mode up to highest_frequency = {spec.highest_frequency:g} Hz; "
            "raise it, or make the link rigid."
        )
    shapes = with_fixed_signs(modes.shapes, mesh.freedoms, _size(mesh.nodes))
    return Modes(modes.squares, np.column_stack([cleaned(shape) for shape in shapes.T]))


def _size(nodes: Matrix) -> float:
    """Length of the diagonal of the box around the nodes [m]."""
    return float(np.linalg.norm(np.ptp(nodes, axis=0)))


def _damping(link: Link, spec: Beam | ModalBody, squares: Matrix) -> Matrix:
    """C = diag(2 zeta w), or a M + b K of Rayleigh, shape (s, s) [1/s]."""
    if spec.rayleigh is not None:
        return np.diag(spec.rayleigh[0] + spec.rayleigh[1] * squares)
    ratio = np.asarray(spec.damping_ratio)
    if ratio.size not in (1, len(squares)):
        raise InputError(
            f"link '{link.name}': damping_ratio has {ratio.size} entries, but {len(squares)} modes are kept; "
            "a single number is for all."
        )
    return np.diag(2 * ratio * np.sqrt(squares))


def _assembled(
    link: Link,
    mesh: Mesh,
    modes: Modes,
    *,
    rotations: Matrix,
    damping: Matrix,
    root: int,
    tip: int,
    strain: Matrix,
    axis: Matrix | None = None,
    foreshortening: Matrix | None = None,
) -> FlexibleBody:
    whole = shape_integrals(mesh, modes.shapes)
    center = np.asarray(link.center_of_mass)
    arm = cross_matrices(center)
    return FlexibleBody(
        mass=whole.mass + link.mass,
        first_moment=whole.first_moment + link.mass * center,
        inertia=whole.inertia + link.inertia_matrix - link.mass * arm @ arm,
        **{name: getattr(whole, name) for name in ("S0", "S1", "E", "F", "D", "P", "h")},
        modal_mass=np.eye(len(modes.squares)),
        stiffness=np.diag(modes.squares),
        damping=damping,
        frequencies=np.sqrt(modes.squares),
        nodes=np.array(mesh.nodes),
        translations=modes.shapes.reshape(len(mesh.nodes), mesh.freedoms, -1)[:, :3].copy(),
        rotations=np.array(rotations),
        node_masses=np.asarray(scalar_mass(mesh).sum(axis=1)),
        node_inertias=_node_inertias(mesh),
        root=root,
        tip=tip,
        strain=strain,
        axis=axis,
        foreshortening=foreshortening,
    )


def _node_inertias(mesh: Mesh) -> Matrix:
    """Rotary inertia of each node, zero for nodes without rotations, shape (N, 3, 3) [kg m^2]."""
    inertias = np.zeros((len(mesh.nodes), 3, 3))
    if mesh.freedoms == ALL_SIX:
        for row in range(3):
            for column in range(3):
                block = mesh.mass[3 + row :: ALL_SIX, 3 + column :: ALL_SIX]
                inertias[:, row, column] = block.diagonal()
    return inertias
