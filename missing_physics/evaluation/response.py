"""Response of a free base and flexible links to small forces along a motion, and the forces at joints.

No actuator acts on a free base and on modes of links. So forces f on the rows of inverse dynamics move both,
to first order

    M_pp a + C v + K u = -f_p,        force at the joints = f_j + M_jp a,

with the mass matrix along the motion, and stiffness K and damping C of the links. Neglected terms (Coriolis
terms of the deviations) are a few percent of the response at typical speeds of robots, and vanish with the
deviations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reference_model.dynamics.tree import Tree

__all__ = ["UNKNOWN", "Response", "Vibration", "newmark", "vibrating"]

Array = NDArray[np.float64]

#: Vibrations smaller than this fraction of the largest one are ignored [-].
VISIBLE = 1e-4
#: Prior standard deviation of the initial vibration, in units of the noise of a complete recording [-].
UNKNOWN = 1e4
#: Newmark's beta of the trapezoidal rule, and that with a phase error of fourth order [-].
TRAPEZOIDAL, ACCURATE = 1 / 4, 1 / 12


@dataclass(frozen=True)
class Response:
    """The response of base and modes along one motion; N samples, n joints, s modes.

    Attributes:
        joints: rows of the joints among those of inverse dynamics.
        step: time between samples [s].
        base: M_xb M_bb^-1 for the rows x of joints and modes, shape (N, n + s, 6); none for a fixed one.
        mass: of the joints with the base free and modes held, shape (N, n, n).
        coupling: M_js with the base free, shape (N, n, s).
        modal: M_ss with the base free, shape (N, s, s).
        stiffness, damping: of the modes, shape (s, s) each.
    """

    joints: slice
    step: float
    base: Array
    mass: Array
    coupling: Array
    modal: Array
    stiffness: Array
    damping: Array

    @classmethod
    def of(cls, tree: Tree, mass: Array, elasticity: tuple[Array, Array], step: float) -> Response:
        """The response of a robot with these bodies and coordinates.

        Args:
            tree: bodies and coordinates.
            mass: matrix along the motion, shape (N, rows, rows).
            elasticity: stiffness and damping of the modes, shape (s, s) each.
            step: time between samples [s].
        """
        base, joints = tree.offset, len(tree.joints)
        moved = mass[:, base:, :base]
        eliminated = np.linalg.solve(mass[:, :base, :base], moved.transpose(0, 2, 1)).transpose(0, 2, 1)
        rest = mass[:, base:, base:] - eliminated @ moved.transpose(0, 2, 1)
        stiffness, damping = elasticity
        return cls(
            joints=slice(base, base + joints),
            step=step,
            base=np.asarray(eliminated),
            mass=rest[:, :joints, :joints],
            coupling=rest[:, :joints, joints:],
            modal=rest[:, joints:, joints:],
            stiffness=stiffness,
            damping=damping,
        )

    def with_elasticity(self, stiffness: Array, damping: Array) -> Response:
        """The response with other stiffness and damping of the modes, shape (s, s) each."""
        return replace(self, stiffness=stiffness, damping=damping)

    def at_joints(self, rows: Array) -> Array:
        """Forces at the joints due to forces on all rows, starting from rest, (N, rows, C) to (N, n, C)."""
        free = rows[:, self.joints.start :]
        if self.base.shape[2]:
            free = free - self.base @ rows[:, : self.joints.start]
        count = self.joints.stop - self.joints.start
        joints, modes = free[:, :count], free[:, count:]
        if not modes.shape[1]:
            return joints
        elasticity = self.stiffness, self.damping
        return joints + self.coupling @ vibrating(self.modal, *elasticity, -modes, self.step)[2]

    def free_vibration(self, *, every: float = np.inf, below: float = np.inf) -> tuple[Array, Array]:
        """Forces at the joints due to free vibration of modes from the start and from later instants.

        Initial deflections are one, initial rates the mode's frequency, so that both have the same energy.

        Args:
            every: time between these instants [s].
            below: modes with a frequency above this start at the first instant only [rad/s].

        Returns:
            Shape (N, n, V), and the instants with the mode of each column, (V, 2) integers.
        """
        count, modes, frequency = len(self.modal), len(self.stiffness), self.frequencies
        stride = max(1, round(every / self.step)) if np.isfinite(every) else count
        begun = [
            (k, mode, moving)
            for k in range(0, count, stride)
            for mode in range(modes)
            for moving in (False, True)
            if k == 0 or frequency[mode] < below
        ]
        starts: dict[int, list[int]] = {}
        for column, (k, _, _) in enumerate(begun):
            starts.setdefault(k, []).append(column)
        moved, answer = _transition(self.modal, self.stiffness, self.damping, self.step)
        state = np.zeros((2 * modes, len(begun)))
        found = np.empty((*self.coupling.shape[:2], len(begun)))
        for k in range(count):
            for column in starts.get(k, ()):
                _, mode, moving = begun[column]
                state[mode + modes * moving, column] = frequency[mode] if moving else 1.0
            found[k] = -self.coupling[k] @ (answer[k] @ state)
            state = moved[k] @ state
        return found, np.array([(k, mode) for k, mode, _ in begun]).reshape(-1, 2)

    @property
    def inertia(self) -> Array:
        """Inertia of the modes with the base free, in the middle of the motion, shape (s, s)."""
        return np.asarray(self.modal[len(self.modal) // 2])

    @property
    def frequencies(self) -> Array:
        """Natural frequency of each mode with the base free, the others held, shape (s,) [rad/s]."""
        return np.sqrt(np.diag(self.stiffness) / np.diag(self.inertia))


def vibrating(
    inertia: Array,
    stiffness: Array,
    damping: Array,
    force: Array,
    step: float,
    start: tuple[Array, Array] | None = None,
    implicit: Array | float = TRAPEZOIDAL,
) -> tuple[Array, Array, Array]:
    """Deflections, rates and accelerations due to forces by Newmark's method, (N, ..., s, C) each.

    Args:
        inertia: shape (N, ..., s, s), for several systems at once.
        stiffness, damping: shape (..., s, s) or (N, ..., s, s).
        force: shape (N, ..., s, C).
        step: time between instants [s].
        start: deflection and rate at the first instant, shape (..., s, C) each; zero when None.
        implicit: Newmark's beta, a number or matrices (..., s, s) (`newmark`).
    """
    modes = inertia.shape[-1]
    weight = step**2 * (np.asarray(implicit) if np.ndim(implicit) else implicit * np.eye(modes))
    damping, stiffness = (np.broadcast_to(part, inertia.shape) for part in (damping, stiffness))
    solver = np.linalg.inv(inertia + step / 2 * damping + stiffness @ weight)
    answer, pushed = solver @ np.concatenate([stiffness, damping], axis=-1), solver @ force
    place, rate = np.zeros((2, *force.shape[1:])) if start is None else start
    first = np.linalg.solve(inertia[0], force[0] - stiffness[0] @ place - damping[0] @ rate)
    state = np.concatenate([place - weight @ first, rate - step / 2 * first], axis=-2)
    states = _predicted(answer, pushed, state, step)
    found = np.asarray(pushed - answer @ states)
    return states[..., :modes, :] + weight @ found, states[..., modes:, :] + step / 2 * found, found


def _predicted(answer: Array, pushed: Array, start: Array, step: float) -> Array:
    """The predicted part w of Newmark's method, deflections then rates, (N, ..., 2 s, C), with a = b - A w.

    Blocks of about sqrt(N) instants march side by side, first from zero and from unit states, then from the
    states that follow for their beginnings.

    Args:
        answer: A, shape (N, ..., s, 2 s).
        pushed: b, shape (N, ..., s, C).
        start: w at the first instant, shape (..., 2 s, C).
        step: time between instants [s].
    """
    size = int(np.ceil(np.sqrt(len(pushed))))
    count = -(-len(pushed) // size)

    def blocks(values: Array) -> Array:
        padded = np.zeros((count * size, *values.shape[1:]))
        padded[: len(values)] = values
        return padded.reshape(count, size, *values.shape[1:])

    def march(state: Array, pushes: Array, kept: Array | None = None) -> Array:
        modes = state.shape[-2] // 2
        places, rates = state[..., :modes, :], state[..., modes:, :]
        for k in range(size):
            if kept is not None:
                kept[:, k] = state
            moved = -answers[:, k] @ state
            moved[..., : pushes.shape[-1]] += pushes[:, k]
            places += step * (rates + step * moved)
            rates += step * moved
        return state

    answers, pushes, columns = blocks(answer), blocks(pushed), start.shape[-1]
    unit = np.broadcast_to(np.eye(start.shape[-2]), (count, *start.shape[:-1], start.shape[-2]))
    ends = march(np.concatenate([np.zeros((count, *start.shape)), unit], axis=-1), pushes)
    begins = [start]
    for end in ends[:-1]:
        begins.append(end[..., :columns] + end[..., columns:] @ begins[-1])
    kept = np.empty((count, size, *start.shape))
    march(np.stack(begins), pushes, kept)
    return kept.reshape(count * size, *start.shape)[: len(pushed)]


def newmark(inertia: Array, stiffness: Array, step: float) -> Array:
    """Newmark's beta for each mode of a system, as a matrix, shape (..., s, s).

    1/12 has an error of the phase of fourth order, but is unstable above sqrt(6) radians per step; modes
    above half of that get 1/4, which is always stable.

    Args:
        inertia, stiffness: symmetric, shape (..., s, s) each; the stiffness may be singular.
        step: time between instants [s].
    """
    root = np.linalg.cholesky(inertia)
    across = np.linalg.solve(root, np.linalg.solve(root, stiffness).swapaxes(-1, -2))
    squared, modes = np.linalg.eigh(across)
    slow = squared * step**2 < 6.0 / 4.0
    beta = np.where(slow, ACCURATE, TRAPEZOIDAL)
    shapes = np.linalg.solve(root.swapaxes(-1, -2), modes)  # of mass one
    return np.asarray(shapes * beta[..., None, :] @ (shapes.swapaxes(-1, -2) @ inertia))


def _transition(inertia: Array, stiffness: Array, damping: Array, step: float) -> tuple[Array, Array]:
    """The trapezoidal rule with steps h, of modes with mass matrix M, stiffness K and damping C.

    With the predicted deflections and rates w at an instant, a = -S [K, C] w with
    S = (M + h/2 C + h^2/4 K)^-1, and w at the next one is T w.

    Returns:
        T and S [K, C].
    """
    damping, stiffness = (np.broadcast_to(part, inertia.shape) for part in (damping, stiffness))
    solver = np.linalg.inv(inertia + step / 2 * damping + TRAPEZOIDAL * step**2 * stiffness)
    answer, unit = solver @ np.concatenate([stiffness, damping], axis=-1), np.eye(inertia.shape[-1])
    onwards = np.block([[unit, step * unit], [np.zeros_like(unit), unit]])
    kick = np.vstack([step**2 * unit, step * unit])
    return np.asarray(onwards - kick @ answer), np.asarray(answer)


@dataclass(frozen=True)
class Vibration:
    """Vibration of links in one recording, not observed by encoders, as correlated noise; n channels.

    Links may vibrate from the start, and encoder noise, differentiated twice, excites them further. With
    white noise of covariance 1/W and columns N of vibrations with prior variances, the covariance of the
    series is 1/W + N N^T, and everything compared is whitened by its inverse root.

    Attributes:
        root: square root of the weights, shape (K, n); zero where nothing is compared.
        basis: orthonormal directions of the weighted columns, shape (K n, R).
        taken: fraction of each direction that is removed, shape (R,).
    """

    root: Array
    basis: Array
    taken: Array

    @classmethod
    def of(cls, columns: Array, weight: Array, spread: Array | None = None) -> Vibration:
        """The vibration from columns and weights.

        Args:
            columns: shape (K, n, V).
            weight: inverse variance of the white noise, (K, n); zero where nothing is compared.
            spread: standard deviation of each column's amplitude, (V,); infinite when None.
        """
        root = np.sqrt(weight)
        flat = (columns * root[:, :, None]).reshape(root.size, -1)
        size = np.sqrt((flat**2).sum(axis=0))
        visible = size > VISIBLE * size.max(initial=0.0)
        if not visible.any():
            return cls(root, np.zeros((root.size, 0)), np.zeros(0))
        wide = np.full(visible.sum(), np.inf) if spread is None else spread[visible]
        scale = np.minimum(wide, UNKNOWN / size[visible])
        left, values, _ = np.linalg.svd(flat[:, visible] * scale, full_matrices=False)
        return cls(root, left, 1.0 - 1.0 / np.sqrt(1.0 + values**2))

    @property
    def left(self) -> Array:
        """Fraction of the variance of white noise that whitening leaves in each row, shape (K, n)."""
        lost = self.basis**2 @ (1.0 - (1.0 - self.taken) ** 2)
        return np.asarray(1.0 - lost.reshape(self.root.shape))

    def removed(self, values: Array) -> Array:
        """Whitened series of the channels, (K, n, ...)."""
        if not self.taken.size:
            return values
        weights = self.root.reshape(*self.root.shape, *[1] * (values.ndim - 2))
        flat = (values * weights).reshape(self.root.size, -1)
        gone = self.basis @ (self.taken[:, None] * (self.basis.T @ flat))
        inverse = np.divide(1.0, weights, out=np.zeros_like(weights), where=weights > 0.0)
        return np.asarray(values - gone.reshape(values.shape) * inverse)
