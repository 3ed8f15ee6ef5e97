"""One evaluation against the number of links and modes, for the reference model and for Exudyn."""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np

from benchmarks.evidence import paragraph, table
from benchmarks.native import NativeRun, Setting
from benchmarks.speed.chains import chain
from benchmarks.speed.loops import own_loop
from benchmarks.work_precision.manoeuvres import CASES, Case
from reference_model.kernels import rate_by_size
from reference_model.plant.closed_loop import Plant
from robot_model import Robot

__all__ = ["LINKS", "MODES", "scaling_part"]

LINKS = (2, 4, 8, 16)
MODES = (2, 4, 8, 16)
#: Repeats whose medians are reported, and steps of a run.
REPEATS, STEPS = 5, 1000
#: Evaluations of a Runge-Kutta step of order 4.
STAGES = 4
#: Negligible duration: a run of this length consists only of its evaluations [s].
DURATION = 0.05


def _median(run: Callable[[], float]) -> float:
    run()
    return float(np.median([run() for _ in range(REPEATS)]))


def _own(robot: Robot) -> float:
    """A state derivative of the free motion [s]."""
    plant = Plant(robot)
    rng = np.random.default_rng(1)
    sizes = (1, plant.layout.size, len(robot.moving_joints), plant.commands)
    columns = [0.1 * rng.normal(size=(32, rows)) for rows in sizes]
    return _median(own_loop(rate_by_size(plant), columns, evaluations=5_000))


def _exudyn(robot: Robot, *, flexible: bool, method: str) -> float:
    """A step [s] of a run of `STEPS`."""
    case = Case("chain", "", robot, flexible=flexible)

    def run() -> float:
        import time

        one = NativeRun(case, Setting(method, steps=STEPS))
        start = time.process_time()
        one()
        return (time.process_time() - start) / STEPS

    return _median(run)


def _still(robot: Robot) -> Robot:
    """Without control, for a short time."""
    reference = {"duration": DURATION, "sample_rate": 1 / DURATION}
    return robot.model_validate(
        {**robot.model_dump(), "reference": reference, "controller": {"kind": "none"}}
    )


def _bending(modes: int) -> Robot:
    """The flexible space robot without control and friction, with this number of modes."""
    robot = CASES["flexible"].robot
    data = _still(robot).model_dump()
    beam = next(link for link in data["links"] if link.get("beam"))["beam"]
    beam["modes"] = modes
    return Robot.model_validate(data)


def scaling_part() -> str:
    """The section of the page."""
    rows = []
    for links in LINKS:
        print(f"chain of {links}", file=sys.stderr, flush=True)
        robot = _still(chain(links))
        own, other = _own(robot), _exudyn(robot, flexible=False, method="RK44") / STAGES
        step = _exudyn(robot, flexible=False, method="trapezoidal, index 2")
        rows.append(["rigid chain", f"{links} links", *_numbers(own, other, step)])
    for modes in MODES:
        print(f"{modes} modes", file=sys.stderr, flush=True)
        robot = _bending(modes)
        step = _exudyn(robot, flexible=True, method="trapezoidal, index 2")
        rows.append(["flexible space robot", f"{modes} modes", *_numbers(_own(robot), None, step)])
    headings = ["robot", "size", "ours, evaluation [us]:", "Exudyn, evaluation [us]:", "ratio:"]
    return "\n\n".join(
        [
            "## One evaluation, against links and modes",
            paragraph(
                "Ours: a state derivative in a compiled loop. Exudyn's evaluation: a stage of",
                "RK44, which has",
                "the same in it, with what the solver adds; and a step of the trapezoidal rule, which is its",
                "way with flexible bodies and no evaluation but an implicit step. No control, no",
                "friction; medians",
                f"of {REPEATS}.",
            ),
            table([*headings, "Exudyn, implicit step [us]:", "over our evaluation:"], rows),
        ]
    )


def _numbers(own: float, other: float | None, step: float) -> list[str]:
    evaluated = ["-", "-"] if other is None else [f"{1e6 * other:.3g}", f"{other / own:.1f}"]
    return [f"{1e6 * own:.3g}", *evaluated, f"{1e6 * step:.3g}", f"{step / own:.0f}"]
