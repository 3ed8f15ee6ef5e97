"""Writes reports/evidence/speed.md: speed of the reference model, MuJoCo and Pinocchio in one run.

    python -m benchmarks.speed.study

Needs the extra [peers] and gcc and g++; compiling Pinocchio's loop takes a minute or more the first time.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from functools import partial
from importlib.metadata import version

import numpy as np

from benchmarks.evidence import EVIDENCE, head, paragraph, table
from benchmarks.speed import cases as cases
from benchmarks.speed.loops import PEER_FLAGS, REPEATS, agreement, own_loop
from benchmarks.speed.making import MADE, exponents, made
from reference_model.codegen.compiled import FLAGS, SWITCH, compiler
from reference_model.kernels import LOOPED_FROM
from robot_model import load_robot

__all__ = ["main"]

PAGE = EVIDENCE / "speed.md"
SHIPPED = ("six_joint_space_arm", "flexible_space_robot")
#: Chains shorter than this are excluded from the exponent: constant costs are still visible in them.
LONG_ENOUGH = 8
#: Longer straight-line code takes minutes to compile [operations].
STRAIGHT = 35_000
#: Chains by whether their links are flexible.
KINDS = {False: "rigid", True: "flexible"}


def _micro(seconds: float) -> str:
    return f"{1e6 * seconds:.3g}"


def _say(text: str) -> None:
    print(text, file=sys.stderr)


def forward_part() -> str:
    """One forward-dynamics evaluation compared with the peers."""
    rows, agreements = [], []
    for name in SHIPPED:
        _say(f"forward dynamics of {name}")
        found = cases.side_by_side(cases.forward_loops(name), REPEATS)
        first = min(found["reference model"]), min(found["reference model, from Python"])
        for engine, (least, median) in found.items():
            own = first["from Python" in engine]
            rows.append([name, engine, _micro(least), _micro(median), f"{least / own:.2f}"])
        mujoco, pinocchio = agreement(load_robot(name))
        agreements.append(f"{name}: MuJoCo {mujoco:.1e}, Pinocchio {pinocchio:.1e}")
    return "\n\n".join(
        [
            "## Forward dynamics of a rigid robot",
            paragraph(
                "The shipped robots, rigid: link 2 of the flexible space robot is made a rigid link of the",
                "same mass, centre and inertia. Each engine gets the same 64 states and joint",
                "torques in turn.",
                "Before timing, the accelerations of all three are compared; largest difference relative to",
                f"the largest acceleration: {'; '.join(agreements)}.",
            ),
            table(["robot", "engine", "least [us]:", "median [us]:", "over reference model:"], rows),
            paragraph(
                "In a compiled loop unless marked; those marked are called from Python one at a time, and",
                "compared among themselves. What the numbers are not: mj_forward does more than forward",
                "dynamics (inertia matrix and its factors, poses and velocities of every body, room for",
                "contacts); what its options can switch off is off (`DISABLED` in",
                "benchmarks/speed/rigid_peers.py).",
                "Pinocchio and MuJoCo read the robot from memory and can change it between",
                "calls; the reference",
                "model's code is generated for one robot, whose lengths, axes and, but for the row that says",
                "otherwise, masses are constants in it. From Python each engine gets rows of its own three",
                "arrays; ours are written into the arrays that its compiled code reads",
                "(`reference_model.evaluation.forward.ForwardDynamics`), and results are read where it",
                "leaves them.",
            ),
        ]
    )


def derivative_part() -> str:
    """The state derivative of the flexible robot with friction from bearing loads."""
    rows = []
    for title, robot in (
        ("without friction", cases.frictionless_robot()),
        ("as shipped: LuGre friction from computed bearing loads in both joints", cases.loaded_robot()),
    ):
        _say(f"state derivative {title}")
        plant, columns = cases.derivative_columns(robot)
        least, median = cases.least(own_loop(plant.rate, columns), REPEATS)
        size, operations = plant.layout.size, plant.rate.n_instructions()
        rows.append([title, str(size), str(operations), _micro(least), _micro(median)])
    return "\n\n".join(
        [
            "## State derivative of the flexible space robot",
            paragraph(
                "Free base, rigid link, beam with 4 modes and payload; the friction depends on the loads,",
                "those on the accelerations and those on the friction, and the loop of the three is closed",
                "inside the evaluation. At 201 states along the manoeuvre, in a compiled loop,",
                "command given.",
            ),
            table(["", "states:", "operations:", "least [us]:", "median [us]:"], rows),
        ]
    )


def chain_part() -> str:
    """Cost against the number of links."""
    rows, exponents = [], []
    for flexible in (False, True):
        kind = KINDS[flexible]
        times: dict[str, list[float]] = {"loop": [], "faster": []}
        for links in cases.LINKS:
            _say(f"{kind} chain of {links}")
            straight, columns = cases.chain_rate(links, flexible=flexible, looped=False)
            functions = {True: cases.chain_rate(links, flexible=flexible, looped=True)[0]}
            if straight.n_instructions() <= STRAIGHT:
                functions[False] = straight
            evaluations = max(200, 40_000 // links)
            found = {}
            for looped, function in functions.items():
                loop = own_loop(function, columns, evaluations=evaluations)
                found[looped] = cases.least(loop, REPEATS)[0]
            times["loop"].append(found[True])
            times["faster"].append(found[straight.n_instructions() >= LOOPED_FROM])
            cells = [_micro(found[way]) if way in found else "-" for way in (False, True)]
            rows.append([kind, str(links), str(straight.n_instructions()), *cells])
        long = [k for k, links in enumerate(cases.LINKS) if links >= LONG_ENOUGH]
        over = np.log([cases.LINKS[k] for k in long])
        slopes = {way: np.polyfit(over, np.log([own[k] for k in long]), 1)[0] for way, own in times.items()}
        exponents.append(f"{kind} {slopes['loop']:.2f} (chosen by size: {slopes['faster']:.2f})")
    headings = ["chain", "links:", "operations:", "straight line [us]:", "loop [us]:"]
    return "\n\n".join(
        [
            "## Cost against the number of links",
            paragraph(
                "State derivative of serial chains of revolute joints about turning axes on a fixed base",
                "in gravity, rigid, and of beams with 2 modes each; in straight line, with every body's",
                "constants in the code, and by a loop that calls one function for each class of bodies",
                "(`reference_model/kernels`). A run takes the loop from",
                f"{LOOPED_FROM:,} operations on. Exponent of the growth of the loop's time from",
                f"{LONG_ENOUGH} to {cases.LINKS[-1]} links, by least squares: {', '.join(exponents)}; it is",
                "larger by size, since short chains are faster in straight line. Code in straight line of",
                f"more than {STRAIGHT:,} operations is not timed.",
            ),
            table(headings, rows),
        ]
    )


def making_part() -> str:
    """Time and memory of making a chain's state derivative against the number of links."""
    rows = []
    lengths = [links for links in cases.LINKS if links >= LONG_ENOUGH]
    for way, flexible in (("loop", False), ("loop", True), ("straight", False), ("straight", True)):
        kind, found = KINDS[flexible], []
        for links in lengths:
            count = cases.chain_rate(links, flexible=flexible, looped=False)[0].n_instructions()
            if way == "straight" and count > STRAIGHT:
                break
            _say(f"making the {way} of a {kind} chain of {links}")
            found.append(made(way, kind, links))
            rows.append([way, kind, str(links), *(f"{found[-1][key]:.3g}" for key in MADE)])
        powers = exponents(lengths[: len(found)], found)
        rows.append([way, kind, f"exponent, {len(found)} lengths", *(f"{powers[key]:.2f}" for key in MADE)])
    headings = ["code", "chain", "links", "equations [s]:", "generating [s]:", "memory [MB]:"]
    return "\n\n".join(
        [
            "## Making the loop, against the number of links",
            paragraph(
                "Each row in a process of its own with an empty cache of code, once; processor time.",
                "`equations` is Python and CasADi building the robot's expressions, those of the straight",
                "line among them, by whose length a run chooses: they are no part of the loop's code, and it",
                "is not made without them. `generating` is the loop and its C source, or the source of the",
                "straight line; `memory` what the process took at the most for both, above what it had with",
                "everything imported. `compiling` and `compiler` are the C compiler's processor time and the",
                "most that one of its processes took; `library` is the file. Exponent of the growth by least",
                "squares of logarithms; parts that every chain has alike (one function for each class of",
                "bodies) keep it low.",
            ),
            table([*headings, "compiling [s]:", "compiler [MB]:", "library [kB]:"], rows),
        ]
    )


def manoeuvre_part() -> str:
    """The complete manoeuvre with friction."""
    robot = cases.loaded_robot()
    assert robot.reference is not None
    duration, rows = robot.reference.duration, []

    def row(title: str, found: tuple[float, float]) -> None:
        factor = f"{duration / found[0]:.0f}"
        rows.append([title, f"{1e3 * found[0]:.1f}", f"{1e3 * found[1]:.1f}", factor])

    counts: Mapping[str, int] = {}
    for code in (True, False):
        _say(f"manoeuvre, compiled {code}")
        run, stats = cases.integration(code)
        words = "compiled C" if code else "CasADi's virtual machine"
        row(f"CVODES alone, {words}", cases.least(run, REPEATS))
        counts = stats()
    for title, options in (
        ("`simulate`, everything, code in the cache", {"compile_code": True}),
        ("`simulate`, everything, uncompiled (the default)", {}),
        ("`simulate(step=1e-3)`, everything, code in the cache", {"compile_code": True, "step": 1e-3}),
    ):
        row(title, cases.least(partial(cases.manoeuvre, **options), 5))
    step, _ = cases.least(cases.fixed_steps(), REPEATS)
    return "\n\n".join(
        [
            f"## The {duration:.0f} s manoeuvre with LuGre friction",
            paragraph(
                "Flexible space robot as shipped, at 200 samples per second, relative tolerance",
                "1e-8, absolute",
                f"1e-10: {counts['nsteps']} steps of CVODES, {counts['nfevals']} evaluations,",
                f"{counts['n_call_jacF']} Jacobians. `everything` builds the equations, generates",
                "the code to",
                "look for it in the cache, integrates and computes all channels.",
            ),
            table(["", "least [ms]:", "median [ms]:", "times faster than real time:"], rows),
            paragraph(
                f"One fixed step of 1 ms of the same robot takes {_micro(step)} us, called from Python",
                f"through `Stepper`: {1e-3 / step:.0f} times faster than real time. The first",
                "compilation for",
                "a robot takes seconds; that is why `simulate` compiles only when it is asked to, and why",
                "evaluation over recordings compiles once it has 30,000 samples to evaluate.",
            ),
        ]
    )


def recording_part() -> str:
    """Long recordings."""
    rows = []
    for name in SHIPPED:
        run = cases.recorded(name)
        for method in ("inverse_dynamics", "joint_wrenches", "motion_jacobians"):
            _say(f"{method} of {name}")
            least, median = cases.least(partial(run, method), 5)
            rows.append([name, f"`{method}`", f"{least:.3f}", f"{median:.3f}"])
    os.environ[SWITCH] = "off"
    try:
        for name in SHIPPED:
            run = cases.recorded(name)
            for method in ("inverse_dynamics", "motion_jacobians"):
                _say(f"{method} of {name}, uncompiled")
                least, median = cases.least(partial(run, method), 2)
                rows.append([name, f"`{method}`, uncompiled", f"{least:.3f}", f"{median:.3f}"])
    finally:
        del os.environ[SWITCH]
    return "\n\n".join(
        [
            f"## Recordings of {cases.RECORDED:,} samples",
            paragraph(
                "`RobotModel` with a moving base, wall time on one core with other programs running, arrays",
                "in and arrays out; the first call, which builds and compiles, is left out.",
            ),
            table(["robot", "method", "least [s]:", "median [s]:"], rows),
        ]
    )


def main() -> None:
    """Measure and write the page."""
    chosen = compiler()
    assert chosen is not None, "no C compiler on the path"
    peers = ", ".join(f"{name} {version(name)}" for name in ("mujoco", "pin"))
    intro = paragraph(
        f"Peers: {peers}. Own code: {chosen.identity.splitlines()[0]}, `{' '.join(FLAGS)}`; loops around the",
        f"peers: `{' '.join(PEER_FLAGS)}`. Times of single evaluations and of the manoeuvre are processor",
        f"time of one thread, least and median of {REPEATS} repeats unless said otherwise; engines side by",
        "side take their repeats in turn. The machine is virtual and was shared with other programs, so read",
        "the ratios of one run and not the microseconds.",
    )
    parts = [
        forward_part(),
        derivative_part(),
        chain_part(),
        making_part(),
        manoeuvre_part(),
        recording_part(),
    ]
    title = head("Speed of the reference model", command="python -m benchmarks.speed.study")
    EVIDENCE.mkdir(parents=True, exist_ok=True)
    PAGE.write_text("\n\n".join([title, intro, *parts]) + "\n")
    _say(f"wrote {PAGE.name}")


if __name__ == "__main__":
    main()
