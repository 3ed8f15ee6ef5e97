"""State space of the correction of a robot's motion (`modal/smoother.py`), and what channels see of it.

The state is [dq; dx; dq'; dx'; d; f; a; e; b; c]: joints and modes, latent torques d of the joints, latent
forces f on the modes (where asked for), the angle a by which a free base is turned otherwise (where a channel
tells it), the white noise e of the torque, offset b and error c of the gain of each further channel. All but
the last two are the rows that move. Channels are in reverse order here, the encoders last: triangular
factors whiten an encoder by all channels before it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.modal.response import ModalResponse

__all__ = ["Sight", "StateSpace"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sight:
    """p further channels that see the correction beside the encoders.

    Attributes:
        rows: derivative of each channel by [dq; dx; dq'; dx'], shape (N, p, 2 (n + s)).
        foretold: the channels without the correction, shape (N, p).
        gap: recorded minus foretold, shape (N, p); NaN where nothing was recorded.
        noise: standard deviation per sample, shape (p,).
        level: rms of the recorded channel, shape (p,).
        load: rms of the elastic force of each mode along the motion, shape (s,).
        guessed: whose noise was only estimated, shape (p,).
        kinds: what measures each; the offsets of one kind walk alike.
        channels: their names.
        pull: derivative by [dq''; dx''], shape (N, p, n + s); None where no channel feels accelerations.
        turn: angular velocity of the base in inertial axes by [dq; dx; dq'; dx'] at every pose, shape
            (P, 3, 2 (n + s)); None where no channel tells the base's angle.
        axes: about which of these each channel tells the angle, -1 where none, shape (p,).
    """

    rows: Array
    foretold: Array
    gap: Array
    noise: Array
    level: Array
    load: Array
    guessed: NDArray[np.bool_]
    kinds: tuple[str, ...]
    channels: tuple[str, ...] = ()
    pull: Array | None = None
    turn: Array | None = None
    axes: NDArray[np.int_] | None = None

    def of(self, chosen: NDArray[np.int_]) -> Sight:
        """Some of the channels."""
        return replace(
            self,
            rows=self.rows[:, chosen],
            foretold=self.foretold[:, chosen],
            gap=self.gap[:, chosen],
            noise=self.noise[chosen],
            level=self.level[chosen],
            guessed=self.guessed[chosen],
            kinds=tuple(self.kinds[k] for k in chosen),
            channels=tuple(self.channels[k] for k in chosen) if self.channels else (),
            pull=None if self.pull is None else self.pull[:, chosen],
            axes=None if self.axes is None else self.axes[chosen],
        )


@dataclass(frozen=True)
class StateSpace:
    """The linear system at K of the samples; L numbers in the state, of which d move, m = n + p channels.

    Attributes:
        response: dynamics of the correction, at P poses.
        sight: further channels.
        rows: the samples, one in so many from the first on, shape (K,).
        pose: at each, shape (K,).
        one: moving rows to those one sample later, shape (P, d, d).
        before, after: the same of the torque r at the sample and at the next, shape (P, d, n) each.
        moves: moving rows to those at the next of `rows`, shape (P, d, d).
        forces, angle, torques: places of f, a and e among the moving rows.
        offsets, gains: places of b and c in the state.
    """

    response: ModalResponse
    sight: Sight | None
    rows: NDArray[np.int_]
    pose: NDArray[np.int_]
    one: Array
    before: Array
    after: Array
    moves: Array
    forces: slice
    angle: slice
    torques: slice
    offsets: slice
    gains: slice

    @classmethod
    def of(
        cls, response: ModalResponse, rows: NDArray[np.int_], sight: Sight | None, *, forces: bool
    ) -> StateSpace:
        """The system at `rows`; with forces on the modes where `forces`."""
        n, g = response.joints, response.inertia.shape[1]
        p = 0 if sight is None else sight.gap.shape[1]
        move, before, after = response.transitions(forces=forces)
        turn = None if sight is None else sight.turn
        told = move.shape[1]
        angle = slice(told, told if turn is None else told + 3)
        torques = slice(angle.stop, angle.stop + n)
        whole = np.zeros((len(move), torques.stop, torques.stop))
        whole[:, :told, :told], whole[:, :told, torques] = move, -before
        none = np.zeros((len(move), torques.stop - told, n))
        before, after = (np.concatenate([part, none], axis=1) for part in (before, after))
        if turn is not None:  # the angle by the trapezoidal rule
            half = 0.5 * response.step * turn
            whole[:, angle, angle] = np.eye(3)
            whole[:, angle] += half @ whole[:, : 2 * g]
            whole[:, angle, : 2 * g] += half
            before[:, angle], after[:, angle] = half @ before[:, : 2 * g], half @ after[:, : 2 * g]
        every = int(rows[1] - rows[0]) if len(rows) > 1 else 1
        return cls(
            response,
            sight,
            rows,
            response.pose[rows],
            whole,
            before,
            after,
            np.linalg.matrix_power(whole, every),
            slice(2 * g + n, told),
            angle,
            torques,
            slice(torques.stop, torques.stop + p),
            slice(torques.stop + p, torques.stop + 2 * p),
        )

    @property
    def every(self) -> int:
        """How many samples lie from one of `rows` to the next."""
        return int(self.rows[1] - self.rows[0]) if len(self.rows) > 1 else 1

    def pushed(self, residual: Array) -> Array:
        """What r, shape (N, n, D), adds to the moving rows up to the next of `rows`, shape (K, d, D)."""
        last, found = len(residual) - 1, np.zeros((len(self.rows), self.one.shape[1], residual.shape[2]))
        bounds = np.flatnonzero(np.r_[True, np.diff(self.pose) != 0, True])
        for first, end in pairwise(bounds):
            rows, pose = self.rows[first:end], self.pose[first]
            for k in range(self.every):
                now, then = (residual[np.minimum(rows + j, last)] for j in (k, k + 1))
                if k:
                    found[first:end] = self.one[pose] @ found[first:end]
                found[first:end] += self.before[pose] @ now + self.after[pose] @ then
        return found

    def spread(self, added: Array) -> Array:
        """Covariance that accumulates up to the next of `rows` of what each sample adds, shape (P, d, d)."""
        whole = added
        for _ in range(self.every - 1):
            whole = self.one @ whole @ self.one.transpose(0, 2, 1) + added
        return whole

    def looks(self, some: slice) -> Array:
        """What the channels see at some of `rows`, shape (len, m, L)."""
        rows, n, g = self.rows[some], self.response.joints, self.response.inertia.shape[1]
        sight = self.sight
        looks = np.zeros((len(rows), n + self.gains.stop - self.gains.start, self.gains.stop))
        looks[:, :n, :n] = np.eye(n)
        if sight is not None:
            p = sight.gap.shape[1]
            further = looks[:, n:]
            further[:, :, : 2 * g] = sight.rows[rows]
            further[:, :, self.offsets] = np.eye(p)
            further[:, :, self.gains] = np.eye(p) * sight.foretold[rows][:, :, None]
            if self.angle.stop > self.angle.start and sight.axes is not None:
                telling = np.flatnonzero(sight.axes >= 0)
                further[:, telling, self.angle.start + sight.axes[telling]] = 1.0
            if sight.pull is not None:
                by = self._by(sight.pull, rows)
                response, latent = self.response, self.forces.stop - 2 * g
                further[:, :, n:g] -= by[:, :, n:] @ response.stiffness
                further[:, :, g + n : 2 * g] -= by[:, :, n:] @ response.damping
                further[:, :, 2 * g : 2 * g + latent] -= by[:, :, :latent]
                further[:, :, self.torques] -= by[:, :, :n]
            further[np.isnan(sight.gap[rows])] = 0.0  # what was not recorded sees nothing
        return looks[:, ::-1]

    def seen(self, residual: Array, gap: Array) -> Array:
        """What channels tell at `rows`, with what they see of r at once taken off, shape (K, m, D).

        Args:
            residual: r, shape (N, n, D).
            gap: of the encoders and the further channels, shape (N, m, D).
        """
        told, n, sight = gap[self.rows].copy(), self.response.joints, self.sight
        if sight is not None and sight.pull is not None:
            by = self._by(sight.pull, self.rows)[:, :, :n]
            by[np.isnan(sight.gap[self.rows])] = 0.0
            told[:, n:] -= by @ residual[self.rows]
        return told[:, ::-1]

    def _by(self, pull: Array, rows: NDArray[np.int_]) -> Array:
        """What channels feel of [r - e - d; -f - K dx - C dx'] by [dq''; dx''] = Z^-1 of it, (len, p, g)."""
        return np.asarray(pull[rows] @ np.linalg.inv(self.response.inertia)[self.response.pose[rows]])
