"""The rows of all recordings, cut into blocks of which each is predicted without having been fitted.

Beside the columns of the standard model there is one of the timing: torque and position of one recording
rarely belong to the same instant (a held command, a filtered current, two buses), so that a common delay of a
sample or so is no physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.hypotheses import Term
from missing_physics.inference.columns import columns_of
from missing_physics.inference.runs import Run, runs_of
from missing_physics.standard import StandardModel
from missing_physics.standard.fit import BLOCKS, FOLDS, design_of
from missing_physics.standard.layout import Layout
from robot_model import Recording

__all__ = ["HELD_OUT", "TIMING", "Block", "Data"]

Array = NDArray[np.float64]

#: Name of the delay of the recorded torque behind the motion [s].
TIMING = "timing"
#: Standard deviation of its prior [samples].
OFFSET = 1.0
#: Columns of terms that are kept.
KEPT = 500
#: Fold of blocks that are never fitted.
HELD_OUT = -1


@dataclass(frozen=True)
class Block:
    """Rows of one recording that are predicted together.

    Attributes:
        run: number of the recording.
        rows: which of its rows.
        fold: blocks of one fold are left out together; `HELD_OUT` for those of held-out recordings.
        gram: products of the standard model's columns at each joint, shape (n, X, X).
        count: rows that are compared at each joint, shape (n,).
    """

    run: int
    rows: slice
    fold: int
    gram: Array
    count: Array


@dataclass(frozen=True)
class Data:
    """What hypotheses are fitted to and judged by.

    Attributes:
        standard: the standard model about which everything is written.
        runs: recordings, those that are fitted first.
        layout: numbers of the standard model, the timing behind them.
        designs: derivative of the recorded torques by these, one array (K, n, X) for each run.
        blocks: of all runs.
        torque: rms of the recorded torque at each joint, shape (n,).
    """

    standard: StandardModel
    runs: tuple[Run, ...]
    layout: Layout
    designs: tuple[Array, ...]
    blocks: tuple[Block, ...]
    torque: Array
    _kept: dict[tuple[Term, int], Array] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def of(
        cls, standard: StandardModel, recordings: Sequence[Recording], held_out: Sequence[Recording] = ()
    ) -> Data:
        """In the band in which the standard model was fitted."""
        runs = runs_of(standard, (*recordings, *held_out))
        designs = tuple(np.concatenate([design_of(r.rows), _late(r)], axis=2) for r in runs)
        fitted = len(recordings)
        parts = 1 if fitted >= FOLDS else FOLDS
        blocks: list[Block] = []
        for i, (run, design) in enumerate(zip(runs, designs)):
            cuts = np.linspace(0, run.rows.time.size, parts * BLOCKS + 1).astype(int)
            for b, (first, last) in enumerate(pairwise(cuts)):
                rows, counted = slice(first, last), run.rows.counted[first:last]
                masked = np.where(counted[:, :, None], design[rows], 0.0)
                gram = masked.transpose(1, 2, 0) @ masked.transpose(1, 0, 2)
                fold = i * parts + b // BLOCKS if i < fitted else HELD_OUT
                blocks.append(Block(i, rows, fold, gram, counted.sum(axis=0).astype(float)))
        squares = np.concatenate([r.rows.measured for r in runs[:fitted]]) ** 2
        torque = np.sqrt(np.mean(squares, axis=0))
        step = 1.0 / runs[0].motion.rate
        return cls(
            standard, runs, _with_timing(standard.estimate.layout, step), designs, tuple(blocks), torque
        )

    def columns(self, term: Term, run: int) -> Array:
        """Of a term along one recording, see `columns_of`; those of the terms used last are kept."""
        key = (term, run)
        if key not in self._kept:
            while len(self._kept) >= KEPT:
                self._kept.pop(next(iter(self._kept)))
            self._kept[key] = columns_of(term, self.runs[run], run)
        return self._kept[key]

    @property
    def fold(self) -> NDArray[np.int_]:
        """Of each block, shape (B,)."""
        return np.array([block.fold for block in self.blocks])

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Blocks of fitted recordings, shape (B,)."""
        return self.fold != HELD_OUT

    @property
    def fitted(self) -> int:
        """How many recordings are fitted."""
        return 1 + max(block.run for block in self.blocks if block.fold != HELD_OUT)

    @property
    def counts(self) -> Array:
        """Rows compared in each block at each joint, shape (B, n)."""
        return np.array([block.count for block in self.blocks])

    @property
    def start(self) -> Array:
        """Numbers of the standard model as it was fitted, and no delay, shape (X,)."""
        return np.append(self.standard.estimate.values, 0.0)


def _late(run: Run) -> Array:
    """What a torque recorded later shows: minus its rate, shape (K, n, 1)."""
    time = run.motion.time
    return -run.reduce(np.asarray(make_interp_spline(time, run.needed, k=3)(time, 1)))[:, :, None]


def _with_timing(base: Layout, step: float) -> Layout:
    place = len(base.names)
    return Layout(
        names=(*base.names, TIMING),
        start=np.append(base.start, 0.0),
        free=np.append(base.free, True),
        bodies=base.bodies,
        own=np.append(base.own, place),
        positive=base.positive,
        size=np.append(base.size, OFFSET * step),
        centre=np.append(base.centre, 0.0),
        width=np.append(base.width, OFFSET * step),
    )
