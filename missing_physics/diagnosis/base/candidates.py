"""Which effects may be added to a hypothesis on the rates of a free base, and where their fits start."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from missing_physics.diagnosis.base.columns import BaseColumns
from missing_physics.diagnosis.base.rates import Rates
from missing_physics.hypotheses import Candidate, Term
from missing_physics.standard import MODEL_ERROR
from reference_model.effects.base import Effect, Extent, Parameter, SensorEffect
from reference_model.effects.catalogue import catalogue

__all__ = ["candidates", "on_board"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Starts that are compared at further values of the other numbers, that far from what is known of these, in
#: standard deviations.
NEAR, CORNER = 8, 0.5


def on_board() -> tuple[Effect, ...]:
    """Effects of the catalogue that turn a base otherwise, and that gyros show."""
    return tuple(effect for effect in catalogue().values() if effect.turns_base)


def of_gyros() -> tuple[Effect, ...]:
    """Errors of gyros."""
    every = (effect for effect in catalogue().values() if isinstance(effect, SensorEffect))
    return tuple(effect for effect in every if "angular_velocity" in effect.searched_in)


def candidates(
    runs: Sequence[Rates],
    terms: Sequence[Term],
    left: Sequence[Array],
    seen: Sequence[Mask],
    columns: BaseColumns,
    error: Array,
) -> Iterator[Candidate]:
    """Every effect that gyros could show, with each of its sets of starting values.

    Args:
        runs: rates of each fitted recording.
        terms: those that the hypothesis has.
        left: its residual, zero where nothing is fitted, shape (K, m) each [rad/s].
        seen: which rows are fitted, shape (K, 1) each.
        columns: of terms.
        error: of any model, rms in each channel, shape (m,) [rad/s].
    """
    present = {term.key for term in terms}
    for effect in on_board():
        if (effect.id, "base") not in present:
            yield from map(Candidate, _leading(list(_starts(effect, runs, left)), left, seen, columns, error))
    for channel in runs[0].channels:
        for law in of_gyros():
            if (law.id, channel) not in present:
                yield Candidate(Term.of(law, channel, {p.name: 0.0 for p in law.parameters}))
    for term in terms:
        for name in sorted(term.optional - set(term.added)):
            yield Candidate(term.having(name), instead=term.key)


def _starts(effect: Effect, runs: Sequence[Rates], left: Sequence[Array]) -> Iterator[Term]:
    """An effect with its starting values, lacking what it may lack."""
    given = {p.name: p.typical if p.absent is None else p.absent for p in effect.estimated}
    optional = frozenset(p.name for p in effect.estimated if _may_lack(p))
    for values in dict.fromkeys(tuple(start.items()) for start in effect.starts(_extent(runs, left))):
        term = Term.of(effect, "base", {**given, **dict(values)}, optional=optional)
        for name in optional:
            term = term.lacking(name)
        yield term


def _may_lack(p: Parameter) -> bool:
    """Whether the effect is the same, only simpler, without a number."""
    return p.absent is not None and not p.linear and p.default == p.absent


def _extent(runs: Sequence[Rates], left: Sequence[Array]) -> Extent:
    """What the recordings cover at the base."""
    time, speed = runs[0].time, np.concatenate([np.linalg.norm(own.turning, axis=1) for own in runs])
    return Extent(
        position=(0.0, 0.0),
        speed=float(speed.max()),
        slow=float(np.quantile(speed, 0.1)),
        torque=0.0,
        residual=float(np.sqrt(np.mean(np.concatenate(list(left)) ** 2))),
        duration=float(time[-1] - time[0]),
        sample_time=1.0 / runs[0].low_pass.rate,
    )


def _leading(
    starts: Sequence[Term],
    left: Sequence[Array],
    seen: Sequence[Mask],
    columns: BaseColumns,
    error: Array,
) -> Iterator[Term]:
    """Starts of an effect; where one number is its size, those that explain most, fitted to the residual.

    What shows is that size times what the others make of it, so that a linear fit of all columns at a small
    size tells where the others are to be looked for. Nothing is where the residual is no larger than the
    error of any model.
    """
    sizes = [p.name for p in starts[0].free if p.absent is not None and not p.linear]
    if len(sizes) != 1:
        yield from starts
        return
    square = np.sum([(own**2).sum(axis=0) for own in left], axis=0)
    if np.all(square < error**2 * np.sum([rows.sum() for rows in seen])):
        return
    priors, effect = starts[0].effect.priors, starts[0].effect
    about = {name for name, (middle, _) in priors.items() if effect.parameter(name).default == middle}
    residual, found = _Residual(left, seen, columns), list[tuple[float, Term, dict[str, float]]]()
    for round_ in range(2):
        fixed = [_only(start, about) for start in starts]
        for i in range(len(left)):
            columns.prepare(fixed, i)
        found += [
            (gain, start, asked) for start in fixed for gain, asked in [_asked(start, sizes[0], residual)]
        ]
        found.sort(key=lambda one: -one[0])
        if round_ == 0:  # what shows is of second order in the others
            places = [
                {
                    name: priors[name][0] + CORNER * sign * priors[name][1]
                    for name, sign in zip(sorted(about), signs)
                }
                for signs in product((-1.0, 1.0), repeat=len(about))
            ]
            starts = [term.moved(place) for place in places for _, term, _ in found[:NEAR] if about]
    _, term, asked = found[0]
    term = residual.fitted(replace(term, limits=()).moved(asked))
    if np.all(np.isfinite(residual.columns(term))):
        yield term


def _only(term: Term, names: Collection[str]) -> Term:
    """A term of which only some numbers are estimated."""
    held = ((p.name, term.parameters[p.name]) for p in term.effect.estimated if p.name not in names)
    return replace(term, limits=tuple((name, value, value) for name, value in held))


class _Residual:
    """What one term is to explain in the fitted rows of all recordings; R rows.

    Attributes:
        wanted: shape (R,).
        independent: how many of them tell different things.
    """

    def __init__(self, left: Sequence[Array], seen: Sequence[Mask], columns: BaseColumns) -> None:
        self._seen, self._columns = seen, columns
        self.wanted = np.concatenate([own.reshape(-1) for own in left])
        self.independent = sum(own.size / _memory(own) for own in left)

    def columns(self, term: Term) -> Array:
        """Of a term, shape (R, 1 + P)."""
        made = [self._columns.acting(term, i)[1] * rows[:, :, None] for i, rows in enumerate(self._seen)]
        return np.concatenate([own.reshape(-1, own.shape[2]) for own in made])

    def fitted(self, term: Term) -> Term:
        """A term with its numbers fitted, with priors of its effect, by least squares within their ranges.

        The second time with the noise that the first leaves; steps that explain less than the error of any
        model are not worth more.
        """
        names = [p.name for p in term.free]
        ends = [[p.lower for p in term.free], [p.upper for p in term.free]]
        middle, spread = np.array([term.effect.priors.get(name, (0.0, np.inf)) for name in names]).T

        @lru_cache(maxsize=1)
        def at(numbers: tuple[float, ...]) -> tuple[Array, Array]:
            made = self.columns(term.moved(dict(zip(names, numbers))))
            apart = np.append(self.wanted - made[:, 0], noise * (np.array(numbers) - middle) / spread)
            return apart, np.concatenate([-made[:, 1:], np.diag(noise / spread)])

        numbers = np.array([term.parameters[name] for name in names])
        left = self.wanted
        for _ in range(2):
            noise = float(np.linalg.norm(left) / np.sqrt(self.independent))
            at.cache_clear()
            if not np.all(np.isfinite(at(tuple(numbers))[0])):
                break
            found = least_squares(
                lambda x: at(tuple(x))[0],
                numbers,
                lambda x: at(tuple(x))[1],
                bounds=ends,
                x_scale="jac",
                ftol=MODEL_ERROR,
                method="dogbox",
            )
            numbers, left = found.x, found.fun[: self.wanted.size]
        return term.moved(dict(zip(names, numbers)))


def _memory(left: Array) -> float:
    """Rows in which a residual forgets itself, by the positive part of its autocorrelation."""
    power = np.sum(np.abs(np.fft.rfft(left - left.mean(axis=0), 2 * len(left), axis=0)) ** 2, axis=1)
    rho = np.fft.irfft(power)[: len(left)]
    ends = np.flatnonzero(rho <= 0.0)
    return max(2.0 * float(rho[: ends[0] if ends.size else rho.size].sum()) / max(float(rho[0]), 1e-300), 1.0)


def _asked(start: Term, size: str, residual: _Residual) -> tuple[float, dict[str, float]]:
    """How much of a residual the columns of a start explain, and the size and numbers that they ask for.

    Where the columns do not tell it by themselves, the squares of size times what the others differ by, in
    their standard deviations, have the square of the size as their mean.
    """
    columns, wanted = residual.columns(start), residual.wanted
    if not np.all(np.isfinite(columns)) or not columns.any():
        return -np.inf, {}
    length = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    found = np.linalg.lstsq(columns / length, wanted, rcond=1e-6)[0] / length
    gain = float(wanted @ columns @ found)
    here, priors = start.parameters[size], start.effect.priors
    beside = {p.name: float(value) for p, value in zip(start.free, found[1:])}
    if not beside:
        return gain, {}
    parts = [value / priors[name][1] for name, value in beside.items()]
    large = float(found[0])
    if large <= 0.0 or max(map(abs, parts)) > 2.0 * large:
        large = max(float(np.sqrt(np.mean(np.square(parts)))), 1e-300)
    moved = {name: start.parameters[name] + value / large for name, value in beside.items()}
    return gain, {size: large * here, **moved}
