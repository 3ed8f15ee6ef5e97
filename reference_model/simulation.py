"""Simulation of a robot's reference motion with all effects of its description."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from reference_model.codegen.batched import Batched
from reference_model.control.laws import sample_time
from reference_model.control.motion import reference_function
from reference_model.dynamics.balance import LOADS
from reference_model.fixed_steps.realtime import integrate_fixed
from reference_model.fixed_steps.stopping import StoppingPlant, integrate_stopping
from reference_model.joint.losses import winding_gain
from reference_model.plant.closed_loop import Plant
from reference_model.plant.loop import LOOP_TOLERANCE, unsettled
from reference_model.plant.sensing import measure
from reference_model.plant.sticking import StickingPlant
from reference_model.plant.truth import require_bodies, truth_of
from reference_model.steppers.effort import Effort
from reference_model.steppers.explicit_run import integrate_explicit
from reference_model.steppers.held_run import integrate_held
from reference_model.steppers.integration import Course, integrate
from reference_model.steppers.rosenbrock_run import integrate_rosenbrock
from reference_model.steppers.sticking import integrate_sticking
from robot_model import Bearing, InputError, Recording, Robot, VoltageServo
from robot_model.description.loosening import loosened

__all__ = ["simulate"]

Array = NDArray[np.float64]


def simulate(
    robot: Robot,
    *,
    seed: int = 0,
    sensors: bool = True,
    stiction: bool = False,
    rtol: float = 1e-8,
    atol: float = 1e-10,
    step: float | None = None,
    compile_code: bool = False,
    integrator: Literal["implicit", "explicit", "rosenbrock"] = "implicit",
    work: bool = False,
    losses: bool = False,
    effort: Effort | None = None,
    any_bodies: bool = False,
) -> Recording:
    """Simulate the robot's reference motion.

    Dry friction is smoothed over `acting.TRANSITION` of speed, so that a joint under load creeps at about
    that speed. With `stiction` it is exact: a joint sticks, without any creep, until the force that holds it
    reaches the static level, and events in between are located; see `reference_model.steppers.sticking`. With
    `stiction` and a `step`, friction stops a joint within a step where its level suffices: no creep, and no
    events either; see `reference_model.fixed_steps.stopping`.

    The controller uses the true state; sensors do not act back. With `sensors`, the channels are those of the
    robot's sensors, with the sensor effects, noise and resolution of the description, and every joint's
    `reference_position`; a robot without sensors is measured on every channel. Without `sensors`, every
    channel is there and true:

    per joint `position`, `velocity`, `acceleration`, `torque` (of the actuator at the joint, as commanded to
    the drive and limited by it), `reference_position`, `reference_velocity`, `friction_torque`,
    `radial_force`, `axial_force`, `bending_moment`, `load_moment` (W of the bearing), and where they exist
    `current`, `voltage`, `bristle`, `sticking`, `contact_force` (of a bearing with clearance); where a gear
    is elastic or has play, or a sensor asks for them, `motor_position`, `motor_velocity` (at the joint side
    of the gear), and in the former case `gear_torque`, which the gear transmits;
    per motor of a transmission `position`, `velocity`, `torque` behind its gear, and where they exist
    `current`, `voltage`, `gear_torque`; of the joints of a transmission `torque` is what its motors' torques
    do there, and the friction of these motors is in their `friction_torque`;
    for a free base `base.position` (inertial frame), `base.attitude`, and in base axes
    `base.linear_velocity`, `base.angular_velocity`, `base.linear_acceleration` (inertial, gravity not in
    it), and where the controller holds it the wrench `base.control_force`, `base.control_torque` about the
    base frame's origin; `robot.energy`, `robot.linear_momentum`, `robot.angular_momentum` (about the centre
    of mass, inertial axes); and where friction depends on what it causes, `robot.loop_residual`, the largest
    relative error left in that loop. With `work` also `robot.work`: what actuators, effects at joints and the
    wrench on a held base did since the start, less what damping of flexible links took, integrated with the
    motion; energy less work is constant.

    With `losses` per joint `friction_power` and `friction_energy` (since the start), and where the actuator's
    torque constant and resistance are known `armature_power` and `armature_energy`, R i^2.

    per spherical joint `attitude` (child to joint axes) and `angular_velocity` (child against parent, child
    axes); per flexible link `tip_deflection` (link's axes), `tip_acceleration` (inertial, in the axes of the
    deformed tip, gravity not in it), `strain.N` of each gauge and `modal_coordinate.N`.

    Args:
        robot: the description, with a reference motion.
        seed: of the sensor noise; each channel's noise depends on the seed and its name alone.
        sensors: measured channels (True) or true ones (False).
        stiction: exact stick and slip instead of smoothed dry friction.
        rtol, atol: tolerances of the integration.
        step: [s]; runs at this fixed step as a real-time loop would (see `realtime`), without tolerances.
        compile_code: run the robot as compiled C where that is possible (see `compiled`); the same recording
            to rounding. Compiling takes seconds and is kept for the next run of the very same robot, so it
            is worth it for a robot that is simulated again and again, and not for one run.
        integrator: "implicit", which carries any friction; or "explicit", which runs as compiled C only and
            is some times faster for the same accuracy where nothing is stiff: without dry friction, or with
            soft bristles (see `explicit_run`); or "rosenbrock", which carries any friction in long steps and
            is some times faster than both where something is stiff: as compiled C only where the controller
            is continuous (see `rosenbrock_run`), uncompiled where it is sampled (see `held_run`).
        work: integrate the work as well.
        losses: record the losses in friction and in the windings' resistance.
        effort: counter to which the run adds its steps.
        any_bodies: also run links of negative mass or unrealisable inertia, which a fit may pass through.

    Raises:
        InputError: no reference motion, an effect that cannot be simulated, effects that leave a link with
            mass properties that no body has, a sensor of a channel that does
            not exist, or an integration that fails.
    """
    robot = loosened(robot)
    if robot.reference is None:
        raise InputError(
            f"robot '{robot.name}' has no reference motion; add a [reference] table with a duration to "
            "its file or an overlay."
        )
    reference = reference_function(robot)
    count = int(np.floor(robot.reference.duration * robot.reference.sample_rate * (1 + 1e-12))) + 1
    time = np.arange(count) / robot.reference.sample_rate
    if integrator != "implicit" and (stiction or step is not None):
        raise InputError(
            f"robot '{robot.name}': stiction and fixed steps bring integrators of their own; "
            'leave them out or take the integrator "implicit".'
        )
    if robot.effects and not any_bodies:
        require_bodies(truth_of(robot))
    settings: dict[str, Any] = {"hold": sample_time(robot), "compile_code": compile_code}
    plant: Plant
    if stiction and step is not None:
        plant = stopping = StoppingPlant(robot, work=work, losses=losses)
        course = integrate_stopping(stopping, reference, time, **settings, step=step, effort=effort)
    elif stiction:
        plant = sticking = StickingPlant(robot, work=work, losses=losses)
        course = integrate_sticking(
            sticking, reference, time, **settings, rtol=rtol, atol=atol, effort=effort
        )
    elif step is not None:
        plant = Plant(robot, work=work, losses=losses)
        course = integrate_fixed(plant, reference, time, **settings, step=step)
    elif integrator == "explicit":
        plant = Plant(robot, work=work, losses=losses)
        course = integrate_explicit(plant, reference, time, hold=settings["hold"], rtol=rtol, atol=atol)
    elif integrator == "rosenbrock":
        plant = Plant(robot, work=work, losses=losses)
        accuracy = {"hold": settings["hold"], "rtol": rtol, "atol": atol}
        if settings["hold"] > 0:
            course = integrate_held(plant, reference, time, **accuracy, effort=effort)
        else:
            course = integrate_rosenbrock(plant, reference, time, **accuracy)
    else:
        plant = Plant(robot, work=work, losses=losses)
        course = integrate(plant, reference, time, **settings, rtol=rtol, atol=atol)
    channels = _channels(plant, course, Batched(reference)(time[:, None]))
    source = f"reference model, robot '{robot.name}'"
    return (
        measure(robot, time, channels, seed=seed, source=source)
        if sensors
        else Recording(time, channels, source)
    )


def _channels(plant: Plant, course: Course, reference: tuple[Array, ...]) -> dict[str, Array]:
    """All true channels."""
    column = course.time[:, None]
    modes = () if course.modes is None else (course.modes,)
    values = Batched(plant.watch)(column, course.states, reference[0], course.commands, *modes)
    watched = dict(zip(Plant.WATCHED, values))
    worst = int(np.argmax(watched["residual"]))
    if not watched["residual"][worst, 0] < LOOP_TOLERANCE:
        raise unsettled(plant.robot, float(course.time[worst]))
    parts = plant.layout.split(course.states)
    return {
        **_joint_channels(plant, parts, watched, reference),
        **_sticking_channels(plant, course),
        **_motor_channels(plant, watched["torque"], course.commands[:, plant.wrench :]),
        **_gear_channels(plant, parts, watched["gears"]),
        **(_base_channels(parts, watched) if plant.layout.free_base else {}),
        **_ball_channels(plant, parts),
        **_link_channels(plant, parts, watched["tips"]),
        **(_wrench_channels(course.commands) if plant.wrench else {}),
        "robot.energy": watched["energy"][:, 0],
        **({"robot.work": parts["work"][:, 0]} if plant.layout.work else {}),
        **_axes("robot.linear_momentum", watched["linear"]),
        **_axes("robot.angular_momentum", watched["angular"]),
        **({"robot.loop_residual": watched["residual"][:, 0]} if plant.forces.needs_solving() else {}),
    }


def _joint_channels(
    plant: Plant, parts: Mapping[str, Array], watched: Mapping[str, Array], reference: tuple[Array, ...]
) -> dict[str, Array]:
    names = [joint.name for joint in plant.robot.moving_joints]
    offset = plant.tree.offset
    loads = watched["loads"].reshape(len(parts["position"]), len(names), len(LOADS))
    bearings = [joint.bearing or Bearing() for joint in plant.robot.moving_joints]
    axial, radial = (np.array([getattr(b, f"{way}_arm") for b in bearings]) for way in ("axial", "radial"))
    columns = {
        "position": parts["position"],
        "velocity": parts["velocity"],
        "acceleration": watched["acceleration"][:, offset : offset + len(names)],
        "torque": watched["torque"] @ plant.robot.coupling,
        "reference_position": reference[0],
        "reference_velocity": reference[1],
        "friction_torque": watched["friction"],
        **{name: loads[:, :, row] for row, name in enumerate(LOADS[:3])},
        "load_moment": axial * loads[:, :, LOADS.index("axial_force")]
        + radial * loads[:, :, LOADS.index("radial_sum")],
        "temperature": watched["temperature"],
    }
    found = {f"{name}.{key}": value[:, k] for k, name in enumerate(names) for key, value in columns.items()}
    if plant.robot.transmissions:
        found |= _coupled_channels(plant, parts, watched["torque"])
    bristles = {f"{name}.bristle": parts["effects"][:, row] for name, row in plant.forces.bristles}
    loose = plant.forces.bearings.names
    pressed = {f"{name}.contact_force": watched["contact"][:, k] for k, name in enumerate(loose)}
    return {**found, **bristles, **pressed, **_loss_channels(plant, parts, watched)}


def _coupled_channels(plant: Plant, parts: Mapping[str, Array], torque: Array) -> dict[str, Array]:
    """Motion and torque of the motors of transmissions, behind their gears."""
    motion = {"position": parts["position"], "velocity": parts["velocity"]}
    columns = {name: values @ plant.robot.coupling.T for name, values in motion.items()}
    for i, k in enumerate(plant.gears.drives):
        columns["position"][:, k], columns["velocity"][:, k] = (
            parts["motor"][:, i],
            parts["motor_rates"][:, i],
        )
    columns["torque"] = torque
    own = plant.gears.coupling.motors.items()
    return {f"{name}.{key}": values[:, k] for name, k in own for key, values in columns.items()}


def _loss_channels(
    plant: Plant, parts: Mapping[str, Array], watched: Mapping[str, Array]
) -> dict[str, Array]:
    """Power and energy since the start that friction takes, and armatures whose resistance is known."""
    if not plant.layout.losses:
        return {}
    gains = winding_gain(plant.robot).full().ravel()
    count = len(gains)
    found: dict[str, Array] = {}
    for k, (joint, drive) in enumerate(zip(plant.robot.moving_joints, plant.robot.drives)):
        found[f"{joint.name}.friction_power"] = -watched["friction"][:, k] * parts["velocity"][:, k]
        found[f"{joint.name}.friction_energy"] = parts["losses"][:, k]
        if gains[k]:
            found[f"{drive.name}.armature_power"] = gains[k] * watched["torque"][:, k] ** 2
            found[f"{drive.name}.armature_energy"] = parts["losses"][:, count + k]
    return found


def _sticking_channels(plant: Plant, course: Course) -> dict[str, Array]:
    """1 while a joint sticks, else 0, where that is exact."""
    if course.modes is None:
        return {}
    names = [joint.name for joint in plant.robot.moving_joints]
    return {f"{name}.sticking": (course.modes[:, k] == 0).astype(float) for k, name in enumerate(names)}


def _motor_channels(plant: Plant, torque: Array, commands: Array) -> dict[str, Array]:
    """Current where the torque constant is known, and the voltage of a voltage servo."""
    found: dict[str, Array] = {}
    for k, drive in enumerate(plant.robot.drives):
        actuator = drive.actuator
        if actuator and actuator.torque_constant:
            found[f"{drive.name}.current"] = torque[:, k] / (actuator.gear_ratio * actuator.torque_constant)
        if actuator and isinstance(plant.robot.controller, VoltageServo):
            found[f"{drive.name}.voltage"] = commands[:, k]
    return found


def _gear_channels(plant: Plant, parts: Mapping[str, Array], torque: Array) -> dict[str, Array]:
    """Of motors that move by themselves their motion and what the gears transmit; of others on request."""
    wanted = {sensor.channel for sensor in plant.robot.sensors}
    found: dict[str, Array] = {}
    drives = plant.robot.drives
    for k, joint in enumerate(drive.joint for drive in drives):
        if joint is None:
            continue  # its motor's channels go by the motor's own name
        for name, side in (("position", "motor"), ("velocity", "motor_rates")):
            channel = f"{joint.name}.motor_{name}"
            if k in plant.gears.drives:
                found[channel] = parts[side][:, plant.gears.drives.index(k)]
            elif channel in wanted:
                found[channel] = parts[name][:, k]
    gears = {drives[k].name: torque[:, i] for i, k in enumerate(plant.gears.drives)}
    return {**found, **{f"{name}.gear_torque": values for name, values in gears.items()}}


def _base_channels(parts: Mapping[str, Array], watched: Mapping[str, Array]) -> dict[str, Array]:
    attitude = parts["attitude"] / np.linalg.norm(parts["attitude"], axis=1, keepdims=True)
    return {
        **_axes("base.position", parts["base_position"]),
        **_axes("base.attitude", attitude, "wxyz"),
        **_axes("base.linear_velocity", parts["base_velocity"][:, :3]),
        **_axes("base.angular_velocity", parts["base_velocity"][:, 3:]),
        **_axes("base.linear_acceleration", watched["acceleration"][:, :3]),
    }


def _ball_channels(plant: Plant, parts: Mapping[str, Array]) -> dict[str, Array]:
    found: dict[str, Array] = {}
    for k, joint in enumerate(plant.robot.spherical_joints):
        attitude = parts["balls"][:, 4 * k : 4 * k + 4]
        attitude = attitude / np.linalg.norm(attitude, axis=1, keepdims=True)
        found |= _axes(f"{joint.name}.attitude", attitude, "wxyz")
        found |= _axes(f"{joint.name}.angular_velocity", parts["ball_rates"][:, 3 * k : 3 * k + 3])
    return found


def _link_channels(plant: Plant, parts: Mapping[str, Array], tips: Array) -> dict[str, Array]:
    """Of flexible links: tip deflection and acceleration, strain, modal coordinates."""
    found: dict[str, Array] = {}
    for k, body in enumerate(plant.flexible):
        assert body.flexible is not None
        x = parts["modal"][:, body.modal : body.modal + body.modes]
        found |= _axes(f"{body.name}.tip_deflection", tips[:, 6 * k : 6 * k + 3])
        found |= _axes(f"{body.name}.tip_acceleration", tips[:, 6 * k + 3 : 6 * k + 6])
        strain = x @ body.flexible.strain.T
        found |= {f"{body.name}.strain.{g + 1}": strain[:, g] for g in range(strain.shape[1])}
        found |= {f"{body.name}.modal_coordinate.{a + 1}": x[:, a] for a in range(body.modes)}
    return found


def _wrench_channels(commands: Array) -> dict[str, Array]:
    return {**_axes("base.control_force", commands[:, :3]), **_axes("base.control_torque", commands[:, 3:6])}


def _axes(name: str, columns: Array, axes: str = "xyz") -> dict[str, Array]:
    return {f"{name}.{axis}": columns[:, k] for k, axis in enumerate(axes)}
