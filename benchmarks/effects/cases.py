"""Single effects missing in the file of a varied shipped robot: cases of `effects_study` and `hard_pairs`.

Robots, motions, sensors and parameters are drawn as in the blind challenge; `effect_ranges` has the ranges of
effects that it does not hide yet.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

import reference_model.simulation
from benchmarks.effects.ranges import GEARS, OTHERS, warm_up
from exudyn_model import measured, simulate
from exudyn_model.bodies.mechanism import mechanism_of
from exudyn_model.control.rigid_dynamics import BaseState, InverseDynamics
from missing_physics.challenge.cases.ranges import (
    BODY,
    BRIEF,
    DRY,
    JOINT,
    MODIFIERS,
    SENSOR,
    Draw,
    Scale,
    bounded,
)
from missing_physics.challenge.cases.truth import Design, Warming
from missing_physics.challenge.draws.manoeuvre import (
    draw_controller,
    draw_reference,
    reference_samples,
    scales_of,
    slow_sines,
)
from missing_physics.challenge.draws.robots import ROBOTS, draw_robot, friction_at, with_coulomb, without
from missing_physics.challenge.draws.warming import fading, warmed, with_thermometer
from missing_physics.challenge.scoring.information import distances, strengths
from missing_physics.challenge.torques.along import ArmAlong
from reference_model.effects.base import GearEffect
from reference_model.effects.catalogue import catalogue
from robot_model import EffectUse, MultiSine, Recording, Reference, Robot, load_robot

__all__ = [
    "Case",
    "Change",
    "distance",
    "draw_case",
    "flexible_robot",
    "has_regressors",
    "strength",
    "with_motor_encoders",
]

Array = NDArray[np.float64]
#: Change of the robot by a case, before the effect's parameters are drawn.
Change = Callable[[Robot], Robot]

#: Shorter and slower sampled than the challenge's, so that a hundred are simulated in reasonable time:
#: duration [s] and rate [Hz].
DURATIONS: Mapping[str, tuple[tuple[float, float], float]] = {
    "single_axis": ((10.0, 12.0), 500.0),
    "two_link_arm": ((10.0, 11.0), 250.0),
    "six_joint_space_arm": ((9.0, 10.0), 200.0),
}
#: Number of evaluations of joint torques along a reference motion.
EVERY = 6
#: Noise and resolution of a joint's thermometer [K].
THERMOMETER = {"noise": 0.05, "resolution": 0.1}
#: Recordings of robots with flexible links: duration [s] and rate [Hz].
LENGTH, RATE = 10.0, 200.0
#: Factor on the motion of robots with flexible links for an observable effect: a beam stiffens in a slew.
WIDER = {"centrifugal_stiffening": 6.0}
#: Coulomb friction added where a modifier of friction needs some, over a hundredth of the actuator's limit.
FIRM_FRICTION = (1.0, 5.0)


@dataclass(frozen=True)
class Case:
    """A robot file and its missing physics.

    Attributes:
        design: robot, hidden effect, both motions; as in the challenge.
        warming: of a joint whose friction changes with its temperature.
    """

    design: Design
    warming: Warming | None = None

    @property
    def use(self) -> EffectUse:
        """The hidden effect."""
        return self.design.hidden[0]

    @cached_property
    def first(self) -> Recording:
        """The recording to be fitted: every channel, no sensors."""
        return self._run(self.design.real)

    @cached_property
    def second(self) -> Recording:
        """The held-out recording."""
        return self._run(self.design.real.model_copy(update={"reference": self.design.validation}))

    @property
    def exact(self) -> tuple[Recording, Recording]:
        """Both."""
        return self.first, self.second

    def _run(self, robot: Robot) -> Recording:
        if self.warming is None:
            return simulate(robot, sensors=False)
        rate = self.use.parameters["rate"]
        forces = (fading(self.warming, self.design.nominal, rate),)
        return warmed(self.warming, simulate(robot, sensors=False, extra=forces))

    @cached_property
    def recordings(self) -> tuple[Recording, Recording]:
        """The recording of the sensors."""
        one, two = (
            measured(self.design.real, exact, seed=seed)
            for exact, seed in zip(self.exact, self.design.noise_seeds)
        )
        names = ("recording.csv", "validation.csv")
        first, second = (replace(r, source=name) for r, name in zip((one, two), names))
        if self.warming is None:
            return first, second
        seeds = self.design.noise_seeds
        return (
            with_thermometer(self.warming, self.first, first, seeds[0]),
            with_thermometer(self.warming, self.second, second, seeds[1]),
        )

    @property
    def truth(self) -> Mapping[str, float]:
        """True parameters of the hidden effect."""
        return self.use.parameters


def strength(case: Case, exact: Recording) -> float:
    """Strength of the hidden effect in a recording over noise and credible errors of the nominal robot.

    If an effect has no regressors along a motion: the energy of the difference of channels from the nominal
    robot's run, in units of the sensors' noise.
    """
    if has_regressors(case):
        return strengths(ArmAlong(case.design.nominal, exact), case.design.hidden)[case.design.labels[0]]
    reference = case.design.nominal.reference if exact is case.first else case.design.validation
    robot = case.design.nominal.model_copy(update={"reference": reference})
    return _energy(robot, exact, reference_model.simulation.simulate(robot, sensors=False))


def distance(case: Case) -> float:
    """Distance to every rival no less simple, as in the challenge; infinite without regressors."""
    if not has_regressors(case):
        return np.inf
    return distances(ArmAlong(case.design.nominal, case.first), case.design.hidden)[case.design.labels[0]]


def has_regressors(case: Case) -> bool:
    """Whether the hidden effect contributes to the torques along a motion, as all effects of a challenge."""
    effect = catalogue()[case.use.effect]
    return case.warming is None and not isinstance(effect, GearEffect) and effect.along_motion


def _energy(robot: Robot, one: Recording, other: Recording) -> float:
    total = 0.0
    for sensor in robot.sensors:
        if sensor.channel in one and sensor.channel in other:
            size = max(float(np.hypot(sensor.noise, sensor.resolution / np.sqrt(12))), 1e-12)
            total += float((((one[sensor.channel] - other[sensor.channel]) / size) ** 2).sum())
    return total


def draw_case(
    effect: str,
    number: int,
    shipped: str,
    *,
    quantity: str = "torque",
    change: Change | None = None,
    attempt: int = 0,
) -> Case:
    """The case of that number, reproducible.

    Args:
        effect: id of the hidden effect.
        number: seed of all draws.
        shipped: name of the robot that is varied.
        quantity: of the channel of a sensor effect, where several are possible; "brief" shortens an event.
        change: of the varied robot, before the effect is drawn.
        attempt: another draw of the same number.
    """
    d = Draw(np.random.default_rng([number, attempt, zlib.crc32(effect.encode())]))
    robot, validation = _moving(shipped, d, WIDER.get(effect, 1.0))
    robot = change(robot) if change else robot
    scales = scales_of(robot, _needed(robot))
    warming = None
    if effect == "temperature_dependent_friction":
        robot = with_coulomb(robot, "joint1", _firm(scales["joint1"], d))
        use, warming = warm_up(d, **THERMOMETER)
    elif effect in OTHERS:
        robot = with_motor_encoders(robot) if effect in GEARS else robot
        use = OTHERS[effect](d, robot, scales)
    else:
        robot, use = _usual(robot, effect, scales, quantity, d)
    design = Design(
        number=number,
        name="",
        shipped=shipped,
        family="plain",
        nominal=robot,
        hidden=(use,),
        validation=validation,
    )
    return Case(design, warming)


def _moving(shipped: str, d: Draw, wider: float) -> tuple[Robot, Reference]:
    """A shipped robot varied, with its controller and first motion, and the second motion."""
    if shipped not in DURATIONS:
        return flexible_robot(shipped, d, wider=wider)
    durations, rate = DURATIONS[shipped]
    kind = replace(ROBOTS[shipped], durations=durations, rates=(rate,))
    robot = draw_robot(shipped, d)
    robot = robot.model_copy(update={"controller": draw_controller(robot, d, stiff=False)})
    robot = robot.model_copy(update={"reference": draw_reference(robot, kind, d)})
    assert robot.reference is not None
    return robot, draw_reference(robot, kind, d, like=robot.reference)


def flexible_robot(shipped: str, d: Draw, *, wider: float = 1.0) -> tuple[Robot, Reference]:
    """A robot with flexible links: its payload and sensors varied; joints swing slowly and without pause.

    Args:
        shipped: its name.
        d: draws.
        wider: factor on the amplitudes of the challenge.
    """
    robot = load_robot(shipped)
    data = robot.model_dump(mode="python")
    for link in data["links"]:
        if link["beam"] is not None:
            link["beam"]["tip"]["mass"] *= d.decades(0.7, 1.4)
    for sensor in data["sensors"]:
        sensor["noise"] *= d.decades(0.6, 2.0)
    robot = Robot.model_validate(data)
    first, second = (
        Reference(
            duration=LENGTH,
            sample_rate=RATE,
            joints=tuple(_swinging(joint.name, d, wider) for joint in robot.moving_joints),
        )
        for _ in range(2)
    )
    return robot.model_copy(update={"reference": first}), second


def _swinging(joint: str, d: Draw, wider: float) -> MultiSine:
    sines = slow_sines(joint, d)
    return sines.model_copy(update={"amplitudes": tuple(wider * a for a in sines.amplitudes)})


def _needed(robot: Robot) -> Array:
    dynamics = InverseDynamics(mechanism_of(robot))
    base = BaseState(np.eye(3), np.zeros(3)) if robot.base.kind == "free" else None
    rows = zip(*(samples[::EVERY].tolist() for samples in reference_samples(robot)))
    return np.array([dynamics(*row, base=base) for row in rows])


def _firm(scale: Scale, d: Draw) -> float:
    return scale.coulomb or scale.torque * d.decades(*FIRM_FRICTION)


def _usual(
    robot: Robot, effect: str, scales: Mapping[str, Scale], quantity: str, d: Draw
) -> tuple[Robot, EffectUse]:
    """An effect of the challenge, in its ranges; the robot without conflicting effects."""
    joint = list(scales)[int(d.chance.integers(len(scales)))]
    scale = scales[joint]
    if effect in BODY:
        link = robot.links[int(d.chance.integers(len(robot.links)))]
        return robot, _use(effect, link.name, BODY[effect](d, link))
    if effect in SENSOR:
        quantities, sized = SENSOR[effect]
        chosen = quantity if quantity in quantities else quantities[0]
        return robot, _use(effect, f"{joint}.{chosen}", sized(d, scale, chosen))
    if effect in DRY:
        robot = without(robot, joint, *DRY)
    if effect == "viscous_friction":
        robot = without(robot, joint, effect)
    if effect in MODIFIERS:
        torque = _firm(scale, d)
        robot = with_coulomb(robot, joint, torque)
        scale = Scale(**{**vars(scale), "coulomb": torque})
    assert friction_at(robot, joint, effect) == 0
    sizes = BRIEF if quantity == "brief" else JOINT
    return robot, _use(effect, joint, sizes[effect](d, scale))


def with_motor_encoders(robot: Robot) -> Robot:
    """An additional encoder at each motor without one, with the accuracy of the one at the joint."""
    own = [s for s in robot.sensors if s.channel.endswith(".position")]
    motors = [s.model_copy(update={"channel": s.channel.replace(".", ".motor_")}) for s in own]
    there = {s.channel for s in robot.sensors}
    added = [motor for motor in motors if motor.channel not in there]
    return robot.model_copy(update={"sensors": (*robot.sensors, *added)})


def _use(effect: str, at: str, values: Mapping[str, float]) -> EffectUse:
    rounded = {key: bounded(value) for key, value in values.items()}
    return EffectUse.model_validate({"effect": effect, "at": at, **rounded})
