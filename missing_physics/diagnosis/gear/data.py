"""Rows of the gaps between two encoders, to which hypotheses are fitted as to rows of torques.

The standard model has one parameter for each gap and recording: the difference of the encoders' zeros. A
held-out recording is centred instead, since no hypothesis predicts its zeros.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.gear.candidates import candidates
from missing_physics.diagnosis.gear.columns import GapColumns
from missing_physics.hypotheses import Candidate, Hypothesis
from missing_physics.inference.data import Data, blocks_of
from missing_physics.motion.gap import Gap
from missing_physics.standard import MODEL_ERROR
from missing_physics.standard.layout import Layout
from robot_model import Robot

__all__ = ["GapData"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False, kw_only=True)
class GapData(Data):
    """Rows of gaps, one channel for each joint with two encoders.

    Attributes:
        gaps: of each recording, channel by channel, the fitted ones first.
        targets: the gaps, those of held-out recordings about their mean, shape (K, n) each [rad or m].
    """

    gaps: tuple[tuple[Gap, ...], ...]
    targets: tuple[Array, ...]

    @classmethod
    def of(cls, robot: Robot, gaps: Sequence[Sequence[Gap]], fitted: int) -> Self:
        """The rows of gaps (`gap.gaps_of`); without held-out recordings a quarter of each one is held out.

        Args:
            robot: nominal.
            gaps: of each recording, channel by channel.
            fitted: number of recordings that are fitted.
        """
        width = len(gaps[0])
        whole = [np.column_stack([gap.reduce(gap.difference) for gap in own]) for own in gaps]
        centred = [target - target.mean(axis=0) for target in whole]
        targets = *whole[:fitted], *centred[fitted:]
        offsets = np.concatenate([target.mean(axis=0) for target in whole[:fitted]])
        about = np.concatenate(centred[:fitted])
        size = np.maximum(np.sqrt(np.mean(about**2, axis=0)), np.finfo(float).eps)
        # The mean error due to the encoders' resolution counts as error of any model, too.
        steps = np.sqrt(np.mean([[gap.steps**2 for gap in own] for own in gaps], axis=0))
        designs = []
        for i, target in enumerate(targets):
            design = np.zeros((*target.shape, offsets.size))
            if i < fitted:
                design[:, np.arange(width), i * width + np.arange(width)] = 1.0
            designs.append(design)
        sizes = np.tile(size, fitted)
        layout = Layout(
            names=tuple(f"{gap.joint}.zero in {i}" for i, own in enumerate(gaps[:fitted]) for gap in own),
            start=offsets,
            free=np.ones(offsets.size, dtype=bool),
            bodies=(),
            gaussian=np.arange(offsets.size),
            positive=np.zeros(0, dtype=int),
            size=sizes,
            centre=np.zeros(offsets.size),
            width=np.full(offsets.size, np.inf),  # determined by the rows
            scale=np.zeros(offsets.size),
            beams=np.zeros(0, dtype=int),
        )
        return cls(
            layout=layout,
            file_values=np.zeros(offsets.size),
            designs=tuple(designs),
            blocks=blocks_of([np.ones(target.shape, dtype=bool) for target in whole], fitted),
            size=size,
            noise=np.sqrt(np.mean([[gap.noise_floor**2 for gap in own] for own in gaps], axis=0)),
            error=np.hypot(MODEL_ERROR * size, steps),
            independent=gaps[0][0].along.motion.low_pass.independent,
            robot=robot,
            joints=tuple(gap.joint for gap in gaps[0]),
            gaps=tuple(map(tuple, gaps)),
            targets=targets,
        )

    @cached_property
    def terms(self) -> GapColumns:
        """Columns of terms along the recordings."""
        return GapColumns(self.gaps, [i >= self.fitted for i in range(len(self.gaps))])

    def time(self, run: int) -> Array:
        """Times of the rows of one recording [s], shape (K,)."""
        return self.gaps[run][0].along.motion.reduced_time

    def counted(self, run: int) -> Mask:
        """Mask of the compared rows, shape (K, n): all."""
        return np.ones((self.time(run).size, self.size.size), dtype=bool)

    def target(self, run: int) -> Array:
        """The gaps, those of a held-out recording about their mean [rad or m], shape (K, n)."""
        return self.targets[run]

    def nominal(self, run: int) -> Array:
        """The gaps of a robot with rigid gears and ideal encoders, shape (K, n)."""
        return np.asarray(self.designs[run] @ self.start)

    def candidates(
        self, hypothesis: Hypothesis, parameters: Array, residual: Sequence[Array]
    ) -> list[Candidate]:
        """Candidates that may be added to a hypothesis."""
        found: list[Candidate] = []
        for k in range(self.size.size):
            own = [gaps[k] for gaps in self.gaps[: self.fitted]]
            found += candidates(own, hypothesis.terms, [each[:, k] for each in residual])
        return found
