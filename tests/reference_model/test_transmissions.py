"""Motors that move several joints together, in both engines: equations by hand, power, no transmission."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

import exudyn_model
from reference_model.evaluation.model import RobotModel
from reference_model.simulation import simulate
from robot_model import InputError, Recording, Robot, load_robot

#: Inertia of the two bodies, and rotors behind their gears [kg m^2].
BODIES, ROTORS = np.diag([3.0, 2.0]), np.diag([0.4, 0.1])
#: A differential: both joints by both motors, one of them geared down.
DIFFERENTIAL = [[0.5, 0.5], [0.8, -0.8]]
COUPLING = np.linalg.inv(DIFFERENTIAL)


def reference(robot: Robot, **settings: Any) -> Recording:
    return simulate(robot, sensors=False, **settings)


def exudyn(robot: Robot, **settings: Any) -> Recording:
    return exudyn_model.simulate(robot, sensors=False, step=5e-4, **settings)


def by_constraints(robot: Robot) -> Recording:
    return exudyn(robot, formulation="redundant")


engines = pytest.mark.parametrize("run", [reference, exudyn])


def differential(*effects: dict, motor: Mapping[str, float] | None = None, **more: Any) -> Robot:
    """Two bodies that turn about an axis each, moved by motors of 0.4 and 0.1 kg m^2 behind their gears."""
    names = ("one", "two")
    return Robot.model_validate(
        {
            "name": "differential",
            "links": [
                {"name": f"body {k}".replace(" ", "_"), "inertia": (j, j, j), "mass": 1.0}
                for k, j in enumerate(np.diag(BODIES))
            ],
            "joints": [
                {"name": name, "parent": "base", "child": f"body_{k}", "initial_velocity": 1.0 - 0.3 * k}
                for k, name in enumerate(names)
            ],
            "transmissions": [
                {
                    "name": "bevels",
                    "joints": names,
                    "matrix": DIFFERENTIAL,
                    "motors": [
                        {"name": "left", "gear_ratio": 20.0, "rotor_inertia": 1e-3, **(motor or {})},
                        {"name": "right", "gear_ratio": 10.0, "rotor_inertia": 1e-3},
                    ],
                }
            ],
            "effects": effects,
            "reference": {"duration": 1.0, "sample_rate": 100.0},
            **more,
        }
    )


def at(effect: str, place: str, **parameters: float) -> dict:
    return {"effect": effect, "at": place, **parameters}


def velocities(recording: Recording) -> NDArray[np.float64]:
    return np.column_stack([recording[f"{name}.velocity"] for name in ("one", "two")])


@engines
def test_rotors_friction_and_torque_at_the_motors_of_a_differential(
    run: Callable[[Robot], Recording],
) -> None:
    """(J + C^T B C) v' = C^T (u - D C v) - d v, D at the motors and d at a joint, u at one motor."""
    robot = differential(
        at("viscous_friction", "left", coefficient=0.7),
        at("viscous_friction", "two", coefficient=0.5),
        at("torque_offset", "right", torque=0.9),
        motor={"viscous_friction": 0.2},
    )
    mass = BODIES + COUPLING.T @ ROTORS @ COUPLING
    damping = COUPLING.T @ np.diag([0.9, 0.0]) @ COUPLING + np.diag([0.0, 0.5])
    push = COUPLING.T @ [0.0, 0.9]
    found = run(robot)
    # v' = -A v + b as one linear system of (v, 1)
    system = np.zeros((3, 3))
    system[:2, :2], system[:2, 2] = -np.linalg.solve(mass, damping), np.linalg.solve(mass, push)
    wanted = np.array([expm(system * t)[:2] @ [1.0, 0.7, 1.0] for t in found.time])
    np.testing.assert_allclose(velocities(found), wanted, atol=2e-6)  # integration at 1e-8 and at 0.5 ms
    motors = np.column_stack([found[f"{name}.velocity"] for name in ("left", "right")])
    np.testing.assert_allclose(motors, wanted @ COUPLING.T, atol=1e-5)


@engines
def test_dry_friction_at_a_motor_brakes_both_joints(run: Callable[[Robot], Recording]) -> None:
    """While the left motor turns forwards it loses T: (J + C^T B C) v' = -C^T (T, 0)."""
    found = run(differential(at("coulomb_friction", "left", torque=0.3)))
    mass = BODIES + COUPLING.T @ ROTORS @ COUPLING
    slope = -np.linalg.solve(mass, COUPLING.T @ [0.3, 0.0])
    wanted = np.array([1.0, 0.7]) + np.outer(found.time, slope)
    assert (wanted @ COUPLING.T)[:, 0].min() > 0.0
    np.testing.assert_allclose(velocities(found), wanted, atol=2e-6)
    torques = np.column_stack([found[f"{name}.friction_torque"] for name in ("one", "two")])
    np.testing.assert_allclose(torques, np.tile(-COUPLING.T @ [0.3, 0.0], (len(torques), 1)), atol=1e-6)


#: Everything that can sit at a motor, with numbers at which it acts.
AT_MOTORS = (
    at("stribeck_friction", "M", coulomb_torque=0.2, static_torque=0.3, stribeck_velocity=0.05),
    at(
        "lugre_friction",
        "M",
        coulomb_torque=0.2,
        static_torque=0.3,
        stribeck_velocity=0.1,
        bristle_stiffness=200.0,
        bristle_damping=2.0,
    ),
    at("torque_ripple", "M", cosine=0.2, sine=0.1, order=6.0),
    at("torque_gain", "M", gain_error=-0.2),
    at("torque_saturation", "M", limit=2.0),
    at("actuator_lag", "M", time_constant=0.02),
    at("position_dependent_friction", "M", cosine=0.2, sine=0.1, order=3.0),
    at("backlash", "M", half_width=0.01, stiffness=500.0, damping=2.0),
    at("cable_spring", "M", stiffness=2.0),
)


def hinge(effect: dict, *, coupled: bool) -> Robot:
    """A body that follows a cycloid, by a motor of its own or by one behind a transmission of one to one."""
    motor = {"gear_ratio": 10.0, "rotor_inertia": 1e-3, "torque_limit": 30.0, "coulomb_friction": 0.05}
    joint: dict[str, Any] = {"name": "hinge", "parent": "base", "child": "body"}
    transmission = {
        "name": "belt",
        "joints": ["hinge"],
        "matrix": [[1.0]],
        "motors": [{"name": "motor", **motor}],
    }
    return Robot.model_validate(
        {
            "name": "hinge",
            "gravity": [0.0, -9.81, 0.0],
            "links": [
                {"name": "body", "mass": 1.0, "inertia": (1.0, 1.0, 1.0), "center_of_mass": (0.1, 0.0, 0.0)}
            ],
            "joints": [joint if coupled else {**joint, "actuator": motor}],
            "transmissions": [transmission] if coupled else [],
            "effects": [{**effect, "at": "motor" if coupled else "hinge"}],
            "controller": {"kind": "pd", "kp": 60.0, "kd": 8.0, "feedback": "joint"},
            "reference": {
                "duration": 0.2,
                "sample_rate": 100.0,
                "joints": [{"joint": "hinge", "kind": "cycloid", "displacement": 0.4, "duration": 0.4}],
            },
        }
    )


#: What Exudyn adds at a motor by different code; the rest of its effects are proofs.
BY_EXUDYN = ("lugre_friction", "actuator_lag")


@pytest.mark.parametrize(
    ("run", "effect"),
    [
        pytest.param(
            run,
            effect,
            id=f"{effect['effect']}-{run.__name__}",
            marks=() if run is reference or effect["effect"] in BY_EXUDYN else pytest.mark.proof,
        )
        for effect in AT_MOTORS
        for run in (reference, exudyn)
    ],
)
def test_a_transmission_of_one_to_one_changes_nothing(
    run: Callable[[Robot], Recording], effect: dict
) -> None:
    own, coupled = run(hinge(effect, coupled=False)), run(hinge(effect, coupled=True))
    rounding = 0.0 if run is reference else 1e-9  # Exudyn sums the laws in another order
    for quantity in ("position", "velocity", "torque", "friction_torque"):
        channel = f"hinge.{quantity}"
        np.testing.assert_allclose(own[channel], coupled[channel], rtol=0.0, atol=rounding, err_msg=channel)
    np.testing.assert_array_equal(coupled["motor.torque"], coupled["hinge.torque"])


#: A wrist whose last axis is moved by both motors, on a body that turns under gravity.
WRIST = [[1.0, 0.0], [-0.4, 1.0]]


def wrist(*effects: dict, controller: Mapping[str, Any] | None = None) -> Robot:
    """An arm of three axes; the last two are moved together by `swing` and `twist`."""
    motor = {"gear_ratio": 20.0, "rotor_inertia": 2e-4, "torque_constant": 0.1, "resistance": 0.5}
    chain = {
        "shoulder": ("base", "upper", (0.0, 0.0, 1.0)),
        "bend": ("upper", "fore", (0.0, 1.0, 0.0)),
        "roll": ("fore", "hand", (1.0, 0.0, 0.0)),
    }
    return Robot.model_validate(
        {
            "name": "wrist",
            "gravity": [0.0, 0.0, -9.81],
            "links": [
                {
                    "name": link,
                    "mass": 1.0,
                    "center_of_mass": (0.15, 0.02, 0.05),
                    "inertia": (0.02, 0.03, 0.03),
                }
                for _, link, _ in chain.values()
            ],
            "joints": [
                {
                    "name": name,
                    "parent": parent,
                    "child": child,
                    "axis": axis,
                    "origin": (0.0 if parent == "base" else 0.3, 0.0, 0.0),
                    **({"actuator": motor} if name == "shoulder" else {}),
                }
                for name, (parent, child, axis) in chain.items()
            ],
            "transmissions": [
                {
                    "name": "wrist",
                    "joints": ["bend", "roll"],
                    "matrix": WRIST,
                    "motors": [{"name": "swing", **motor}, {"name": "twist", **motor}],
                }
            ],
            "controller": controller or {"kind": "pd", "kp": 400.0, "kd": 20.0},
            "effects": effects,
            "reference": {
                "duration": 0.25,
                "sample_rate": 100.0,
                "joints": [
                    {"joint": name, "kind": "cycloid", "displacement": turn, "duration": 0.5}
                    for name, turn in zip(chain, (0.5, -0.4, 0.7))
                ],
            },
        }
    )


MIXED = (
    at("coulomb_friction", "swing", torque=0.2),
    at(
        "lugre_friction",
        "twist",
        coulomb_torque=0.2,
        static_torque=0.3,
        stribeck_velocity=0.2,
        bristle_stiffness=300.0,
        bristle_damping=2.0,
    ),
    at("torque_gain", "swing", gain_error=0.1),
    at("viscous_friction", "roll", coefficient=0.1),
    at("joint_elasticity", "twist", stiffness=3e3, damping=1.0),
)


def test_power_is_the_same_on_both_sides_of_a_transmission() -> None:
    found = reference(wrist(*MIXED), work=True)
    change = found["robot.energy"] - found["robot.work"]
    assert np.ptp(change) < 1e-5 * np.ptp(found["robot.energy"])  # the tolerance of the integration


@pytest.mark.parametrize(
    ("run", "controller"),
    [
        pytest.param(exudyn, None, id="tree"),
        pytest.param(by_constraints, None, id="constraints", marks=pytest.mark.proof),
        pytest.param(exudyn, {"kind": "voltage_servo", "gain": 8.0, "supply": 24.0}, id="servo"),
        pytest.param(exudyn, {"kind": "computed_torque", "kp": 400.0, "kd": 40.0}, id="computed torque"),
    ],
)
def test_engines_agree(run: Callable[[Robot], Recording], controller: Mapping[str, Any] | None) -> None:
    """To what steps of 0.5 ms of the second order leave beside motions of 0.5 s: (h/T)^2 and tens of that."""
    robot = wrist(*MIXED, controller=controller)
    one, other = reference(robot), run(robot)
    for channel in other.channels:
        size = max(np.ptp(one[channel]), 1e-3)
        bound = 1e-4 if channel.endswith(("position", "velocity")) else 3e-3
        assert np.abs(one[channel] - other[channel]).max() < bound * size, channel
    assert {"swing.torque", "twist.current", "twist.gear_torque"} <= set(other.channels)


LEVELS = {"coulomb_torque": 1.0, "static_torque": 1.5, "stribeck_velocity": 0.01}
BRISTLES = {**LEVELS, "bristle_stiffness": 1e4, "bristle_damping": 10.0}
RUBBING = (
    at("stribeck_friction", "joint1", **LEVELS),
    at("lugre_friction", "second", **BRISTLES),
    at("lugre_friction", "joint2", **BRISTLES, load_coefficient=0.1, load_static_coefficient=0.15),
)


def bent(*effects: dict) -> Robot:
    """The flexible space robot on two motors, the second of which also turns the first joint's link."""
    data = load_robot("flexible_space_robot_planar").model_dump(exclude_none=True)
    for joint in data["joints"]:
        del joint["actuator"]
    motor = {"gear_ratio": 20.0, "rotor_inertia": 1e-3}
    motors = [{"name": name, **motor} for name in ("first", "second")]
    coupled = {"name": "belt", "joints": ["joint1", "joint2"], "matrix": WRIST, "motors": motors}
    motion = {"joint": "joint1", "kind": "quintic", "displacement": 0.05, "duration": 0.05}
    return Robot.model_validate(
        data
        | {
            "transmissions": [coupled],
            "sensors": [],
            "effects": effects,
            "controller": {"kind": "pd", "kp": 1000.0, "kd": 300.0},
            "reference": {"duration": 0.02, "sample_rate": 100.0, "joints": [motion]},
        }
    )


def test_engines_agree_on_friction_of_coupled_motors_that_move_flexible_links() -> None:
    own, other = reference(bent(*RUBBING)), exudyn(bent(*RUBBING))
    smooth = reference(bent())
    for channel in ("joint1.position", "joint2.position", "link2.tip_deflection.y"):
        rubbed = np.abs(own[channel] - smooth[channel]).max()
        # The trapezoidal rule at 0.5 ms errs by some 1e-4 of the motion.
        np.testing.assert_allclose(other[channel], own[channel], atol=5e-4 * np.ptp(own[channel]))
        assert rubbed > 5e-3 * np.ptp(own[channel])


def test_two_formulations_agree_on_coupled_rotors() -> None:
    rng = np.random.default_rng(1)
    model = RobotModel(wrist())
    q, qd, qdd = rng.normal(size=(3, 5, 3))
    torque = model.inverse_dynamics(q, qd, qdd)
    np.testing.assert_allclose(model.forward_dynamics(q, qd, torque), qdd, atol=1e-10)
    matrix, forces = model.minimal_form(q, qd)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", matrix, qdd) - forces, torque, atol=1e-10)
    np.testing.assert_allclose(model.mass_matrix(q), matrix, atol=1e-12)
    rotors = COUPLED.T @ np.diag([0.08] * 2) @ COUPLED
    bare = RobotModel(without_rotors(wrist())).mass_matrix(q)
    np.testing.assert_allclose((matrix - bare)[:, 1:, 1:], np.broadcast_to(rotors, (5, 2, 2)), atol=1e-12)


COUPLED = np.linalg.inv(WRIST)


def without_rotors(robot: Robot) -> Robot:
    text = robot.model_dump()
    for motor in text["transmissions"][0]["motors"]:
        motor["rotor_inertia"] = 0.0
    text["joints"][0]["actuator"]["rotor_inertia"] = 0.08 / 400.0
    return Robot.model_validate(text)


@pytest.mark.parametrize(
    ("run", "settings"),
    [
        (simulate, {"stiction": True}),
        (exudyn_model.simulate, {"stiction": True, "step": 1e-3, "integrator": "runge-kutta"}),
    ],
)
def test_exact_stiction_of_a_coupled_motor_is_refused(
    run: Callable[..., Recording], settings: dict[str, Any]
) -> None:
    """Nothing would stop it: the velocity that friction brings to zero is that of several joints."""
    with pytest.raises(InputError, match=r"motor 'swing': exact stick and slip is of joints"):
        run(wrist(at("coulomb_friction", "swing", torque=0.2)), **settings)
    run(differential(at("viscous_friction", "left", coefficient=0.2)), **settings)


@engines
def test_gear_effects_are_at_motors_and_not_at_joints(run: Callable[[Robot], Recording]) -> None:
    with pytest.raises(InputError, match=r"at 'roll': it can sit at|it can sit at .* not at 'roll'"):
        run(wrist(at("joint_elasticity", "roll", stiffness=1e3)))
