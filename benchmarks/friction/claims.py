"""What the paper's abstract and introduction say of friction, held against the simulations of the study.

Each claim gives a verdict and the numbers it rests on; both are computed. A claim holds here for this
robot, these controllers and these figures of friction, all of which are this project's own.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.evidence import number, percent
from benchmarks.friction.cases import JOINTS, PRELOAD, SLOW_STRIBECK_SPEED, Case, run
from benchmarks.friction.features import features
from benchmarks.friction.measures import Measures, error, measures

__all__ = ["claims", "hunting_cases"]

MILLI = 1e3
#: Friction matters for a quantity when it makes it so many times as large as without friction.
MANY = 2.0
#: And when what it makes is above this: a tenth of a millimetre at the tip [m].
SEEN = 1e-4
#: A limit cycle keeps this part of its size from the second to the last quarter of the hold.
KEPT = 0.8
#: A smaller swing is rest [rad].
AWAKE = 1e-4
LAWS = ("Coulomb", "LuGre")
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


def _told(case: Case) -> str:
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
        f"{part} of {len(light)} without. Largest: {number(MILLI * most)} mrad rms ({_told(case)}) against "
        f"{number(MILLI * without)} mrad without friction: small beside the error that friction leaves.",
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
        f"where every stop and break-away strikes the link, {number(MILLI * turning)} mm rms ({_told(case)}) "
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
        f"Final error {number(MILLI * max(map(abs, with_.final.values())))} mrad ({_told(case)}) against "
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
    bristles, plain = (features(case.but(friction=law), "joint2") for law in ("LuGre", "Coulomb"))
    both = bristles.stribeck > 1.05 > plain.stribeck and bristles.breakaway > 1.2 * plain.breakaway
    return (
        claim,
        "holds" if both and bristles.travel > MANY * plain.travel else "holds in part",
        f"Joint 2, base free, reversals: slow sliding over fast sliding {bristles.stribeck:.3f} with LuGre, "
        f"{plain.stribeck:.3f} with Coulomb; largest coefficient {bristles.breakaway:.3f} against "
        f"{plain.breakaway:.3f}; way after a reversal until friction is built up "
        f"{number(1e6 * bristles.travel)} microrad against {number(1e6 * plain.travel)} microrad; "
        "difference between the branches before and after a reversal at the same slow speed "
        f"{number(bristles.loop)} against {number(plain.loop)}. In errors the two laws differ less: see "
        "below.",
    )


def _low_speed() -> tuple[str, str, str]:
    claim = "Nonlinear features stand out more at low speed (introduction)."
    gaps = {}
    for manoeuvre in ("fast", "slow"):
        coulomb, bristles = (
            measures(Case(law, manoeuvre, preload=PRELOAD)).tracking["joint1"] for law in ("Coulomb", "LuGre")
        )
        gaps[manoeuvre] = bristles / coulomb - 1
    slow = measures(Case("LuGre", "slow", preload=PRELOAD))
    light = measures(Case("LuGre", "slow"))
    return (
        claim,
        "holds for errors, not for vibration" if gaps["slow"] > gaps["fast"] else "does not hold",
        f"LuGre's tracking error exceeds Coulomb's by {percent(gaps['slow'], 0)} in the slow motion, by "
        f"{percent(gaps['fast'], 0)} in the fast one (joint 1, base free, preload). But link vibration in "
        "the slow "
        f"motion is {number(MILLI * slow.vibration)} mm, and without preload low speed takes the load "
        "away with "
        f"the accelerations: tracking error {number(MILLI * light.tracking['joint1'])} mrad.",
    )


def _planar() -> tuple[str, str, str]:
    claim = "A planar model of the joint cannot give the true friction (introduction)."
    skewed, planar = (measures(Case("Coulomb", base="held", geometry=g)) for g in ("skewed", "planar"))
    ratio = min(skewed.friction[name] / planar.friction[name] for name in JOINTS)
    peaks = [", ".join(number(m.friction[name]) for name in JOINTS) for m in (skewed, planar)]
    loads = [", ".join(number(m.load[name]) for name in JOINTS) for m in (skewed, planar)]
    return (
        claim,
        "holds" if ratio > MANY else "does not hold",
        f"Fast manoeuvre, base held, joints 1 and 2: loads up to {loads[0]} N m on the skewed robot, "
        f"{loads[1]} N m on the planar one, and friction up to {peaks[0]} N m against {peaks[1]} N m: "
        "bending "
        "moments, which a planar robot has none of, carry the load.",
    )


def _limit_cycle() -> tuple[str, str, str]:
    claim = "Stick-slip and limit cycles (introduction)."
    swings = {name: _swing(case) for name, case in hunting_cases().items()}
    lasting = [n for n, (early, end, turns) in swings.items() if end > max(KEPT * early, AWAKE) and turns > 1]
    told = "; ".join(
        f"{name}: {number(MILLI * early)} then {number(MILLI * end)} mrad"
        for name, (early, end, _) in swings.items()
    )
    return (
        claim,
        "holds with integral action" if lasting and "none" not in lasting else "does not hold",
        f"Range of joint 2's error in the second and the last quarter of the hold under PID: {told}. It "
        "goes on "
        f"with {' and '.join(lasting) or 'no law'} only; the others come to rest, slowly. Computed torque "
        "has no "
        "integral action, and the joints rest in its dead band.",
    )


def hunting_cases() -> dict[str, Case]:
    """PID with preload under each law, and with bearings that leave static friction at a lower speed."""
    case = Case("none", "wait", preload=PRELOAD, control="pid")
    found = {law: case.but(friction=law) for law in ("none", *LAWS)}
    return {**found, "LuGre, low Stribeck speed": case.but(friction="LuGre", stribeck=SLOW_STRIBECK_SPEED)}


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
