"""Statements on friction in the paper's abstract and introduction, compared with the study's simulations.

Each claim gives a verdict and its supporting numbers; both are computed. A claim holds here for this robot,
these controllers and these friction parameters, all of which are this project's own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from benchmarks.evidence import number, percent
from benchmarks.friction.cases import JOINTS, LAWS, MU_KINETIC, PRELOAD, SLOW_STRIBECK_SPEED, Case, run
from benchmarks.friction.features import features
from benchmarks.friction.measures import Measures, error, measures

__all__ = ["claims", "hunting_cases"]

MILLI = 1e3
#: Friction matters for a quantity when it increases it by this factor relative to no friction.
MANY = 2.0
#: And when the result is above this: a tenth of a millimetre at the tip [m].
SEEN = 1e-4
#: A limit cycle keeps this fraction of its amplitude from the second to the last quarter of the hold.
KEPT = 0.8
#: A smaller swing is rest [rad].
AWAKE = 1e-4
#: Errors that differ by more than this fraction are different.
MATTERS = 0.02
EQUAL = "LuGre, equal coefficients"
#: Comparisons of two laws: difference of the first from the second.
STATIC = "Stribeck over Coulomb (the static coefficient)"
STATE = "LuGre over Stribeck (the state)"
BARE_STATE = "LuGre with equal coefficients over Coulomb (the state)"
MANOEUVRES = ("fast", "slow", "reversals")
BASES = ("held", "free")


def claims() -> Iterator[tuple[str, str, str]]:
    """Claim, verdict, and the numbers."""
    yield _joints()
    yield _link()
    yield _precision()
    yield _features()
    yield _low_speed()
    yield _planar()
    yield _limit_cycle()
    yield _momentum()


def _pairs(preload: float = PRELOAD) -> Iterator[tuple[Case, Measures, Measures]]:
    """Every case with friction, its numbers, and those without friction."""
    for base in BASES:
        for manoeuvre in MANOEUVRES:
            bare = measures(Case("none", manoeuvre, base=base))
            for law in LAWS:
                case = Case(law, manoeuvre, base=base, preload=preload)
                yield case, measures(case), bare


def _case(case: Case) -> str:
    return f"{case.friction}, {case.manoeuvre}, base {case.base}"


def _joints() -> tuple[str, str, str]:
    claim = "Joint friction can cause oscillation of the joint response."
    found = [(max(with_.shaking.values()), max(bare.shaking.values()), c) for c, with_, bare in _pairs()]
    light = [(max(with_.shaking.values()), max(bare.shaking.values())) for _, with_, bare in _pairs(0.0)]
    share, part = sum(a > MANY * b for a, b, _ in found), sum(a > MANY * b for a, b in light)
    most, without, case = max(found, key=lambda item: item[0])
    verdict = "holds" if share == len(found) else "holds in part" if share else "does not hold"
    return (
        claim,
        verdict,
        f"Above 0.5 Hz the joint error more than doubles in {share} of {len(found)} cases with preload "
        "and in "
        f"{part} of {len(light)} without. Largest: {number(MILLI * most)} mrad rms ({_case(case)}) against "
        f"{number(MILLI * without)} mrad without friction: small compared with the error due to friction.",
    )


def _link() -> tuple[str, str, str]:
    claim = "It can cause vibration of the flexible link."
    found = [(with_.vibration, bare.vibration, c) for c, with_, bare in _pairs()]
    share = sum(a > MANY * b for a, b, _ in found)
    turning, bare, case = max(
        (item for item in found if item[2].manoeuvre == "reversals"), key=lambda i: i[0]
    )
    slow = max(a for a, _, c in found if c.manoeuvre == "slow")
    quick = {law: measures(_brisk(law)).vibration for law in ("none", *LAWS)}
    seen = max(quick["LuGre"] - quick["none"], turning - bare) > SEEN
    verdict = "holds" if share == len(found) and seen else "holds in part" if share else "does not hold"
    brisk = ", ".join(f"{number(MILLI * size)} mm ({law})" for law, size in quick.items())
    return (
        claim,
        verdict,
        f"Vibration above 0.5 Hz more than doubles in {share} of {len(found)} cases with preload. In "
        "reversals, "
        f"where every stop and break-away strikes the link, {number(MILLI * turning)} mm rms ({_case(case)}) "
        f"against {number(MILLI * bare)} mm without friction; in the slow motion at most "
        f"{number(MILLI * slow)} mm. "
        "It grows with the controller's bandwidth: in the fast manoeuvre at 3 rad/s, base held, with "
        "preload, "
        f"{brisk}.",
    )


def _brisk(law: str) -> Case:
    return Case(law, base="held", preload=PRELOAD, bandwidth=3.0)


def _precision() -> tuple[str, str, str]:
    claim = "It affects the precision of position control."
    worst = max(_pairs(), key=lambda item: max(map(abs, item[1].final.values())))
    case, with_, bare = worst
    return (
        claim,
        "holds",
        f"Final error {number(MILLI * max(map(abs, with_.final.values())))} mrad ({_case(case)}) against "
        f"{number(MILLI * max(map(abs, bare.final.values())))} mrad without friction; tracking error "
        f"{number(MILLI * max(with_.tracking.values()))} mrad rms against "
        f"{number(MILLI * max(bare.tracking.values()))} mrad. Without preload the friction goes when the "
        "motion "
        "ends, and the final error with it: "
        f"{number(MILLI * max(map(abs, measures(case.but(preload=0.0)).final.values())))} mrad. A held "
        "base ends "
        f"turned by up to {number(MILLI * max(m.turned for c, m, _ in _pairs() if c.base == 'held'))} mrad.",
    )


def _features() -> tuple[str, str, str]:
    claim = "The Coulomb model is limited in describing the nonlinear features of friction."
    case = Case("LuGre", "reversals", preload=PRELOAD)
    cases = {
        "Coulomb": case.but(friction="Coulomb"),
        "Stribeck": case.but(friction="Stribeck"),
        "LuGre": case,
        EQUAL: case.but(static=MU_KINETIC),
    }
    found = {name: features(one, "joint2") for name, one in cases.items()}
    falling = found["Stribeck"].stribeck > 1.05 > found["Coulomb"].stribeck
    bristles = found[EQUAL].travel > MANY * found["Stribeck"].travel
    ranges = "; ".join(
        f"{name}: {number(f.stribeck)}, {number(f.breakaway)}, {number(1e6 * f.travel)} microrad, "
        f"{number(f.loop)}"
        for name, f in found.items()
    )
    return (
        claim,
        "holds, for two reasons" if falling and bristles else "holds in part",
        "Joint 2, base free, reversals; slow over fast sliding, largest coefficient, way after a reversal "
        f"until friction is built up, difference between the branches at the same slow speed: {ranges}. The "
        "fall from static to kinetic friction is a matter of the coefficients, which Stribeck's law has "
        "without a state; pre-sliding and hysteresis are the state's.",
    )


def _low_speed() -> tuple[str, str, str]:
    claim = "Nonlinear features stand out more at low speed (introduction)."
    excess = {
        manoeuvre: {name: _tracking(one) / _tracking(below) - 1 for name, (one, below) in _steps(manoeuvre)}
        for manoeuvre in ("fast", "slow")
    }
    ranges = "; ".join(
        f"{name} {percent(excess['slow'][name], 1)} slow, {percent(excess['fast'][name], 1)} fast"
        for name in excess["slow"]
    )
    coefficient = excess["slow"][STATIC] > MATTERS and excess["slow"][STATIC] > excess["fast"][STATIC]
    state = max(abs(excess["slow"][name]) for name in (STATE, BARE_STATE)) > MATTERS
    verdict = "holds for" if coefficient or state else "does not hold for"
    parts = [name for name, true in (("the static coefficient", coefficient), ("the state", state)) if true]
    slow, light = measures(Case("LuGre", "slow", preload=PRELOAD)), measures(Case("LuGre", "slow"))
    return (
        claim,
        f"{verdict} {' and '.join(parts) or 'errors'}{'' if state else ', not for the internal state'}",
        f"Excess of tracking error (joint 1, base free, preload): {ranges}. The excess of a law with a "
        "static coefficient over Coulomb's error is due to that coefficient; with equal coefficients LuGre's "
        "error is Coulomb's. Link vibration in the slow motion is "
        f"{number(MILLI * slow.vibration)} mm, and without preload low speed takes the load away with "
        f"the accelerations: tracking error {number(MILLI * light.tracking['joint1'])} mrad.",
    )


def _steps(manoeuvre: str) -> Iterator[tuple[str, tuple[Case, Case]]]:
    """Pairs of cases that isolate each part of a law."""
    coulomb = Case("Coulomb", manoeuvre, preload=PRELOAD)
    stribeck, lugre = coulomb.but(friction="Stribeck"), coulomb.but(friction="LuGre")
    yield STATIC, (stribeck, coulomb)
    yield STATE, (lugre, stribeck)
    yield BARE_STATE, (lugre.but(static=MU_KINETIC), coulomb)


def _tracking(case: Case) -> float:
    return measures(case).tracking["joint1"]


def _planar() -> tuple[str, str, str]:
    claim = "A planar model of the joint cannot give the true friction (introduction)."
    spatial = measures(Case("Coulomb", base="held"))
    planar = measures(Case("Coulomb", base="held", joint="planar"))
    other = measures(Case("Coulomb", base="held", geometry="planar"))
    ratio = min(spatial.friction[name] / planar.friction[name] for name in JOINTS)

    def pair(values: Mapping[str, float], scale: float = 1.0) -> str:
        return ", ".join(number(scale * values[name]) for name in JOINTS)

    return (
        claim,
        "holds" if ratio > MANY else "does not hold",
        "Same robot, fast manoeuvre, base held, joints 1 and 2. Bearings that carry forces and bending "
        f"moments: friction up to {pair(spatial.friction)} N m, tracking error "
        f"{pair(spatial.tracking, MILLI)} mrad rms. Radial force alone, as a planar model of the joint has "
        f"it: {pair(planar.friction)} N m and {pair(planar.tracking, MILLI)} mrad. The bending moments carry "
        f"the load. (A robot that is planar itself has next to none: {pair(other.friction)} N m.)",
    )


def _limit_cycle() -> tuple[str, str, str]:
    claim = "Stick-slip and limit cycles (introduction)."
    swings = {name: _swing(case) for name, case in hunting_cases().items()}
    lasting = [n for n, (early, end, turns) in swings.items() if end > max(KEPT * early, AWAKE) and turns > 1]
    ranges = "; ".join(
        f"{name}: {number(MILLI * early)} then {number(MILLI * end)} mrad"
        for name, (early, end, _) in swings.items()
    )
    return (
        claim,
        "holds with integral action" if lasting and "none" not in lasting else "does not hold",
        f"Range of joint 2's error in the second and the last quarter of the hold under PID: {ranges}. It "
        "goes on "
        f"with {' and '.join(lasting) or 'no law'} only; the others come to rest, slowly: it is the speed at "
        "which friction leaves its static level that keeps it going, with a state or without one. Computed "
        "torque has no "
        "integral action, and the joints rest in its dead band.",
    )


def hunting_cases() -> dict[str, Case]:
    """PID with preload under each law, and with bearings that leave static friction at a lower speed."""
    case = Case("none", "wait", preload=PRELOAD, control="pid")
    found = {law: case.but(friction=law) for law in ("none", *LAWS)}
    return found | {
        f"{law}, low Stribeck speed": case.but(friction=law, stribeck=SLOW_STRIBECK_SPEED) for law in LAWS[1:]
    }


def _swing(case: Case) -> tuple[float, float, int]:
    """Range of joint 2's error in the second and last quarter of the hold [rad], its turns in the last "
    "half."""
    found = run(case)
    hold = found.time > case.motion_end
    quarters = np.array_split(error(found, "joint2")[hold], 4)
    late = np.concatenate(quarters[2:])
    turns = np.count_nonzero(np.diff(np.sign(late - late.mean())))
    return float(np.ptp(quarters[1])), float(np.ptp(quarters[3])), turns


def _momentum() -> tuple[str, str, str]:
    claim = "The model describes the dynamics of the system."
    worst = [
        measures(Case(law, manoeuvre, preload=preload)).momentum
        for law in ("none", *LAWS)
        for manoeuvre in MANOEUVRES
        for preload in ((0.0,) if law == "none" else (0.0, PRELOAD))
    ]
    linear, angular = (max(column) for column in zip(*worst))
    moved = measures(Case("none", base="held")).momentum
    return (
        claim,
        "consistent",
        f"With a free base and joint friction, which is internal, total momentum stays zero: at most "
        f"{number(linear)} N s and {number(angular)} N m s in {len(worst)} runs, where a held base takes "
        f"{number(moved[0])} N s and {number(moved[1])} N m s. Identities, limits and the second engine are "
        "matters of the tests.",
    )
