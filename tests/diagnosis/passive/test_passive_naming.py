"""What is missing from base and flexible links, named by gauges, tip and gyro of simulated recordings."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.passive.naming import search_passive
from missing_physics.diagnosis.passive.results import PassiveResult, diagnose_passive
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_segments
from reference_model.simulation import simulate
from robot_model import Cycloid, EffectUse, Recording, Reference, Robot, load_robot, robot_from_toml

FRICTION = EffectUse.model_validate({"effect": "viscous_friction", "at": "joint1", "coefficient": 40.0})
NOTHING = EffectUse.model_validate({"effect": "modal_damping", "at": "link2", "damping_ratio": 0.0})
DAMPING = EffectUse.model_validate({"effect": "modal_damping", "at": "link2", "damping_ratio": 0.03})


@lru_cache(maxsize=1)
def robot() -> Robot:
    """The planar robot with one move and a rest."""
    described = load_robot("flexible_space_robot_planar")
    sensors = tuple(s for s in described.sensors if "attitude" not in s.channel)
    return described.model_copy(update={"effects": (), "sensors": sensors, "reference": move(0.2, -0.15)})


def move(one: float, other: float, rate: float = 200.0, seconds: float = 6.0) -> Reference:
    joints = tuple(
        Cycloid(joint=f"joint{k + 1}", displacement=way, start=0.3, duration=seconds / 3)
        for k, way in enumerate((one, other))
    )
    return Reference(duration=seconds, sample_rate=rate, joints=joints)


def recorded(use: EffectUse, seed: int, reference: Reference) -> Recording:
    return simulate(robot().with_effects(use).model_copy(update={"reference": reference}), seed=seed)


def two_of(use: EffectUse, rate: float = 200.0) -> tuple[Segment, ...]:
    ways = (0.2, -0.15), (-0.15, 0.2)
    two = [recorded(use, 12200 + k, move(*way, rate)) for k, way in enumerate(ways)]
    return tuple(make_segments(robot(), two))


def found(use: EffectUse, rate: float = 200.0) -> PassiveResult:
    segments = two_of(use, rate)
    basis = inertial_basis(robot(), segments[:1])
    return diagnose_passive(robot(), segments[:1], segments[1:], basis, lambda phrase: None)


@pytest.mark.proof
def test_damping_of_a_link_is_named_with_its_number() -> None:
    result = found(DAMPING)
    (named,) = result.findings
    assert (named.effect, named.location) == ("modal_damping", "link2")
    assert named.probability > 0.9
    low, high = named.parameters["damping_ratio"].ci95
    assert low < 0.03 < high
    assert high - low < 0.01
    assert result.fit is not None
    errors = result.fit["link2.strain.1"]
    # White noise is left: its rms over 1200 samples is known to 2 %; noise of the joints moves the link, too.
    assert errors.after.validation_rms < 1.1 * errors.noise_floor < 0.6 * errors.before.validation_rms


@pytest.mark.proof
def test_nothing_is_looked_for_where_nothing_is_missing_or_held_out() -> None:
    none = np.zeros((0, 0))
    nothing = two_of(NOTHING)
    assert search_passive(robot(), nothing[:1], nothing[1:], none, lambda phrase: None) is None
    missing = two_of(DAMPING)
    assert search_passive(robot(), missing, (), none, lambda phrase: None) is None


@pytest.mark.proof
def test_what_acts_at_a_joint_gets_no_name_there() -> None:
    assert not found(FRICTION).findings


@pytest.mark.proof
def test_nothing_is_named_of_modes_that_are_sampled_too_slowly() -> None:
    result = found(DAMPING, 50.0)
    assert not result.findings
    assert not result.ladder


@pytest.mark.proof
@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("reaction_wheel", {"momentum_x": 4.0, "momentum_y": -3.0, "momentum_z": 2.0, "torque_y": 0.1}),
        ("slosh", {"mass": 80.0, "frequency": 0.6, "damping_ratio": 0.02, "x": 0.2, "z": -0.2}),
    ],
)
def test_wheels_and_liquids_are_named_and_the_robot_with_them_moves_alike(
    effect: str, values: dict[str, float]
) -> None:
    use = EffectUse.model_validate({"effect": effect, "at": "base", **values})
    first, second = move(0.45, 0.45, seconds=17.0), move(-0.45, 0.35, seconds=17.0)
    described = load_robot("flexible_space_robot").model_copy(update={"effects": (), "reference": first})
    real = described.with_effects(use)
    one = simulate(real, seed=12210)
    other = simulate(real.model_copy(update={"reference": second}), seed=12211)
    result = diagnose(described, [one], [other], options=Options(experiments=False))
    (named,) = result.diagnosis.findings
    assert (named.effect, named.location) == (effect, "base")
    for name, value in values.items():
        low, high = named.parameters[name].ci95
        assert low <= value <= high, name
    augmented = robot_from_toml(result.augmented_robot_toml)
    quiet = [
        simulate(r.model_copy(update={"reference": second}), sensors=False)
        for r in (described, augmented, real)
    ]
    for channel in ("base.angular_velocity.z", "joint1.torque"):
        without, found_, true = (r[channel] for r in quiet)
        assert np.std(found_ - true) < 0.2 * np.std(without - true), channel
