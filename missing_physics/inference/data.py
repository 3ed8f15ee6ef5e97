"""Rows of recordings, cut into folds for cross-validation: the interface that fits and scores use.

A channel is the torque of a joint (`missing_physics.inference.torques`), the difference between the
two encoders of a joint (`missing_physics.diagnosis.gear`), or a gyro of the base
(`missing_physics.diagnosis.base`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import Candidate, Hypothesis, Term
from missing_physics.standard.layout import Layout
from missing_physics.standard.normal import Normal, Places, acting, total_of
from robot_model import Robot

__all__ = ["BLOCKS", "HELD_OUT", "MANY", "Block", "Columns", "Data", "blocks_of", "held_out_windows"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Fold of blocks that are never fitted.
HELD_OUT = -1
#: Stretches into which a recording is cut, each a fold, and blocks per stretch. A block is long compared with
#: the correlation time of the residual.
STRETCHES, BLOCKS = 8, 5
#: Stretches held out where no recording is: separated from each other and from both ends.
OWN_HELD_OUT = (2, 6)
#: With at least this many recordings, each is one fold: the others still cover the motion.
MANY = 5


@dataclass(frozen=True)
class Block:
    """Consecutive rows of one recording that are scored together.

    Attributes:
        run: number of the recording.
        rows: its rows.
        fold: number of the fold, whose blocks are left out together; `HELD_OUT` for blocks never fitted.
        count: number of rows compared in each channel, shape (n,).
    """

    run: int
    rows: slice
    fold: int
    count: Array


class Columns(Protocol):
    """Contributions of terms to the rows, and their derivatives by the terms' parameters."""

    def prepare(self, terms: Sequence[Term], run: int) -> None:
        """Compute the columns of several terms along one recording: cheaper than one at a time."""

    def acting(self, term: Term, run: int) -> tuple[Places, Array]:
        """The channels to which a term contributes, and its columns there, zero where nothing is compared.

        Args:
            term: the effect.
            run: number of the recording.

        Returns:
            Shapes (a,) and (K, a, 1 + P): the contribution, then its derivatives by the estimated parameters.
        """

    def contributed(self, terms: Sequence[Term], run: int) -> Array:
        """Summed contributions of terms to one recording, zero where nothing is compared, shape (K, n)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Data(ABC):
    """The data to which hypotheses are fitted and by which they are judged: n channels, K rows a recording.

    Attributes:
        robot: the nominal robot.
        joints: name of each channel's joint, or of the channel.
        layout: parameters of the standard model.
        file_values: values of these parameters in the robot file, shape (X,).
        designs: derivatives of the rows by these parameters, one array (K, n, X) for each recording, the
            fitted ones first; zero where nothing is compared.
        blocks: of all recordings.
        size: rms of each recorded channel, shape (n,).
        noise: rms of the sensor noise in each channel, shape (n,).
        error: rms of the error of any model in each channel, which no hypothesis explains, shape (n,).
        independent: independent samples per row: a low-pass passes two per period of its cut-off.
        given: effects of the robot file that are not parameters of the standard model, and their modifiers;
            a law that contains Coulomb friction holds that of the standard model fixed.
    """

    robot: Robot
    joints: tuple[str, ...]
    layout: Layout
    file_values: Array
    designs: tuple[Array, ...]
    blocks: tuple[Block, ...]
    size: Array
    noise: Array
    error: Array
    independent: float
    given: tuple[Candidate, ...] = ()
    _normals: dict[int | None, Normal] = field(default_factory=dict, init=False, repr=False)

    @property
    @abstractmethod
    def terms(self) -> Columns:
        """Columns of terms along the recordings."""

    @property
    def start(self) -> Array:
        """Starting values of the parameters of the standard model, shape (X,)."""
        return self.layout.start

    @property
    def sigma(self) -> Array:
        """Starting value of the rms residual of each channel, shape (n,)."""
        return self.size

    @property
    def least(self) -> Array:
        """Least rms residual of each channel in a fit, shape (n,)."""
        return np.zeros_like(self.size)

    @abstractmethod
    def time(self, run: int) -> Array:
        """Times of the rows of one recording [s], shape (K,)."""

    @abstractmethod
    def counted(self, run: int) -> Mask:
        """Mask of the rows of one recording that are compared, shape (K, n)."""

    def samples(self, run: int) -> Array:
        """Number of samples that each row of one recording counts as, 0 to 1, shape (K, n)."""
        return self.counted(run).astype(float)

    @abstractmethod
    def target(self, run: int) -> Array:
        """Values to be fitted in one recording, zero where nothing is compared, shape (K, n)."""

    @abstractmethod
    def nominal(self, run: int) -> Array:
        """Prediction of the robot file for one recording, zero where nothing is compared, shape (K, n)."""

    @abstractmethod
    def candidates(
        self, hypothesis: Hypothesis, parameters: Array, residual: Sequence[Array]
    ) -> list[Candidate]:
        """Candidates that may be added to a hypothesis.

        Args:
            hypothesis: the fitted hypothesis.
            parameters: its estimates of the standard model's parameters, shape (X,).
            residual: of the fit in each fitted recording, zero where nothing is fitted, shape (K, n) each.
        """

    @property
    def width(self) -> float:
        """Relative width of the prior of bodies."""
        return 1.0

    @property
    def timing(self) -> tuple[str, ...]:
        """Name of the delay common to all channels, if there is such a parameter."""
        return ()

    @property
    def delays(self) -> tuple[str, ...]:
        """Names of the additional delays of single channels."""
        return ()

    @property
    def further(self) -> tuple[str, ...]:
        """Names of parameters with a value in the robot file, other than those of joints and bodies."""
        return ()

    @property
    def orders(self) -> Array:
        """Number of distinguishable angular orders of a wave over position in each channel, shape (n,).

        One where candidates account for it themselves (`Term.further`).
        """
        return np.ones_like(self.size)

    @property
    def laws(self) -> tuple[Candidate, ...]:
        """The effects of `given` whose contribution is not yet subtracted from the rows."""
        return ()

    @property
    def about_numbers(self) -> Array:
        """Standard model parameters at which the rows are linearised, shape (X,)."""
        return np.zeros_like(self.file_values)

    def about(self, parameters: Array) -> Self:
        """The same rows, linearised at other parameters of the standard model, shape (X,)."""
        return self

    def with_bodies(self, parameters: Array, terms: Sequence[Term]) -> Array:
        """Standard model parameters with the contributions of terms added to the bodies, shape (X,)."""
        return parameters

    def is_near(self, one: Array, other: Array, terms: Sequence[Term] = ()) -> bool:
        """Whether rows linearised at the first parameters, (X,), are valid at the second with these terms."""
        return True

    def cut(self, terms: Sequence[Term]) -> Array:
        """Number of rows of each block and channel that terms saturate, shape (B, n)."""
        return np.zeros_like(self.counts)

    def columns(self, term: Term, run: int) -> Array:
        """Columns of a term along one recording, zero where nothing is compared, shape (K, n, 1 + P).

        Args:
            term: the effect.
            run: number of the recording.
        """
        active, values = self.terms.acting(term, run)
        found = np.zeros((*self.counted(run).shape, 1 + len(term.free)))
        found[:, active] = values
        return found

    @cached_property
    def active(self) -> tuple[Places, ...]:
        """Indices of the parameters on which the rows of each channel depend, shape (u,) each."""
        return acting(self.designs)

    @cached_property
    def active_columns(self) -> tuple[tuple[Array, ...], ...]:
        """Columns of the parameters `active` in each recording and channel, shape (K, u) each."""
        return tuple(
            tuple(np.ascontiguousarray(design[:, k, own]) for k, own in enumerate(self.active))
            for design in self.designs
        )

    def normal(self, fold: int | None = None) -> Normal:
        """Normal equations of the standard model over the rows of one fold, or of all fitted folds."""
        if fold not in self._normals:
            if fold is None:
                self._normals[fold] = total_of([self.normal(each) for each in self.folds])
            else:
                parts = []
                for run, rows in self.stretches(fold):
                    columns = [own[rows] for own in self.active_columns[run]]
                    count = self.samples(run)[rows].sum(axis=0)
                    target = self.target(run)[rows]
                    parts.append(Normal.of(self.active, columns, target, count, self.file_values.size))
                self._normals[fold] = total_of(parts)
        return self._normals[fold]

    def stretches(self, fold: int | None = None) -> list[tuple[int, slice]]:
        """Recordings and consecutive rows of one fold, or of all fitted folds."""
        found: list[tuple[int, slice]] = []
        for block in self.blocks:
            if block.fold == HELD_OUT or fold not in (None, block.fold):
                continue
            if found and found[-1][0] == block.run and found[-1][1].stop == block.rows.start:
                found[-1] = block.run, slice(found[-1][1].start, block.rows.stop)
            else:
                found.append((block.run, block.rows))
        return found

    @cached_property
    def fold(self) -> NDArray[np.int_]:
        """Fold of each block, shape (B,)."""
        return np.array([block.fold for block in self.blocks])

    @property
    def folds(self) -> tuple[int, ...]:
        """Numbers of the fitted folds."""
        return tuple(sorted({block.fold for block in self.blocks} - {HELD_OUT}))

    @cached_property
    def fitted_blocks(self) -> NDArray[np.bool_]:
        """Mask of the blocks that are fitted, shape (B,)."""
        return self.fold != HELD_OUT

    @property
    def fitted(self) -> int:
        """Number of recordings that are fitted."""
        return 1 + max(block.run for block in self.blocks if block.fold != HELD_OUT)

    @cached_property
    def counts(self) -> Array:
        """Number of rows compared in each block and channel, shape (B, n)."""
        return np.array([block.count for block in self.blocks])

    def fitted_rows(self, run: int) -> NDArray[np.bool_]:
        """Mask of the rows of a recording that are fitted, shape (K,)."""
        found = np.zeros(self.time(run).size, dtype=bool)
        for block in self.blocks:
            if block.run == run and block.fold != HELD_OUT:
                found[block.rows] = True
        return found


def blocks_of(counted: Sequence[Mask] | Sequence[Array], fitted: int) -> tuple[Block, ...]:
    """Blocks of all recordings; without held-out recordings a quarter of each one is held out.

    Args:
        counted: rows of each recording that are compared, or the number of samples that they count as, shape
            (K, n) each.
        fitted: number of recordings that are fitted; the others are held out.
    """
    found: list[Block] = []
    for i, own in enumerate(counted):
        cuts = np.linspace(0, len(own), STRETCHES * BLOCKS + 1).astype(int)
        for b, (first, last) in enumerate(pairwise(cuts)):
            fold = _fold(i, b // BLOCKS, fitted, fitted < len(counted))
            found.append(Block(i, slice(first, last), fold, own[first:last].sum(axis=0).astype(float)))
    return tuple(found)


def held_out_windows(time: Array) -> tuple[tuple[float, float], ...]:
    """Time intervals of a recording that are held out where no recording is [s].

    Args:
        time: times of the rows in the band [s], shape (K,).
    """
    cuts = np.linspace(0, time.size, STRETCHES * BLOCKS + 1).astype(int)
    return tuple(
        (float(time[cuts[s * BLOCKS]]), float(time[cuts[(s + 1) * BLOCKS] - 1]))
        for s in OWN_HELD_OUT
        if cuts[(s + 1) * BLOCKS] > cuts[s * BLOCKS]
    )


def _fold(run: int, stretch: int, fitted: int, validated: bool) -> int:
    if run >= fitted or (not validated and stretch in OWN_HELD_OUT):
        return HELD_OUT
    return run if fitted >= MANY else run * STRETCHES + stretch
