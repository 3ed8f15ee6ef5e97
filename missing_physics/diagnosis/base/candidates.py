"""Effects that may be added to a hypothesis on the rates of a free base, and their starting values."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from missing_physics.diagnosis.base.columns import BaseColumns
from missing_physics.hypotheses import Candidate, Term
from missing_physics.motion.base.rates import Rates
from missing_physics.standard import MODEL_ERROR
from reference_model.effects.base import Effect, Extent, Parameter, SensorEffect
from reference_model.effects.catalogue import catalogue

__all__ = ["candidates", "on_board"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Number of starts that are tried again with the other parameters moved away from their prior means, and by
#: how many standard deviations.
NEAR, CORNER = 8, 0.5


def on_board() -> tuple[Effect, ...]:
    """Effects of the catalogue that change the rates of a free base."""
    return tuple(effect for effect in catalogue().values() if effect.turns_base)


def of_gyros() -> tuple[Effect, ...]:
    """Sensor errors of gyros."""
    every = (effect for effect in catalogue().values() if isinstance(effect, SensorEffect))
    return tuple(effect for effect in every if "angular_velocity" in effect.searched_in)


def candidates(
    runs: Sequence[Rates],
    terms: Sequence[Term],
    residuals: Sequence[Array],
    fitted_rows: Sequence[Mask],
    columns: BaseColumns,
    error: Array,
) -> Iterator[Candidate]:
    """All effects that gyros could show, each with all its sets of starting values.

    Args:
        runs: rates of each fitted recording.
        terms: those of the hypothesis.
        residuals: of the hypothesis, zero where nothing is fitted, shape (K, m) each [rad/s].
        fitted_rows: mask of the rows that are fitted, shape (K, 1) each.
        columns: of terms.
        error: rms of the error of any model in each channel, shape (m,) [rad/s].
    """
    present = {term.key for term in terms}
    for effect in on_board():
        if (effect.id, "base") not in present:
            yield from map(
                Candidate,
                _best_starts(list(_starts(effect, runs, residuals)), residuals, fitted_rows, columns, error),
            )
    for channel in runs[0].channels:
        for law in of_gyros():
            if (law.id, channel) not in present:
                yield Candidate(Term.of(law, channel, {p.name: 0.0 for p in law.parameters}))
    for term in terms:
        for name in sorted(term.optional - set(term.added)):
            yield Candidate(term.having(name), instead=term.key)


def _starts(effect: Effect, runs: Sequence[Rates], residuals: Sequence[Array]) -> Iterator[Term]:
    """An effect with its sets of starting values, without its optional parameters."""
    given = {p.name: p.typical if p.absent is None else p.absent for p in effect.estimated}
    optional = frozenset(p.name for p in effect.estimated if _is_optional(p))
    for values in dict.fromkeys(tuple(start.items()) for start in effect.starts(_extent(runs, residuals))):
        term = Term.of(effect, "base", {**given, **dict(values)}, optional=optional)
        for name in optional:
            term = term.lacking(name)
        yield term


def _is_optional(p: Parameter) -> bool:
    """Whether the effect without a parameter is a simpler version of the same effect."""
    return p.absent is not None and not p.linear and p.default == p.absent


def _extent(runs: Sequence[Rates], residuals: Sequence[Array]) -> Extent:
    """Range that the recordings cover at the base."""
    time, speed = runs[0].time, np.concatenate([np.linalg.norm(own.turning, axis=1) for own in runs])
    return Extent(
        position=(0.0, 0.0),
        speed=float(speed.max()),
        slow=float(np.quantile(speed, 0.1)),
        torque=0.0,
        residual=float(np.sqrt(np.mean(np.concatenate(list(residuals)) ** 2))),
        duration=float(time[-1] - time[0]),
        sample_time=1.0 / runs[0].low_pass.rate,
    )


def _best_starts(
    starts: Sequence[Term],
    residuals: Sequence[Array],
    fitted_rows: Sequence[Mask],
    columns: BaseColumns,
    error: Array,
) -> Iterator[Term]:
    """Starts of an effect; if one parameter is its size, only the best one, fitted to the residual.

    The contribution is that size times a function of the other parameters. So a linear fit of all columns at
    a small size indicates values of the others. Nothing is yielded if the residual is below the error of any
    model.
    """
    sizes = [p.name for p in starts[0].free if p.absent is not None and not p.linear]
    if len(sizes) != 1:
        yield from starts
        return
    square = np.sum([(own**2).sum(axis=0) for own in residuals], axis=0)
    if np.all(square < error**2 * np.sum([rows.sum() for rows in fitted_rows])):
        return
    priors, effect = starts[0].effect.priors, starts[0].effect
    varied = {name for name, (middle, _) in priors.items() if effect.parameter(name).default == middle}
    residual, found = _Residual(residuals, fitted_rows, columns), list[tuple[float, Term, dict[str, float]]]()
    for round_ in range(2):
        fixed = [_only(start, varied) for start in starts]
        for i in range(len(residuals)):
            columns.prepare(fixed, i)
        found += [
            (gain, start, implied)
            for start in fixed
            for gain, implied in [_implied(start, sizes[0], residual)]
        ]
        found.sort(key=lambda one: -one[0])
        if round_ == 0:  # the contribution is of second order in the others
            places = [
                {
                    name: priors[name][0] + CORNER * sign * priors[name][1]
                    for name, sign in zip(sorted(varied), signs)
                }
                for signs in product((-1.0, 1.0), repeat=len(varied))
            ]
            starts = [term.moved(place) for place in places for _, term, _ in found[:NEAR] if varied]
    _, term, implied = found[0]
    term = residual.fitted(replace(term, limits=()).moved(implied))
    if np.all(np.isfinite(residual.columns(term))):
        yield term


def _only(term: Term, names: Collection[str]) -> Term:
    """A term with only some of its parameters estimated."""
    held = ((p.name, term.parameters[p.name]) for p in term.effect.estimated if p.name not in names)
    return replace(term, limits=tuple((name, value, value) for name, value in held))


class _Residual:
    """The residual that one term is fitted to, in the fitted rows of all recordings; R rows.

    Attributes:
        wanted: the residual, shape (R,).
        independent: number of independent samples.
    """

    def __init__(self, residuals: Sequence[Array], fitted_rows: Sequence[Mask], columns: BaseColumns) -> None:
        self._fitted_rows, self._columns = fitted_rows, columns
        self.wanted = np.concatenate([own.reshape(-1) for own in residuals])
        self.independent = sum(own.size / _correlation_length(own) for own in residuals)

    def columns(self, term: Term) -> Array:
        """Columns of a term, shape (R, 1 + P)."""
        made = [
            self._columns.acting(term, i)[1] * rows[:, :, None] for i, rows in enumerate(self._fitted_rows)
        ]
        return np.concatenate([own.reshape(-1, own.shape[2]) for own in made])

    def fitted(self, term: Term) -> Term:
        """A term with its parameters fitted by bounded least squares, with the priors of its effect.

        Fitted twice, the second time with the noise level of the first fit's residual. Iterations end when
        they improve the fit by less than the error of any model.
        """
        names = [p.name for p in term.free]
        ends = [[p.lower for p in term.free], [p.upper for p in term.free]]
        middle, spread = np.array([term.effect.priors.get(name, (0.0, np.inf)) for name in names]).T

        @lru_cache(maxsize=1)
        def at(numbers: tuple[float, ...]) -> tuple[Array, Array]:
            made = self.columns(term.moved(dict(zip(names, numbers))))
            stacked = np.append(self.wanted - made[:, 0], noise * (np.array(numbers) - middle) / spread)
            return stacked, np.concatenate([-made[:, 1:], np.diag(noise / spread)])

        numbers = np.array([term.parameters[name] for name in names])
        residuals = self.wanted
        for _ in range(2):
            noise = float(np.linalg.norm(residuals) / np.sqrt(self.independent))
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
            numbers, residuals = found.x, found.fun[: self.wanted.size]
        return term.moved(dict(zip(names, numbers)))


def _correlation_length(residuals: Array) -> float:
    """Correlation length of a residual in rows, from the positive part of its autocorrelation."""
    power = np.sum(
        np.abs(np.fft.rfft(residuals - residuals.mean(axis=0), 2 * len(residuals), axis=0)) ** 2, axis=1
    )
    rho = np.fft.irfft(power)[: len(residuals)]
    ends = np.flatnonzero(rho <= 0.0)
    return max(2.0 * float(rho[: ends[0] if ends.size else rho.size].sum()) / max(float(rho[0]), 1e-300), 1.0)


def _implied(start: Term, size: str, residual: _Residual) -> tuple[float, dict[str, float]]:
    """Gain of a linear fit of a start's columns to the residual, and the size and parameters it implies.

    If the size does not follow from its own column, it is the rms of the others' coefficients in prior
    standard deviations: each is the size times a change of about one.
    """
    columns, wanted = residual.columns(start), residual.wanted
    if not np.all(np.isfinite(columns)) or not columns.any():
        return -np.inf, {}
    length = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    found = np.linalg.lstsq(columns / length, wanted, rcond=1e-6)[0] / length
    gain = float(wanted @ columns @ found)
    here, priors = start.parameters[size], start.effect.priors
    others = {p.name: float(value) for p, value in zip(start.free, found[1:])}
    if not others:
        return gain, {}
    parts = [value / priors[name][1] for name, value in others.items()]
    large = float(found[0])
    if large <= 0.0 or max(map(abs, parts)) > 2.0 * large:
        large = max(float(np.sqrt(np.mean(np.square(parts)))), 1e-300)
    moved = {name: start.parameters[name] + value / large for name, value in others.items()}
    return gain, {size: large * here, **moved}
