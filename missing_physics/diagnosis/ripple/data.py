"""Rows of torques above the band of the motion, to which waves over position are fitted.

The residual of the torques' answer is made white by a filter (`whitening`). The standard model of these rows
has the relative error of the inertia at each joint, known as well as the motion's band determines it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.ripple.rows import PER_PERIOD, Rows, about_zeros
from missing_physics.diagnosis.ripple.series import HIGHEST, Fast
from missing_physics.diagnosis.ripple.whitening import Whitening
from missing_physics.hypotheses import Candidate, Hypothesis, Place, Term, candidates, extent_of
from missing_physics.inference.data import Data, blocks_of
from missing_physics.inference.kept import TermColumns
from missing_physics.standard import MODEL_ERROR
from missing_physics.standard.layout import Layout
from missing_physics.standard.normal import Places
from reference_model.effects.base import JointEffect, SensorEffect
from robot_model import Robot

__all__ = ["RippleData"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class _Columns(TermColumns):
    """Columns of terms in the rows."""

    def __init__(self, data: RippleData) -> None:
        super().__init__()
        self._data = data

    def _places(self, term: Term, run: int) -> Places:
        """All compared joints for an encoder, else the joint."""
        if isinstance(term.effect, SensorEffect):
            return np.array(self._data.compared)
        return np.array([self._data.joints.index(term.joint)])

    def _made(self, term: Term, run: int) -> Array:
        effect, rows, places = term.effect, self._data.rows[run], self._places(term, run)
        if isinstance(effect, SensorEffect):
            return rows.reduced(rows.own.of_encoder(term, effect)[:, places], places)
        assert isinstance(effect, JointEffect)
        return rows.reduced(rows.own.of_joint(term, effect)[:, None], places)

    def _shape(self, run: int) -> tuple[int, int]:
        return self._data.target(run).shape


def _known(every: Sequence[Fast]) -> Array:
    """Standard deviation of the relative error of the inertia at each joint in the motion's band, shape (n,).

    Of a regression of the residual there on the torque that accelerates the bodies.
    """
    inertial, residual = (np.sum(one, axis=0) for one in zip(*(own.in_band for own in every)))
    count = sum(2.0 * own.slow * float(own.motion.time[-1] - own.motion.time[0]) for own in every)
    found = np.sqrt(residual / np.maximum(inertial * count, np.finfo(float).tiny))
    return np.clip(found, MODEL_ERROR, 1.0)


def _filters(every: Sequence[Fast], high: float) -> tuple[Whitening | None, ...]:
    """The filter of each joint; None where it is not compared in any recording."""
    found: list[Whitening | None] = []
    for k in range(len(every[0].compared)):
        seen = [one for one in every if one.known[:, k].any()]
        series, rates = [one.residual[:, k] for one in seen], [one.motion.rate for one in seen]
        white = Whitening.of(series, rates, low=every[0].slow, high=high) if seen else None
        if white is not None:
            columns = [one.inertial[:, k] * one.motion.shares[:, k] for one in seen]
            white = white.sharing(columns, [one.recorded[:, k] for one in seen], rates)
        found.append(white)
    return tuple(found)


def _layout(robot: Robot, filters: Sequence[Whitening | None], known: Array) -> Layout:
    """Relative errors of the inertia at each joint, with their standard deviations, shape (n,)."""
    zero, compared = np.zeros_like(known), np.array([one is not None for one in filters])
    return Layout(
        names=tuple(f"{drive.name}.inertia" for drive in robot.drives),
        start=zero,
        free=compared,
        bodies=(),
        gaussian=np.flatnonzero(compared),
        positive=np.zeros(0, dtype=int),
        size=known,
        centre=zero,
        width=known,
        scale=zero,
        beams=np.zeros(0, dtype=int),
    )


def _above(term: Term, lowest: float) -> tuple[tuple[str, float, float], ...]:
    """Limits of a wave whose order is at least the lowest one."""
    return tuple(
        (name, max(low, lowest), high) if name == "order" else (name, low, high)
        for name, low, high in term.limits
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class RippleData(Data):
    """Rows above the band of the motion, one channel for each joint.

    Attributes:
        rows: of the recordings, the fitted ones first.
    """

    rows: tuple[Rows, ...]

    @classmethod
    def of(cls, robot: Robot, every: Sequence[Fast], fitted: int) -> Self | None:
        """The rows of recordings; a quarter of each is held out where no recording is.

        Args:
            robot: nominal.
            every: the recordings, the fitted ones first.
            fitted: how many of them are fitted.

        Returns:
            None where the residual is zero above the band at all joints.
        """
        high = HIGHEST * min(one.motion.rate for one in every)
        filters = _filters(every[:fitted], high)
        if not any(filters):
            return None
        rows = about_zeros([Rows(one, filters, high) for one in every])
        layout = _layout(robot, filters, _known([one.own for one in rows[:fitted]]))
        count = sum(one.mask.sum(axis=0) for one in rows[:fitted])
        energy = sum((one.target**2).sum(axis=0) for one in rows[:fitted])
        size = np.sqrt(energy / np.maximum(count, 1))
        level = np.array([1.0 if one is None else one.level for one in filters])
        torque = np.concatenate([np.where(one.known, one.torque, 0.0) for one in every[:fitted]])
        return cls(
            robot=robot,
            joints=tuple(drive.name for drive in robot.drives),
            layout=layout,
            file_values=layout.start,
            designs=tuple(one.design for one in rows),
            blocks=blocks_of([one.mask for one in rows], fitted),
            size=np.where(size > 0.0, size, level),
            noise=level,
            error=MODEL_ERROR * np.sqrt(np.mean(torque**2, axis=0)),
            independent=min(1.0, 2.0 * (1.0 - every[0].slow / high) / PER_PERIOD),
            rows=rows,
        )

    @cached_property
    def terms(self) -> _Columns:
        """Columns of terms along the recordings."""
        return _Columns(self)

    def time(self, run: int) -> Array:
        """Of the rows of one recording [s], shape (K,)."""
        rows = self.rows[run]
        return rows.own.motion.time[rows.kept]

    def counted(self, run: int) -> Mask:
        """Rows in which a joint slides, shape (K, n)."""
        return self.rows[run].mask

    def target(self, run: int) -> Array:
        """Filtered residuals of the answer [N m or N], shape (K, n)."""
        return self.rows[run].target

    def nominal(self, run: int) -> Array:
        """Nothing: the rows are residuals, shape (K, n)."""
        return np.zeros_like(self.rows[run].target)

    @property
    def compared(self) -> list[int]:
        """Numbers of the joints that are compared."""
        return [k for k, one in enumerate(self.rows[0].filters) if one is not None]

    @cached_property
    def orders(self) -> Array:
        """Angular orders of a wave over each joint's position that recordings tell apart, shape (n,)."""
        found = np.ones(len(self.joints))
        for rows in self.rows[: self.fitted]:
            motion = rows.own.motion
            speed = np.median(np.abs(motion.velocity), axis=0)
            found = np.maximum(found, rows.high * np.ptp(motion.position, axis=0) / np.maximum(speed, 1e-12))
        return found

    def candidates(
        self, hypothesis: Hypothesis, parameters: Array, residual: Sequence[Array]
    ) -> list[Candidate]:
        """One wave over position for each joint, but for those that the robot file has."""
        places, present = {}, {term.joint for term in hypothesis.terms}
        for k in self.compared:
            joint = self.robot.drives[k]
            if joint.name in present:  # its harmonics are no other effect
                continue
            ratio = joint.actuator.gear_ratio if joint.actuator else 1.0
            extents = tuple(
                extent_of(rows.sight(k, own[:, k], ratio)) for rows, own in zip(self.rows, residual)
            )
            places[joint.name] = Place(extents, 0.0, driven=joint.actuator is not None)
        channels = {f"{name}.{end}" for name in places for end in ("position", "torque")}
        known = {(use.effect, use.at) for use in self.rows[0].own.robot.effects}
        lowest = dict(zip(self.joints, self._slowest))
        return [
            replace(one, term=replace(one.term, limits=_above(one.term, lowest[one.term.joint])))
            for one in candidates(self.robot, hypothesis, places, channels)
            if one.term.effect.is_wave
            and one.term.key not in known
            and one.term.parameters["order"] > lowest[one.term.joint]
        ]

    @cached_property
    def _slowest(self) -> Array:
        """Angular order of a wave that has the frequency of the end of the motion's band, shape (n,)."""
        runs = [one.own for one in self.rows[: self.fitted]]
        speed = np.concatenate([np.abs(one.motion.velocity) for one in runs])
        known = np.concatenate([one.known for one in runs])
        usual = np.array([np.median(own[seen]) if seen.any() else 0.0 for own, seen in zip(speed.T, known.T)])
        return np.asarray(2.0 * np.pi * runs[0].slow / np.maximum(usual, 1e-12))
