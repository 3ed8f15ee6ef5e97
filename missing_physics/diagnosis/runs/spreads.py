"""How sure runs are of numbers: of noise, of blocks of time, of a fit's end, of held-out recordings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs.fit import RunFit, With, at_step, errors_of, lengths, way_of

__all__ = ["spread_of"]

Array = NDArray[np.float64]

#: Where this multiple of the noise's energy is left held-out recordings are not asked for numbers.
FAR = 100.0
#: A held-out recording has a say on a number that it alone tells to so many of its standard deviations.
KNOWS = 3.0


def spread_of(replay: Replay, fit: RunFit, with_them: With) -> Array:
    """Standard deviations of a fit's numbers, shape (K,), wider where held-out recordings want others.

    And where a fit ended before it had arrived, by the step that it had still to go.
    """
    spread = np.hypot(fit.spread, np.where(fit.told, np.abs(fit.step), 0.0))
    if fit.energy > FAR * fit.errors.size:
        return np.asarray(spread)
    return np.asarray(np.hypot(spread, np.sqrt(_excess(replay, fit, with_them))))


def _excess(replay: Replay, fit: RunFit, with_them: With) -> Array:
    """Variance of numbers that held-out recordings show beyond what noise makes of them, shape (K,).

    To first order, by how far each recording that took no part in a fit would move the numbers. What engines
    differ by, and what a law is not quite, moves them by other amounts along another motion.
    """
    found, told = np.zeros(fit.told.size), fit.told
    asked = np.zeros(int(told.sum()))
    held_out = range(replay.fitted, len(replay.asked))
    for which in held_out if told.any() else ():
        errors = errors_of(replay, with_them(fit.terms), recordings=(which,))
        columns = []
        for k in np.flatnonzero(told):
            step = max((fit.steps[k], -fit.steps[k]), key=lambda by: abs(way_of(fit.terms, int(k), by)))
            moved = errors_of(
                replay, with_them(at_step(fit.terms, int(k), step)), keep=False, recordings=(which,)
            )
            if errors is not None and moved is not None:
                columns.append((moved - errors) / way_of(fit.terms, int(k), step))
        if errors is None or len(columns) < int(told.sum()):
            continue
        size = lengths(np.stack(columns, axis=1))
        whole = np.stack(columns, axis=1) / size
        step_to = np.linalg.lstsq(whole, errors, rcond=1e-8)[0] / size
        noise = np.diagonal(np.linalg.pinv(whole.T @ whole)) / size**2
        knows = noise <= (KNOWS * fit.spread[told]) ** 2
        found[told] += np.where(knows, np.maximum(step_to**2 - noise, 0.0), 0.0)
        asked += knows
    found[told] /= np.maximum(asked, 1.0)
    return found
