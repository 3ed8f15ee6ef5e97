"""The sections of the HTML report in the order in which they tell the story, one file each."""

from __future__ import annotations

from missing_physics.reporting.sections import (
    experiments,
    findings,
    ladder,
    limits,
    method,
    mismatch,
    overlay,
    parameters,
    residual_maps,
    spectrum,
    unnamed,
    verdict,
)
from missing_physics.reporting.sections.base import Maker, Section

__all__ = ["SECTIONS", "Section"]

SECTIONS: tuple[Maker, ...] = (
    verdict.section,
    mismatch.section,
    findings.section,
    unnamed.section,
    overlay.section,
    residual_maps.section,
    spectrum.section,
    ladder.section,
    parameters.section,
    experiments.section,
    limits.section,
    method.section,
)
