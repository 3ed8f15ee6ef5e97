"""Trajectories of both engines over robots, frictions, motions, controllers and effects.

Exudyn runs twice, the second time at half the step. The step error then falls to a quarter, and the limit of
both runs is compared: a modelling difference remains in it, however small compared with the step error.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from math import inf, log2, pi
from typing import Any

from benchmarks.cross_validation.gaps import Gap, by_quantity, extrapolated, exudyn_run, gaps, reference_run
from benchmarks.cross_validation.robots import (
    ball_robot,
    chain,
    coupled,
    flexible,
    imported,
    rigid,
    slide_robot,
    stiffening,
    use,
)
from benchmarks.cross_validation.statics import CONTROLLERS, FRICTION, MOTIONS
from exudyn_model.effects.build import BODY_CHANGES, JOINT_LAWS
from exudyn_model.effects.gear import GEAR_PARTS
from reference_model.effects.catalogue import catalogue
from robot_model import Cycloid, EffectUse, InputError, JointPD, MultiSine, Robot

__all__ = [
    "BASES",
    "GEOMETRIES",
    "GROUPS",
    "LAWS",
    "LEFT",
    "NOISE",
    "ORDER",
    "STEP",
    "TRAVELS",
    "Case",
    "Outcome",
    "build_cases",
    "cases",
    "controller_cases",
    "effect_cases",
    "outcome",
]

#: Largest step of Exudyn [s].
STEP = 5e-4
#: Tolerances of the reference run, far below the error of that step.
REFERENCE = {"rtol": 1e-10, "atol": 1e-13}
#: Duration of every run [s], and frequency of the sines that reverse twice in it [Hz].
DURATION, FREQUENCY = 0.1, 7.5
#: Gains of the matrix' controller [N m/rad, N m s/rad].
CONTROL = JointPD(kp=400.0, kd=40.0)

GEOMETRIES = ("planar", "spatial")
BASES = ("fixed", "free")
LAWS = ("none", "Coulomb", "Stribeck", "LuGre", "LuGre with load")
TRAVELS = ("fast", "slow", "reversing")

#: Motion, and quantities that follow from rates; all others follow from accelerations.
MOTION = ("position", "attitude", "tip_deflection", "strain", "modal_coordinate")
RATES = ("velocity", "linear_velocity", "angular_velocity", "energy", "linear_momentum", "angular_momentum")
#: Largest relative difference after extrapolation: the next power of the step, and reversals of friction,
#: which two step sizes hit at different instants.
LEFT = {"motion": 2e-5, "rates": 2e-5, "forces": 1e-3}
#: Differences of motion and rates must decrease at least with this power of the step, unless they are below
#: `NOISE`, where Newton's iterations, the reference run's tolerance and rounding dominate.
ORDER, NOISE = 1.5, 5e-7


@dataclass(frozen=True)
class Case:
    """One closed loop; `labels` are its places along the axes of the matrix."""

    robot: Robot
    labels: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """Differences of the engines in one case.

    Attributes:
        case: the closed loop.
        gaps: of every quantity, at the step.
        halved: the same at half the step.
        limit: the same for the extrapolated limit.
        refused: why an engine refused it, if one did.
    """

    case: Case
    gaps: tuple[Gap, ...] = ()
    halved: tuple[Gap, ...] = ()
    limit: tuple[Gap, ...] = ()
    refused: str = ""

    def worst(self, group: str) -> float:
        """Largest relative difference of a group of quantities: "motion", "rates" or "forces"."""
        return _worst(self.gaps, group)

    def half(self, group: str) -> float:
        """The same at half the step."""
        return _worst(self.halved, group)

    def left(self, group: str) -> float:
        """The same of the limit."""
        return _worst(self.limit, group)

    def order(self, group: str) -> float:
        """Power of the step with which a group's largest difference decreases; infinite below `NOISE`."""
        fine = self.half(group)
        return log2(self.worst(group) / fine) if fine > NOISE else inf

    @property
    def holds(self) -> bool:
        """Every group's limit is within its bound, and motion and rates converge with the required order."""
        within = all(self.left(name) <= bound for name, bound in LEFT.items())
        return not self.refused and within and all(self.order(name) >= ORDER for name in ("motion", "rates"))


GROUPS = tuple(LEFT)


def _worst(found: Iterable[Gap], group: str) -> float:
    values = by_quantity(found)
    return max((value for name, value in values.items() if _group(name) == group), default=0.0)


def _group(quantity: str) -> str:
    return "motion" if quantity in MOTION else "rates" if quantity in RATES else "forces"


def cases() -> Iterator[Case]:
    """Rigid and flexible, planar and spatial, fixed and free, every law, every motion."""
    for kind, geometry, base, law, travel in product(("rigid", "flexible"), GEOMETRIES, BASES, LAWS, TRAVELS):
        make = rigid if kind == "rigid" else flexible
        robot = _travelling(make(geometry=geometry, base=base), travel)
        robot = robot.model_copy(update={"controller": CONTROL})
        if law != "none":
            effect, parameters = FRICTION[law]
            robot = robot.with_effects(*(use(effect, j.name, **parameters) for j in robot.moving_joints))
        yield Case(robot, (kind, geometry, base, law, travel))


def controller_cases() -> Iterator[Case]:
    """Every controller, continuous and sampled where it can be, on a rigid and a flexible arm."""
    for (name, controller), sampled in product(CONTROLLERS.items(), (False, True)):
        if sampled and "sample_time" not in type(controller).model_fields:
            continue
        held = getattr(controller, "base_kp", None) is not None
        for robot in (rigid(base="free" if held else "fixed"), flexible(base="free")):
            chosen: Any = controller.model_copy(update={"sample_time": 5e-3}) if sampled else controller
            assert robot.reference is not None
            reference = robot.reference.model_copy(update={"joints": MOTIONS})
            made = robot.model_copy(update={"controller": chosen, "reference": reference})
            yield Case(made, (name + (", sampled" if sampled else ""), _kind(robot)))


def build_cases() -> Iterator[Case]:
    """Robots with other parts, with friction from bearing loads."""
    effect, parameters = FRICTION["LuGre with load"]
    robots = (
        chain(),
        chain(base="fixed", inner="free", outer="free", place=1.5),
        stiffening(chain()),
        imported("frame"),
        imported("lattice", boundary="free", base="fixed"),
        ball_robot(),
    )
    for robot in robots:
        moving = _travelling(robot, "fast").model_copy(update={"controller": CONTROL})
        rubbing = moving.with_effects(*(use(effect, j.name, **parameters) for j in robot.moving_joints))
        yield Case(rubbing, ("LuGre with load", robot.name))


def effect_cases() -> Iterator[Case]:
    """Every effect that both engines support, at twice its typical value or less, at every possible place."""
    yield from _joint_and_body_effects()
    yield from _effects_at_motors()
    yield from _pushes_and_structures()


def _pushes_and_structures() -> Iterator[Case]:
    """Force effects on bodies, and structure effects."""
    fixed, free, bent = rigid(base="fixed"), rigid(), flexible()
    grounded = flexible(base="fixed")
    rows = [
        ("contact", (free, "upper"), (grounded, "lower")),
        ("base_motion", (fixed, "base"), (grounded, "base")),
        ("reaction_wheel", (free, "base"), (bent, "base")),
        ("slosh", (free, "base"), (bent, "base")),
        ("link_flexibility", (free, "lower"), (fixed, "lower")),
        ("modal_damping", (bent, "lower"), (imported("frame"), "lower")),
        ("centrifugal_stiffening", (bent, "lower"), (chain(), "upper")),
    ]
    for effect, *pairs in rows:
        for robot, place in pairs:
            moving = _travelling(robot, "fast").model_copy(update={"controller": JointPD(kp=400.0, kd=40.0)})
            given = use(effect, place, **{**SIZES[effect], **WALLS.get((effect, place), {})})
            yield Case(moving.with_effects(given), (effect, _kind(robot)))


def _effects_at_motors() -> Iterator[Case]:
    """Every effect of a joint or an actuator at a motor that moves two joints."""
    for effect in (*JOINT_LAWS, *GEAR_PARTS):
        if effect in catalogue():
            robot = _travelling(coupled(rigid()), "fast")
            moving = robot.model_copy(update={"controller": JointPD(kp=400.0, kd=40.0)})
            yield Case(moving.with_effects(_typical(effect, "two")), (effect, "coupled"))


def _joint_and_body_effects() -> Iterator[Case]:
    for effect in (*JOINT_LAWS, *GEAR_PARTS, *BODY_CHANGES):
        if effect not in catalogue():
            continue
        for robot in (slide_robot(), flexible()):
            moving = _travelling(robot, "fast").model_copy(update={"controller": JointPD(kp=400.0, kd=40.0)})
            place = PLACES.get(effect, "shoulder")
            place = "lower" if effect == "payload" and robot.flexible_links else place
            yield Case(moving.with_effects(_typical(effect, place)), (effect, _kind(robot)))


#: Values where an effect's typical ones do not suit these robots.
SIZES: Mapping[str, Mapping[str, float]] = {
    "payload": {"mass": 0.6, "x": 0.2, "y": 0.1, "z": -0.1},
    "inertia": {
        "mass": 0.3,
        "first_moment_x": 0.05,
        "inertia_xx": 0.02,
        "inertia_yy": 0.03,
        "inertia_zz": 0.03,
    },
    "gravity": {"x": 0.3, "y": -0.2, "z": 0.4},
    "external_torque": {"torque": 2.0, "start": 0.03, "duration": 0.05},
    "joint_elasticity": {"stiffness": 3000.0, "damping": 3.0},
    "backlash": {"half_width": 0.0005, "stiffness": 3000.0, "damping": 3.0},
    "gear_hysteresis": {"torque": 1.0, "travel": 1e-3, "stiffness": 3000.0, "damping": 3.0},
    "torque_saturation": {"limit": 3.0},
    "end_stop": {"stiffness": 200.0, "position": 0.1},
    "lugre_friction": {**FRICTION["LuGre with load"][1]},
    "stribeck_friction": {**FRICTION["Stribeck"][1]},
    "coulomb_friction": {"torque": 0.8},
    "load_dependent_friction": {"coefficient": 0.4, "gear_share": 0.1},
    "contact": {"stiffness": 2e4, "damping": 0.3, "normal_y": -1.0, "normal_z": 0.3},
    "base_motion": {"compliance": 1e-4, "mass": 60.0, "inertia": 8.0},
    "reaction_wheel": {"momentum_x": 3.0, "torque_z": 0.2, "drag": 0.3, "rotor_inertia": 0.05},
    "slosh": {"mass": 3.0, "frequency": 2.0, "damping_ratio": 0.03, "x": 0.3, "y": -0.2, "z": 0.4},
    "link_flexibility": {"period": 0.1, "damping_ratio": 0.05, "modes": 2.0},
    "modal_damping": {"damping_ratio": 0.1},
    "centrifugal_stiffening": {"strength": 0.7},
}

#: Contact points and walls: the point starts a millimetre inside the wall.
WALLS: Mapping[tuple[str, str], Mapping[str, float]] = {
    ("contact", "upper"): {"x": 0.6, "offset": -0.0872433},
    ("contact", "lower"): {"x": 1.0, "offset": -1.0089797},
}


#: Places of body effects; a payload is on a flexible link where there is one.
PLACES = {"payload": "upper", "inertia": "upper", "gravity": "base"}


def _typical(effect: str, place: str) -> EffectUse:
    given = SIZES.get(effect)
    if given is None:
        parameters = catalogue()[effect].parameters
        given = {p.name: p.typical for p in parameters if p.default is None}
    return use(effect, place, **given)


def _travelling(robot: Robot, travel: str) -> Robot:
    """The robot with a motion: from rest to rest, or back and forth through two reversals of each joint."""
    assert robot.reference is not None
    joints = [joint.name for joint in robot.moving_joints]
    if travel == "reversing":
        sizes = dict(zip(joints, (0.05, -0.04, 0.03)))
        waves = [
            MultiSine(
                joint=name,
                amplitudes=(abs(size),),
                frequencies=(FREQUENCY,),
                phases=(0.0 if size > 0 else pi,),
                ramp=0.0,
            )
            for name, size in sizes.items()
        ]
        moving = tuple(
            joint.model_copy(update={"initial_velocity": 2 * pi * FREQUENCY * sizes[joint.name]})
            if joint.name in sizes
            else joint
            for joint in robot.joints
        )
        reference = robot.reference.model_copy(update={"joints": tuple(waves)})
        return robot.model_copy(update={"joints": moving, "reference": reference})
    way = 0.6 if travel == "fast" else 0.01
    ways = zip(joints, (way, -0.8 * way, 0.3 * way))
    travels = tuple(Cycloid(joint=name, displacement=far, duration=DURATION) for name, far in ways)
    return robot.model_copy(update={"reference": robot.reference.model_copy(update={"joints": travels})})


def _kind(robot: Robot) -> str:
    links = robot.flexible_links
    kind = "imported" if any(link.modal for link in links) else "flexible" if links else "rigid"
    return f"{'two ' if len(links) > 1 else ''}{kind}, {robot.base.kind}"


def outcome(case: Case) -> Outcome:
    """Run both engines; a refusal by name is an outcome, too."""
    try:
        reference = reference_run(case.robot, **REFERENCE)
        coarse, fine = (
            exudyn_run(case.robot, formulation="redundant", step=step) for step in (STEP, STEP / 2)
        )
    except InputError as error:
        return Outcome(case, refused=str(error))
    found = (tuple(gaps(reference, run)) for run in (coarse, fine, extrapolated(coarse, fine)))
    return Outcome(case, *found)
