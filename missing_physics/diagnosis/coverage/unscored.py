"""Errors of joints that do not move where they would be counted: there are none, which is not zero."""

from __future__ import annotations

import math
from dataclasses import replace

from missing_physics.diagnosis.coverage.joints import Coverage
from missing_physics.results.result import ChannelFit, Diagnosis, Errors

__all__ = ["without_unscored"]


def without_unscored(diagnosis: Diagnosis, covered: Coverage) -> Diagnosis:
    """The diagnosis with NaN for the errors of torques over samples of which none counts."""
    channels = dict(diagnosis.fit.channels)
    for joint in covered.joints:
        if (fit := channels.get(f"{joint.name}.torque")) is not None:
            channels[f"{joint.name}.torque"] = _counted(fit, joint.sure)
    return replace(diagnosis, fit=replace(diagnosis.fit, channels=channels))


def _counted(fit: ChannelFit, sure: tuple[int, int]) -> ChannelFit:
    """Runs in closed loop count every sample, so that their errors are not zero and stay."""

    def counted(errors: Errors) -> Errors:
        parts = zip((errors.train_rms, errors.validation_rms), sure)
        return Errors(*(error if count or error else math.nan for error, count in parts))

    return replace(fit, before=counted(fit.before), after=counted(fit.after))
