"""Comparison of the answer with the standard identification model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

__all__ = ["AT_NOISE", "LITTLE", "Compared", "Comparison", "Errors", "LogScore", "Timing", "Written"]

#: Noise levels are estimates: up to this factor above one an rms is at the noise.
AT_NOISE = 1.2
#: Largest remaining part of the mismatch energy for an explained mismatch.
LITTLE = 0.05
#: Content of the written robot file: the answer; the answer with the standard model's friction at some
#: joints; the answer's effects on the standard model's bodies; the standard model; the nominal robot.
Written = Literal["answer", "standard_friction", "standard_bodies", "standard", "nominal"]


@dataclass(frozen=True)
class Errors:
    """Root mean square of measured minus model, in the channel's unit, on both parts of the data."""

    train_rms: float
    validation_rms: float


@dataclass(frozen=True)
class Compared:
    """Errors of one channel along the recorded motion, all on the same samples in the same band.

    Attributes:
        unit: of the channel.
        nominal: of the nominal robot.
        standard: of the standard model, None where that could not be fitted.
        answer: of the robot file that is written.
        noise: rms due to the sensors' noise alone.
    """

    unit: str
    nominal: Errors
    standard: Errors | None
    answer: Errors
    noise: float


@dataclass(frozen=True)
class LogScore:
    """Predictive log density of held-out data under a model [nats]; only differences are meaningful.

    Gaussian, in every channel with the variance of the model's residual in the fitted data, over as many
    samples as the band supports.
    """

    nominal: float
    standard: float | None
    answer: float


@dataclass(frozen=True)
class Comparison:
    """Nominal robot, standard model and answer.

    Attributes:
        channels: by name; empty where nothing can be compared.
        written: content of the robot file.
        worse: channels in which the answer was worse than the standard model, so that the file has another
            model there.
        words: why there is no standard model, or why the file does not have the answer; else "".
    """

    channels: Mapping[str, Compared] = field(default_factory=dict)
    written: Written = "answer"
    worse: tuple[str, ...] = ()
    words: str = ""


@dataclass(frozen=True)
class Timing:
    """A time offset between channels that is due to the recording.

    Attributes:
        recording: name of the recording; "" where the offset is the same in all.
        channel: the channels that are late relative to the motion.
        offset: delay [s], positive where they are late.
        ci95: its 95 % confidence interval [s].
        samples: the delay in samples.
        undone: whether the channels were shifted by it before anything was fitted.
    """

    recording: str
    channel: str
    offset: float
    ci95: tuple[float, float]
    samples: float
    undone: bool
