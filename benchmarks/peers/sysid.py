"""MuJoCo's system-identification toolbox on a case: parameters of a given structure.

The structure is the usual friction model: viscous friction (`damping`) and Coulomb friction (`frictionloss`)
in every joint, an offset of every motor, and every mass that the robot file does not fix (if all are fixed,
every rotor inertia). The toolbox simulates the fitted recordings in windows, each from the estimated state at
its start, under the recorded torque or voltage, and fits the joints' positions.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.peers.cases import Case, Motion, motor_of
from benchmarks.peers.tools import Answer
from robot_model import EffectUse, Robot

__all__ = ["WINDOW", "mujoco_sysid"]

#: Length of a window [s]: long against the position's noise, short against the drift of a free run.
WINDOW = 1.0
#: Masses and rotors lie within this factor of the robot file's.
FACTOR = 3.0
#: Friction is at most this fraction of a joint's rms torque, at top speed where it is viscous.
MOST_FRICTION = 3.0
#: A starting value of friction, relative to its bound: on the bound itself the optimiser stalls.
START = 0.05
#: Iterations at most.
ITERATIONS = 50
#: MuJoCo requires a rotary inertia also for a body that has none [kg m^2].
LEAST_INERTIA = 1e-9


@dataclass(frozen=True)
class _Number:
    """One parameter: label, start, bounds, and the function that sets it in MuJoCo's model."""

    label: str
    start: float
    lower: float
    upper: float
    write: Callable[[Any, float], None]


def mujoco_sysid(case: Case) -> Answer:
    """Fit with `mujoco.sysid`; an answer without predictions where the toolbox is not installed."""
    try:
        from mujoco import sysid

        optimize = sysid.optimize
    except (ImportError, AttributeError):
        return Answer(note="mujoco.sysid is not installed; it comes with the extra `peers`")
    numbers = _numbers(case)
    spec = _spec(case)
    parameters = sysid.ParameterDict()
    for number in numbers:
        parameters.add(
            sysid.Parameter(
                number.label,
                nominal=number.start,
                min_value=number.lower,
                max_value=number.upper,
                modifier=lambda s, p, n=number: n.write(s, float(p.value[0])),
            )
        )
    sequences = _sequences(case, spec, sysid)
    residual = sysid.build_residual_fn(models_sequences=[sequences], n_threads=1)
    with redirect_stdout(io.StringIO()):  # its table of iterations
        found, result = optimize(
            initial_params=parameters,
            residual_fn=residual,
            optimizer="mujoco",
            verbose=False,
            max_iters=ITERATIONS,
            x_scale="jac",
        )
    left = residual(result.x, found)[0]
    _, half = sysid.calculate_intervals(left, np.asarray(result.jac))
    values = {n.label: float(found[n.label].value[0]) for n in numbers}
    robot = _robot(case, values)
    return Answer(
        {label: (value, float(h)) for (label, value), h in zip(values.items(), half)},
        [m.predicted(robot) for m in case.held_out_motions],
        f"{len(sequences.sequence_name)} windows of {WINDOW:g} s",
    )


def _numbers(case: Case) -> list[_Number]:
    found = []
    kept = set(case.nominal.known)
    free = [link for link in case.nominal.links if not {link.name, f"{link.name}.mass"} & kept]
    for link in free:
        found.append(
            _Number(
                f"{link.name}.mass",
                link.mass,
                link.mass / FACTOR,
                FACTOR * link.mass,
                lambda s, value, link=link: _write_mass(s, link, value),  # type: ignore[misc]
            )
        )
    torque = np.sqrt(np.mean(np.concatenate([m.torque for m in case.motions]) ** 2, axis=0))
    speed = np.max([np.abs(m.state[1]).max(axis=0) for m in case.motions], axis=0)
    for joint, level, fastest in zip(case.nominal.moving_joints, torque, speed):
        name, most = joint.name, MOST_FRICTION * float(level)
        inertia = joint.actuator.gear_ratio**2 * joint.actuator.rotor_inertia if joint.actuator else 0.0
        if not free:
            found.append(
                _Number(
                    f"{name}.reflected_inertia",
                    inertia,
                    inertia / FACTOR,
                    FACTOR * inertia,
                    lambda s, value, name=name: setattr(s.joint(name), "armature", value),  # type: ignore[misc]
                )
            )
        for effect, key, bound in (
            ("viscous_friction@{}.coefficient", "damping", most / float(fastest)),
            ("coulomb_friction@{}.torque", "frictionloss", most),
        ):
            found.append(
                _Number(
                    effect.format(name),
                    START * bound,
                    0.0,
                    bound,
                    lambda s, v, name=name, key=key: _write_joint(s, name, key, v),  # type: ignore[misc]
                )
            )
        found.append(
            _Number(
                f"torque_offset@{name}.torque",
                0.0,
                -most,
                most,
                lambda s, value, name=name: _write_offset(s, name, value),  # type: ignore[misc]
            )
        )
    return found


def _write_mass(spec: Any, link: Any, mass: float) -> None:
    """Set a mass and scale the inertia, the shape of the body unchanged."""
    body = spec.body(link.name)
    matrix = np.asarray(link.inertia_matrix) * mass / link.mass + LEAST_INERTIA * np.eye(3)
    body.mass = mass
    body.fullinertia = [matrix[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def _write_joint(spec: Any, name: str, key: str, value: float) -> None:
    """`damping` is a polynomial's coefficients in newer versions, its first being the linear one."""
    joint = spec.joint(name)
    current = getattr(joint, key)
    if np.ndim(current):
        current[:] = 0.0
        current[0] = value
    else:
        setattr(joint, key, value)


def _write_offset(spec: Any, name: str, value: float) -> None:
    spec.actuator(name).biasprm[0] = value


def _spec(case: Case) -> Any:
    """The nominal robot without its effects, a motor and a position sensor at every joint."""
    import mujoco

    from benchmarks.speed.rigid_peers import mjcf

    spec = mujoco.MjSpec.from_string(mjcf(case.nominal))
    spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    spec.option.timestep = 1.0 / case.rate
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for link in case.nominal.links:
        _write_mass(spec, link, link.mass)
    for joint in case.nominal.moving_joints:
        motor = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.gaintype, motor.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        motor.gainprm[0] = 1.0
        if f"{joint.name}.torque" not in case.fitted[0]:  # MuJoCo's way of a motor under voltage
            constant, resistance = motor_of(joint)
            motor.gainprm[0], motor.biasprm[2] = constant / resistance, -(constant**2) / resistance
        spec.add_sensor(
            name=joint.name,
            type=mujoco.mjtSensor.mjSENS_JOINTPOS,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            objname=joint.name,
        )
    return spec


def _sequences(case: Case, spec: Any, sysid: Any) -> Any:
    model = spec.compile()
    names, states, controls, sensed = [], [], [], []
    for motion in case.motions:
        for first, last in _windows(motion):
            q, v = (part[first:last] for part in motion.state[:2])
            time = motion.time[first:last] - motion.time[first]
            names.append(f"{motion.recording.source} {first}")
            states.append(sysid.create_initial_state(model, q[0], v[0]))
            controls.append(sysid.TimeSeries(time, motion.drive[first:last]))
            sensed.append(sysid.TimeSeries.from_names(time, q, model))
    return sysid.ModelSequences(case.title, spec, names, states, controls, sensed)


def _windows(motion: Motion) -> list[tuple[int, int]]:
    size = int(WINDOW * motion.rate)
    return [(k, k + size) for k in range(0, motion.time.size - size, size)]


def _robot(case: Case, values: dict[str, float]) -> Robot:
    """The nominal robot with these parameters, its own effects replaced."""
    links = tuple(_link(link, values.get(f"{link.name}.mass")) for link in case.nominal.links)
    joints = tuple(
        _joint(joint, values.get(f"{joint.name}.reflected_inertia")) for joint in case.nominal.joints
    )
    effects = tuple(
        EffectUse(
            effect=label.split("@")[0], at=label.split("@")[1].split(".")[0], **{label.split(".")[-1]: v}
        )
        for label, v in values.items()
        if "@" in label
    )
    return case.nominal.model_copy(update={"links": links, "joints": joints, "effects": effects})


def _link(link: Any, mass: float | None) -> Any:
    if mass is None:
        return link
    inertia = tuple(number * mass / link.mass for number in link.inertia)
    return link.model_copy(update={"mass": mass, "inertia": inertia})


def _joint(joint: Any, inertia: float | None) -> Any:
    if inertia is None:
        return joint
    rotor = inertia / joint.actuator.gear_ratio**2
    return joint.model_copy(update={"actuator": joint.actuator.model_copy(update={"rotor_inertia": rotor})})
