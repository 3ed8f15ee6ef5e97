"""The blind proof: conceal, seal, diagnose, open, score.

`design` draws what is hidden, `conceal` makes the case folders, `seal` locks the truth away, `blind` lets the
diagnosis answer where as little else as possible can be seen, `score` opens and counts. `course` does all of
it, and goes on where it was interrupted.
"""

from missing_physics.challenge.course import Settings, run, show
from missing_physics.challenge.result import CaseScore, Report

__all__ = ["CaseScore", "Report", "Settings", "run", "show"]
