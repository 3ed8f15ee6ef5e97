"""Flexibility of a link described as rigid: mass, analytic frequencies, the limit of a stiff link."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh

from reference_model.dynamics.inertial import ten_numbers
from reference_model.evaluation.model import RobotModel
from reference_model.flexible import flexible_body
from reference_model.kinematics.spatial import quaternion_from_rpy
from reference_model.passive.base_motion import BaseMotion
from reference_model.plant.truth import truth_of
from reference_model.simulation import simulate
from robot_model import (
    Actuator,
    Base,
    EffectUse,
    InputError,
    Joint,
    JointPD,
    Link,
    Reference,
    Robot,
    load_robot,
)


def bends(at: str, **parameters: float) -> EffectUse:
    return EffectUse.model_validate({"effect": "link_flexibility", "at": at, **parameters})


def damped(at: str, ratio: float) -> EffectUse:
    return EffectUse.model_validate({"effect": "modal_damping", "at": at, "damping_ratio": ratio})


def pole(*, payload: float = 0.0, mass: float = 4.0, base: Base | None = None) -> Robot:
    """A uniform rod of 2 m welded to the base, with a point mass welded to its end."""
    links = [Link(name="rod", mass=mass, center_of_mass=(0.0, 0.0, 1.0), inertia=(mass / 3, mass / 3, 1e-4))]
    joints = [Joint(name="root", kind="fixed", parent="base", child="rod")]
    if payload:
        links.append(Link(name="load", mass=payload))
        joints.append(Joint(name="grip", kind="fixed", parent="rod", child="load", origin=(0.0, 0.0, 2.0)))
    return Robot(
        name="pole",
        base=base or Base(),
        links=tuple(links),
        joints=tuple(joints),
        reference=Reference(duration=1.0, sample_rate=200.0),
    )


def frequencies(robot: Robot) -> np.ndarray:
    """Natural frequencies at rest of base and modal coordinates, rising [rad/s]; those of moving are zero."""
    truth = truth_of(robot)
    model = RobotModel(truth.robot)
    base = BaseMotion.at_rest(quaternion_from_rpy((0.0, 0.0, 0.0))) if model.free_base else None
    mass = model.mass_matrix(np.zeros(0), base=base)[0]
    stiffness = np.zeros_like(mass)
    start = len(mass) - truth.tree.modal
    for body in truth.tree.bodies:
        if body.flexible:
            rows = slice(start + body.modal, start + body.modal + body.modes)
            stiffness[rows, rows] = body.flexible.stiffness
    return np.sqrt(np.maximum(eigh(stiffness, mass, eigvals_only=True), 0.0))


@pytest.mark.parametrize(
    ("name", "link"),
    [
        ("two_link_arm", "link1"),
        ("two_link_arm", "link2"),
        ("flexible_space_robot", "link1"),
        *(("six_joint_space_arm", f"link{k}") for k in range(1, 7)),
    ],
)
def test_the_undeformed_link_keeps_its_mass_properties(name: str, link: str) -> None:
    nominal = load_robot(name)
    bent = truth_of(nominal.with_effects(bends(link, period=0.3))).robot.link(link)
    body, before = flexible_body(bent), ten_numbers(nominal.link(link))
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    after = [body.mass, *body.first_moment, *(body.inertia[pair] for pair in pairs)]
    # Sums and differences of the same numbers.
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-12 * np.abs(before).max())
    assert bent.beam is not None
    assert bent.beam.mass > 0.4 * bent.mass


def test_a_uniform_rod_vibrates_at_the_clamped_beam_frequency() -> None:
    first = frequencies(pole().with_effects(bends("rod", period=0.5)))[0]
    # Rayleigh's 33/140 gives w^2 = 3 E I / (33/140 m L^3), the exact first mode 3.5160^2 E I / (m L^3): a
    # ratio of 0.9856. The hub takes 1 % of the mass; lumping the mass of 12 elements lowers a bare beam's
    # first frequency by 0.4 %, as the square of their size.
    exact = 3.5160 / np.sqrt(3 * 140 / 33)
    assert first == pytest.approx(exact * 2 * np.pi / 0.5, rel=6e-3)


def test_with_a_heavy_load_the_period_is_the_requested_one() -> None:
    first = frequencies(pole(payload=20.0).with_effects(bends("rod", period=0.5)))[0]
    # Rayleigh's formula holds to 0.1 % with a heavy tip. The two modes in a plane are those of the bare beam,
    # which under a force at the tip give 1 - 12/(4.694^4) - ... = 0.1 % less than its whole compliance.
    assert first == pytest.approx(2 * np.pi / 0.5, rel=2e-3)


def test_the_period_converges_to_rayleighs_with_more_modes() -> None:
    errors = []
    for modes in (2.0, 4.0, 6.0):
        first = frequencies(pole(payload=40.0, mass=0.4).with_effects(bends("rod", period=0.5, modes=modes)))[
            0
        ]
        errors.append(abs(first / (2 * np.pi / 0.5) - 1))
    # A beam's n-th mode has a part of its compliance that goes as n^-4: 3 %, 0.07 %, and less.
    assert errors[0] < 2e-2
    assert errors[1] < errors[0] / 5
    assert errors[2] < 1.2e-3


def test_a_free_base_raises_the_frequency_as_in_a_two_body_oscillator() -> None:
    light, load = 0.04, 20.0
    base = Base(kind="free", mass=30.0, inertia=(50.0, 50.0, 50.0))
    fixed = frequencies(pole(payload=load, mass=light).with_effects(bends("rod", period=0.5)))[0]
    free = frequencies(pole(payload=load, mass=light, base=base).with_effects(bends("rod", period=0.5)))
    # Deflection w of the load at L = 2 m: 1/m_eff = 1/m + 1/M + L^2/J; the rod weighs 0.2 % of the load, of
    # which a quarter counts.
    expected = fixed * np.sqrt(load * (1 / load + 1 / 30.0 + 4 / 50.0))
    np.testing.assert_allclose(free[:6], 0.0, atol=1e-4)
    assert free[6] == pytest.approx(expected, rel=1e-3)
    assert free[7] == pytest.approx(expected, rel=1e-3)


def arm(**changes: object) -> Robot:
    """A driven link on a free base that swings and stops."""
    given = {
        "name": "arm",
        "base": Base(kind="free", mass=40.0, inertia=(5.0, 5.0, 5.0)),
        "links": (Link(name="rod", mass=4.0, center_of_mass=(1.0, 0.0, 0.0), inertia=(1e-3, 4 / 3, 4 / 3)),),
        "joints": (
            Joint(
                name="shoulder",
                parent="base",
                child="rod",
                origin=(0.2, 0.0, 0.0),
                initial_velocity=0.5,
                actuator=Actuator(),
            ),
        ),
        "controller": JointPD(kp=60.0, kd=30.0, sample_time=0.0),
        "reference": Reference(duration=1.5, sample_rate=200.0),
    }
    return Robot.model_validate({**given, **changes})


def test_zero_period_leaves_the_robot_unchanged() -> None:
    without = simulate(arm(), sensors=False)
    absent = simulate(arm().with_effects(bends("rod", period=0.0)), sensors=False)
    assert set(absent.channels) == set(without.channels)
    for name in without.channels:
        np.testing.assert_array_equal(absent[name], without[name])


def test_a_stiff_link_converges_quadratically_in_its_period_to_the_rigid_one() -> None:
    rigid = simulate(arm(), sensors=False, rtol=1e-11, atol=1e-13)

    def gap(period: float) -> float:
        use = bends("rod", period=period, damping_ratio=0.3)
        bent = simulate(arm().with_effects(use), sensors=False, rtol=1e-11, atol=1e-13)
        return float(np.abs(bent["shoulder.position"] - rigid["shoulder.position"]).max())

    # Compliance is the period's square; the initial transient decays within some periods.
    ratio = gap(0.04) / gap(0.02)
    assert ratio == pytest.approx(4.0, rel=0.1)


def test_momentum_energy_and_work_with_a_bending_link() -> None:
    robot = arm().with_effects(bends("rod", period=0.6, damping_ratio=0.02))
    recording = simulate(robot, sensors=False, work=True, rtol=1e-11, atol=1e-13)
    balance = recording["robot.energy"] - recording["robot.work"]
    np.testing.assert_allclose(balance, balance[0], rtol=0, atol=1e-9)
    for axis in "xyz":
        np.testing.assert_allclose(np.ptp(recording[f"robot.angular_momentum.{axis}"]), 0.0, atol=1e-9)
        np.testing.assert_allclose(np.ptp(recording[f"robot.linear_momentum.{axis}"]), 0.0, atol=1e-9)


def test_the_controller_model_keeps_the_rigid_link() -> None:
    """Computed torque of the nominal robot: its torque at the start is the rigid link's."""
    robot = load_robot("two_link_arm")
    plain = simulate(robot, sensors=False)
    bent = simulate(robot.with_effects(bends("link1", period=0.05)), sensors=False)
    first = slice(0, 1)
    np.testing.assert_allclose(
        bent["joint1.torque"][first], plain["joint1.torque"][first], rtol=0, atol=1e-12
    )
    assert np.abs(bent["joint1.position"] - plain["joint1.position"]).max() > 1e-6


@pytest.mark.parametrize(
    ("robot", "use", "sentence"),
    [
        (load_robot("flexible_space_robot"), bends("link2", period=0.1), "is flexible already"),
        (load_robot("single_axis"), bends("carriage", period=0.1), "has no length"),
        (pole(payload=1.0), bends("load", period=0.1), "has no length"),
        (load_robot("two_link_arm"), damped("link1", 0.1), "is rigid and has no modes"),
        (load_robot("flexible_space_robot"), damped("link2", -0.2), "no structure generates energy"),
        (load_robot("two_link_arm"), bends("base", period=0.1), "it can sit at link1, link2"),
    ],
)
def test_impossible_links_are_refused_with_a_message(robot: Robot, use: EffectUse, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence) as caught:
        simulate(robot.with_effects(use))
    assert f"effect '{use.effect}' at '{use.at}'" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("ratio", [0.02, -0.003])
def test_damping_changes_only_the_decrement(ratio: float) -> None:
    """Ring-down of a welded mast: the amplitude falls by exp(-zeta w t)."""
    mast = pole(payload=5.0).model_copy(update={"gravity": (0.1, 0.0, 0.0)})
    mast = mast.model_copy(update={"reference": Reference(duration=6.0, sample_rate=200.0)})
    soft = bends("rod", period=0.5, damping_ratio=0.005, modes=2.0)
    recording = simulate(mast.with_effects(soft, damped("rod", ratio)), sensors=False, rtol=1e-10, atol=1e-12)
    x = recording["rod.modal_coordinate.1"]
    other = recording["rod.modal_coordinate.2"]
    x = x if np.ptp(x) > np.ptp(other) else other
    # Fit of A exp(-s t) cos(w t + p) + c through its exact recurrence of order two.
    rows = np.column_stack([x[1:-1], x[:-2], np.ones(len(x) - 2)])
    first, second, _ = np.linalg.lstsq(rows, x[2:], rcond=None)[0]
    roots = np.log(np.roots([1.0, -first, -second])) * 200.0
    w0 = frequencies(pole(payload=5.0).with_effects(soft))[0]
    # One modal coordinate of the bare beam carries the load too: c x' has the bare frequency, not w0.
    bare = flexible_body(truth_of(pole(payload=5.0).with_effects(soft)).robot.link("rod")).frequencies[0]
    expected = (0.005 + ratio) * bare * (w0 / bare) ** 2
    assert -roots[0].real == pytest.approx(expected, rel=1e-3)
    assert np.abs(roots[0]) == pytest.approx(w0, rel=1e-4)


def test_damping_of_a_described_beam_is_added() -> None:
    robot = load_robot("flexible_space_robot")
    body = truth_of(robot.with_effects(damped("link2", 0.02))).tree.bodies[2].flexible
    plain = truth_of(robot).tree.bodies[2].flexible
    assert body is not None
    assert plain is not None
    np.testing.assert_allclose(
        np.diag(body.damping) / (2 * body.frequencies),
        np.diag(plain.damping) / (2 * plain.frequencies) + 0.02,
        rtol=1e-12,
    )
    same = truth_of(robot.with_effects(damped("link2", 0.0))).tree.bodies[2].flexible
    assert same is not None
    np.testing.assert_array_equal(same.damping, plain.damping)
