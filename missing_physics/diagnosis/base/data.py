"""Rows of the gyros of a free base, to which hypotheses are fitted as to rows of torques.

Zero offsets of the gyros and the initial vibration of links are nuisance parameters of each recording. Its
initial angular momentum is a parameter of the standard model, zero in the robot file. For a recording that is
held out, or left out as a fold, it is a nuisance parameter, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.base.bodies import MOMENTUM, bodies_column, layout_of, momentum_names
from missing_physics.diagnosis.base.candidates import candidates
from missing_physics.diagnosis.base.columns import BaseColumns
from missing_physics.evaluation.vibration.whitening import Vibration
from missing_physics.hypotheses import Candidate, Hypothesis
from missing_physics.inference.data import MANY, Data, blocks_of
from missing_physics.motion.base.rates import Rates
from missing_physics.plausibility.table import INERTIAL_CHANGE
from missing_physics.standard import MODEL_ERROR

__all__ = ["BaseData"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False, kw_only=True)
class BaseData(Data):
    """Rows of rates, one channel for each gyro.

    Attributes:
        runs: rates of each recording, the fitted ones first.
        quiet: nuisance signals of each recording, which are removed from its rows.
        masks: masks of the rows of each recording that are compared, shape (K, m) each.
        targets: values to be fitted, shape (K, m) each [rad/s].
    """

    runs: tuple[Rates, ...]
    quiet: tuple[Vibration, ...]
    masks: tuple[Mask, ...]
    targets: tuple[Array, ...]
    _started: dict[tuple[object, ...], tuple[list[Array], list[Candidate]]] = field(
        default_factory=dict, init=False, repr=False
    )

    @classmethod
    def of(cls, runs: Sequence[Rates], fitted: int) -> Self:
        """The rows of rates; without held-out recordings a quarter of each one is held out.

        Args:
            runs: rates of each recording.
            fitted: number of recordings that are fitted.
        """
        centred = np.concatenate(
            [own.reduce(own.measured - own.measured.mean(axis=0)) for own in runs[:fitted]]
        )
        size = np.maximum(np.sqrt(np.mean(centred**2, axis=0)), np.finfo(float).eps)
        error = MODEL_ERROR * size
        noise = np.sqrt(np.mean([own.noise**2 for own in runs], axis=0))
        begun = fitted if fitted < MANY else 0
        layout = layout_of(runs, begun)
        masks = tuple(own.covered for own in runs)
        quiet, targets, designs = [], [], []
        file_values = layout.start.copy()
        file_values[: runs[0].dynamics.model.inertial.size] = runs[0].dynamics.model.inertial
        for i, (own, mask) in enumerate(zip(runs, masks)):
            momenta = own.rows(own.floating.turned(own.floating.kept(np.eye(3))))
            nuisance = [np.broadcast_to(np.eye(size.size), (*mask.shape, size.size)), own.vibration]
            nuisance += [] if i < begun else [momenta]
            weight = mask / (noise**2 + error**2)
            removed = Vibration.of(np.concatenate(nuisance, axis=2) * mask[:, :, None], weight)
            bodies = bodies_column(own)
            design = np.zeros((*mask.shape, file_values.size))
            design[:, :, : bodies.shape[2]] = bodies
            design[:, :, ~layout.free] = 0.0
            if i < begun:
                places = [layout.names.index(name) for name in momentum_names(i)]
                design[:, :, places] = momenta
            design = removed.removed(design * mask[:, :, None])
            residual = own.reduce(own.measured - own.predicted)
            quiet.append(removed)
            designs.append(design)
            targets.append(removed.removed(residual * mask) + design @ file_values)
        return cls(
            layout=layout,
            file_values=file_values,
            designs=tuple(designs),
            blocks=blocks_of(masks, fitted),
            size=size,
            noise=noise,
            independent=runs[0].low_pass.independent,
            robot=runs[0].dynamics.model.robot,
            joints=runs[0].channels,
            runs=tuple(runs),
            quiet=tuple(quiet),
            masks=masks,
            targets=tuple(targets),
            error=error,
        )

    @cached_property
    def terms(self) -> BaseColumns:
        """Columns of terms along the recordings."""
        return BaseColumns(self.runs, self.quiet, self.masks)

    @property
    def width(self) -> float:
        """Relative width of the prior of bodies: CAD models lack cables and screws."""
        return INERTIAL_CHANGE

    @property
    def further(self) -> tuple[str, ...]:
        """Names of the initial momenta: zero in the robot file, whose base starts at rest."""
        return tuple(name for name in self.layout.names if name.startswith(MOMENTUM))

    def time(self, run: int) -> Array:
        """Times of the rows of one recording [s], shape (K,)."""
        return self.runs[run].time

    def counted(self, run: int) -> Mask:
        """Mask of the rows in which the gyros were recorded without a gap, shape (K, m)."""
        return self.masks[run]

    def target(self, run: int) -> Array:
        """Rates minus those of the robot file, plus the file's parameters times their derivatives, (K, m)."""
        return self.targets[run]

    def nominal(self, run: int) -> Array:
        """Prediction of the robot file's parameters, shape (K, m)."""
        return np.asarray(self.designs[run] @ self.file_values)

    def candidates(
        self, hypothesis: Hypothesis, parameters: Array, residual: Sequence[Array]
    ) -> list[Candidate]:
        """Candidates that may be added to a hypothesis, started at the bodies of the robot file.

        The bodies estimated without an effect have partly compensated for it.
        """
        fitted_rows = [self.fitted_rows(i)[:, None] for i in range(self.fitted)]
        moved = [design @ (parameters - self.file_values) for design in self.designs]
        wanted = [own + np.where(rows, more, 0.0) for own, rows, more in zip(residual, fitted_rows, moved)]
        key = tuple((term.key, term.values, term.added) for term in hypothesis.terms)
        known = self._started.get(key)
        if known is None or not all(np.allclose(a, b) for a, b in zip(known[0], wanted)):
            runs = self.runs[: self.fitted]
            every = candidates(runs, hypothesis.terms, wanted, fitted_rows, self.terms, self.error)
            self._started[key] = known = wanted, list(every)
        return known[1]
