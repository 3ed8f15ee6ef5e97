"""What hidden modes contribute to the torques of one recording, as terms of an explanation."""

from __future__ import annotations

from collections.abc import Callable
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.dynamics import MotionDynamics
from missing_physics.diagnosis.hidden_modes import HiddenModes
from missing_physics.diagnosis.terms import Term
from reference_model.effects.base import Parameter
from reference_model.effects.catalogue import get_effect
from reference_model.effects.structure import StructureEffect
from robot_model import InputError, Robot

__all__ = ["HiddenResponses"]

Array = NDArray[np.float64]
Single = NDArray[np.float32]

#: Period [s] and damping ratio at which the constants of a hidden mode are made; those of others follow.
PROBE = (0.2, 0.1)
#: Responses kept for reuse, and the phase [rad] that a mode may be off while it lasts, or the relative change
#: of its damping, for a response to be taken to first order: it then errs by half the square.
MOST_KEPT = 20
NEAR = 0.03


class HiddenResponses:
    """Hidden modes along the motion of one recording; everything is computed when first asked for.

    Args:
        robot: the nominal robot.
        dynamics: its dynamics along the motion.
        reduce: filters and decimates predictions of shape (N, m, k).
    """

    def __init__(self, robot: Robot, dynamics: MotionDynamics, reduce: Callable[[Array], Array]) -> None:
        self._robot, self._dynamics, self._reduce = robot, dynamics, reduce
        self._modes: dict[tuple[str, str], HiddenModes | None] = {}
        self._scans: dict[tuple[object, ...], Single] = {}
        self._known: dict[tuple[str, str], dict[tuple[float, float], Array]] = {}

    def modes(self, effect: str, link: str) -> HiddenModes | None:
        """The modes that a structure effect gives a link; None where the link cannot have it."""
        if (effect, link) not in self._modes:
            changes = get_effect(effect)
            assert isinstance(changes, StructureEffect)
            values = {**changes.defaults(), "period": PROBE[0], "damping_ratio": PROBE[1]}
            found = None
            try:
                bent = changes.changed(self._robot, link, values)
                found = HiddenModes(bent, link, period=PROBE[0], damping=PROBE[1], along=self._dynamics)
            except (InputError, np.linalg.LinAlgError):
                pass  # nothing of it can bend, or numbers on trial leave a mode without inertia
            self._modes[effect, link] = found
        return self._modes[effect, link]

    def scan(self, effect: str, link: str, periods: Array, damping: float) -> Single:
        """`HiddenModes.scan` of modes that there are, shape (M, n, P)."""
        key = (effect, link, periods.tobytes(), damping)
        if key not in self._scans:
            modes = self.modes(effect, link)
            assert modes is not None
            self._scans[key] = modes.scan(periods, damping)
        return self._scans[key]

    def starts(self, effect: str, link: str) -> tuple[Parameter, ...]:
        """Deflections and rates of the slowest modes at this recording's first sample, to be estimated."""
        modes = self.modes(effect, link)
        count = 0 if modes is None else 2 * modes.slowest.shape[1]
        name = f"start_{crc32(self._dynamics.motion.raw_position.tobytes()):08x}"
        return tuple(
            Parameter(f"{name}_{k}", "-", "of a hidden mode", -np.inf, np.inf, 1.0, linear=True)
            for k in range(count)
        )

    def contribution(self, term: Term) -> tuple[Array, Array]:
        """The response to the motion and to the numbers of the start, (M, m), and its derivatives, (M, m, k).

        Another recording's start is no number of this one, where modes begin undeformed and at rest.
        """
        period, damping = term.parameters["period"], term.parameters["damping_ratio"]
        parts = self._response(term.key, period, damping)
        names = [p.name for p in self.starts(*term.key)]
        weights = np.array([1.0, *(term.parameters.get(name, 0.0) for name in names)])
        value, by_period, by_damping = parts @ weights
        columns = {"period": by_period, "damping_ratio": by_damping}
        columns |= {name: parts[0][:, :, 1 + k] for k, name in enumerate(names)}
        jacobian = np.zeros((*value.shape, len(term.free)))
        for k, name in enumerate(term.free):
            if name in columns:
                jacobian[:, :, k] = columns[name]
        return value, jacobian

    def unknown_starts(self, term: Term) -> Array:
        """What unit numbers of the start add where `term` was not fitted to this recording, (M, m, k)."""
        parts = self._response(term.key, term.parameters["period"], term.parameters["damping_ratio"])
        columns = parts[0][:, :, 1:]
        fitted = all(p.name in term.parameters for p in self.starts(*term.key))
        return np.zeros_like(columns) if fitted else columns

    def _response(self, key: tuple[str, str], period: float, damping: float) -> Array:
        """`HiddenModes.respond` on the kept rows, to first order about a response known already, if near."""
        known = self._known.setdefault(key, {})
        for (t, z), parts in known.items():
            if abs(period / t - 1.0) / (2.0 * z) + abs(damping / z - 1.0) < NEAR:
                moved = parts.copy()
                moved[0] += (period - t) * parts[1] + (damping - z) * parts[2]
                return moved
        if len(known) > MOST_KEPT:
            known.clear()
        modes = self.modes(*key)
        assert modes is not None
        known[period, damping] = np.stack([self._reduce(part) for part in modes.respond(period, damping)])
        return known[period, damping]
