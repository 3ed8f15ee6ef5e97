"""Two engines on one robot: how far apart, against what each costs itself, as numbers, words and pictures."""

from missing_physics.reporting.crosscheck.comparison import Comparison, Difference, compare
from missing_physics.reporting.crosscheck.file import write_crosscheck
from missing_physics.reporting.crosscheck.report import report
from missing_physics.reporting.crosscheck.words import table, verdict_lines

__all__ = ["Comparison", "Difference", "compare", "report", "table", "verdict_lines", "write_crosscheck"]
