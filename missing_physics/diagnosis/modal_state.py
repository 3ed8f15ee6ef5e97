"""State space of the correction of a robot's motion (`modal_smoother`), and what channels see of it.

The state is [dq; dx; dq'; dx'; d; f; a; b; c; e]: joints and modes, latent torques d of the joints, latent
forces f on the modes (where asked for), the angle a by which a free base is turned otherwise (where a channel
tells it), offset b and error c of the gain of each further channel, and the white noise e of the torque.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.modal_response import ModalResponse

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
            pull=None if self.pull is None else self.pull[:, chosen],
            axes=None if self.axes is None else self.axes[chosen],
        )


@dataclass(frozen=True)
class StateSpace:
    """The linear system; L numbers in the state, m = n + p channels, P poses.

    Attributes:
        moves: state to the state one sample later, shape (P, L, L).
        before, after: the same of the torque r at the sample and at the next, shape (P, L, n) each.
        looks: what the channels see, encoders first, shape (N, m, L).
        through: what they see of r at once, shape (N, m, n); None where nothing.
        forces, offsets, gains: places of f, b and c in the state.
    """

    moves: Array
    before: Array
    after: Array
    looks: Array
    through: Array | None
    forces: slice
    offsets: slice
    gains: slice

    @classmethod
    def of(cls, response: ModalResponse, samples: int, sight: Sight | None, *, forces: bool) -> StateSpace:
        """The system along `samples`; with forces on the modes where `forces`."""
        n, s = response.joints, response.modes
        g, p = n + s, 0 if sight is None else sight.gap.shape[1]
        move, before, after = response.transitions(forces=forces)
        turn = None if sight is None else sight.turn
        told = move.shape[1]
        first = told if turn is None else told + 3
        poses, size = len(move), first + 2 * p + n
        whole = np.zeros((poses, size, size))
        whole[:, :told, :told], whole[:, :told, -n:] = move, -before
        stay = np.arange(told, first + 2 * p)
        whole[:, stay, stay] = 1.0
        none = np.zeros((poses, size - told, n))
        before, after = (np.concatenate([part, none], axis=1) for part in (before, after))
        if turn is not None:  # the angle by the trapezoidal rule
            half = 0.5 * response.step * turn
            whole[:, told:first] += half @ whole[:, : 2 * g]
            whole[:, told:first, : 2 * g] += half
            before[:, told:first], after[:, told:first] = half @ before[:, : 2 * g], half @ after[:, : 2 * g]
        places = slice(2 * g + n, told), slice(first, first + p), slice(first + p, first + 2 * p)
        encoders = np.broadcast_to(np.eye(n, size), (samples, n, size))
        if sight is None:
            return cls(whole, before, after, encoders, None, *places)
        looks, through = np.zeros((samples, n + p, size)), None
        looks[:, :n] = encoders
        looks[:, n:, : 2 * g] = sight.rows
        looks[:, n:, places[1]] = np.eye(p)
        looks[:, n:, places[2]] = np.eye(p) * sight.foretold[:, :, None]
        if turn is not None and sight.axes is not None:
            telling = np.flatnonzero(sight.axes >= 0)
            looks[:, n + telling, told + sight.axes[telling]] = 1.0
        if sight.pull is not None:
            through = np.zeros((samples, n + p, n))
            through[:, n:] = _pulled(response, sight.pull, looks[:, n:], forces=forces)
        unseen = np.isnan(sight.gap)
        looks[:, n:][unseen] = 0.0  # what was not recorded sees nothing
        if through is not None:
            through[:, n:][unseen] = 0.0
        return cls(whole, before, after, looks, through, *places)


def _pulled(response: ModalResponse, pull: Array, looks: Array, *, forces: bool) -> Array:
    """Add to `looks` what channels feel of accelerations; what they feel of r, shape (N, p, n).

    [dq''; dx''] = Z^-1 [r - e - d; -f - K dx - C dx'].
    """
    n, g = response.joints, response.inertia.shape[1]
    by = pull @ np.linalg.inv(response.inertia)[response.pose]
    looks[:, :, n:g] -= by[:, :, n:] @ response.stiffness
    looks[:, :, g + n : 2 * g] -= by[:, :, n:] @ response.damping
    latent = g if forces else n
    looks[:, :, 2 * g : 2 * g + latent] -= by[:, :, :latent]
    looks[:, :, -n:] -= by[:, :, :n]
    return np.asarray(by[:, :, :n])
