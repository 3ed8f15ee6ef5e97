"""Other tools must find the truth of an analytic recording: otherwise the comparison would be unfair."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from benchmarks.peers import tools as peer_tools
from benchmarks.peers.cases import Case
from benchmarks.peers.tools import Answer
from robot_model import EffectUse, Recording, robot_from_toml

#: A pendulum with a motor; the numbers that are hidden from the nominal robot.
PENDULUM = """
name = "pendulum"
gravity = [0.0, 0.0, -9.81]

[[links]]
name = "arm"
mass = 2.0
center_of_mass = [0.0, 0.0, -0.3]
inertia = [0.05, 0.05, 0.05]

[[joints]]
name = "joint1"
parent = "base"
child = "arm"
axis = [0.0, 1.0, 0.0]
actuator = { gear_ratio = 1.0, torque_constant = 0.5, resistance = 2.0 }
"""
TRUTH = {
    "viscous_friction@joint1.coefficient": 0.8,
    "coulomb_friction@joint1.torque": 0.6,
    "torque_offset@joint1.torque": 0.2,
}
RATE, CUTOFF = 200.0, 15.0
#: Mass times distance, and moment of inertia about the joint, as in the file.
MOMENT, INERTIA = 2.0 * 0.3, 0.05 + 2.0 * 0.3**2


def recorded(tempo: float, *, as_voltage: bool = False) -> Recording:
    time = np.arange(0.0, 16.0, 1.0 / RATE)
    waves = [(0.7, 0.31 * tempo, 0.0), (0.4, 0.73 * tempo, 1.1)]
    q, v, a = (
        sum(s * (2 * np.pi * f) ** k * np.sin(2 * np.pi * f * time + p + k * np.pi / 2) for s, f, p in waves)
        for k in range(3)
    )
    friction = TRUTH["viscous_friction@joint1.coefficient"] * v
    friction += TRUTH["coulomb_friction@joint1.torque"] * np.sign(v)
    torque = INERTIA * a + 9.81 * MOMENT * np.sin(q) + friction - TRUTH["torque_offset@joint1.torque"]
    channels = {"joint1.position": q, "joint1.torque": torque}
    if as_voltage:
        channels = {"joint1.position": q, "joint1.voltage": 2.0 / 0.5 * torque + 0.5 * v}
    return Recording(time, channels, "by formula")


def case(*, as_voltage: bool = False) -> Case:
    return Case(
        title="pendulum",
        origin="by formula",
        nominal=robot_from_toml(PENDULUM),
        fitted=(recorded(1.0, as_voltage=as_voltage),),
        held_out=(recorded(0.8, as_voltage=as_voltage),),
        cutoff=CUTOFF,
        rate=RATE,
        known=TRUTH,
        truth="true",
    )


def error(made: Case, answer: Answer) -> float:
    [motion], [predicted] = made.held_out_motions, answer.predicted
    left, measured = motion.reduced(motion.torque - predicted), motion.reduced(motion.torque)
    return float(np.sqrt(np.mean(left**2) / np.mean(measured**2)))


@pytest.mark.parametrize("as_voltage", [False, True])
def test_least_squares_finds_the_truth(as_voltage: bool) -> None:
    made = case(as_voltage=as_voltage)
    answer = peer_tools.idim(made)
    for label, value in TRUTH.items():
        # 2 %: sign(v) of a filtered motion against the filtered torque at reversals
        assert answer.found[label][0] == pytest.approx(value, rel=0.02)
    assert answer.found["arm.first_moment.z"][0] == pytest.approx(-MOMENT, rel=0.01)
    assert error(made, answer) < 0.01
    assert error(made, peer_tools.nominal(made)) > 0.1


def test_a_refit_without_friction_terms_leaves_friction_in_the_residual() -> None:
    made = case()
    answer = peer_tools.refitted(made)
    assert 0.05 < error(made, answer) <= error(made, peer_tools.nominal(made))


def test_sparse_regression_finds_the_terms() -> None:
    pytest.importorskip("pysindy")
    made = case()
    answer = peer_tools.sparse(made)
    assert answer.found["coulomb_friction@joint1"][0] == pytest.approx(0.6, rel=0.1)
    assert answer.found["viscous_friction@joint1"][0] == pytest.approx(0.8, rel=0.1)
    assert error(made, answer) < 0.02


def test_sparse_regression_does_not_use_the_measured_torque() -> None:
    """With the measured torque among the regressors, torque = torque would be the best law."""
    pytest.importorskip("pysindy")
    made = case()
    [held] = made.held_out
    spoilt = Recording(
        held.time, {**held.channels, "joint1.torque": held["joint1.torque"] + 5.0}, "with an error"
    )
    other = Case(**{**{k: getattr(made, k) for k in made.__dataclass_fields__}, "held_out": (spoilt,)})
    one, two = (peer_tools.sparse(c).predicted[0] for c in (made, other))
    np.testing.assert_allclose(one, two, rtol=0, atol=1e-9)


@pytest.mark.parametrize("as_voltage", [False, True])
def test_system_identification_of_mujoco_finds_the_truth(as_voltage: bool) -> None:
    pytest.importorskip("absl")
    pytest.importorskip("mujoco")
    from benchmarks.peers.sysid import mujoco_sysid

    made = case(as_voltage=as_voltage)
    answer = mujoco_sysid(made)
    # 5 %: MuJoCo regularises dry friction, and the position was filtered
    assert answer.found["arm.mass"][0] == pytest.approx(2.0, rel=0.05)
    for label, value in TRUTH.items():
        assert answer.found[label][0] == pytest.approx(value, rel=0.05)
    assert error(made, answer) < 0.03


def test_a_missing_peer_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pysindy", None)
    answer = peer_tools.sparse(case())
    assert not answer.predicted
    assert "not installed" in answer.note


def test_other_motor_constants_do_not_change_the_measured_torque() -> None:
    """The required voltage is compared, so that a weak motor requires more of it."""
    made = case(as_voltage=True)
    robot = made.nominal
    [joint] = robot.joints
    assert joint.actuator is not None
    weak = joint.model_copy(update={"actuator": joint.actuator.model_copy(update={"torque_constant": 0.25})})
    [motion] = made.held_out_motions
    same = motion.predicted(robot)
    np.testing.assert_allclose(same, motion.along.nominal(), atol=1e-12)
    other = motion.predicted(robot.model_copy(update={"joints": (weak,)}))
    speed = motion.state[1]
    # V = R/k torque + k speed, written as k0/R (V - k0 speed)
    expected = 0.25 * (8.0 * same + 0.25 * speed - 0.5 * speed)
    np.testing.assert_allclose(other, expected, atol=1e-12)


def test_torque_dependent_friction_is_predicted_without_measured_torque() -> None:
    """T = ID + s |T| sgn(v), so T = ID / (1 - s) where it drives and ID / (1 + s) where it is driven."""
    made = case()
    share = 0.4
    robot = made.nominal.with_effects(
        EffectUse(effect="load_dependent_friction", at="joint1", gear_share=share, coefficient=0.0)
    )
    [motion] = made.held_out_motions
    own, speed = motion.along.rigid[:, 0], motion.state[1][:, 0]
    moving = np.abs(speed) > 0.05
    expected = own / (1 - share * np.sign(own * speed))
    # 0.4^14 = 3e-6 of the torque
    np.testing.assert_allclose(motion.predicted(robot)[moving, 0], expected[moving], atol=1e-3)
