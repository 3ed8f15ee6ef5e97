"""The sections of the HTML report in their order, one file each."""

from __future__ import annotations

from missing_physics.reporting.sections import (
    experiments,
    findings,
    limits,
    method,
    mismatch,
    parameters,
    verdict,
)
from missing_physics.reporting.sections.base import Maker, Section
from missing_physics.reporting.sections.plots import ladder, overlay, residual_maps, spectrum, unnamed

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
