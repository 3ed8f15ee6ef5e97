"""What hidden modes contribute to the torques of one recording, as terms of an explanation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.responses.compliant_base import GivingBase
from missing_physics.diagnosis.responses.hidden_modes import BendingLink, HiddenModes
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.base import Parameter
from reference_model.effects.catalogue import get_effect
from reference_model.effects.structure import StructureEffect
from robot_model import InputError, Robot

__all__ = ["HiddenResponses"]

Array = NDArray[np.float64]
Single = NDArray[np.float32]

#: Period [s] and damping ratio at which the constants of a hidden mode are made; those of others follow.
PROBE = (0.2, 0.1)
#: Responses kept for reuse.
MOST_KEPT = 20


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
        self._base_scans: dict[tuple[object, ...], tuple[Array, Array]] = {}
        self._known: dict[tuple[str, str], dict[tuple[float, ...], Array]] = {}

    def modes(self, effect: str, link: str) -> HiddenModes | None:
        """The modes that a structure effect gives a link; None where the link cannot have it."""
        if (effect, link) not in self._modes:
            try:
                self._modes[effect, link] = MADE[effect](self._robot, link, self._dynamics)
            except (InputError, np.linalg.LinAlgError):
                # nothing of it can bend, or numbers on trial leave a mode without inertia
                self._modes[effect, link] = None
        return self._modes[effect, link]

    def scan(self, effect: str, link: str, periods: Array, damping: float) -> Single:
        """`HiddenModes.scan` of modes that there are, shape (M, n, P)."""
        key = (effect, link, periods.tobytes(), damping)
        if key not in self._scans:
            modes = self.modes(effect, link)
            assert isinstance(modes, BendingLink)
            self._scans[key] = modes.scan(periods, damping)
        return self._scans[key]

    def base_scan(self, periods: Array, damping: float) -> tuple[Array, Array]:
        """`GivingBase.scan` of a base that can give way."""
        key = ("base", periods.tobytes(), damping)
        if key not in self._base_scans:
            self._base_scans[key] = self.giving_base.scan(periods, damping)
        return self._base_scans[key]

    @property
    def giving_base(self) -> GivingBase:
        """The base that gives way."""
        modes = self.modes("base_motion", "base")
        assert isinstance(modes, GivingBase)
        return modes

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
        parts = self._response(term)
        names = [p.name for p in self.starts(*term.key)]
        weights = np.array([1.0, *(term.parameters.get(name, 0.0) for name in names)])
        value, *derivatives = parts @ weights
        columns = dict(zip(self._of(term).names, derivatives))
        columns |= {name: parts[0][:, :, 1 + k] for k, name in enumerate(names)}
        jacobian = np.zeros((*value.shape, len(term.free)))
        for k, name in enumerate(term.free):
            if name in columns:
                jacobian[:, :, k] = columns[name]
        return value, jacobian

    def unknown_starts(self, term: Term) -> Array:
        """What unit numbers of the start add where `term` was not fitted to this recording, (M, m, k)."""
        parts = self._response(term)
        columns = parts[0][:, :, 1:]
        fitted = all(p.name in term.parameters for p in self.starts(*term.key))
        return np.zeros_like(columns) if fitted else columns

    def _of(self, term: Term) -> HiddenModes:
        modes = self.modes(*term.key)
        assert modes is not None
        return modes

    def _response(self, term: Term) -> Array:
        """`HiddenModes.respond` on the kept rows, to first order about a response known already, if near."""
        modes, known = self._of(term), self._known.setdefault(term.key, {})
        values = tuple(term.parameters[name] for name in modes.names)
        for others, parts in known.items():
            if modes.near(others, values):
                moved = parts.copy()
                for k, (value, other) in enumerate(zip(values, others)):
                    moved[0] += (value - other) * parts[1 + k]
                return moved
        if len(known) > MOST_KEPT:
            known.clear()
        known[values] = np.stack([self._reduce(part) for part in modes.respond(*values)])
        return known[values]


def _bending_link(robot: Robot, link: str, along: MotionDynamics) -> HiddenModes:
    changes = get_effect("link_flexibility")
    assert isinstance(changes, StructureEffect)
    period, damping = PROBE
    values = {**changes.defaults(), "period": period, "damping_ratio": damping}
    bent = changes.changed(robot, link, values)
    return BendingLink(bent, link, period=period, damping=damping, along=along)


def _giving_base(robot: Robot, base: str, along: MotionDynamics) -> HiddenModes:
    changes = get_effect("base_motion")
    assert isinstance(changes, StructureEffect)
    values = {p.name: p.typical for p in changes.parameters}
    loose = changes.changed(robot, base, values)
    return GivingBase(loose, tuple(values[name] for name in GivingBase.names), along)


#: How the modes of each effect are made.
MADE: Mapping[str, Callable[[Robot, str, MotionDynamics], HiddenModes]] = MappingProxyType(
    {"link_flexibility": _bending_link, "base_motion": _giving_base}
)
