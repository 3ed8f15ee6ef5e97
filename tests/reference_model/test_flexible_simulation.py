"""The closed loop of flexible robots: conserved quantities, closed forms, limits."""

from __future__ import annotations

import numpy as np
import pytest
from free_flyers import FRICTION, axes, cantilever, space_robot
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

from reference_model.effects.catalogue import used_effects
from reference_model.flexible import flexible_body
from reference_model.flexible.undeformed import undeformed
from reference_model.plant.acting import bodies_with
from reference_model.simulation import simulate
from robot_model import EffectUse, InputError, Recording, Robot, load_robot


def moved_by_nothing(recording: Recording, tolerance: float) -> None:
    """Momenta constant beside sum |m v|, |m r v|, and energy less work beside the work done."""
    # the arm's 104 kg at up to 1 m/s, 5 m from the centre of mass
    for name, scale in (("robot.linear_momentum", 100.0), ("robot.angular_momentum", 500.0)):
        column = axes(recording, name)
        assert np.abs(column[0]).max() > 0.05 * scale  # something is there to be kept
        assert np.abs(column - column[0]).max() < tolerance * scale
    rest = recording["robot.energy"] - recording["robot.work"]
    assert np.abs(rest - rest[0]).max() < 10 * tolerance * recording["robot.energy"].max()
    assert np.ptp(recording["robot.work"]) > 0.1 * recording["robot.energy"].max()


@pytest.mark.parametrize("inboard", [False, pytest.param(True, marks=pytest.mark.proof)])
def test_control_friction_and_bending_conserve_momentum_and_energy_balance(inboard: bool) -> None:
    robot = space_robot(3.0, inboard=inboard, effects=FRICTION)
    # the drift is of the size of the integration's tolerance; 1e-11 was seen
    moved_by_nothing(simulate(robot, sensors=False, work=True, rtol=1e-10, atol=1e-12), 1e-9)


@pytest.mark.proof
@pytest.mark.parametrize("inboard", [False, True])
def test_a_hundred_seconds_of_free_flight_keep_momentum_and_energy_balance(inboard: bool) -> None:
    robot = space_robot(100.0, inboard=inboard, effects=FRICTION)
    moved_by_nothing(simulate(robot, sensors=False, work=True, rtol=1e-10, atol=1e-12), 1e-9)


def test_a_held_base_and_exact_stiction_close_the_energy_balance_too() -> None:
    # one that knows the deformation: with the rigid model these gains make the closed loop unstable
    controller = {
        "kind": "computed_torque",
        "kp": 1.0,
        "kd": 2.0,
        "base_kp": 1.0,
        "base_kd": 2.0,
        "model": "full",
    }
    robot = space_robot(2.0, effects=FRICTION[2:], controller=controller)
    recording = simulate(robot, sensors=False, work=True, stiction=True)
    rest = recording["robot.energy"] - recording["robot.work"]
    assert np.abs(recording["base.control_torque.z"]).max() > 1.0
    # default tolerances, 1e-8 relative
    assert np.abs(rest - rest[0]).max() < 1e-6 * recording["robot.energy"].max()


def spinning(inertia: tuple[float, ...], omega: tuple[float, ...], **changes: object) -> Robot:
    """A body on a spherical joint at the inertial origin."""
    return Robot.model_validate(
        {
            "name": "top",
            "links": [{"name": "body", "mass": 2.0, "inertia": inertia, **changes.pop("link", {})}],
            "joints": [
                {
                    "name": "ball",
                    "kind": "spherical",
                    "parent": "base",
                    "child": "body",
                    "initial_angular_velocity": omega,
                    **changes.pop("joint", {}),
                }
            ],
            "reference": {"duration": 8.0, "sample_rate": 20.0},
            **changes,
        }
    )


def test_eulers_top_tumbles_about_its_middle_axis() -> None:
    inertia, omega = np.array([1.0, 2.0, 3.0]), (0.01, 2.0, 0.01)
    robot = spinning(tuple(inertia), omega)
    found = simulate(robot, sensors=False, rtol=1e-11, atol=1e-13)

    def euler(_: float, w: np.ndarray) -> np.ndarray:
        return -np.cross(w, inertia * w) / inertia

    wanted = solve_ivp(euler, (0, 8), omega, "DOP853", found.time, rtol=1e-12, atol=1e-14).y.T
    rate = axes(found, "ball.angular_velocity")
    assert rate[:, 1].min() < -1.9  # it turns over
    np.testing.assert_allclose(rate, wanted, atol=1e-7)
    # the angular momentum keeps its direction in inertial axes
    attitude = axes(found, "ball.attitude", "wxyz")
    assert np.abs(turned(attitude, rate * inertia) - inertia * omega).max() < 1e-8


def turned(attitude: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    w, v = attitude[:, :1], attitude[:, 1:]
    return vectors + 2 * np.cross(v, np.cross(v, vectors) + w * vectors)


def test_lagranges_top_precesses_steadily_at_the_analytic_rate() -> None:
    """Precession p at spin s: (I1 - I3) p^2 cos(tilt) - I3 s p + m g l = 0, the slower of its two roots."""
    mass, arm, gravity, tilt, spin = 2.0, 0.3, 9.81, 0.6, 120.0
    first, third = 0.02 + mass * arm**2, 0.03
    slow = np.roots([(first - third) * np.cos(tilt), -third * spin, mass * gravity * arm]).real.min()
    body_rate = (0.0, slow * np.sin(tilt), spin + slow * np.cos(tilt))  # precession seen in body axes
    robot = spinning(
        (0.02, 0.02, third),
        body_rate,
        link={"center_of_mass": (0.0, 0.0, arm)},
        joint={"rpy": (tilt, 0.0, 0.0)},
        gravity=(0.0, 0.0, -gravity),
    )
    found = simulate(robot, sensors=False, rtol=1e-11, atol=1e-13)
    attitude = axes(found, "ball.attitude", "wxyz")
    up = turned(attitude, np.tile([0.0, 0.0, 1.0], (len(found), 1)))  # in joint axes
    c, s = np.cos(tilt), np.sin(tilt)
    axis = up @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T
    np.testing.assert_allclose(axis[:, 2], np.cos(tilt), atol=1e-7)
    angle = np.unwrap(np.arctan2(axis[:, 0], -axis[:, 1]))
    np.testing.assert_allclose(angle, slow * found.time, atol=1e-6)


def test_a_cantilever_settles_at_the_analytic_deflection() -> None:
    """Tip P L^3/3EI + q L^4/8EI, strain at the root (P L + q L^2/2) c/EI (Roark, table 8.1)."""
    robot = cantilever()
    link = robot.link("link1")
    assert link.beam is not None
    found = simulate(robot, sensors=False)
    area, _, second, _ = link.beam.section.figures
    load, line = 0.5 * 9.81, 7800.0 * area * 9.81
    stiffness, length = 210e9 * second, 2.0
    tip = load * length**3 / (3 * stiffness) + line * length**4 / (8 * stiffness)
    # twelve modes leave 1e-4, the lumped line load as much
    assert found["link1.tip_deflection.z"][-1] == pytest.approx(-tip, rel=1e-3)
    strain = (load * length + line * length**2 / 2) * 0.005 / stiffness
    # bending moments converge an order later than deflections
    assert found["link1.strain.1"][-1] == pytest.approx(strain, rel=0.03)
    assert np.abs(axes(found, "link1.tip_acceleration")[-1]).max() < 1e-6


def test_a_cantilever_vibrates_at_its_first_frequency() -> None:
    robot = cantilever(damping_ratio=0.0, modes=1, tip={"mass": 5.0})
    reference = {"duration": 10.0, "sample_rate": 100.0}
    found = simulate(Robot.model_validate({**robot.model_dump(), "reference": reference}), sensors=False)
    omega = flexible_body(robot.link("link1")).frequencies[0]
    deflection = found["link1.tip_deflection.z"]
    rest = -9.81 * heave(robot) / omega**2
    # one mode of a body at rest is a linear oscillator; the tolerance is the integration's
    np.testing.assert_allclose(deflection, rest * (1 - np.cos(omega * found.time)), atol=1e-5 * abs(rest))


def heave(robot: Robot) -> float:
    """Static tip deflection of the only mode under unit gravity, times omega^2: phi_tip sum m phi."""
    body = flexible_body(robot.link("link1"))
    return float(body.translations[body.tip, 2, 0] * body.S0[2, 0])


def test_links_converge_to_the_rigid_robot_with_the_inverse_of_their_stiffness() -> None:
    rigid = simulate(undeformed(space_robot(2.0)), sensors=False, rtol=1e-10, atol=1e-12)
    errors = []
    for factor in (1e2, 1e4):
        robot = space_robot(2.0)
        link = robot.link("link2")
        assert link.beam is not None
        beam = link.beam.model_copy(update={"young": 70e9 * factor, "damping_ratio": 0.5})
        stiff = robot.model_copy(update={"links": (robot.links[0], link.model_copy(update={"beam": beam}))})
        found = simulate(stiff, sensors=False, rtol=1e-10, atol=1e-12)
        errors.append(
            max(np.abs(found[f"joint{k}.position"] - rigid[f"joint{k}.position"]).max() for k in (1, 2))
        )
    assert errors[0] < 1e-4
    assert 50 < errors[0] / errors[1] < 200


def test_a_payload_on_a_node_is_a_heavier_tip_when_all_modes_are_kept() -> None:
    """Then the modes span every deformation, and the loaded body has the frequencies of the heavy one."""
    few = {"elements": 2, "modes": 12, "damping_ratio": 0.0}
    heavy = flexible_body(cantilever(**few, tip={"mass": 1.7}).link("link1"))
    light = cantilever(**few, tip={"mass": 0.5})
    use = EffectUse.model_validate({"effect": "payload", "at": "link1", "mass": 1.2, "x": 2.0})
    loaded = bodies_with(light, used_effects(light.with_effects(use)))["link1"]
    assert loaded.mass == pytest.approx(heavy.mass, rel=1e-12)
    np.testing.assert_allclose(loaded.inertia, heavy.inertia, rtol=1e-12, atol=1e-12)
    squares = eigh(loaded.stiffness, loaded.modal_mass, eigvals_only=True)
    np.testing.assert_allclose(np.sqrt(squares), heavy.frequencies, rtol=1e-6)


def test_a_payload_effect_bends_its_flexible_link() -> None:
    use = EffectUse.model_validate({"effect": "payload", "at": "link1", "mass": 0.5, "x": 2.0})
    light, heavy = cantilever(), cantilever(tip={"mass": 1.0})
    found = simulate(light.with_effects(use), sensors=False)["link1.tip_deflection.z"][-1]
    wanted = simulate(heavy, sensors=False)["link1.tip_deflection.z"][-1]
    assert found == pytest.approx(wanted, rel=1e-3)  # modes of either body


def test_channels_of_flexible_links_and_their_sensors() -> None:
    robot = load_robot("flexible_space_robot")
    reference = {**robot.model_dump()["reference"], "duration": 1.0}
    robot = Robot.model_validate({**robot.model_dump(), "reference": reference})
    true = simulate(robot, sensors=False)
    names = {f"link2.{q}.{a}" for q in ("tip_deflection", "tip_acceleration") for a in "xyz"}
    names |= {f"link2.modal_coordinate.{k}" for k in (1, 2, 3, 4)} | {"link2.strain.1", "link2.strain.2"}
    assert names <= set(true)
    measured = simulate(robot, seed=3)
    for channel in ("link2.strain.2", "link2.tip_acceleration.y"):
        gap = measured[channel] - true[channel]
        assert 0.5 < gap.std() / measured.noise[channel] < 2


def test_a_failed_simulation_reports_the_state_of_links_and_spherical_joints() -> None:
    given = space_robot(1.0).model_dump(exclude_none=True)
    for joint in given["joints"]:
        joint["initial_velocity"] = 1e5
    with pytest.raises(InputError, match=r"stopped after t = .*tip of link2 deflected by .* m\); try"):
        simulate(Robot.model_validate(given), sensors=False)
