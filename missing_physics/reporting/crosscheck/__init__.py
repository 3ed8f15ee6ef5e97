"""Two engines on one robot: their differences compared with their integration errors, as text and plots."""

from missing_physics.reporting.crosscheck.comparison import Comparison, Difference, compare
from missing_physics.reporting.crosscheck.file import write_crosscheck
from missing_physics.reporting.crosscheck.report import report
from missing_physics.reporting.crosscheck.words import table, verdict_lines

__all__ = ["Comparison", "Difference", "compare", "report", "table", "verdict_lines", "write_crosscheck"]
