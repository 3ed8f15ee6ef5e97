"""Influence of joint friction on the flexible space robot: tests of the claims of the paper's abstract.

    python -m benchmarks.friction.study

Simulates the shipped robots with the reference model and writes `reports/evidence/friction_study.md` and its
pictures. Takes some minutes.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from time import process_time

from benchmarks.evidence import EVIDENCE, head, number, paragraph, table
from benchmarks.friction.cases import (
    BANDWIDTH,
    BASE_BANDWIDTH,
    ELEMENTS,
    INTEGRAL,
    JOINTS,
    LAWS,
    MODES,
    MU_KINETIC,
    MU_STATIC,
    PRELOAD,
    RADIUS,
    SIGMA,
    SLOW_STRIBECK_SPEED,
    STRIBECK_SPEED,
    TOLERANCES,
    Case,
    effective_inertia,
)
from benchmarks.friction.claims import claims, hunting_cases
from benchmarks.friction.features import features
from benchmarks.friction.measures import Measures, measures
from benchmarks.friction.plots import hunting, laws, loads, response, spectra
from benchmarks.friction.truncation import truncation
from robot_model import InputError, write_atomically

__all__ = ["main"]

COMMAND = "python -m benchmarks.friction.study"
NAME = "friction_study"
MILLI = 1e3
SHOWN = ("none", *LAWS)
#: Multiples of the friction under exact decoupling.
LEVELS = (0.0, 0.01, 0.03, 0.1, 0.3)
#: Controller bandwidths with friction [rad/s].
BANDWIDTHS = (1.0, 2.0, 3.0)

INTRODUCTION = """\
Liu, Li, Wang, Cai, *Dynamics analysis of flexible space robot with joint friction*, Aerospace Science
and Technology 47 (2015) 164-176, state in their abstract that joint friction can cause oscillation of the
joint response and vibration of the flexible link and affect the precision of position control, and that
the Coulomb model is limited in describing friction's nonlinear features. This page tests these
statements, and some of the introduction, on the robot shipped here as `flexible_space_robot`. **All
parameters of robot, friction, control and motion are this project's own; the paper's are not known, and
no number here is the paper's.**"""

SETTING = """\
Base 1000 kg, rigid link 1 of 5 m, flexible link 2 of 6 m, payload 50 kg; joint 2's axis is inclined to
joint 1's (skewed), or parallel to it (planar robot). *Fast*: joints 1 and 2 by 30 and -45 degrees on a
cycloid of 10 s, then 10 s of hold. *Slow*: the same in 120 s. *Reversals*: both joints on a sine of 5
degrees at 0.05 Hz for 60 s. The base floats, or is held by the controller. The friction of the shipped
robots is replaced by the values below. Friction follows the bearing load W that the
simulation computes from the joint's reaction forces and moments; *preload* adds a constant load to W.
Three laws: Coulomb's has one coefficient, the kinetic one; Stribeck's has the static one near rest and
falls to the kinetic one with speed; LuGre's has both, and bristles, which are a state. The first two
stick and slip exactly. A difference between laws is given for each step from one to the next,
and once more for LuGre with equal coefficients."""

COLUMNS = """\
Tracking error is reference minus position, rms over the run; final error its mean over the last second;
*shaking* the rms of its part above 0.5 Hz. Vibration is the rms of the tip's transverse deflection above
0.5 Hz while the reference moves, residual after it (reversals: last half of the run). Two numbers are
joints 1 and 2."""


def main() -> None:
    """Simulate, draw, write."""
    began = process_time()
    parts = [
        head("Joint friction on the flexible space robot", command=COMMAND),
        INTRODUCTION,
        "## The claims",
        table(("claim", "here", "numbers"), claims()),
        "## Setting",
        SETTING,
        _figures(),
        "## Responses",
        COLUMNS,
        _responses(),
        *_pictures(),
        "## Bandwidth",
        _bandwidths(),
        "## Exact decoupling",
        _decoupling(),
        "## Laws around reversals",
        _laws(),
        "## Models of the joint",
        _geometry(),
        "## Modes of the link",
        truncation(),
    ]
    took = f"The study took {process_time() - began:.0f} s of one processor."
    write_atomically(EVIDENCE / f"{NAME}.md", "\n\n".join([*parts, took]) + "\n")


def _figures() -> str:
    rows = [
        ("kinetic and static friction coefficient", f"{MU_KINETIC:g}, {MU_STATIC:g}"),
        ("friction radius of the bearings", f"{RADIUS:g} m"),
        ("bristle stiffness, damping, viscosity", f"{SIGMA[0]:g} 1/m, {SIGMA[1]:g} s/m, {SIGMA[2]:g} s/m"),
        ("Stribeck speed; the lower one", f"{STRIBECK_SPEED:g} m/s; {SLOW_STRIBECK_SPEED:g} m/s"),
        (
            "preload, if any",
            f"{PRELOAD:g} N m, so {MU_KINETIC * PRELOAD:g} N m of kinetic friction",
        ),
        ("computed torque with the rigid model", _gains(BANDWIDTH["rigid"])),
        ("computed torque with the full model", _gains(BANDWIDTH["full"])),
        ("the held base", _gains(BASE_BANDWIDTH)),
        ("PID", f"{_gains(BANDWIDTH['pid'])}, ki = {INTEGRAL:g} 1/s^3, times the joints' inertias"),
        ("link 2", f"{ELEMENTS} elements, {MODES} modes"),
        ("tolerances of CVODES", f"relative {TOLERANCES['rtol']:g}, absolute {TOLERANCES['atol']:g}"),
    ]
    return table(("figure", "value"), rows)


def _gains(bandwidth: float) -> str:
    return f"kp = {bandwidth**2:g} 1/s^2, kd = {2 * bandwidth:g} 1/s"


def _responses() -> str:
    cases = [
        Case(law, manoeuvre, base=base, preload=preload)
        for base in ("held", "free")
        for manoeuvre in ("fast", "slow", "reversals")
        for preload in (0.0, PRELOAD)
        for law in SHOWN
        if law != "none" or not preload
    ]
    headings = (
        *(
            "base",
            "manoeuvre",
            "friction",
            "preload, N m:",
            "tracking, mrad:",
            "final, mrad:",
            "shaking, mrad:",
        ),
        *(
            "vibration, mm:",
            "residual, mm:",
            "peak deflection, mm:",
            "largest friction, N m:",
            "base turned, mrad:",
        ),
    )
    rows = []
    for case in cases:
        found = measures(case)
        start = [case.base, case.manoeuvre, case.friction, f"{case.preload:g}"]
        rows.append([*start, *_cells(found), _two(found.friction.values()), number(MILLI * found.turned)])
    return table(headings, rows)


def _cells(found: Measures) -> list[str]:
    angles = (found.tracking, found.final, found.shaking)
    lengths = (found.vibration, found.residual, found.peak)
    return [*(_two(MILLI * v for v in a.values()) for a in angles), *(number(MILLI * v) for v in lengths)]


def _two(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.3g}" for value in values)


def _pictures() -> list[str]:
    reversing = Case("LuGre", "reversals", preload=PRELOAD)
    fast = Case("LuGre", base="held", preload=PRELOAD)
    shown = {
        "fast": response("Fast manoeuvre, base held, with preload", fast),
        "slow": response("Slow manoeuvre, base free, with preload", reversing.but(manoeuvre="slow")),
        "reversals": response("Reversals, base free, with preload", reversing),
        "spectra": spectra(
            "Spectrum of the tip's deflection",
            {"reversals, base free": reversing, "reversals, base held": reversing.but(base="held")},
        ),
        "laws": laws("Joint 2 around a reversal, base free, with preload", reversing, "joint2"),
        "integral": hunting("PID after the fast motion, base free, with preload", hunting_cases()),
        "loads": loads(
            "Fast manoeuvre, base held, Coulomb friction without preload", Case("Coulomb", base="held")
        ),
    }
    for name, text in shown.items():
        write_atomically(EVIDENCE / f"{NAME}_{name}.svg", text)
    return [f"![{name}]({NAME}_{name}.svg)" for name in shown]


def _bandwidths() -> str:
    rows = []
    for bandwidth in BANDWIDTHS:
        for law in SHOWN:
            case = Case(law, base="held", preload=PRELOAD, bandwidth=bandwidth)
            rows.append([f"{bandwidth:g}", law, *_cells(measures(case))])
    headings = ("bandwidth, rad/s:", "friction", "tracking, mrad:", "final, mrad:", "shaking, mrad:")
    text = paragraph(
        "Fast manoeuvre, base held, preload, rigid computed torque with other gains: a stiffer "
        "controller leaves",
        "less error and passes more of the friction's jumps on to the link.",
    )
    return f"{text}\n\n" + table((*headings, "vibration, mm:", "residual, mm:", "peak deflection, mm:"), rows)


def _decoupling() -> str:
    rows = []
    for base in ("held", "free"):
        for level in LEVELS:
            case = Case("Coulomb" if level else "none", base=base, control="full", level=level)
            try:
                cells = _cells(measures(case))
            except InputError:
                cells = ["the simulation stops: the motion runs away", *["-"] * 5]
            rows.append([base, f"{level * MU_KINETIC:g}", *cells])
    inertia = {
        flexible: effective_inertia("flexible_space_robot", flexible=flexible) for flexible in (False, True)
    }
    text = paragraph(
        "With the full model joint errors are exactly zero without friction, whatever the link does; but "
        "nothing",
        "the controller does damps the link. What a joint then moves is only Zbar with the modal coordinates",
        f"eliminated: {_two(inertia[True])} kg m^2 at joints 1 and 2 of the stretched arm with a floating "
        "base,",
        f"against {_two(inertia[False])} kg m^2 undeformed. Friction T_f leaves the error T_f / (kp "
        "Zbar), and it",
        "follows the load that its own vibration makes: with the base held, a coefficient that rigid "
        "computed",
        "torque bears without harm makes the motion run away.",
    )
    headings = ("base", "coefficient:", "tracking, mrad:", "final, mrad:", "shaking, mrad:", "vibration, mm:")
    return f"{text}\n\n" + table((*headings, "residual, mm:", "peak deflection, mm:"), rows)


def _laws() -> str:
    rows = []
    for base in ("held", "free"):
        for law, static in (*((law, MU_STATIC) for law in LAWS), ("LuGre", MU_KINETIC)):
            for joint in JOINTS:
                case = Case(law, "reversals", base=base, preload=PRELOAD, static=static)
                found = features(case, joint)
                numbers = (1e6 * found.travel, found.loop, found.stribeck, found.breakaway)
                name = law if static == MU_STATIC else f"{law}, static {static:g}"
                rows.append([base, name, joint, *(number(value) for value in numbers)])
    text = paragraph(
        "Friction per load in the reversals with preload. The fall from static to kinetic friction is in",
        "the coefficients, which Stribeck's law shares with LuGre's; pre-sliding and hysteresis are in the",
        "bristles alone, and are there with equal coefficients too.",
    )
    headings = ("base", "law", "joint", "way until built up, microrad:", "gap between branches:")
    return f"{text}\n\n" + table((*headings, "slow over fast sliding:", "largest coefficient:"), rows)


def _geometry() -> str:
    rows = []
    for base in ("held", "free"):
        for geometry, joint in (("skewed", "spatial"), ("skewed", "planar"), ("planar", "spatial")):
            for law in LAWS:
                found = measures(Case(law, base=base, geometry=geometry, joint=joint))
                pairs = (
                    found.load.values(),
                    found.friction.values(),
                    (MILLI * v for v in found.tracking.values()),
                )
                words = "forces and bending moment" if joint == "spatial" else "radial force alone"
                rows.append([base, geometry, words, law, *(_two(pair) for pair in pairs)])
    headings = ("base", "robot", "bearings know", "law", "largest W, N m:", "largest friction, N m:")
    return "Fast manoeuvre without preload.\n\n" + table((*headings, "tracking, mrad:"), rows)


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(f"{COMMAND}: {error}")
