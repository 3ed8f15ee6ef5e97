"""The page of evidence: comparisons, faults found, remaining differences."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from benchmarks.cross_validation.convergence import Course
from benchmarks.cross_validation.deflection import Bent
from benchmarks.cross_validation.faults.seeding import Caught, Fault
from benchmarks.cross_validation.matrix import GROUPS, LAWS, LEFT, NOISE, ORDER, STEP, TRAVELS, Outcome
from benchmarks.cross_validation.statics import Agreement
from benchmarks.evidence import paragraph, percent, table

__all__ = [
    "bending",
    "bounds",
    "courses",
    "faults",
    "findings",
    "formulas",
    "introduction",
    "loops",
    "product_table",
    "summary",
]


def introduction() -> str:
    """Introduction of the page."""
    return paragraph(
        "Two engines carry the same robot descriptions: the reference model (a recursive formulation in",
        "CasADi, integrated by CVODES) and a twin built on Exudyn (its kinematic tree, or its bodies and",
        "constraints; its modal bodies or its geometrically exact beams; its integrators). They share the",
        "description with its derived data (unit axes, section properties, node positions, matrices read",
        "from files), and no code of mechanics: kinematics, inertia, finite elements, friction, control",
        "and effects are implemented twice. A misinterpretation of the description could be in both; the",
        "tests check against closed forms, and MuJoCo agrees with the reference to 1e-8 on rigid arms in",
        "free motion ([benchmarks.md](benchmarks.md)). Differences are relative to the range of the compared",
        "quantity, over all axes of a vector; Exudyn minus reference. For features that Exudyn's modal",
        "bodies lack, the twin adds equations of its own: joints on nodes that move with the modes,",
        "stiffening, masses that couple displacements with rotations.",
    )


def findings() -> str:
    """Faults revealed by this comparison; all are corrected, and each has a test."""
    return """\
- **Gravity on Exudyn's modal bodies** has the moment of the *undeformed* body: the load of the library
  neglects the deformation. The twin now applies gravity to the bent link itself. The resulting difference is
  among the seeded faults below.
- **Rotary inertia of finite-element nodes** was constant in the link's axes in the reference model, so that
  the gyroscopic moment of a tip body did not bend its link. It now rotates with its node (seeded below).
- **Angular momentum** of robots on a fixed base counted reflected rotor inertia in the twin.
- **Integral action of a sampled controller** summed samples in the twin; by the description only the output
  is held.
- **Exudyn's first accelerations** are computed by differences, and the trapezoidal rule keeps their error in
  constraint forces forever. The twin corrects them at the start.
- **The attitude error of a held base** depended on the sign of the quaternion in the reference model: one of
  the two signs of an attitude gave the longer return rotation.
- **Magnitudes of bearing loads** were all 1e-9 N too small in the reference model, the smoothing at zero.
  Constraint forces therefore stopped converging at 1.3e-8 of their range, with 1.000e-9 N of difference in
  the bearings. It is 1e-12 N now: at a given state the loads are equal except for rounding, and along the
  motion they converge with the step as the motion does.
- **Modes of a clamped beam** had rounding errors relative to the highest frequency of its mesh in the twin,
  so that mass matrices differed by 5e-12 and control torques with spherical joints by 4e-11. The lowest modes
  are computed first now, and the 5e-12 became 1e-14.
- **A diverging run** under error control took very long to give up; it now ends soon, with time and state."""


def formulas(found: Sequence[Agreement]) -> str:
    """Worst difference of every quantity, over all subjects."""
    rows = []
    for quantity in dict.fromkeys(item.quantity for item in found):
        own = [item for item in found if item.quantity == quantity]
        worst = max(own, key=lambda item: item.worst)
        rows.append([quantity, str(len(own)), f"{worst.worst:.0e}", f"{worst.bound:.0e}", worst.subject])
    failed = [item for item in found if not item.holds]
    text = paragraph(
        f"{len(found)} comparisons at random states: joint speeds from 1e-5 to 2 rad/s in both directions,",
        "links bent by centimetres, bases rotated and moving. Exudyn's mass matrix, forces and constraint",
        "forces are those of its solver; redundant coordinates are projected by the null space of its",
        "constraint Jacobian. Load-dependent friction is iterated to agree with Exudyn's constraint forces.",
        f"{len(found) - len(failed)} of {len(found)} are within their bounds: rounding, which is ten times",
        "larger in accelerations and loads, since the smallest eigenvalue of the mass matrix is 1e-3 of the",
        "largest. Rates of bristles and lags are computed by differences.",
    )
    return f"{text}\n\n" + table(("quantity", "subjects:", "largest difference:", "bound:", "found in"), rows)


def product_table(found: Sequence[Outcome]) -> str:
    """The product of robots, laws and motions: worst of motion, rates and forces."""
    rows = []
    places = dict.fromkeys(item.case.labels[:3] for item in found)
    for law in LAWS:
        for travel in TRAVELS:
            cells = []
            for place in places:
                own = next((o for o in found if o.case.labels == (*place, law, travel)), None)
                cells.append("-" if own is None else "/".join(_power(own.worst(group)) for group in GROUPS))
            rows.append([law, travel, *cells])
    headings = ("friction", "motion", *(f"{kind}, {geometry}, {base}:" for kind, geometry, base in places))
    return table(headings, rows)


def loops(found: Sequence[Outcome]) -> str:
    """Controllers or effects, one line each."""
    rows = []
    for item in found:
        cells = ["/".join(_power(of(group)) for group in GROUPS) for of in (item.worst, item.left)]
        rows.append([*item.case.labels, *cells, item.refused or ("" if item.holds else "beyond")])
    return table(("case", "robot", "difference:", "left:", "remark"), rows)


def bounds() -> str:
    """Compared quantities and bounds."""
    allowed = ", ".join(f"{group} {LEFT[group]:g}" for group in GROUPS)
    return paragraph(
        f"Exudyn at steps of {STEP:g} s at most under local error control, with constraints; the",
        "reference at tolerances of 1e-10. Largest difference over range of *motion* (positions, attitudes,",
        "deflections, strains, modal coordinates), of *rates* (velocities, energy, momenta) and of *forces*",
        "(torques, friction, loads, accelerations). To separate step errors, every case runs a second time",
        "at half the step: a step error falls to a quarter, a modelling difference stays. The limit of both",
        "runs (Richardson's extrapolation) is compared with the reference again, and must stay within",
        f"bounds: {allowed} of the range. In motion and rates the power of the step must be at least",
        f"{ORDER:g} where the difference at half the step is more than {NOISE:g}, below which Newton's",
        "iterations and the tolerance of the reference run dominate. These runs last 0.1 s;",
        "shipped robots over their full reference motions are in",
        "[crosscheck_full_length.md](crosscheck_full_length.md).",
    )


def summary(found: Sequence[Outcome]) -> str:
    """Over all cases: largest difference, the same at half the step, after extrapolation, and the powers."""
    rows = []
    for group in GROUPS:
        cells = [f"{max(of(item, group) for item in found):.0e}" for of in (_coarse, _fine, _left)]
        worst = max(found, key=lambda item: item.left(group))
        powers = sorted(power for item in found if np.isfinite(power := item.order(group)))
        quantiles = ", ".join(f"{np.quantile(powers, share):.2f}" for share in (0.0, 0.05, 0.5, 0.95))
        rows.append([group, *cells, f"{LEFT[group]:.0e}", ", ".join(worst.case.labels), quantiles])
    text = f"All {len(found)} cases, of which {sum(item.holds for item in found)} hold:"
    headings = (
        "group",
        f"at {STEP:g} s:",
        "at half of it:",
        "left:",
        "bound:",
        "most is left in",
        "power of the step: least, 5 %, median, 95 %",
    )
    return f"{text}\n\n" + table(headings, rows)


def _coarse(item: Outcome, group: str) -> float:
    return item.worst(group)


def _fine(item: Outcome, group: str) -> float:
    return item.half(group)


def _left(item: Outcome, group: str) -> float:
    return item.left(group)


def courses(found: Sequence[Course]) -> str:
    """Every study: differences along the steps, and observed orders."""
    parts = []
    for item in found:
        study = item.study
        rows = [
            [name, *(f"{value:.1e}" for value in values), ", ".join(f"{o:.2f}" for o in item.orders(name))]
            for name, values in item.relative.items()
            if max(values) > 0
        ]
        headings = ("quantity", *(f"{step:g} s:" for step in study.steps), "observed orders")
        goal = f"Order of the integrator {study.order}; wanted {study.goal:g}, forces {study.force_goal:g}:"
        verdict = "reached." if item.holds else "not reached."
        parts.append(f"**{study.name}.** {goal} {verdict} {study.remark}\n\n" + table(headings, rows))
    return "\n\n".join(parts)


def bending(modes: Iterable[Bent], elements: Iterable[Bent], loads: Iterable[Bent]) -> str:
    """Three tables: modes, elements, deflections."""
    first = [[f"{b.value:g}", percent(b.across), percent(b.strain)] for b in modes]
    second = [[f"{b.value:g}", percent(b.across, 3)] for b in elements]
    third = [[percent(b.deflection), percent(b.across), percent(b.along, 3)] for b in loads]
    return "\n\n".join(
        [
            "Modes kept, of a bare beam that is let go in a field: tip deflection and root strain against "
            "exact elements. With enough modes the remaining difference is the lumping of the masses.",
            table(("modes:", "deflection:", "strain:"), first),
            "Elements, with a body of half the beam's mass or more at the tip:",
            table(("elements:", "deflection:"), second),
            "Peak deflection over length: linear modes against large rotations. *Across* is relative to the "
            "peak, *along* (foreshortening, which linear modes lack) to the length.",
            table(("deflection:", "across:", "along:"), third),
        ]
    )


def faults(found: Sequence[tuple[Fault, Caught | None]]) -> str:
    """Seeded faults and what saw them first."""
    rows = []
    for fault, sight in found:
        seen = (
            ("nothing", "-", "-")
            if sight is None
            else (sight.quantity, sight.subject, f"{sight.difference:.0e}")
        )
        rows.append([fault.engine, fault.what, *seen])
    count = sum(sight is not None for _, sight in found)
    text = f"{count} of {len(found)} seeded faults are detected by the quick checks of every test run."
    return f"{text}\n\n" + table(("engine", "fault", "first detected in", "of", "difference:"), rows)


def _power(value: float) -> str:
    return "0" if value <= 0 else f"{value:.0e}".replace("e-0", "e-")
