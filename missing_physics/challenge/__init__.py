"""Blind challenge: conceal, seal, diagnose, open, score.

`draws` draws the hidden physics of the `cases`, `concealing` generates their files, `seals` encrypts the
truth, `processes` runs the diagnosis in isolation, and `scoring` compares the answers with the truth.
`course` runs all of these, and resumes an interrupted challenge.
"""

from missing_physics.challenge.course import Settings, run, show
from missing_physics.challenge.scoring.result import CaseScore, Report

__all__ = ["CaseScore", "Report", "Settings", "run", "show"]
