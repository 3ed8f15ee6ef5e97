"""Residuals of hypotheses on the rates of a free base: errors and series."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.base.data import BaseData
from missing_physics.diagnosis.further.errors import Channel, fits_of, series_of
from missing_physics.hypotheses import Term
from missing_physics.inference import Fit
from missing_physics.results.result import ChannelFit, ChannelSeries, Finding
from reference_model.effects.base import SensorEffect
from reference_model.passive.prescribed import prescribed
from robot_model import Robot

__all__ = ["errors_and_series", "residual_of", "residual_of_file", "stated_terms"]

Array = NDArray[np.float64]


def stated_terms(fit: Fit, findings: tuple[Finding, ...]) -> tuple[Term, ...]:
    """Terms of a fit that are reported as findings."""
    stated = {(finding.effect, finding.location) for finding in findings}
    return tuple(term for term in fit.hypothesis.terms if term.key in stated)


def residual_of(data: BaseData, fit: Fit, terms: tuple[Term, ...], run: int) -> Array:
    """Residual with the robot file's bodies and some terms, shape (K, m) [rad/s].

    Nuisance parameters and initial momenta are those of the fit.
    """
    numbers = data.file_values.copy()
    places = [data.layout.names.index(name) for name in data.further]
    numbers[places] = fit.parameters[places]
    return data.target(run) - data.designs[run] @ numbers - data.terms.contributed(terms, run)


def residual_of_file(data: BaseData, fit: Fit, terms: tuple[Term, ...], file: Robot, run: int) -> Array:
    """Residual of a robot file and of those terms that are gyro errors, shape (K, m) [rad/s]."""
    own = data.runs[run]
    motion = own.dynamics.motion
    made = prescribed(file, motion.time, motion.position, motion.velocity, motion.acceleration)
    rates = np.column_stack([made[channel] for channel in own.channels])
    change = own.reduce(rates - own.predicted) * data.counted(run)
    of_gyros = tuple(term for term in terms if isinstance(term.effect, SensorEffect))
    return residual_of(data, fit, of_gyros, run) - data.quiet[run].removed(change)


def errors_and_series(
    data: BaseData, before: Sequence[Array], after: Sequence[Array]
) -> tuple[dict[str, ChannelFit], tuple[ChannelSeries, ...]]:
    """Errors and series of the nominal and of the written robot file; rates about their means."""
    channels = [Channel(name, "rad/s", "base") for name in data.joints]
    measured = [own.reduce(own.measured - own.measured.mean(axis=0)) for own in data.runs]

    def shown(run: int, k: int) -> dict[str, Any]:
        return {
            "recording": data.runs[run].dynamics.motion.source,
            "counted": data.counted(run)[:, k],
        }

    series = series_of(data, channels, measured, before, after, shown)
    return fits_of(data, channels, before, after), series
