"""What a comparison with the standard identification model says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

__all__ = ["AT_NOISE", "LITTLE", "Compared", "Comparison", "Errors", "LogScore", "Timing", "Written"]

#: Noise levels are estimates: up to this factor above one an rms is at the noise.
AT_NOISE = 1.2
#: Part of the mismatch energy that may be left of what is called explained.
LITTLE = 0.05
#: What is in the robot file: the answer; the answer with the standard model's friction at some joints; the
#: answer's effects on the standard model's bodies; the standard model; the robot as described.
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
        nominal: of the robot as described.
        standard: of the standard model, None where that could not be fitted.
        answer: of the robot file that is written.
        noise: rms that the sensors' noise alone leaves.
    """

    unit: str
    nominal: Errors
    standard: Errors | None
    answer: Errors
    noise: float


@dataclass(frozen=True)
class LogScore:
    """Logarithm of the density that a model gave to what was not fitted [nats]; differences have a meaning.

    Gaussian, in every channel with the variance that the model left in the fitted data, over as many
    samples as the band holds.
    """

    nominal: float
    standard: float | None
    answer: float


@dataclass(frozen=True)
class Comparison:
    """Robot as described, standard model and answer.

    Attributes:
        channels: by name; empty where nothing can be compared.
        written: what is in the robot file.
        worse: channels in which the answer was worse than the standard model, so that the file has another
            model there.
        words: why there is no standard model, or why the file does not have the answer; "" else.
    """

    channels: Mapping[str, Compared] = field(default_factory=dict)
    written: Written = "answer"
    worse: tuple[str, ...] = ()
    words: str = ""


@dataclass(frozen=True)
class Timing:
    """An offset between channels that is a matter of recording.

    Attributes:
        recording: in which; "" where it is the same in all.
        channel: which channels are late beside the motion.
        offset: by how much [s], positive where they are late.
        ci95: its 95 % confidence interval [s].
        samples: the same in samples.
        undone: whether they were moved by it before anything was fitted.
    """

    recording: str
    channel: str
    offset: float
    ci95: tuple[float, float]
    samples: float
    undone: bool
