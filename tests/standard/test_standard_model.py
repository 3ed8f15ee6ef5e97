"""The standard model: recovered from simulations, physically realisable, with reproducible predictions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from missing_physics.bodies.pseudo_inertia import BASIS, divergence, pseudo_inertia, solid
from missing_physics.standard import StandardModel, fit_standard
from reference_model.evaluation.model import RobotModel
from reference_model.simulation import simulate
from robot_model import EffectUse, InputError, Recording, load_robot

ARM = load_robot("two_link_arm").model_copy(update={"effects": ()})
#: What the simulated machine has and the description does not.
FRICTION = {
    "viscous_friction": {"coefficient": 2.0},
    "coulomb_friction": {"torque": 1.5},
    "torque_offset": {"torque": -0.3},
}
MACHINE = ARM.with_effects(
    *(EffectUse(effect=e, at=j.name, **values) for j in ARM.moving_joints for e, values in FRICTION.items())
)


def recorded(seed: int) -> Recording:
    run = simulate(MACHINE, seed=seed)
    names = [f"{j.name}.{q}" for j in MACHINE.moving_joints for q in ("position", "torque")]
    return Recording(run.time, {name: run[name] for name in names}, "simulated")


@pytest.fixture(scope="module")
def run() -> Recording:
    return recorded(0)


@pytest.fixture(scope="module")
def fitted(run: Recording) -> StandardModel:
    return fit_standard(ARM, [run])


@pytest.mark.parametrize(("kind", "truth"), [("viscous", 2.0), ("coulomb", 1.5), ("offset", 0.3)])
@pytest.mark.parametrize("joint", [j.name for j in ARM.moving_joints])
def test_friction_and_offset_of_a_simulation_are_recovered(
    fitted: StandardModel, joint: str, kind: str, truth: float
) -> None:
    value, deviation = fitted.estimate.value(f"{joint}.{kind}")
    # Four standard deviations, and two percent for what the band's filter makes of reversals.
    assert abs(value - truth) < 4 * deviation + 0.02 * truth


def test_error_of_the_standard_model_on_another_run_equals_the_noise(fitted: StandardModel) -> None:
    for errors in fitted.errors([recorded(1)]).values():
        assert errors.standard < 2.0 * errors.noise
        assert errors.standard < 0.1 * errors.nominal


def test_file_of_the_standard_model_reproduces_its_stated_error(
    fitted: StandardModel, run: Recording
) -> None:
    """The error of the written file, evaluated as a nominal robot, is the error stated of the fit."""
    stated = fitted.errors([run])
    written = replace(fitted, nominal=fitted.robot).errors([run])
    for joint, errors in stated.items():
        assert written[joint].nominal == pytest.approx(errors.standard, rel=1e-3)  # ten digits in the file


def test_wrong_masses_are_corrected(run: Recording) -> None:
    """Torque at the joints, since single masses of two links are not determined by them."""
    links = tuple(link.model_copy(update={"mass": 1.4 * link.mass}) for link in ARM.links)
    wrong = ARM.model_copy(update={"links": links})
    model = fit_standard(wrong, [run])
    for errors in model.errors([recorded(1)]).values():
        assert errors.standard < 3.0 * errors.noise


def test_mass_properties_stay_realisable_for_any_torque(run: Recording) -> None:
    """A torque that would need negative inertia: turned round, and of random numbers."""
    chance = np.random.default_rng(3)
    for make in (lambda tau: -tau, lambda tau: 100.0 * chance.standard_normal(tau.size)):
        absurd = run.with_channels({c: make(run[c]) for c in run if c.endswith("torque")})
        found = fit_standard(ARM, [absurd])
        for link in found.robot.links:
            assert link.mass > 0.0
            assert np.linalg.eigvalsh(link.inertia_matrix)[0] > 0.0
        for joint in ARM.moving_joints:
            assert min(found.estimate.value(f"{joint.name}.{k}")[0] for k in ("viscous", "coulomb")) >= 0.0


def test_result_does_not_depend_on_the_units_of_a_prismatic_axis() -> None:
    """An axis described in millimetres and its recording give the same relative error as in metres."""
    axis = load_robot("single_axis")
    run = simulate(axis, seed=2)
    names = [f"{j.name}.{q}" for j in axis.moving_joints for q in ("position", "torque")]
    metres = Recording(run.time, {n: run[n] for n in names}, "m")
    scaled = Recording(run.time, {n: run[n] * (1e3 if n.endswith("position") else 1.0) for n in names}, "mm")
    lighter = tuple(link.model_copy(update={"mass": link.mass / 1e3}) for link in axis.links)
    small = axis.model_copy(update={"links": lighter, "sensors": (), "effects": ()})
    plain = axis.model_copy(update={"sensors": (), "effects": ()})
    for errors, other in zip(
        fit_standard(plain, [metres]).errors([metres]).values(),
        fit_standard(small, [scaled]).errors([scaled]).values(),
    ):
        assert other.standard == pytest.approx(errors.standard, rel=0.02)  # rotors are not rescaled


def test_recording_without_torque_is_rejected_with_one_sentence(run: Recording) -> None:
    positions = Recording(run.time, {c: run[c] for c in run if c.endswith("position")}, "positions only")
    with pytest.raises(InputError, match=r"torque.*map"):
        fit_standard(ARM, [positions])


def test_joint_at_rest_is_not_fitted(run: Recording) -> None:
    still = run.with_channels({"joint2.position": np.zeros(len(run))})
    errors = fit_standard(ARM, [still]).errors([still])
    assert np.isnan(errors["joint2"].standard)
    assert np.isfinite(errors["joint1"].standard)


def test_trembling_joint_is_not_fitted(run: Recording) -> None:
    """Held by its controller, it moves by a thousandth of what the other one does."""
    trembling = 1e-3 * run["joint2.position"]
    errors = fit_standard(ARM, [run.with_channels({"joint2.position": trembling})])
    assert errors.estimate.value("joint2.viscous") == (0.0, 0.0)


def test_masses_of_the_file_are_kept_for_a_robot_with_a_passive_joint() -> None:
    """Without torque every equation is fitted by a robot without mass; the file's masses have to stand."""
    joints = tuple(j if j.name == "joint1" else j.model_copy(update={"actuator": None}) for j in ARM.joints)
    passive = ARM.model_copy(update={"joints": joints})
    time = np.arange(0.0, 10.0, 0.005)
    angles = np.column_stack([0.5 * np.sin(3.0 * time), 0.7 * np.sin(4.1 * time)])
    rates = np.column_stack([1.5 * np.cos(3.0 * time), 2.87 * np.cos(4.1 * time)])
    needed = RobotModel(ARM).inverse_dynamics(angles, rates, -np.array([9.0, 16.81]) * angles)
    noise = 0.1 * np.random.default_rng(0).standard_normal(time.size)
    channels = {f"joint{k + 1}.position": angles[:, k] for k in range(2)}
    channels["joint1.torque"] = (
        needed[:, 0] + noise
    )  # the second joint would need a torque that nothing gives
    found = fit_standard(passive, [Recording(time, channels, "passive")])
    assert found.robot.link("link2").mass > 0.8 * ARM.link("link2").mass


def ten_numbers(draw: st.DataObject) -> np.ndarray:
    """Ten numbers of a body made of five random point masses."""
    unit = st.floats(-1.0, 1.0)
    points = np.array(draw.draw(st.lists(st.tuples(unit, unit, unit), min_size=5, max_size=5)))
    masses = np.array(draw.draw(st.lists(st.floats(0.1, 2.0), min_size=5, max_size=5)))
    second = np.einsum("k,ki,kj->ij", masses, points, points)
    inertia = np.trace(second) * np.eye(3) - second
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return np.array([masses.sum(), *(masses @ points), *(inertia[p] for p in pairs)])


@given(st.data())
def test_solid_body_keeps_its_inertia_and_stays_realisable(data: st.DataObject) -> None:
    ten = solid(ten_numbers(data), 1.0)
    assert np.linalg.eigvalsh(pseudo_inertia(ten))[0] > 0.0
    np.testing.assert_allclose(solid(ten, 1.0), ten, rtol=1e-9, atol=1e-9)


@given(st.data())
def test_the_divergence_has_its_minimum_at_the_nominal_body_and_true_derivatives(data: st.DataObject) -> None:
    ten, nominal = (solid(ten_numbers(data), 1.0) for _ in range(2))
    assert divergence(nominal, nominal)[0] == pytest.approx(0.0, abs=1e-9)
    value, gradient, hessian = divergence(ten, nominal)
    assert value >= -1e-9
    step = 1e-6 * np.linalg.eigvalsh(pseudo_inertia(ten))[0]
    for k in range(len(BASIS)):
        moved = [divergence(ten + sign * step * np.eye(10)[k], nominal) for sign in (1.0, -1.0)]
        # Central differences of a step that small: rounding of the value over the step.
        slope = (moved[0][0] - moved[1][0]) / (2 * step)
        assert slope == pytest.approx(gradient[k], rel=1e-3, abs=1e-6 * max(1.0, value) / step * 1e-8 + 1e-3)
        curve = (moved[0][1] - moved[1][1]) / (2 * step)
        np.testing.assert_allclose(curve, hessian[:, k], rtol=1e-3, atol=1e-4 * np.abs(hessian).max())
