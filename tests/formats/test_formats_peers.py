"""Robots of URDF and MJCF files have the dynamics that Pinocchio and MuJoCo read from the same file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from states import ROUNDING, States, random_states, read_quietly

#: Gen3's file has two links with moments of inertia that no body has; Pinocchio takes them as they are.
GEN3_FAULTS = {'izz="0.000409"': 'izz="0.01157"', 'izz="0.000399"': 'izz="0.01559"'}

URDF = (
    "dfki_double_pendulum/design_A.0_cad_double_pendulum.urdf",
    "dfki_simple_pendulum/pendulum.urdf",
    "kuka_iiwa14/iiwa14.urdf",
    "kuka_iiwa14/iiwa14_estimated_params.urdf",
    "kuka_iiwa14/iiwa14_full_estimated_params.urdf",
    "kinova_gen3/gen3.urdf",
)


def pinocchio_forces(text: str, states: States, names: dict[str, str]) -> np.ndarray:
    """Inverse dynamics by Pinocchio; joints that the robot has not are held where they are neutral."""
    pin = pytest.importorskip("pinocchio")
    whole = pin.buildModelFromXML(text)
    named = [names.get(name, name) for name in states.joints]
    model = pin.buildReducedModel(
        whole, [whole.getJointId(n) for n in list(whole.names)[1:] if n not in named], pin.neutral(whole)
    )
    model.gravity.linear = np.array(states.robot.gravity)
    motors = [joint.actuator for joint in states.robot.moving_joints]
    rotors = np.array([motor.rotor_inertia * motor.gear_ratio**2 for motor in motors])
    joints, data = [model.joints[model.getJointId(name)] for name in named], model.createData()
    found = []
    for row in zip(states.position, states.velocity, states.acceleration):
        position, velocity, acceleration = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        for joint, q, v, a in zip(joints, *row):
            angle = (
                (np.cos(q), np.sin(q)) if joint.nq == 2 else (q,)
            )  # a continuous joint's place on the circle
            position[joint.idx_q : joint.idx_q + joint.nq] = angle
            velocity[joint.idx_v], acceleration[joint.idx_v] = v, a
        force = pin.rnea(model, data, position, velocity, acceleration)
        found.append(force[[joint.idx_v for joint in joints]] + rotors * row[2])
    return np.array(found)


def check_urdf(path: Path, names: dict[str, str]) -> None:
    states = random_states(read_quietly(path))
    text = path.read_text()
    if 'link="world"' in text and 'link name="world"' not in text:  # Pinocchio knows no ground by itself
        text = text.replace("<joint", '<link name="world"/><joint', 1)
    wanted = pinocchio_forces(text, states, names)
    np.testing.assert_allclose(states.force, wanted, rtol=0, atol=ROUNDING * np.abs(wanted).max())


def test_a_branched_urdf(files: Path, tmp_path: Path) -> None:
    # Pinocchio holds a joint at 0, not at the offset of its <mimic>.
    text = (files / "branched.urdf").read_text().replace('offset="0.01"', 'offset="0"')
    (tmp_path / "branched.urdf").write_text(text)
    check_urdf(tmp_path / "branched.urdf", {"left_arm_shoulder": "left arm/shoulder"})


@pytest.mark.parametrize("file", URDF)
def test_real_urdfs(real: Path, tmp_path: Path, file: str) -> None:
    text = (real / file).read_text()
    for wrong, right in GEN3_FAULTS.items() if "gen3" in file else ():
        assert wrong in text
        text = text.replace(wrong, right)
    path = tmp_path / Path(file).name
    path.write_text(text)
    check_urdf(path, {})


def meshless(mujoco: Any, path: Path) -> Any:
    """MuJoCo's model of a file whose meshes are nowhere and weigh nothing."""
    spec = mujoco.MjSpec.from_file(str(path))
    for geom in [geom for geom in spec.geoms if geom.meshname]:
        spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    return spec.compile()


def mujoco_forces(path: Path, states: States) -> tuple[np.ndarray, np.ndarray]:
    """Inverse dynamics by MuJoCo, without passive forces, and these (springs, damping), rows as ours."""
    mujoco = pytest.importorskip("mujoco")
    model = meshless(mujoco, path)
    for name in ("CONTACT", "LIMIT", "FRICTIONLOSS", "EQUALITY"):
        model.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}")
    data = mujoco.MjData(model)
    joints = [model.joint(name) for name in states.joints]
    rows = [int(joint.dofadr[0]) for joint in joints]
    found, passive = [], []
    for k in range(len(states.force)):
        turn = np.eye(3)
        if (base := states.base) is not None:
            data.qpos[3:7] = base.attitude[k]
            mujoco.mju_quat2Mat(flat := np.zeros(9), base.attitude[k])
            turn = flat.reshape(3, 3)
            data.qvel[:6] = *(turn @ base.linear_velocity[k]), *base.angular_velocity[k]
            acceleration = *(turn @ base.linear_acceleration[k]), *base.angular_acceleration[k]
        for joint, q, v in zip(joints, states.position[k], states.velocity[k]):
            data.qpos[joint.qposadr], data.qvel[joint.dofadr] = q, v
        mujoco.mj_forward(model, data)
        if base is not None:
            data.qacc[:6] = acceleration
        data.qacc[rows] = states.acceleration[k]
        mujoco.mj_inverse(model, data)
        force = data.qfrc_inverse + data.qfrc_passive
        wrench = [] if base is None else [*(turn.T @ force[:3]), *force[3:6]]
        found.append([*wrench, *force[rows]])
        passive.append(data.qfrc_passive[rows].copy())
    return np.array(found), np.array(passive)


def passive_forces(states: States) -> np.ndarray:
    """What the viscous friction and the springs of the robot's effects do, shape (N, n)."""
    total = np.zeros_like(states.velocity)
    for use in states.robot.effects:
        k, p = states.joints.index(use.at) if use.at in states.joints else None, use.parameters
        if use.effect == "viscous_friction":
            total[:, k] -= p["coefficient"] * states.velocity[:, k]
        elif use.effect == "cable_spring":
            total[:, k] += p["torque_at_zero"] - p["stiffness"] * states.position[:, k]
    return total


def check_mjcf(path: Path, **options: Any) -> None:
    states = random_states(read_quietly(path, **options))
    wanted, passive = mujoco_forces(path, states)
    np.testing.assert_allclose(states.force, wanted, rtol=0, atol=ROUNDING * np.abs(wanted).max())
    np.testing.assert_allclose(passive_forces(states), passive, rtol=0, atol=ROUNDING * np.abs(passive).max())


@pytest.mark.parametrize("file", ["gimbal.xml", "quadruped.xml"])
def test_mjcf(files: Path, file: str) -> None:
    check_mjcf(files / file)


def test_a_real_quadruped(real: Path) -> None:
    check_mjcf(real / "go2" / "go2.xml")


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass' is deprecated")
@pytest.mark.parametrize(
    ("compiler", "part"),
    [
        ('settotalmass="7"', ""),
        ('boundmass="3" boundinertia="0.05"', ""),
        ('inertiafromgeom="true"', '<inertial pos="0 0 1" mass="5" diaginertia="1 1 1"/>'),
        ('inertiagrouprange="0 1"', '<geom type="sphere" size="0.3" group="2"/>'),
        ('balanceinertia="true"', '<inertial pos="0 0 .1" mass="1" diaginertia="1 1 3"/>'),
        ('eulerseq="XYZ"', '<geom type="box" size=".1 .2 .3" euler="10 20 30"/>'),
        ('eulerseq="xZy"', '<geom type="ellipsoid" size=".1 .2 .3" pos="0 0 .1" euler="10 -20 70"/>'),
        ("", '<frame pos="1 2 3" euler="30 40 50"><geom type="box" size=".1 .2 .3" mass="2"/></frame>'),
        ("", '<geom type="cylinder" fromto="0.1 0.2 0.3 -.1 .1 .5" size=".05" density="300"/>'),
    ],
)
def test_compiler_settings_for_masses(tmp_path: Path, compiler: str, part: str) -> None:
    text = f"""<mujoco><compiler {compiler}/><worldbody><body name="a" pos="0 0 1" euler="20 30 40">
      <joint name="first" axis="0 1 1" pos="0.1 0 0"/><geom type="capsule" size="0.1 0.2"/>{part}
      <body name="b" pos="0.3 0 0"><joint name="second" type="slide" axis="1 0 1"/>
      <geom type="box" size="0.1 0.2 0.3" pos="0 0.1 0"/></body></body></worldbody></mujoco>"""
    (tmp_path / "two.xml").write_text(text)
    check_mjcf(tmp_path / "two.xml")


def test_joints_in_a_frame_are_rotated_with_it(tmp_path: Path) -> None:
    text = """<mujoco><worldbody><body name="a" pos="0 0 1" euler="20 30 40">
      <frame pos="1 2 3" euler="30 40 50"><joint name="first" axis="0 1 1" pos="0.1 0 0" ref="20"/></frame>
      <geom type="box" size="0.1 0.2 0.3" pos="0 0.1 0"/></body></worldbody></mujoco>"""
    (tmp_path / "frame.xml").write_text(text)
    check_mjcf(tmp_path / "frame.xml")
