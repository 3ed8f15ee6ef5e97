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

from missing_physics.diagnosis.ripple.series import HIGHEST, Fast
from missing_physics.diagnosis.ripple.whitening import Whitening
from missing_physics.diagnosis.ripple.zeros import zeros_of
from missing_physics.evaluation.band import SPOILED_PERIODS
from missing_physics.hypotheses import Candidate, Hypothesis, Place, Sight, Term, candidates, extent_of
from missing_physics.inference.data import Data, blocks_of
from missing_physics.inference.kept import Kept
from missing_physics.standard import MODEL_ERROR
from missing_physics.standard.layout import Layout
from missing_physics.standard.normal import Places
from reference_model.effects.base import JointEffect, SensorEffect
from robot_model import Robot

__all__ = ["RippleData"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Rows kept per period of the band's end.
PER_PERIOD = 2.5


class _Columns:
    """Columns of terms, those of the terms used last cached."""

    def __init__(self, data: RippleData) -> None:
        self._data = data
        self._kept = Kept[Array]()

    def prepare(self, terms: Sequence[Term], run: int) -> None:
        """Compute the columns of several terms."""
        for term in terms:
            self.acting(term, run)

    def acting(self, term: Term, run: int) -> tuple[Places, Array]:
        """The joints at which a term acts, shape (a,), and its columns there, shape (K, a, 1 + P)."""
        effect, own = term.effect, self._data.every[run]
        key = (*term.key, term.values, tuple(p.name for p in term.free), run)
        found = self._kept.get(key)
        place = self._data.joints.index(term.joint)
        if isinstance(effect, SensorEffect):
            places = np.flatnonzero(self._data.driven)
            if found is None:
                found = self._kept.keep(
                    key, self._data.reduced(run, own.of_encoder(term, effect)[:, places], places)
                )
            return places, found
        places = np.array([place])
        if found is None:
            assert isinstance(effect, JointEffect)
            each = own.of_joint(term, effect)[:, None]
            found = self._kept.keep(key, self._data.reduced(run, each, places))
        return places, found

    def contributed(self, terms: Sequence[Term], run: int) -> Array:
        """Sum of what terms contribute, shape (K, n)."""
        found = np.zeros_like(self._data.target(run))
        for term in terms:
            places, values = self.acting(term, run)
            found[:, places] += values[:, :, 0]
        return found


def _known(every: Sequence[Fast]) -> Array:
    """Standard deviation of the relative error of the inertia at each joint in the motion's band, shape (n,).

    Of a regression of the residual there on the torque that accelerates the bodies.
    """
    inertial, residual = (np.sum(one, axis=0) for one in zip(*(own.in_band for own in every)))
    count = sum(2.0 * own.slow * float(own.motion.time[-1] - own.motion.time[0]) for own in every)
    found = np.sqrt(residual / np.maximum(inertial * count, np.finfo(float).tiny))
    return np.clip(found, MODEL_ERROR, 1.0)


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
        every: recordings, the fitted ones first.
        filters: of each joint; None where nothing is compared.
        targets: filtered residuals, zero where nothing is compared, shape (K, n) each [N m or N].
        masks: which rows are compared, shape (K, n) each.
    """

    every: tuple[Fast, ...]
    filters: tuple[Whitening | None, ...]
    targets: tuple[Array, ...] = ()
    masks: tuple[Mask, ...] = ()

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
        joints = tuple(drive.name for drive in robot.drives)
        rate, slow = min(one.motion.rate for one in every), every[0].slow
        filters = []
        for k in range(len(joints)):
            parts = [one.residual[:, k] for one in every[:fitted] if one.known[:, k].any()]
            made = Whitening.of(parts, low=slow, high=HIGHEST * rate, rate=rate) if parts else None
            filters.append(made)
        if not any(filters):
            return None
        level = np.array([1.0 if one is None else one.level for one in filters])
        torque = [np.where(one.known, one.torque, 0.0) for one in every[:fitted]]
        usual = np.sqrt(np.mean(np.concatenate(torque) ** 2, axis=0))
        names = tuple(f"{joint}.inertia" for joint in joints)
        zero = np.zeros(len(joints))
        bare = cls(
            robot=robot,
            joints=joints,
            layout=Layout(
                names=names,
                start=zero,
                free=np.array([one is not None for one in filters]),
                bodies=(),
                gaussian=np.flatnonzero([one is not None for one in filters]),
                positive=np.zeros(0, dtype=int),
                size=_known(every[:fitted]),
                centre=zero,
                width=_known(every[:fitted]),
                scale=zero,
                beams=np.zeros(0, dtype=int),
            ),
            file_values=zero,
            designs=(),
            blocks=(),
            size=level,
            noise=level,
            error=MODEL_ERROR * usual,
            independent=float(min(1.0, 2.0 * (HIGHEST * rate - slow) / (PER_PERIOD * HIGHEST * rate))),
            every=tuple(every),
            filters=tuple(filters),
        )
        masks = tuple(bare._mask(run) for run in range(len(every)))
        whole = replace(bare, masks=masks, blocks=blocks_of(masks, fitted))
        joints_of = np.arange(len(joints))
        residuals = [one.residual[:, :, None] for one in every]
        targets = tuple(whole.reduced(i, own, joints_of)[:, :, 0] for i, own in enumerate(residuals))
        count = np.maximum(sum(mask.sum(axis=0) for mask in masks[:fitted]), 1)
        size = np.sqrt(sum((own**2).sum(axis=0) for own in targets[:fitted]) / count)
        return replace(
            whole,
            every=whole._about_zeros(targets, level**2),
            designs=tuple(whole._design(run) for run in range(len(every))),
            targets=targets,
            size=np.where(size > 0.0, size, level),
        )

    def _about_zeros(self, targets: Sequence[Array], variance: Array) -> tuple[Fast, ...]:
        """The recordings with positions about the zeros of the first one."""
        zeros = np.zeros((len(self.every), len(self.joints)))
        for k in np.flatnonzero(self.driven):
            sights = [self._sight(run, int(k), own[:, k], 1.0) for run, own in enumerate(targets)]
            zeros[:, k] = zeros_of(sights, float(variance[k]))
        return tuple(replace(one, zeros=own) for one, own in zip(self.every, zeros))

    def _design(self, run: int) -> Array:
        """Derivatives of the rows by a relative error of the inertia at each joint, shape (K, n, n)."""
        rows = self.reduced(run, self.every[run].inertial[:, :, None], np.arange(len(self.joints)))
        return np.asarray(rows * np.eye(len(self.joints)))

    def kept(self, run: int) -> slice:
        """Samples of one recording that are rows."""
        motion, low = self.every[run].motion, self.every[run].slow
        edge = int(SPOILED_PERIODS * motion.rate / low)
        stride = max(1, int(motion.rate / (PER_PERIOD * HIGHEST * motion.rate)))
        return slice(edge, max(edge, motion.time.size - edge), stride)

    def _mask(self, run: int) -> Mask:
        return np.asarray(self.every[run].known[self.kept(run)] & self.driven)

    @cached_property
    def driven(self) -> Mask:
        """Joints that are compared, shape (n,)."""
        return np.array([one is not None for one in self.filters])

    def reduced(self, run: int, values: Array, places: Places) -> Array:
        """Torques at some joints, (N, a, C), filtered, in the rows, zero where nothing is compared."""
        kept, own = self.kept(run), self.every[run]
        shares = own.motion.shares
        found = np.zeros((len(own.motion.time[kept]), *values.shape[1:]))
        for i, k in enumerate(places):
            white = self.filters[k]
            if white is not None:
                found[:, i] = white(values[:, i] * shares[:, k, None])[kept]
        return found * self.masks[run][:, places, None]

    @cached_property
    def terms(self) -> _Columns:
        """Columns of terms along the recordings."""
        return _Columns(self)

    def time(self, run: int) -> Array:
        """Of the rows of one recording [s], shape (K,)."""
        return self.every[run].motion.time[self.kept(run)]

    def counted(self, run: int) -> Mask:
        """Rows in which a joint slides, shape (K, n)."""
        return self.masks[run]

    def target(self, run: int) -> Array:
        """Filtered residuals of the answer [N m or N], shape (K, n)."""
        return self.targets[run]

    def nominal(self, run: int) -> Array:
        """Nothing: the rows are residuals, shape (K, n)."""
        return np.zeros_like(self.targets[run])

    @cached_property
    def orders(self) -> Array:
        """Angular orders of a wave over each joint's position that recordings tell apart, shape (n,)."""
        found = np.ones(len(self.joints))
        for one in self.every[: self.fitted]:
            travel, speed = (
                np.ptp(one.motion.position, axis=0),
                np.median(np.abs(one.motion.velocity), axis=0),
            )
            found = np.maximum(found, HIGHEST * one.motion.rate * travel / np.maximum(speed, 1e-12))
        return found

    def candidates(
        self, hypothesis: Hypothesis, parameters: Array, residual: Sequence[Array]
    ) -> list[Candidate]:
        """One wave over position for each joint, but for those that the robot file has."""
        places, present = {}, {term.joint for term in hypothesis.terms}
        for k in np.flatnonzero(self.driven):
            joint = self.robot.drives[k]
            if joint.name in present:  # its harmonics are no other effect
                continue
            ratio = joint.actuator.gear_ratio if joint.actuator else 1.0
            extents = tuple(
                extent_of(self._sight(run, int(k), own[:, k], ratio)) for run, own in enumerate(residual)
            )
            places[joint.name] = Place(extents, 0.0, driven=joint.actuator is not None)
        channels = {f"{name}.{end}" for name in places for end in ("position", "torque")}
        known = {(use.effect, use.at) for use in self.every[0].robot.effects}
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
        runs = self.every[: self.fitted]
        speed = np.concatenate([np.abs(one.motion.velocity) for one in runs])
        known = np.concatenate([one.known for one in runs])
        usual = np.array([np.median(own[seen]) if seen.any() else 0.0 for own, seen in zip(speed.T, known.T)])
        return np.asarray(2.0 * np.pi * self.every[0].slow / np.maximum(usual, 1e-12))

    def _sight(self, run: int, k: int, residual: Array, ratio: float) -> Sight:
        motion, kept = self.every[run].motion, self.kept(run)
        return Sight(
            time=motion.time[kept],
            position=self.every[run].position[kept, k],
            velocity=motion.velocity[kept, k],
            torque=self.every[run].torque[kept, k],
            residual=residual,
            step=1.0 / motion.rate,
            cutoff=HIGHEST * motion.rate,
            gear_ratio=ratio,
        )
