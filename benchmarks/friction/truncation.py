"""Influence of the number of modes of the flexible link on free frequencies and on the study's measures."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from benchmarks.evidence import number, paragraph, percent, table
from benchmarks.friction.cases import ELEMENTS, JOINTS, MODES, PRELOAD, Case
from benchmarks.friction.measures import measures
from reference_model.evaluation.model import RobotModel
from reference_model.flexible.body import flexible_body
from reference_model.passive.base_motion import BaseMotion
from robot_model import Robot

__all__ = ["free_frequencies", "truncation"]

MILLI = 1e3
#: Elements and modes of the shipped robots, of the study, and of the converged solution.
SHIPPED, CONVERGED = (12, 4), (96, 24)
MESHES = (SHIPPED, (12, 6), (ELEMENTS, MODES), (ELEMENTS, 8))
#: Frequencies on the page.
TOLD = 4


@cache
def free_frequencies(robot: Robot) -> NDArray[np.float64]:
    """Natural frequencies of a free-floating robot with flexible links and free joints, shape (s,) [Hz].

    Solutions of K v = w^2 Z v in the pose of all joints at zero, Z being the mass matrix and K the links'
    modal stiffness, without the motions that deform nothing.
    """
    joints = len(robot.moving_joints)
    still = BaseMotion.at_rest(np.array([1.0, 0.0, 0.0, 0.0]))
    mass = RobotModel(robot).mass_matrix(np.zeros((1, joints)), base=still)[0]
    stiffness, row = np.zeros_like(mass), 6 + joints
    for link in robot.links:
        if link.beam is not None:
            block = flexible_body(link).stiffness
            stiffness[row : row + len(block), row : row + len(block)] = block
            row += len(block)
    squares = eigh(stiffness, mass, eigvals_only=True)
    return np.sqrt(squares[6 + joints :]) / (2 * np.pi)


def truncation() -> str:
    """The section of the page."""
    limit = free_frequencies(Case("none", elements=CONVERGED[0], modes=CONVERGED[1]).robot)[:TOLD]
    rows = []
    for elements, modes in MESHES:
        found = free_frequencies(Case("none", elements=elements, modes=modes).robot)[:TOLD]
        error = np.abs(found / limit - 1).max()
        frequencies = ", ".join(f"{value:.3f}" for value in found)
        rows.append([str(elements), str(modes), frequencies, percent(float(error), 2)])
    rows.append([*map(str, CONVERGED), ", ".join(f"{value:.3f}" for value in limit), "-"])
    free = paragraph(
        "Free floating, joints free, arm stretched: the lowest frequencies [Hz], and the largest deviation",
        f"of the four from those of {CONVERGED[0]} elements and {CONVERGED[1]} modes. The robots are shipped",
        f"with {SHIPPED[1]} modes on {SHIPPED[0]} elements, clamped at the joint: enough for slow bending,",
        f"not for the fourth; the study has {MODES} on {ELEMENTS}.",
    )
    text = f"{free}\n\n" + table(("elements:", "modes:", "frequencies, Hz:", "largest deviation:"), rows)
    return f"{text}\n\n{_cost()}"


def _cost() -> str:
    """Error of the study's numbers due to the shipped robots' modes."""
    rows = []
    for case in (
        Case("none", base="held"),
        Case("LuGre", base="held", preload=PRELOAD),
        Case("LuGre", base="held", preload=PRELOAD, bandwidth=3.0),
        Case("LuGre", "reversals", preload=PRELOAD),
    ):
        few = measures(case.but(elements=SHIPPED[0], modes=SHIPPED[1]))
        many, most = measures(case), measures(case.but(modes=MODES + 4))
        name = f"{case.friction}, {case.manoeuvre}, base {case.base}"
        if case.bandwidth:
            name += f", {case.bandwidth:g} rad/s"
        for words, scale, values in (
            ("tracking, mrad", MILLI, [max(m.tracking.values()) for m in (few, many, most)]),
            ("shaking, mrad", MILLI, [max(m.shaking.values()) for m in (few, many, most)]),
            ("vibration, mm", MILLI, [m.vibration for m in (few, many, most)]),
        ):
            off = [percent(abs(value / values[-1] - 1), 1) for value in values[:2]]
            rows.append([name, words, *(number(scale * value) for value in values), *off])
    headings = ("case", "quantity", f"{SHIPPED[1]} modes:", f"{MODES} modes:", f"{MODES + 4} modes:")
    words = paragraph(
        f"What {SHIPPED[1]} modes cost in the numbers above (the largest of {len(JOINTS)} joints): how far",
        f"{SHIPPED[1]} and {MODES} modes are from {MODES + 4}.",
    )
    return f"{words}\n\n" + table((*headings, f"{SHIPPED[1]} off by:", f"{MODES} off by:"), rows)
