"""A wrist whose two motors move both joints: effects are named at the motor or joint where they act."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import missing_physics
from missing_physics.checks.transmissions import on_both_sides
from missing_physics.diagnosis import diagnose
from missing_physics.standard import fit_standard
from reference_model.evaluation.drive_model import drive_model
from reference_model.evaluation.model import RobotModel
from robot_model import Beam, EffectUse, InputError, Recording, Robot
from robot_model.description.flexible import Rectangle

Array = NDArray[np.float64]

#: Joints from motors: the second motor turns the hand alone, the first one bends it and turns it back.
MATRIX = np.array([[1.0, 0.0], [-0.6, 1.0]])
MOTORS = ("swing", "twist")
RATE, DURATION, NOISE = 100.0, 10.0, 0.005
LEVELS = {"coulomb_torque": 0.2, "static_torque": 0.3, "stribeck_velocity": 0.5}


def stribeck(speed: Array) -> Array:
    excess = LEVELS["static_torque"] - LEVELS["coulomb_torque"]
    fall = np.exp(-((speed / LEVELS["stribeck_velocity"]) ** 2))
    return (LEVELS["coulomb_torque"] + excess * fall) * np.sign(speed)


@pytest.fixture(scope="module")
def wrist() -> Robot:
    body = {"mass": 1.0, "center_of_mass": (0.15, 0.02, 0.05), "inertia": (0.02, 0.03, 0.03)}
    return Robot.model_validate(
        {
            "name": "wrist",
            "gravity": (0.0, 0.0, -9.81),
            "links": [{"name": "fore", **body}, {"name": "hand", **body}],
            "joints": [
                {"name": "bend", "parent": "base", "child": "fore", "axis": (0.0, 1.0, 0.0)},
                {"name": "roll", "parent": "fore", "child": "hand", "axis": (1.0, 0.0, 0.0)},
            ],
            "transmissions": [
                {
                    "name": "bevels",
                    "joints": ("bend", "roll"),
                    "matrix": MATRIX.tolist(),
                    "motors": [{"name": name, "gear_ratio": 20.0, "rotor_inertia": 2e-4} for name in MOTORS],
                }
            ],
        }
    )


def recorded(robot: Robot, at: str, law: str, size: float, *, seed: int) -> Recording:
    """Encoders and torques at the motors, with friction at a motor or a joint, by one of three laws."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, DURATION, 1.0 / RATE)
    waves = [[(0.6, 0.31), (0.3, 0.77), (0.15, 1.3)], [(0.8, 0.23), (0.4, 0.59), (0.2, 1.1)]]
    q, qd, qdd = np.zeros((3, time.size, 2))
    for k, own in enumerate(waves):
        for amplitude, frequency in own:
            w, phase = 2 * np.pi * frequency, rng.uniform(0, 2 * np.pi)
            q[:, k] += amplitude * np.sin(w * time + phase)
            qd[:, k] += w * amplitude * np.cos(w * time + phase)
            qdd[:, k] -= w**2 * amplitude * np.sin(w * time + phase)
    to_motors = np.linalg.inv(MATRIX).T
    speed = {**dict(zip(MOTORS, (qd @ to_motors).T)), **dict(zip(("bend", "roll"), qd.T))}[at]
    laws = {"coulomb": np.sign(speed), "stribeck": stribeck(speed), "viscous": speed}
    force = size * laws[law]
    torque = RobotModel(robot).inverse_dynamics(q, qd, qdd) @ MATRIX
    share = np.eye(2)[MOTORS.index(at)] if at in MOTORS else MATRIX[("bend", "roll").index(at)]
    torque += force[:, None] * share + NOISE * rng.normal(size=q.shape)
    turned = q @ to_motors + 1e-5 * rng.normal(size=q.shape)
    channels = {f"{name}.position": turned[:, k] for k, name in enumerate(MOTORS)}
    return Recording(time, {**channels, **{f"{name}.torque": torque[:, k] for k, name in enumerate(MOTORS)}})


@pytest.mark.proof
@pytest.mark.parametrize(
    ("at", "law", "size", "effect", "parameter"),
    [
        ("swing", "coulomb", 0.4, "coulomb_friction", "torque"),
        ("roll", "viscous", 0.3, "viscous_friction", "coefficient"),
        ("roll", "coulomb", 0.3, "coulomb_friction", "torque"),
    ],
)
def test_friction_is_named_on_the_side_of_the_transmission_where_it_acts(
    wrist: Robot, at: str, law: str, size: float, effect: str, parameter: str
) -> None:
    found = missing_physics.diagnose(wrist, recorded(wrist, at, law, size, seed=1))
    assert [(f.effect, f.location) for f in found.findings] == [(effect, at)]
    assert found.findings[0].probability > 0.5
    estimate = found.findings[0].parameters[parameter]
    assert estimate.value == pytest.approx(size, rel=0.05)
    written = {(use.effect, use.at): use for use in found.robot.effects}
    assert written[effect, at].parameters[parameter] == pytest.approx(estimate.value)
    assert set(found.result.diagnosis.fit.channels) == {"swing.torque", "twist.torque"}


def test_standard_model_of_a_transmission_has_friction_at_the_motors(wrist: Robot) -> None:
    standard = fit_standard(wrist, [recorded(wrist, "twist", "viscous", 0.3, seed=2)])
    value, deviation = standard.estimate.value("twist.viscous")
    assert value == pytest.approx(0.3, abs=0.01)
    assert 0.0 < deviation < 0.01
    assert standard.estimate.value("swing.viscous")[0] == pytest.approx(0.0, abs=0.01)
    assert {use.at for use in standard.robot.effects} == set(MOTORS)


def test_each_side_of_a_transmission_follows_from_the_other(wrist: Robot) -> None:
    motors = recorded(wrist, "twist", "viscous", 0.3, seed=3)
    both = on_both_sides(wrist, motors)
    joints = Recording(both.time, {c: both[c] for c in both if c.startswith(("bend", "roll"))})
    assert set(joints) == {
        f"{name}.{quantity}" for name in ("bend", "roll") for quantity in ("position", "torque")
    }
    back = on_both_sides(wrist, joints)
    for channel in motors:
        np.testing.assert_allclose(back[channel], motors[channel], atol=1e-12)
    power = [
        sum(both[f"{name}.torque"] * np.gradient(both[f"{name}.position"]) for name in names)
        for names in (MOTORS, ("bend", "roll"))
    ]
    np.testing.assert_allclose(*power, atol=1e-12)


def test_dynamics_of_the_drives_are_equivalent_to_those_of_the_joints(wrist: Robot) -> None:
    rng = np.random.default_rng(4)
    m, md, mdd = rng.normal(size=(3, 6, 2))
    drives, joints = drive_model(wrist), RobotModel(wrist)
    q, qd, qdd = (part @ MATRIX.T for part in (m, md, mdd))
    torque = joints.inverse_dynamics(q, qd, qdd) @ MATRIX
    np.testing.assert_allclose(drives.inverse_dynamics(m, md, mdd), torque, atol=1e-12)
    mass = drives.mass_matrix(m)
    np.testing.assert_allclose(mass, MATRIX.T @ joints.mass_matrix(q) @ MATRIX, atol=1e-12)
    # rotors are where they are: their reflected inertia is a diagonal of its own
    rotors = [drives.inertial_names.index(f"{name}.reflected_inertia") for name in MOTORS]
    columns = drives.regressor(m, md, mdd)[:, :, rotors]
    np.testing.assert_allclose(columns, np.eye(2) * mdd[:, :, None], atol=1e-12)
    step = 1e-6
    for k, jacobian in enumerate(drives.motion_jacobians(m, md, mdd)):
        ahead, behind = ([part.copy() for part in (m, md, mdd)] for _ in range(2))
        ahead[k][:, 1] += step
        behind[k][:, 1] -= step
        slope = (drives.inverse_dynamics(*ahead) - drives.inverse_dynamics(*behind)) / (2 * step)
        np.testing.assert_allclose(jacobian[:, :, 1], slope, atol=1e-6)


BENDING = Beam(
    length=0.3, section=Rectangle(width=0.02, height=0.01), young=70e9, shear=27e9, density=2700.0, modes=1
)


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (
            {"effect": "stribeck_friction", "at": "roll", **LEVELS},
            "the robot file has stribeck_friction at 'roll', which a transmission moves, .* leave it out",
        ),
        (
            {"effect": "joint_elasticity", "at": "swing", "stiffness": 1e3},
            "the robot file has joint_elasticity at 'swing', which cannot be taken as known; leave it out",
        ),
    ],
)
def test_unsupported_coupled_robots_are_rejected_with_one_sentence(
    wrist: Robot, law: dict[str, Any], words: str
) -> None:
    recording = recorded(wrist, "twist", "viscous", 0.3, seed=5)
    with pytest.raises(InputError, match=rf"robot 'wrist' cannot be diagnosed as it is: {words}"):
        diagnose(wrist.with_effects(EffectUse(**law)), [recording])


def test_stribeck_friction_of_a_motor_is_read_from_the_robot_file(wrist: Robot) -> None:
    motor = EffectUse(effect="stribeck_friction", at="swing", **LEVELS)
    diagnosis = diagnose(
        wrist.with_effects(motor), [recorded(wrist, "swing", "stribeck", 1.0, seed=6)]
    ).diagnosis
    assert diagnosis.findings == ()
    assert not [change for change in diagnosis.nominal_parameters if "@" in change.name]


def test_missing_channels_of_a_coupled_robot_are_reported_in_one_sentence(wrist: Robot) -> None:
    recording = recorded(wrist, "twist", "viscous", 0.3, seed=5)
    bent = wrist.links[1].model_copy(update={"beam": BENDING})
    with pytest.raises(InputError, match="link 'hand' bends; leave out its 'beam' and give its whole mass"):
        diagnose(wrist.model_copy(update={"links": (wrist.links[0], bent)}), [recording])
    still = Recording(recording.time, {c: v for c, v in recording.channels.items() if "torque" not in c})
    silent = diagnose(wrist, [still]).diagnosis
    assert silent.verdict == "not_enough_data"
    assert "no torque, current or voltage is recorded" in silent.summary
    half = Recording(recording.time, {c: v for c, v in recording.channels.items() if c != "twist.position"})
    with pytest.raises(InputError, match=r"has neither twist.position nor a channel that determines"):
        diagnose(wrist, [half])
