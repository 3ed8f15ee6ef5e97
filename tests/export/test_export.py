"""An exported robot has the same dynamics as the original."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from missing_physics.cli import main
from missing_physics.export import code_of, content_of, mjcf_of, urdf_of
from missing_physics.export.urdf import unsaid
from reference_model.simulation import simulate
from robot_model import EffectUse, InputError, NoController, Robot, load_robot, save_robot

#: In all four ways a model file can hold: friction, a spring, a payload, wrong masses.
HELD = (
    ("viscous_friction", "joint1", {"coefficient": 0.8}),
    ("cable_spring", "joint2", {"stiffness": 3.0, "torque_at_zero": 1.2}),
    ("payload", "link2", {"mass": 0.7, "x": 0.3, "y": 0.1, "z": 0.05}),
    ("inertia", "link1", {"mass": 0.2, "inertia_zz": 0.03, "inertia_xx": 0.03, "inertia_yy": 0.03}),
)


def arm(*uses: tuple[str, str, dict[str, float]], swinging: bool = True, name: str = "arm") -> Robot:
    """The two-link arm with these effects; `swinging` means released with an initial push."""
    robot = load_robot("two_link_arm")
    effects = tuple(EffectUse(effect=effect, at=at, **values) for effect, at, values in uses)
    change: dict[str, Any] = {"effects": effects, "name": name}
    if swinging:
        joints = [j.model_copy(update={"initial_velocity": v}) for j, v in zip(robot.joints, (0.4, -0.7))]
        change |= {"controller": NoController(), "joints": tuple(joints)}
    return robot.model_copy(update=change)


def swung(robot: Robot, times: np.ndarray, passive: Any = None) -> np.ndarray:
    """Joint positions of the exported model in MuJoCo, shape (N, joints)."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(mjcf_of(content_of(robot)))
    model.opt.timestep = 1e-3
    if passive is None:
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    for joint in robot.moving_joints:
        data.joint(joint.name).qpos = joint.initial_position
        data.joint(joint.name).qvel = joint.initial_velocity
    mujoco.set_mjcb_passive(passive)
    try:
        found = []
        for time in times:
            while data.time < time - 5e-4:
                mujoco.mj_step(model, data)
            found.append([float(data.joint(joint.name).qpos[0]) for joint in robot.moving_joints])
    finally:
        mujoco.set_mjcb_passive(None)
    return np.array(found)


def recorded(robot: Robot, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Instants, whole milliseconds, and positions of our own engine."""
    truth = simulate(robot, sensors=False)
    kept = (truth.time <= seconds) & (np.abs(truth.time * 1e3 - np.round(truth.time * 1e3)) < 1e-6)
    positions = np.column_stack([truth[f"{joint.name}.position"] for joint in robot.moving_joints])
    return truth.time[kept], positions[kept]


def test_mujoco_simulates_the_exported_model_like_our_engine() -> None:
    robot = arm(*HELD)
    times, expected = recorded(robot, 1.5)
    assert np.ptp(expected, axis=0).min() > 0.05
    np.testing.assert_allclose(swung(robot, times), expected, atol=1e-5)
    without = swung(arm(), times)
    assert np.abs(without - expected).max() > 0.01


def test_dry_friction_and_reflected_rotor_have_the_same_influence_in_mujoco() -> None:
    """MuJoCo's dry friction is a soft constraint, so that it agrees to some milliradians."""
    robot = arm(("coulomb_friction", "joint2", {"torque": 0.8}))
    rotor = robot.joints[0].actuator.model_copy(update={"rotor_inertia": 1e-3})  # type: ignore[union-attr]
    joints = robot.joints[0].model_copy(update={"actuator": rotor}), robot.joints[1]
    robot = robot.model_copy(update={"joints": joints})
    times, expected = recorded(robot, 1.0)
    np.testing.assert_allclose(swung(robot, times), expected, atol=5e-3)
    assert np.abs(swung(arm(), times) - expected).max() > 0.05


def test_motors_have_gain_and_offset() -> None:
    mujoco = pytest.importorskip("mujoco")
    uses = (("torque_gain", "joint1", {"gain_error": 0.1}), ("torque_offset", "joint1", {"torque": 0.3}))
    model = mujoco.MjModel.from_xml_string(mjcf_of(content_of(arm(*uses))))
    data = mujoco.MjData(model)
    data.ctrl[model.actuator("joint1").id] = 2.0
    mujoco.mj_forward(model, data)
    assert data.joint("joint1").qfrc_actuator == pytest.approx(2.5)


@pytest.mark.parametrize(
    "use",
    [
        (
            "stribeck_friction",
            "joint2",
            {"coulomb_torque": 0.3, "static_torque": 0.5, "stribeck_velocity": 0.1},
        ),
        ("asymmetric_friction", "joint1", {"coulomb_difference": 0.2, "viscous_difference": 0.5}),
        ("torque_ripple", "joint1", {"order": 7.0, "sine": 2.0, "cosine": 1.0}),
        (
            "lugre_friction",
            "joint2",
            {
                "coulomb_torque": 0.3,
                "static_torque": 0.4,
                "stribeck_velocity": 0.1,
                "bristle_stiffness": 200.0,
                "bristle_damping": 0.5,
            },
        ),
    ],
    ids=lambda use: use[0],
)
def test_the_python_module_computes_effects_the_file_cannot_hold(
    use: tuple[str, str, dict[str, float]], tmp_path: Path
) -> None:
    robot = arm(("viscous_friction", "joint1", {"coefficient": 0.8}), use)
    times, expected = recorded(robot, 1.0)
    assert [left.effect for left in content_of(robot).left] == [use[0]]
    passive = module_of(code_of(content_of(robot)), tmp_path).passive
    np.testing.assert_allclose(swung(robot, times, passive), expected, atol=3e-3)
    assert np.abs(swung(robot, times, lambda model, data: None) - expected).max() > 1e-2


def module_of(code: str, folder: Path) -> Any:
    """The module that was written, imported as a user would."""
    (folder / "exported_passive.py").write_text(code, "utf-8")
    sys.path.insert(0, str(folder))
    try:
        sys.modules.pop("exported_passive", None)
        return __import__("exported_passive")
    finally:
        sys.path.remove(str(folder))


def test_exported_urdf_reads_as_the_original_robot(tmp_path: Path) -> None:
    robot = arm(("coulomb_friction", "joint2", {"torque": 0.4}), *HELD[2:])
    path = tmp_path / "arm.urdf"
    path.write_text(urdf_of(content_of(robot)), "utf-8")
    again, before = content_of(load_robot(path)), content_of(robot)
    assert again.joints["joint2"].frictionloss == 0.4
    for name, body in before.bodies.items():
        assert again.bodies[name].mass == pytest.approx(body.mass)
        np.testing.assert_allclose(again.bodies[name].inertia, body.inertia, atol=1e-9)


@pytest.mark.parametrize("to", ["mjcf", "urdf", "json"])
def test_the_command_writes_the_file_and_lists_omissions(
    to: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    uses = (
        ("actuator_lag", "joint1", {"time_constant": 0.01}),
        ("viscous_friction", "joint1", {"coefficient": 0.8}),
    )
    save_robot(arm(*uses, swinging=False), tmp_path / "robot.augmented.toml")
    monkeypatch.setattr(sys, "argv", ["missing-physics", "export", str(tmp_path), "--to", to])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 0
    assert "actuator_lag at joint1" in capsys.readouterr().out
    assert len(list(tmp_path.glob("arm*"))) == 2


def test_unsupported_robots_are_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="link 'link2' bends"):
        content_of(load_robot("flexible_space_robot"))
    with pytest.raises(InputError, match="mass of -"):
        content_of(arm(("payload", "link2", {"mass": -100.0})))
    monkeypatch.setattr(sys, "argv", ["missing-physics", "export", str(tmp_path), "--to", "mjcf"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2


def coupled(*uses: tuple[str, str, dict[str, float]]) -> Robot:
    """The two-link arm on the motors `one` and `two` of a differential."""
    robot = arm(*uses).model_dump()
    motors = [{**joint.pop("actuator"), "name": name} for joint, name in zip(robot["joints"], ("one", "two"))]
    bevels = {"name": "bevels", "joints": ("joint1", "joint2"), "matrix": ((0.5, 0.5), (0.6, -0.6))}
    return Robot.model_validate({**robot, "transmissions": [{**bevels, "motors": motors}]})


def test_motors_of_a_transmission_are_tendons_in_mujoco() -> None:
    robot = coupled(
        ("viscous_friction", "one", {"coefficient": 0.3}),
        ("cable_spring", "two", {"stiffness": 2.0, "torque_at_zero": 0.7}),
        ("viscous_friction", "joint2", {"coefficient": 0.1}),
    )
    times, expected = recorded(robot, 1.0)
    assert np.ptp(expected, axis=0).min() > 0.05
    np.testing.assert_allclose(swung(robot, times), expected, atol=1e-5)


def test_effects_tendons_cannot_hold_become_python_code(tmp_path: Path) -> None:
    robot = coupled(("torque_ripple", "two", {"cosine": 1.5, "sine": 0.5, "order": 3.0}))
    times, expected = recorded(robot, 1.0)
    passive = module_of(code_of(content_of(robot)), tmp_path).passive
    # 4e-3 is what steps of 1 ms of first order leave of this arm without any effect
    np.testing.assert_allclose(swung(robot, times, passive), expected, atol=6e-3)
    assert np.abs(swung(coupled(), times) - expected).max() > 0.01


def test_urdf_lists_omissions_of_a_transmission() -> None:
    content = content_of(coupled(("viscous_friction", "one", {"coefficient": 0.3})))
    notes = list(unsaid(content))
    assert "the transmission bevels, so that its joints are driven one by one there" in notes
    assert "damping of one: 0.3" in notes


def test_exported_tendons_read_as_the_original_transmission(tmp_path: Path) -> None:
    robot = coupled(
        ("viscous_friction", "one", {"coefficient": 0.3}),
        ("cable_spring", "two", {"stiffness": 2.0, "torque_at_zero": -0.7}),
    )
    path = tmp_path / "arm.xml"
    path.write_text(mjcf_of(content_of(robot)), "utf-8")
    with pytest.warns(UserWarning, match="motors of a transmission"):
        again = load_robot(path)
    assert [motor.name for motor in again.motors] == ["one", "two"]
    np.testing.assert_allclose(again.transmitting, robot.transmitting, atol=1e-9)
    rotors = [drive.reflected_inertia for drive in robot.drives]
    np.testing.assert_allclose([drive.reflected_inertia for drive in again.drives], rotors)
    assert [drive.actuator.torque_limit for drive in again.drives if drive.actuator] == [150.0, 60.0]
    effects = {(use.effect, use.at): use.parameters for use in again.effects}
    assert effects["viscous_friction", "one"] == {"coefficient": 0.3}
    assert effects["cable_spring", "two"] == pytest.approx({"stiffness": 2.0, "torque_at_zero": -0.7})
