"""How modes that the description lacks answer a recorded joint motion, and what they do to the torques.

Along a known joint motion the modal coordinates x of a link that bends obey their own rows of the equations
of motion. To first order in x, about the undeformed link, with the base's accelerations eliminated,

    M x'' + (G + C) x' + (H + K) x = -f,        change of the other rows = A x + B x' + D x'',

f the modal rows of inverse dynamics of the undeformed link, K and C of the beam, everything else functions of
the joints' motion. The shapes of a uniform beam's modes do not depend on its stiffness, so that only K, as
one over the period squared, and C, as damping ratio over period, change with the parameters: all matrices
are evaluated once. f is linear between samples and the matrices are constant over small changes of pose, so
that transitions are exact exponentials; derivatives by the parameters obey the same equations.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.modal.courses import march, transitions
from reference_model.dynamics.symbolic import SymbolicRobot
from reference_model.evaluation.model import BaseMotion, RobotModel
from robot_model import Robot

__all__ = ["BendingLink", "Constants", "HiddenModes", "oscillators"]

Array = NDArray[np.float64]
Single = NDArray[np.float32]
#: Stiffness, loss and inertia, shape (s, s) each.
Constants = tuple[Array, Array, Array]

#: Matrices are taken anew when the joints have moved by this much together [rad or m], at most so many times.
POSE_STEP = 0.02
MOST_POSES = 600
#: Of which this many are taken for one where a rough response will do.
THIN = 4
#: A coordinate that is pushed this much less than the strongest one, and shows as little, takes no part.
UNCOUPLED = 1e-7
#: The phase [rad] that a mode may be off while it lasts, or the relative change of its damping, for its
#: response to be taken to first order: it then errs by half the square. One of unknown damping lasts long.
NEAR = 0.03
LIGHT = 0.05
#: Modes no faster than this many times the slowest belong to the same bending, in another plane.
SAME = 1.5


@dataclass(frozen=True)
class _Course:
    """The equations at some samples.

    Attributes:
        own, outer: [H, G, M] and [A, B, D].
        force: f.
        samples: which ones.
        step: time between them [s].
        thin: one pose in so many stands for its neighbours.
    """

    own: list[Array]
    outer: list[Array]
    force: Array
    samples: NDArray[np.int_]
    step: float
    thin: int = 1


class HiddenModes(ABC):
    """The linear equations of coordinates that the description lacks, along one motion.

    Attributes:
        names: of the parameters on which they depend.
        sizes: those of them that scale the whole response.
        lowest: period of the slowest mode at the parameters `probe`, in the middle of the motion [s].
        size: number s of coordinates that take part.
        slowest: shapes of the slowest modes, one for each plane that takes part, shape (s, p).
    """

    names: ClassVar[tuple[str, ...]]
    sizes: ClassVar[tuple[str, ...]] = ()

    def __init__(self, model: RobotModel, along: MotionDynamics, probe: tuple[float, ...]) -> None:
        """Evaluate the matrices.

        Args:
            model: the robot with the coordinates.
            along: the described robot's dynamics along the motion.
            probe: parameters at which modes are told apart.
        """
        self._along, self._model = along, model
        self._poses(along.state[0])
        everything = np.ones(self._count, dtype=bool)
        own, outer, force = self._evaluate(self._middle, everything)
        shown = np.abs(outer[2]).max(axis=(0, 1))
        pushed = np.abs(force).max(axis=0)
        kept = (shown > UNCOUPLED * shown.max()) | (pushed > UNCOUPLED * max(float(pushed.max()), 1e-300))
        self._kept, self.size = kept, int(kept.sum())
        self._at_poses = [part[:, kept][:, :, kept] for part in own]
        self._shown_at_poses = outer[2][:, :, kept]
        elastic, _, heavier, _ = self._constants(probe)
        inertia = self._at_poses[2][len(self._middle) // 2] + heavier
        squares, shapes = eigh(elastic, inertia)
        self.lowest = 2 * np.pi / float(np.sqrt(squares[0]))
        self.slowest = shapes[:, squares < SAME**2 * squares[0]]

    @property
    @abstractmethod
    def _count(self) -> int:
        """Number of all coordinates."""

    @abstractmethod
    def _all_constants(self, values: tuple[float, ...]) -> tuple[Constants, tuple[Constants, ...]]:
        """K, C and what is added to M, at these parameters, and their derivatives by each parameter."""

    @abstractmethod
    def _evaluate(
        self, rows: NDArray[np.int_] | slice, kept: NDArray[np.bool_]
    ) -> tuple[list[Array], list[Array], Array]:
        """[H, G, M], [A, B, D] of the other rows, and f, at these samples."""

    def near(self, known: tuple[float, ...], values: tuple[float, ...]) -> bool:
        """Whether a response at `values` is that at `known` to first order in their difference."""
        changed = sum(abs(b - a) / max(abs(a), 1e-300) for a, b in zip(known, values))
        return changed / (2.0 * LIGHT) < NEAR

    def _constants(self, values: tuple[float, ...]) -> tuple[Array, Array, Array, tuple[Constants, ...]]:
        kept = np.ix_(self._kept, self._kept)
        own, derived = self._all_constants(values)
        elastic, loss, heavier = (part[kept] for part in own)
        return elastic, loss, heavier, tuple((a[kept], b[kept], c[kept]) for a, b, c in derived)

    def _poses(self, position: Array) -> None:
        travel = np.abs(np.diff(position, axis=0, append=position[-1:])).sum(axis=1).cumsum()
        count = int(np.clip(np.ceil(travel[-1] / POSE_STEP), 1, MOST_POSES))
        part = np.minimum((travel * count / max(float(travel[-1]), 1e-300)).astype(int), count - 1)
        _, self._pose = np.unique(part, return_inverse=True)
        numbers = np.arange(self._pose[-1] + 1)
        ends = [np.searchsorted(self._pose, numbers, side=side) for side in ("left", "right")]
        self._middle = np.minimum((ends[0] + ends[1]) // 2, len(position) - 1)

    @cached_property
    def _everywhere(self) -> _Course:
        own, outer, force = self._evaluate(slice(None), self._kept)
        return _Course(own, outer, force, np.arange(len(self._pose)), self._along.step)

    @cached_property
    def _coarse(self) -> _Course:
        """At the kept samples only, the motion through the filter of all torques beforehand."""
        low_pass, whole = self._along.motion.low_pass, self._everywhere
        kept = low_pass.kept(len(self._pose))
        rows = np.arange(len(self._pose))[kept.start % kept.step : kept.stop : kept.step]
        own, outer = ([part[rows] for part in parts] for parts in (whole.own, whole.outer))
        return _Course(own, outer, low_pass.smooth(whole.force)[rows], rows, kept.step * whole.step, THIN)

    def pushed_by(self, acceleration: Array) -> Array:
        """Change of the modal rows of inverse dynamics by that of the joints' accelerations, (N, n)."""
        shown = self._along.joint_rows(self._everywhere.outer[2], self._everywhere.samples)
        return np.asarray(np.einsum("tns,tn->ts", shown, acceleration))

    def respond(self, *values: float, force: Array | None = None) -> Array:
        """Change of what is predicted.

        Args:
            values: of the parameters `names`.
            force: f, shape (N, s); that of the motion when left out.

        Returns:
            Shape (1 + k, N, m, 1 + 2 p): the response of modes that start undeformed and at rest, and what
            unit deflections and unit rates of the p slowest ones at the first sample add; then the
            derivatives of all by each of the k parameters.
        """
        course = self._everywhere if force is None else replace(self._everywhere, force=force)
        s, planes = self.size, self.slowest.shape[1]
        first = np.zeros((2 * s, 1 + 2 * planes))
        first[:s, 1 : 1 + planes] = first[s:, 1 + planes :] = self.slowest
        rows, parts = self._rows(values, course, first)
        return np.stack(np.split(self._along.response(rows), parts, axis=2))

    def coarsely(self, *values: float) -> tuple[Array, Array]:
        """`respond` at the kept samples, the motion through the filter of all torques beforehand.

        Returns:
            From a start at rest, (1 + k, M, n), and what unit starts add, (M, n, 2 p): to look with.
        """
        course, motion = self._coarse, self._along.motion
        s, planes = self.size, self.slowest.shape[1]
        first = np.zeros((2 * s, 1 + 2 * planes))
        first[:s, 1 : 1 + planes] = first[s:, 1 + planes :] = self.slowest
        rows, parts = self._rows(values, course, first)
        kept = motion.low_pass.kept(motion.time.size)
        torques = self._along.joint_rows(rows, course.samples)[kept.start // kept.step :]
        every = np.stack(np.split(torques, parts, axis=2))
        return every[..., 0], every[0, :, :, 1:]

    def _rows(self, values: tuple[float, ...], course: _Course, first: Array) -> tuple[Array, int]:
        """Change of the rows of base and joints from first states (2 s, c), with derivatives beside it.

        Returns:
            Shape (N, rows, (1 + k) c), and 1 + k.
        """
        s, pose = self.size, self._pose[course.samples] // course.thin
        elastic, loss, heavier, derived = self._constants(values)
        geometric, gyroscopic, inertia = course.own
        inverse, stiff, lossy = np.linalg.inv(inertia + heavier), elastic + geometric, loss + gyroscopic
        moves = self._moves(values, course)
        forces = np.zeros((len(course.force), s, first.shape[1]))
        forces[:, :, 0] = course.force
        states = march(moves, pose, forces, first)
        x, rate = states[:, :s], states[:, s:]
        accelerated = -inverse @ (forces + stiff @ x + lossy @ rate)
        pushed = np.concatenate([by[0] @ x + by[1] @ rate + by[2] @ accelerated for by in derived], axis=2)
        moved = march(moves, pose, pushed, np.zeros((2 * s, pushed.shape[2])))
        changed = -inverse @ (pushed + stiff @ moved[:, :s] + lossy @ moved[:, s:])
        by_x, by_rate, by_acceleration = course.outer
        whole = np.concatenate([states, moved], axis=2)
        accelerated = np.concatenate([accelerated, changed], axis=2)
        rows = by_x @ whole[:, :s] + by_rate @ whole[:, s:] + by_acceleration @ accelerated
        return np.asarray(rows), 1 + len(derived)

    def _moves(self, values: tuple[float, ...], course: _Course) -> tuple[Array, Array, Array]:
        """`transitions` at every pose."""
        s, (elastic, loss, heavier, _) = self.size, self._constants(values)
        geometric, gyroscopic, inertia = (part[:: course.thin] for part in self._at_poses)
        inverse = np.linalg.inv(inertia + heavier)
        a = np.zeros((len(inertia), 2 * s, 2 * s))
        a[:, :s, s:] = np.eye(s)
        a[:, s:, :s] = -inverse @ (elastic + geometric)
        a[:, s:, s:] = -inverse @ (loss + gyroscopic)
        b = np.zeros((len(inertia), 2 * s, s))
        b[:, s:] = -inverse
        return transitions(a, b, course.step)


class BendingLink(HiddenModes):
    """The modes of a link that bends although it is described as rigid."""

    names = ("period", "damping_ratio")

    def __init__(
        self, bent: Robot, link: str, *, period: float, damping: float, along: MotionDynamics
    ) -> None:
        """Evaluate the matrices.

        Args:
            bent: the robot with the link as a beam of this `period` [s] and `damping` ratio.
            link: its name; no other link bends.
            along: the rigid robot's dynamics along the motion.
        """
        model = RobotModel(bent)
        body = next(b.flexible for b in model.tree.bodies if b.name == link)
        assert body is not None
        self._stiffness, self._loss = body.stiffness, body.damping
        self._elastic, self._unit_loss = body.stiffness * period**2, body.damping * period / damping
        super().__init__(model, along, (1.0, damping))

    @property
    def _count(self) -> int:
        return len(self._elastic)

    def _all_constants(self, values: tuple[float, ...]) -> tuple[Constants, tuple[Constants, ...]]:
        period, damping = values
        elastic, loss = self._elastic / period**2, self._unit_loss * (damping / period)
        none = np.zeros_like(elastic)
        by_period = (-2 * elastic / period, -loss / period, none)
        return (elastic, loss, none), (by_period, (none, self._unit_loss / period, none))

    def near(self, known: tuple[float, ...], values: tuple[float, ...]) -> bool:
        (t, z), (period, damping) = known, values
        return abs(period / t - 1.0) / (2.0 * z) + abs(damping / z - 1.0) < NEAR

    def _evaluate(
        self, rows: NDArray[np.int_] | slice, kept: NDArray[np.bool_]
    ) -> tuple[list[Array], list[Array], Array]:
        """[H, G, M] with the base eliminated, [A, B, D] of the other rows, and f, at these samples."""
        along, model = self._along, self._model
        base = None if along.base is None else BaseMotion.from_stacked(along.base.stacked()[rows])
        q, qd, qdd = (part[rows] for part in along.state)
        needed, *derivatives = model.evaluate(_linearised, (q, qd, qdd), (base, None, None))
        s = model.tree.modal
        flat = [part.reshape(len(part), s, model.rows).transpose(0, 2, 1) for part in derivatives]
        inner = slice(model.rows - s, model.rows)
        flat[0][:, inner] -= self._stiffness
        flat[1][:, inner] -= self._loss
        outer, own = [part[:, : -s or None] for part in flat], [part[:, inner] for part in flat]
        force = needed[:, inner]
        if base is not None:
            lever = np.linalg.solve(along.base_inertia[rows], flat[2][:, :6]).transpose(0, 2, 1)
            own = [part - lever @ whole[:, :6] for part, whole in zip(own, flat)]
            force = force - np.einsum("tij,tj->ti", lever, needed[:, :6])
        own = [part[:, kept][:, :, kept] for part in own]
        return own, [part[:, :, kept] for part in outer], force[:, kept]

    def scan(self, periods: Array, damping: float) -> Single:
        """What the slowest modes alone do to the joints' torques, for many periods [s] at once.

        The motion is taken through the filter of all torques beforehand and at the kept samples only: good
        enough to find where to look.

        Returns:
            Shape (M, n, P), single precision.
        """
        low_pass, samples = self._along.motion.low_pass, len(self._pose)
        kept = low_pass.kept(samples)
        rows = np.arange(samples)[kept.start % kept.step : kept.stop : kept.step]
        shapes, at = self.slowest, self._pose[rows]
        force = self._model.inverse_dynamics(*self._along.state, base=self._along.base)
        force = force[:, force.shape[1] - len(self._kept) :][:, self._kept] @ shapes
        force = low_pass.smooth(force)[rows]
        mass = np.einsum("ia,tij,ja->ta", shapes, self._at_poses[2], shapes)[at]
        stiffness = np.einsum("ia,ij,ja->a", shapes, self._elastic[np.ix_(self._kept, self._kept)], shapes)
        found = np.zeros((len(rows), len(self._along.model.joints), periods.size), dtype=np.float32)
        for k in range(shapes.shape[1]):
            shown = self._along.joint_rows(self._shown_at_poses[at] @ shapes[:, k : k + 1], rows)
            slow = np.sqrt(stiffness[k] / mass[:, k])
            drive = -force[:, k] / mass[:, k]
            moved = oscillators(slow, drive, periods, damping, kept.step * self._along.step)
            found += shown.astype(np.float32) * moved[:, None, :]
        return found[kept.start // kept.step :]


def oscillators(slow: Array, drive: Array, periods: Array, damping: float, step: float) -> Single:
    """x'' of x'' + 2 damping w x' + w^2 x = drive with w = slow / period, shape (N, P), single precision.

    Args:
        slow: shape (N,), changing slowly. drive: constant between samples at its mean there, shape (N,).
    """
    root = complex(-damping, np.sqrt(1 - damping**2))
    poles = (root * slow[:, None] / periods).astype(np.complex64)
    turns = np.exp(poles * step)
    mean = np.append(0.5 * (drive[1:] + drive[:-1]), 0.0).astype(np.float32)
    pushes = (turns - 1) / poles * mean[:, None]
    states = np.zeros_like(poles)
    for k in range(len(drive) - 1):
        np.multiply(turns[k], states[k], out=states[k + 1])
        states[k + 1] += pushes[k]
    # with z' = pole z + drive: x = Im z / Im pole, so that x'' = Im(pole^2 z + pole drive) / Im pole
    return np.asarray((poles * (poles * states + drive[:, None].astype(np.float32))).imag / poles.imag)


def _linearised(robot: SymbolicRobot, extra: ca.SX) -> list[ca.SX]:
    """Inverse dynamics and its derivatives by modal coordinates, rates and accelerations, column-major."""
    motion, rows = robot.motion, robot.inverse_dynamics
    by = (motion.modal, motion.modal_rates, motion.inner_acceleration)
    return [rows, *(ca.densify(ca.jacobian(rows, variable)) for variable in by)]
