"""Coverage of the recordings: which joints can be judged, and why others cannot. Shared by the commands."""

from missing_physics.coverage.joints import (
    FEWEST_ROWS,
    Coverage,
    JointCoverage,
    Reason,
    coverage,
    one_way_words,
    reason_words,
    require_same_torques,
)
from missing_physics.coverage.prepare import Prepared, prepared

__all__ = [
    "FEWEST_ROWS",
    "Coverage",
    "JointCoverage",
    "Prepared",
    "Reason",
    "coverage",
    "one_way_words",
    "prepared",
    "reason_words",
    "require_same_torques",
]
