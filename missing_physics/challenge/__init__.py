"""The blind proof: conceal, seal, diagnose, open, score.

`draws` draws what is hidden in the `cases`, `concealing` makes their folders, `seals` locks the truth away,
`processes` lets the diagnosis answer where as little else as possible can be seen, `scoring` opens and
counts. `course` does all of it, and goes on where it was interrupted.
"""

from missing_physics.challenge.course import Settings, run, show
from missing_physics.challenge.scoring.result import CaseScore, Report

__all__ = ["CaseScore", "Report", "Settings", "run", "show"]
