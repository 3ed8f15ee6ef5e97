"""Sliding mode and the adaptive network: closed forms, limits that are other controllers, both engines."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
import tomli_w
from sliding_blocks import MASS, block

import exudyn_model
from exudyn_model.control.base import JointState
from exudyn_model.control.nonlinear import SlidingModeLaw
from reference_model.simulation import simulate
from robot_model import InputError, Recording, Robot, load_robot, robot_from_toml, robot_to_toml


def reference(robot: Robot) -> Recording:
    return simulate(robot, sensors=False)


def exudyn(robot: Robot) -> Recording:
    return exudyn_model.simulate(robot, sensors=False)


both = pytest.mark.parametrize("run", [reference, exudyn])
#: What a test of both engines beside each other holds too.
also_by_exudyn = pytest.mark.parametrize("run", [reference, pytest.param(exudyn, marks=pytest.mark.proof)])
SLIDING = {"kind": "sliding_mode", "slope": 2.0, "rate": 1.0, "boundary_layer": 1e-3}
NETWORK = {"kind": "adaptive_network", "kp": 25.0, "kd": 10.0, "centres": 5, "width": 1.0, "adaptation": 0.0}
RUBBING = {"effect": "viscous_friction", "at": "slide", "coefficient": 3.0}
#: A constant push unknown to the controllers [N].
PUSH = {"effect": "external_torque", "at": "slide", "torque": 4.0, "start": 0.0, "duration": 100.0}


def arm(controller: dict, effects: tuple[dict, ...] = (), **more) -> Robot:
    data = load_robot("two_link_arm").model_dump()
    data |= {"sensors": [], "controller": controller, "effects": effects, **more}
    data["reference"] = {
        "duration": 0.5,
        "sample_rate": 100.0,
        "joints": [
            {"joint": "joint1", "kind": "quintic", "displacement": 0.4, "duration": 0.4},
            {"joint": "joint2", "kind": "quintic", "displacement": -0.5, "duration": 0.5},
        ],
    }
    return Robot.model_validate(data)


FRICTION = tuple(
    {"effect": "stribeck_friction", "at": name, "coulomb_torque": 2.0, "static_torque": 3.0}
    | {"stribeck_velocity": 0.1}
    for name in ("joint1", "joint2")
)
PAYLOAD = {"effect": "payload", "at": "link2", "mass": 2.0, "x": 0.3, "y": 0.0, "z": 0.0}


@both
@pytest.mark.parametrize("proportional", [0.0, 3.0])
def test_the_sliding_variable_follows_its_reaching_law(
    run: Callable[[Robot], Recording], proportional: float
) -> None:
    law = {**SLIDING, **({"reaching": "exponential", "proportional": proportional} if proportional else {})}
    found = run(block(velocity=1.0, controller=law, rate=200.0))
    surface = -found["slide.velocity"] - 2.0 * found["slide.position"]  # the reference rests at zero
    time = found.time
    if proportional:
        wanted = -((1 + 1 / proportional) * np.exp(-proportional * time) - 1 / proportional)
    else:
        wanted = -(1 - time)
    outside = wanted < -2e-3
    assert outside.sum() > 80
    np.testing.assert_allclose(surface[outside], wanted[outside], atol=1e-5)
    assert np.all(np.abs(surface[time > time[outside][-1] + 0.1]) < 1e-3)  # and stays in the layer


@also_by_exudyn
def test_inside_the_layer_it_is_computed_torque(run: Callable[[Robot], Recording]) -> None:
    wide = {**SLIDING, "boundary_layer": 10.0, "rate": 80.0}  # p = 8 1/s
    linear = {"kind": "computed_torque", "kp": 2.0 * 8.0, "kd": 2.0 + 8.0}
    own, other = (run(arm(law, FRICTION)) for law in (wide, linear))
    np.testing.assert_allclose(own["joint1.position"], other["joint1.position"], atol=1e-8)
    np.testing.assert_allclose(own["joint2.torque"], other["joint2.torque"], atol=1e-5)


@also_by_exudyn
def test_a_network_that_does_not_adapt_is_computed_torque(run: Callable[[Robot], Recording]) -> None:
    linear = {"kind": "computed_torque", "kp": 25.0, "kd": 10.0}
    own, other = (run(arm(law, FRICTION)) for law in (NETWORK, linear))
    np.testing.assert_allclose(own["joint1.position"], other["joint1.position"], atol=1e-8)


@also_by_exudyn
def test_infinitely_wide_basis_functions_are_integral_action(run: Callable[[Robot], Recording]) -> None:
    """With phi = 1 the m weights make a = m adaptation (e + kd/2 int e): the PID of a pushed block."""
    network = {**NETWORK, "width": 1e6, "adaptation": 4.0}
    pid = {"kind": "pd", "kp": MASS * (25.0 + 20.0), "kd": MASS * 10.0, "ki": MASS * 20.0 * 5.0}
    own, other = (run(block(RUBBING, PUSH, controller=law)) for law in (network, pid))
    assert np.ptp(other["slide.position"]) > 0.02
    np.testing.assert_allclose(own["slide.position"], other["slide.position"], atol=1e-6)


@also_by_exudyn
def test_leakage_bounds_the_weights(run: Callable[[Robot], Recording]) -> None:
    """At rest W = phi s / leakage, so that an error w/(kp + m kd/(2 leakage)) is left under a push w."""
    network = {**NETWORK, "width": 1e6, "adaptation": 40.0, "leakage": 0.5}
    found = run(block(RUBBING, PUSH, controller=network, duration=3.0))
    left = 4.0 / MASS / (25.0 + 5 * 5.0 / 0.5)
    np.testing.assert_allclose(found["slide.position"][-1], left, rtol=1e-3)


def test_adaptation_reduces_the_error_under_friction_and_payload() -> None:
    learning = {**NETWORK, "centres": 15, "width": 0.5, "adaptation": 200.0}
    errors = []
    for law in (NETWORK, learning):
        found = reference(arm(law, (*FRICTION, PAYLOAD)))
        errors.append(np.abs(found["joint1.reference_position"] - found["joint1.position"]).max())
    assert errors[1] < errors[0] / 2


@pytest.mark.parametrize(
    "law",
    [
        {**SLIDING, "rate": [5.0, 8.0], "boundary_layer": 0.05},
        {**SLIDING, "reaching": "exponential", "proportional": 3.0, "rate": 5.0, "boundary_layer": 0.05},
        {**NETWORK, "adaptation": 100.0, "leakage": 0.01},
        {**NETWORK, "adaptation": 100.0, "sample_time": 0.01},
        {**SLIDING, "rate": 5.0, "boundary_layer": 0.05, "sample_time": 0.01},
    ],
)
def test_engines_agree_on_nonlinear_control(law: dict) -> None:
    robot = arm(law, (*FRICTION, PAYLOAD))
    own, other = reference(robot), exudyn(robot)
    for name in ("joint1.position", "joint2.position"):
        np.testing.assert_allclose(own[name], other[name], atol=2e-5, err_msg=name)
    np.testing.assert_allclose(own["joint1.torque"], other["joint1.torque"], atol=0.2)


def test_fixed_steps_support_the_network_weights() -> None:
    robot = arm({**NETWORK, "adaptation": 100.0}, (PAYLOAD,))
    stepped = simulate(robot, sensors=False, step=1e-3)
    np.testing.assert_allclose(stepped["joint1.position"], reference(robot)["joint1.position"], atol=1e-8)


def test_a_free_flexible_robot_supports_both_controllers() -> None:
    for law in ({**SLIDING, "rate": 0.5, "boundary_layer": 0.01}, {**NETWORK, "adaptation": 10.0}):
        data = load_robot("flexible_space_robot").model_dump()
        data |= {"sensors": [], "controller": law, "effects": []}
        data["reference"] |= {"duration": 0.2, "sample_rate": 50.0}
        robot = Robot.model_validate(data)
        own, other = reference(robot), exudyn(robot)
        np.testing.assert_allclose(own["joint2.position"], other["joint2.position"], atol=1e-7)


def test_a_thin_layer_needs_no_more_evaluations_than_a_thick_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Exudyn's iterations know the slope of the law, rate/layer; by torques alone they converge slowly."""
    evaluations: list[float] = []
    output = SlidingModeLaw.output

    def counted(law: SlidingModeLaw, state: JointState, integral: Sequence[float]) -> list[float]:
        evaluations.append(state.time)
        return output(law, state, integral)

    monkeypatch.setattr(SlidingModeLaw, "output", counted)
    counts = []
    for layer in (1.0, 0.01):
        law = {**SLIDING, "rate": 5.0, "boundary_layer": layer}
        evaluations.clear()
        exudyn_model.simulate(
            block(PUSH, controller=law, duration=0.02),
            formulation="redundant",
            integrator="trapezoidal",
            step=1e-3,
        )
        counts.append(len(evaluations))
    assert counts[1] < 1.2 * counts[0]  # without the slope 3 times as many


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({**SLIDING, "boundary_layer": 0.0}, "boundary_layer is 0; it must be positive"),
        ({**SLIDING, "rate": [1.0, -2.0]}, "rate is -2"),
        ({**SLIDING, "slope": 0.0}, "slope is 0; it must be positive"),
        ({**SLIDING, "proportional": 2.0}, "proportional is 2"),
        ({**SLIDING, "reaching": "exponential"}, "proportional is 0"),
        ({**SLIDING, "slope": [1.0, 2.0, 3.0]}, "slope: has 3 entries but needs 2"),
        ({**NETWORK, "centres": 52}, "52 centres are more than the 51 samples"),
        ({**NETWORK, "kp": 0.0}, "kp is 0"),
        ({**NETWORK, "width": -1.0}, "width.*-1"),
        ({**NETWORK, "leakage": -0.1}, "leakage.*-0.1"),
    ],
)
def test_impossible_controllers_are_refused(changes: dict, sentence: str) -> None:
    data = arm(NETWORK).model_dump(exclude_none=True)
    with pytest.raises(InputError, match=sentence):
        robot_from_toml(tomli_w.dumps(data | {"controller": changes}))


@pytest.mark.parametrize("law", [NETWORK, {**SLIDING, "rate": [1.0, 2.0]}])
def test_controllers_round_trip_through_a_file(law: dict) -> None:
    assert robot_from_toml(robot_to_toml(arm(law))) == arm(law)
