"""How far the diagnosis as a whole is to be trusted.

Probabilities compare explanations of the catalogue with each other and with what runs in closed loop leave.
They take for granted that the truth is among these, and that model, sensors and controller are as described.
How often that fails is not computed but counted: in cases of the blind challenge on development numbers, each
diagnosed once before anybody looked at it.
"""

from __future__ import annotations

from dataclasses import replace

from missing_physics.diagnosis.written import words
from missing_physics.results.result import Result
from robot_model import Robot

__all__ = ["TRUST", "calibrated"]

#: Names stated with 0.9 and more, and how many of them were wrong: rigid robots of one and two joints among
#: the development numbers 17004 to 17027, and 11120 to 11133, of all robots.
STATED, WRONG = 24, 0
#: The chance that the next one is right, by Laplace's rule of succession.
TRUST = 1.0 - (WRONG + 1) / (STATED + 2)


def calibrated(result: Result, robot: Robot) -> Result:
    """`result` with every name, and every rival of one, less probable by what was counted.

    Args:
        robot: as the user described it.
    """
    told = result.diagnosis
    if not told.findings:
        return result
    findings = tuple(
        replace(
            finding,
            probability=TRUST * finding.probability,
            alternatives=tuple(replace(a, probability=TRUST * a.probability) for a in finding.alternatives),
        )
        for finding in told.findings
    )
    summary = words.summary(robot, told.verdict, told.mismatch, findings, told.fit, told.unnamed)
    return replace(result, diagnosis=replace(told, findings=findings, summary=summary))
