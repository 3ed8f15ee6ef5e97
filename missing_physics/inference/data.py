"""Rows of recordings, cut into folds for cross-validation: all that fits and scores need to know of them.

Rows are of channels: torques of joints (`missing_physics.inference.torques`), or differences between two
encoders of a joint (`missing_physics.diagnosis.gear`).
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

__all__ = ["HELD_OUT", "MANY", "Block", "Columns", "Data", "blocks_of", "held_out_windows"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Fold of blocks that are never fitted.
HELD_OUT = -1
#: Stretches into which a recording is cut, each of them a fold, and blocks per stretch: long compared with
#: the correlation time of the residual.
STRETCHES, BLOCKS = 8, 5
#: Stretches that are held out where no recording is held out: apart from each other and from both ends.
OWN_HELD_OUT = (2, 6)
#: With at least this many recordings, each of them is one fold: the others then still cover the motion.
MANY = 5


@dataclass(frozen=True)
class Block:
    """Rows of one recording that are predicted together.

    Attributes:
        run: number of the recording.
        rows: which of its rows.
        fold: blocks of one fold are left out together; `HELD_OUT` for those that are never fitted.
        count: rows that are compared in each channel, shape (n,).
    """

    run: int
    rows: slice
    fold: int
    count: Array


class Columns(Protocol):
    """What terms contribute to the rows, and its derivatives."""

    def prepare(self, terms: Sequence[Term], run: int) -> None:
        """Compute the columns of several terms along one recording, which costs less than one at a time."""

    def acting(self, term: Term, run: int) -> tuple[Places, Array]:
        """The channels in which a term acts, and its columns there, zero where nothing is compared.

        Args:
            term: the effect.
            run: number of the recording.

        Returns:
            Shapes (a,) and (K, a, 1 + P): the contribution, then its derivatives by the estimated parameters.
        """

    def contributed(self, terms: Sequence[Term], run: int) -> Array:
        """Sum of what terms contribute to one recording, zero where nothing is compared, shape (K, n)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Data(ABC):
    """The data to which hypotheses are fitted and by which they are judged: n channels, K rows a recording.

    Attributes:
        robot: the nominal robot.
        joints: name of each channel's joint.
        layout: parameters of the standard model.
        filed: values of these parameters in the robot file, shape (X,).
        designs: derivatives of the rows by these parameters, one array (K, n, X) for each recording, the
            fitted ones first; zero where nothing is compared.
        blocks: of all recordings.
        size: rms of what each channel recorded, shape (n,).
        noise: rms in each channel that sensors leave, shape (n,).
        error: that no hypothesis explains, rms in each channel, shape (n,).
        independent: samples in a row: a low-pass passes two in a period of its cut-off.
        given: effects of the robot file that are no parameters of the standard model, and what multiplies
            them; a law that contains Coulomb friction holds that of the standard model.
    """

    robot: Robot
    joints: tuple[str, ...]
    layout: Layout
    filed: Array
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
        """Parameters of the standard model where fits begin, shape (X,)."""
        return self.layout.start

    @property
    def sigma(self) -> Array:
        """rms residual of each channel where fits begin, shape (n,)."""
        return self.size

    @abstractmethod
    def time(self, run: int) -> Array:
        """Of the rows of one recording [s], shape (K,)."""

    @abstractmethod
    def counted(self, run: int) -> Mask:
        """Which rows of one recording are compared, shape (K, n)."""

    @abstractmethod
    def target(self, run: int) -> Array:
        """What the parameters predict in one recording, zero where nothing is compared, shape (K, n)."""

    @abstractmethod
    def nominal(self, run: int) -> Array:
        """What the robot file predicts in one recording, zero where nothing is compared, shape (K, n)."""

    @abstractmethod
    def candidates(self, hypothesis: Hypothesis, numbers: Array, left: Sequence[Array]) -> list[Candidate]:
        """What may be added to a hypothesis.

        Args:
            hypothesis: it.
            numbers: its parameters of the standard model, shape (X,).
            left: its residual in each fitted recording, zero where nothing is fitted, shape (K, n) each.
        """

    @property
    def width(self) -> float:
        """Relative width of the prior of bodies."""
        return 1.0

    @property
    def timing(self) -> tuple[str, ...]:
        """Name of the delay that all channels share, where there is such a parameter."""
        return ()

    @property
    def delays(self) -> tuple[str, ...]:
        """Names of the further delays of single channels."""
        return ()

    @property
    def further(self) -> tuple[str, ...]:
        """Names of parameters that the robot file states beside those of joints and bodies."""
        return ()

    @property
    def orders(self) -> Array:
        """How many angular orders of a wave over position each channel tells apart, shape (n,).

        One where candidates say it themselves (`Term.further`).
        """
        return np.ones_like(self.size)

    @property
    def laws(self) -> tuple[Candidate, ...]:
        """Those of `given` that the rows do not have."""
        return ()

    @property
    def about_numbers(self) -> Array:
        """Parameters of the standard model about which the rows are linearised, shape (X,)."""
        return np.zeros_like(self.filed)

    def about(self, numbers: Array) -> Self:
        """The same rows, linearised about other parameters of the standard model, shape (X,)."""
        return self

    def with_bodies(self, numbers: Array, terms: Sequence[Term]) -> Array:
        """Parameters of the standard model where bodies include what terms add to them, shape (X,)."""
        return numbers

    def is_near(self, one: Array, other: Array, terms: Sequence[Term] = ()) -> bool:
        """Whether rows linearised about the first parameters, (X,), serve for the second with these terms."""
        return True

    def cut(self, terms: Sequence[Term]) -> Array:
        """Rows of each block and channel whose recorded value terms cut off, shape (B, n)."""
        return np.zeros_like(self.counts)

    def columns(self, term: Term, run: int) -> Array:
        """Columns of a term along one recording, zero where nothing is compared, shape (K, n, 1 + P).

        Args:
            term: the effect.
            run: number of the recording.
        """
        acts, values = self.terms.acting(term, run)
        found = np.zeros((*self.counted(run).shape, 1 + len(term.free)))
        found[:, acts] = values
        return found

    @cached_property
    def acts(self) -> tuple[Places, ...]:
        """Parameters on which the rows of each channel depend, shape (u,) each."""
        return acting(self.designs)

    @cached_property
    def own(self) -> tuple[tuple[Array, ...], ...]:
        """Of each run's design, the columns of these parameters in each channel, shape (K, u) each."""
        return tuple(
            tuple(np.ascontiguousarray(design[:, k, own]) for k, own in enumerate(self.acts))
            for design in self.designs
        )

    def normal(self, fold: int | None = None) -> Normal:
        """Normal equations of the standard model over the rows of one fold, or of all that are fitted."""
        if fold not in self._normals:
            if fold is None:
                self._normals[fold] = total_of([self.normal(each) for each in self.folds])
            else:
                parts = []
                for run, rows in self.stretches(fold):
                    columns = [own[rows] for own in self.own[run]]
                    count = self.counted(run)[rows].sum(axis=0).astype(float)
                    target = self.target(run)[rows]
                    parts.append(Normal.of(self.acts, columns, target, count, self.filed.size))
                self._normals[fold] = total_of(parts)
        return self._normals[fold]

    def stretches(self, fold: int | None = None) -> list[tuple[int, slice]]:
        """Runs and consecutive rows of one fold, or of all folds that are fitted."""
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
        """The folds that are fitted."""
        return tuple(sorted({block.fold for block in self.blocks} - {HELD_OUT}))

    @cached_property
    def seen(self) -> NDArray[np.bool_]:
        """Blocks that are fitted, shape (B,)."""
        return self.fold != HELD_OUT

    @property
    def fitted(self) -> int:
        """How many recordings are fitted."""
        return 1 + max(block.run for block in self.blocks if block.fold != HELD_OUT)

    @cached_property
    def counts(self) -> Array:
        """Rows compared in each block and channel, shape (B, n)."""
        return np.array([block.count for block in self.blocks])

    def rows_seen(self, run: int) -> NDArray[np.bool_]:
        """Which rows of a recording are fitted, shape (K,)."""
        found = np.zeros(self.time(run).size, dtype=bool)
        for block in self.blocks:
            if block.run == run and block.fold != HELD_OUT:
                found[block.rows] = True
        return found


def blocks_of(counted: Sequence[Mask], fitted: int) -> tuple[Block, ...]:
    """Blocks of all recordings; a quarter of each fitted one is held out where no recording is.

    Args:
        counted: which rows of each recording are compared, shape (K, n) each.
        fitted: how many of them are fitted; the others are held out.
    """
    found: list[Block] = []
    for i, own in enumerate(counted):
        cuts = np.linspace(0, len(own), STRETCHES * BLOCKS + 1).astype(int)
        for b, (first, last) in enumerate(pairwise(cuts)):
            fold = _fold(i, b // BLOCKS, fitted, fitted < len(counted))
            found.append(Block(i, slice(first, last), fold, own[first:last].sum(axis=0).astype(float)))
    return tuple(found)


def held_out_windows(time: Array) -> tuple[tuple[float, float], ...]:
    """Stretches of a recording that are held out where no recording is [s].

    Args:
        time: of the rows in the band [s], shape (K,).
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
