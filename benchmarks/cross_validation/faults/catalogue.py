"""All seeded faults."""

from __future__ import annotations

from benchmarks.cross_validation.faults.of_reference import REFERENCE_FAULTS
from benchmarks.cross_validation.faults.of_twin import TWIN_FAULTS
from benchmarks.cross_validation.faults.seeding import Fault

__all__ = ["FAULTS"]

FAULTS: tuple[Fault, ...] = (*TWIN_FAULTS, *REFERENCE_FAULTS)
