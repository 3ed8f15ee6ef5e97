"""The result of a diagnosis, and the series from which a report draws it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, is_dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation.band import Band
from missing_physics.results.comparison import Comparison, Errors, LogScore, Timing
from missing_physics.results.samples import Rows
from missing_physics.results.unnamed import Curve, Unnamed
from robot_model import Robot

__all__ = [
    "SCHEMA",
    "Alternative",
    "ChannelFit",
    "ChannelSeries",
    "Curve",
    "Dependence",
    "Diagnosis",
    "Errors",
    "Estimate",
    "Experiment",
    "Finding",
    "Fit",
    "Mismatch",
    "ParameterChange",
    "Result",
    "Rung",
    "Timing",
    "Unnamed",
    "Verdict",
    "in_words",
    "narrowed",
]

SCHEMA = 2

Verdict = Literal[
    "explained", "partly_explained", "ambiguous", "unexplained", "consistent", "not_enough_data"
]
Array = NDArray[np.float64]

#: An interval wider than this part of the prior interval is not informative.
AS_WIDE = 0.9


@dataclass(frozen=True)
class Dependence:
    """A variable on which a residual depends: the range, and the share of the energy in it."""

    variable: str
    range: tuple[float, float]
    share: float


@dataclass(frozen=True)
class Mismatch:
    """One channel in which the nominal model and the recording differ.

    `share` is the part of all whitened residual energy; `p_value` that of the hypothesis that the
    channel holds noise only; `windows` [s]; `frequency_hz` the peaks of the residual's spectrum.
    """

    location: str
    channel: str
    share: float
    p_value: float
    windows: tuple[tuple[float, float], ...] = ()
    depends_on: tuple[Dependence, ...] = ()
    frequency_hz: tuple[float, ...] = ()
    words: str = ""


@dataclass(frozen=True)
class Estimate:
    """A value, its 95 % confidence interval and its unit; `prior95` is the 95 % prior interval."""

    value: float
    ci95: tuple[float, float]
    unit: str
    prior95: tuple[float, float] = (-math.inf, math.inf)

    @property
    def narrowed(self) -> bool:
        """Whether the recordings say anything of it."""
        return narrowed(self.ci95, self.prior95)


@dataclass(frozen=True)
class Alternative:
    """An explanation that was weighed, its probability, and why it was not chosen."""

    effect: str
    location: str
    probability: float
    why_not: str


@dataclass(frozen=True)
class Finding:
    """A named piece of physics; `note` is what a reader must know about how it was identified."""

    effect: str
    location: str
    probability: float
    parameters: Mapping[str, Estimate]
    ambiguous_with: tuple[str, ...] = ()
    alternatives: tuple[Alternative, ...] = ()
    validation_improvement: float = 0.0
    note: str = ""


@dataclass(frozen=True)
class ChannelFit:
    """Fit of one channel before (nominal robot) and after (augmented robot).

    The errors count the samples in which the joint moves. `standard` are those of the standard
    identification model, None where it was not compared.
    """

    unit: str
    before: Errors
    after: Errors
    noise_floor: float
    standard: Errors | None = None


@dataclass(frozen=True)
class Fit:
    """Fit of all channels.

    Attributes:
        channels: by name.
        validation_improvement: 1 - after/before of the whitened held-out error.
        bands: frequencies in which torques of each recording were compared, the fitted recordings first;
            with them `evaluation.evaluate` reproduces the errors of the robot file.
    """

    channels: Mapping[str, ChannelFit]
    validation_improvement: float
    bands: tuple[Band, ...] = ()


@dataclass(frozen=True)
class Experiment:
    """A motion that would separate explanations; `motion` is a file name relative to the output folder."""

    separates: tuple[str, ...]
    do: str
    why: str
    motion: str | None = None


@dataclass(frozen=True)
class ParameterChange:
    """A re-estimated parameter of the nominal robot; `prior95` is the 95 % prior interval."""

    name: str
    unit: str
    nominal: float
    estimate: float
    ci95: tuple[float, float]
    note: str = ""
    prior95: tuple[float, float] = (-math.inf, math.inf)

    @property
    def moved(self) -> bool:
        """Whether the robot file's value lies outside the interval of the estimate."""
        return not self.ci95[0] <= self.nominal <= self.ci95[1]

    @property
    def narrowed(self) -> bool:
        """Whether the recordings say anything of it."""
        return narrowed(self.ci95, self.prior95)

    @property
    def surprise(self) -> float:
        """Change of the parameter in half widths of its prior interval."""
        half = (self.prior95[1] - self.prior95[0]) / 2.0
        return abs(self.estimate - self.nominal) / half if half > 0.0 else math.inf


@dataclass(frozen=True)
class Diagnosis:
    """The answer; `to_json` gives the documented file."""

    robot: str
    recordings: tuple[str, ...]
    validation: tuple[str, ...]
    verdict: Verdict
    summary: str
    mismatch: tuple[Mismatch, ...]
    findings: tuple[Finding, ...]
    fit: Fit
    experiments: tuple[Experiment, ...] = ()
    could_not_tell: tuple[str, ...] = ()
    unnamed: tuple[Unnamed, ...] = ()
    nominal_parameters: tuple[ParameterChange, ...] = ()
    notes: tuple[str, ...] = ()
    comparison: Comparison = field(default_factory=Comparison)
    timing: tuple[Timing, ...] = ()
    log_score: LogScore | None = None
    not_judged: tuple[str, ...] = ()
    augmented_robot: str = "robot.augmented.toml"
    schema: int = SCHEMA

    @property
    def nominal_changes(self) -> tuple[ParameterChange, ...]:
        """Re-estimated parameters of the robot file, the most surprising first."""
        return tuple(sorted(self.nominal_parameters, key=lambda change: -change.surprise))

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists; numbers that are not finite become None."""
        rest = {key: value for key, value in vars(self).items() if key != "schema"}
        return _plain({"schema": self.schema, **rest, "nominal_changes": self.nominal_changes})

    def to_json(self) -> str:
        """The text of `diagnosis.json`; the same diagnosis gives the same text."""
        return json.dumps(self.to_dict(), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


@dataclass(frozen=True)
class ChannelSeries:
    """One channel of one recording, as the models see it, on the recording's time base.

    Attributes:
        recording: its source.
        role: whether the recording (or the held-out blocks of it) was fitted or only scored.
        channel, unit, location: e.g. ``joint1.torque``, ``N m``, ``joint1``.
        time: [s], shape (N,).
        measured, nominal, augmented: shape (N,), in `unit`, filtered alike.
        held_out: True where a sample was not used for fitting, shape (N,).
        counted: True where a sample counts in the channel's errors, shape (N,); None for channels that are
            not compared along the recorded motion, where all samples count.
        noise_floor: rms due to noise alone, in `unit`.
        position, velocity: of the place, shape (N,), or None.
        variable_units: units of `position` and `velocity`.
    """

    recording: str
    role: Literal["train", "validation"]
    channel: str
    unit: str
    location: str
    time: Array
    measured: Array
    nominal: Array
    augmented: Array
    held_out: NDArray[np.bool_]
    noise_floor: float
    position: Array | None = None
    velocity: Array | None = None
    variable_units: tuple[str, str] = ("rad", "rad/s")
    counted: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Rung:
    """One explanation that was tried: the change of the hypothesis and of the held-out error.

    Attributes:
        effect, location: the effect that was added (or removed again).
        added_to: labels `effect@place` of the hypothesis to which it was added.
        train_rms, validation_rms: whitened error of the whole model, in fitted and in held-out blocks.
        evidence: natural logarithm of the odds for the effect against leaving it out.
        kept: whether the search continued from here.
        why: reason in words.
    """

    effect: str
    location: str
    added_to: tuple[str, ...]
    train_rms: float
    validation_rms: float
    evidence: float
    kept: bool
    why: str


@dataclass(frozen=True)
class Result:
    """A diagnosis with everything else that a report shows.

    Attributes:
        real: whether the found mass properties are physically consistent.
        stated: the robot by which errors are stated; the file gets its bodies and parameters in the end. None
            where no errors are stated.
        rows: samples of each recording in which robot files are compared; none where they are not.
    """

    diagnosis: Diagnosis
    series: tuple[ChannelSeries, ...]
    ladder: tuple[Rung, ...]
    augmented_robot_toml: str
    experiment_motions: Mapping[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    real: bool = True
    stated: Robot | None = None
    rows: tuple[Rows, ...] = ()


def narrowed(ci95: tuple[float, float], prior95: tuple[float, float]) -> bool:
    """Whether a posterior interval is informative compared with the prior one.

    An interval that contains the middle of the prior interval and is about as wide is not.

    Args:
        ci95: the estimate's 95 % interval.
        prior95: 95 % prior interval, infinite where nothing was known.
    """
    (low, high), (first, last) = ci95, prior95
    if not all(map(math.isfinite, (low, high, first, last))):
        return True
    return high - low < AS_WIDE * (last - first) or not low <= (first + last) / 2.0 <= high


def in_words(name: str) -> str:
    """``joint1's velocity`` of ``joint1.velocity``, ``time`` of ``time``: what `Unnamed.depends_on` has."""
    place, _, quantity = name.rpartition(".")
    words = quantity.replace("_", " ")
    return f"{place}'s {words}" if place else words


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return _plain(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return float(f"{value:.10g}") if math.isfinite(value) else None
    return value
