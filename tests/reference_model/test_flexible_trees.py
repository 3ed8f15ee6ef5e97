"""Identities of the dynamics of random trees of rigid and flexible bodies in random states."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from flexible_cases import Case, random_flexible_case, symbols_of, tilde, trees
from hypothesis import given, settings
from lagrange_multipliers import cut_motion

from reference_model.dynamics.balance import centre_of_mass, momentum, structural_loss
from reference_model.dynamics.equations import accelerations, joint_wrench
from reference_model.evaluation.model import RobotModel
from reference_model.flexible import FlexibleBody
from reference_model.flexible.motion_forces import Deformed, deformed
from reference_model.flexible.undeformed import undeformed
from robot_model import InputError, load_robot

#: Sums of some thousand products of order one to a hundred, in double precision.
ROUNDING = 1e-10

pytestmark = pytest.mark.fuzz
few = settings(max_examples=settings.default.max_examples // 4, derandomize=True)


def close(value: np.ndarray, wanted: np.ndarray, tolerance: float = ROUNDING) -> None:
    scale = 1 + np.max(np.abs(wanted), initial=0.0)
    assert np.shape(value) == np.shape(wanted)
    assert np.max(np.abs(value - wanted), initial=0.0) <= tolerance * scale


@few
@given(trees())
def test_forward_dynamics_inverts_inverse_dynamics(case: Case) -> None:
    force = case.model.inverse_dynamics(*case.motion, **case.given)
    close(case.forward(force), case.generalised_acceleration)


@few
@given(trees())
def test_the_minimal_form_equals_the_recursive_one(case: Case) -> None:
    matrix, forces = case.model.minimal_form(case.position, case.velocity, **case.given)
    close(case.model.mass_matrix(case.position, **case.given), matrix)
    force = case.model.inverse_dynamics(*case.motion, **case.given)
    close(np.einsum("nij,nj->ni", matrix, case.generalised_acceleration) - forces, force)
    if matrix.size:
        assert np.linalg.eigvalsh(matrix).min() > 0


@few
@given(trees())
def test_lagrange_multipliers_find_the_same_wrenches_and_accelerations(case: Case) -> None:
    model = case.model
    force = model.inverse_dynamics(*case.motion, **case.given)
    cut = cut_motion(model, case.position, case.velocity, force, **case.given)
    symbols = symbols_of(case)
    indices = range(1, len(symbols.robot.tree.bodies))
    robot = symbols.robot
    columns = [joint_wrench(robot.mechanism, index, robot.wrenches[index]) for index in indices]
    wrenches = ca.horzcat(*columns)
    wanted = symbols.values(case, wrenches)[0].T
    # the multipliers come from a system with the condition number of all masses together
    close(cut.wrenches[0], wanted, 1e-8)
    modal = np.hstack([column[:, 6:] for column in cut.accelerations])
    order = [n for body in robot.tree.bodies for n in range(body.modal, body.modal + body.modes)]
    close(modal, case.inner.modal_accelerations[:, order], 1e-8)


@few
@given(trees())
def test_the_moment_about_the_axis_is_the_joint_torque_and_modal_rows_close(case: Case) -> None:
    model = case.model
    forces, moments = model.joint_wrenches(*case.motion, **case.given)
    torque = model.inverse_dynamics(*case.motion, **case.given)[:, 0 if case.base is None else 6 :]
    names = list(model.inertial_names)
    for k, joint in enumerate(model.robot.moving_joints):
        reflected = model.inertial[names.index(f"{joint.name}.reflected_inertia")]
        along = (forces if joint.kind == "prismatic" else moments)[:, k] @ joint.unit_axis
        close(along + reflected * case.acceleration[:, k], torque[:, k])


@few
@given(trees())
def test_velocities_and_accelerations_are_derivatives_of_positions(case: Case) -> None:
    """Of every body: dr/dt = A v, dA/dt = A om~, and d/dt (A v) = A a, d(om)/dt = alpha, exactly."""
    symbols = symbols_of(case)
    states = symbols.robot.mechanism.states
    motion = symbols.motion
    moved = accelerations(
        symbols.robot.mechanism, motion.acceleration, motion.base_acceleration, motion.inner_acceleration
    )
    for state, acceleration in zip(states, moved):
        turn, column = state.rotation, state.velocity
        pairs = [
            (symbols.rate(state.position), turn @ column[:3]),
            (symbols.rate(turn), turn @ ca.skew(column[3:6])),
            (symbols.rate(turn @ column[:3]), turn @ acceleration[:3]),
            (symbols.rate(column[3:6]), acceleration[3:6]),
            (symbols.rate(column[6:]), acceleration[6:]),
            (turn @ turn.T, ca.SX.eye(3)),
        ]
        found = symbols.values(case, *(item for pair in pairs for item in pair))
        for value, wanted in zip(found[::2], found[1::2]):
            close(value, wanted)


@few
@given(trees())
def test_node_velocities_are_derivatives_of_their_positions(case: Case) -> None:
    """dr/dt = R v and d/dt (R v) = R a of every flexible body's tip; R is a rotation."""
    symbols = symbols_of(case)
    robot = symbols.robot
    for index, body in enumerate(robot.tree.bodies):
        if body.flexible is None:
            continue
        place, turn, velocity, acceleration = robot.node(index, body.flexible.tip)
        state = robot.mechanism.states[index]
        rotation = state.rotation @ turn
        where = state.position + state.rotation @ place
        pairs = [
            (symbols.rate(where), rotation @ velocity[:3]),
            (symbols.rate(rotation), rotation @ ca.skew(velocity[3:])),
            (symbols.rate(rotation @ velocity[:3]), rotation @ acceleration[:3]),
            (symbols.rate(velocity[3:]), acceleration[3:]),
            (rotation @ rotation.T, ca.SX.eye(3)),
        ]
        found = symbols.values(case, where, acceleration[:3], *(item for pair in pairs for item in pair))
        for value, wanted in zip(found[2::2], found[3::2]):
            close(value, wanted)
        moved = case.model.node_motion(
            body.name, *case.motion, **case.given, base_position=symbols.base_position
        )
        close(moved.position[0], found[0][:, 0])
        close(moved.acceleration[0], found[1][:, 0])


@few
@given(trees())
def test_energy_changes_by_the_power_of_the_forces(case: Case) -> None:
    """d/dt (T + V) = yd^T f - xd^T C xd, at any accelerations."""
    symbols = symbols_of(case)
    loss = structural_loss(symbols.robot.mechanism)
    change, lost = symbols.values(case, symbols.rate(symbols.robot.energy), loss)
    force = case.model.inverse_dynamics(*case.motion, **case.given)[0]
    close(change, np.array([[force @ case.speed[0]]]) - lost)
    assert lost[0, 0] >= 0


@few
@given(trees(base=("free",), gravity=False))
def test_only_the_wrench_on_the_base_changes_momentum(case: Case) -> None:
    """Whatever acts inside: dp/dt = F_0, dL/dt about the centre of mass = N_0 + (r_0 - c) x F_0."""
    symbols = symbols_of(case)
    mechanism = symbols.robot.mechanism
    linear, angular = momentum(mechanism)
    turn, place = mechanism.states[0].rotation, mechanism.states[0].position
    wrench = symbols.robot.inverse_dynamics[:6]
    force, moment = turn @ wrench[:3], turn @ wrench[3:]
    arm = place - centre_of_mass(mechanism)[1]
    found = symbols.values(
        case, symbols.rate(linear), force, symbols.rate(angular), moment + ca.cross(arm, force)
    )
    close(found[0], found[1])
    close(found[2], found[3])
    mass, centre = centre_of_mass(mechanism)
    moving, wanted = symbols.values(case, symbols.rate(centre) * mass, linear)
    close(moving, wanted)


@few
@given(trees())
def test_kinetic_energy_from_bodies_equals_that_of_the_mass_matrix(case: Case) -> None:
    energy = case.model.energies(case.position, case.velocity, **case.given)[:, 0]
    matrix = case.model.mass_matrix(case.position, **case.given)
    close(energy, np.einsum("ni,nij,nj->n", case.speed, matrix, case.speed) / 2)


@few
@given(trees())
def test_regressor_is_the_derivative_by_the_inertial_numbers(case: Case) -> None:
    model = case.model
    regressor = model.regressor(*case.motion, **case.given)
    force = model.inverse_dynamics(*case.motion, **case.given)
    step = np.random.default_rng(0).normal(size=model.inertial.shape)
    step[-3:] = 0  # gravity times mass is not linear
    changed = model.inverse_dynamics(*case.motion, **case.given, inertial=model.inertial + step)
    close(changed - force, regressor @ step)


@pytest.mark.parametrize(
    ("kind", "modes", "rows"), [("revolute", 1, 2), ("fixed", 2, 2), ("fixed", 1, 1), ("fixed", 0, 0)]
)
def test_robots_with_the_fewest_coordinates(kind: str, modes: int, rows: int) -> None:
    """One coordinate, or none, of the joints or of the modes: CasADi slices such vectors to rows."""
    case = random_flexible_case(3, base="fixed", kinds=[kind], modes=[modes])
    model = case.model
    force = model.inverse_dynamics(*case.motion, **case.given)
    assert force.shape == (3, rows)
    close(case.forward(force), case.generalised_acceleration)
    regressor = model.regressor(*case.motion, **case.given)
    assert regressor.shape == (3, rows, model.inertial.size)
    sizes = [one.shape for one in model.motion_jacobians(*case.motion, **case.given)]
    assert sizes == [(3, rows, len(model.joints))] * 3


def test_strain_is_that_of_the_gauges_and_unusable_arguments_are_refused() -> None:
    case = random_flexible_case(4, base="fixed", kinds=["revolute", "spherical"], modes=[2, 3])
    strain = case.model.strain("link1", case.inner)
    first = case.model.tree.bodies[case.model.tree.index("link1")].modal
    close(strain, case.inner.modal[:, first : first + 3] @ case.bodies["link1"].strain.T)
    with pytest.raises(InputError, match="no flexible link 'link7'"):
        case.model.strain("link7", case.inner)
    with pytest.raises(InputError, match="no node 9"):
        case.model.node_motion("link1", *case.motion, **case.given, node=9)
    short = replace(case.inner, modal=case.inner.modal[:, :2])
    with pytest.raises(InputError, match=r"modal has shape \(3, 2\)"):
        case.model.inverse_dynamics(*case.motion, inner=short)


def body_case(seed: int) -> tuple[Case, ca.SX, ca.SX, ca.SX]:
    """One flexible body with symbols of its x, om and xd; seeds differ in kind of body."""
    case = random_flexible_case(seed, base="free", kinds=["fixed"], modes=[3])
    return case, ca.SX.sym("x", 3), ca.SX.sym("w", 3), ca.SX.sym("xd", 3)


def with_hub(body: FlexibleBody, x: ca.SX) -> Deformed:
    """The body with a hub of its own."""
    return deformed(body, x, ca.SX(2.0), ca.SX([0.1, -0.2, 0.3]), ca.SX(np.diag([0.4, 0.5, 0.6])))


def test_inertial_forces_follow_from_the_mass_matrix_by_lagranges_equations() -> None:
    """f_w = -(dM/dt v + [om x p; om x L; -1/2 d/dx v^T M v]) with the frame's velocity zero."""
    for seed in range(6):
        case, x, omega, rate = body_case(seed)
        body = case.bodies["link0"]
        bent = with_hub(body, x)
        matrix = ca.densify(bent.matrix)
        v = ca.vertcat(ca.SX.zeros(3), omega, rate)
        changing = ca.reshape(ca.jtimes(ca.vec(matrix), x, rate), matrix.shape)
        column = matrix @ v
        kinetic = ca.dot(v, matrix @ v) / 2
        turning = ca.vertcat(
            ca.cross(omega, column[:3]), ca.cross(omega, column[3:6]), -ca.gradient(kinetic, x)
        )
        wanted = -(changing @ v + turning)
        function = ca.Function("f", [x, omega, rate], [bent.motion_force(omega, rate), wanted])
        found = function(*np.random.default_rng(seed).normal(size=(3, 3)))
        close(found[0].full(), found[1].full(), 1e-12)


def test_the_mass_matrix_is_the_sum_over_the_nodes() -> None:
    for seed in (0, 2):  # with and without a moving root
        case, x, _, _ = body_case(seed)
        body = case.bodies["link0"]
        bent = deformed(body, x, ca.SX(1, 1), ca.SX(3, 1), ca.SX(3, 3))
        value = 0.3 * np.random.default_rng(seed).normal(size=3)
        found = ca.Function("m", [x], [ca.densify(bent.matrix)])(value).full()
        wanted = np.zeros_like(found)
        for m, inertia, place, phi, psi in zip(
            body.node_masses, body.node_inertias, body.nodes, body.translations, body.rotations
        ):
            linear = np.hstack([np.eye(3), -tilde(place + phi @ value), phi])
            angular = np.hstack([np.zeros((3, 3)), np.eye(3), psi])
            wanted += m * linear.T @ linear + angular.T @ inertia @ angular
        close(found, wanted, 1e-12)


def test_foreshortening_agrees_with_shortened_nodes_to_second_order() -> None:
    """Against node sums with rho - e x^T B x/2 in full: M12, M13 exact, the error of J is x^3, of M23 x^2."""
    case, x, _, _ = body_case(1)
    body = case.bodies["link0"]
    assert body.axis is not None
    assert body.foreshortening is not None
    bent = deformed(body, x, ca.SX(1, 1), ca.SX(3, 1), ca.SX(3, 3))
    function = ca.Function("m", [x], [ca.densify(bent.matrix)])
    errors = []
    for size in (1e-2, 1e-3):
        value = size * np.array([1.0, -0.7, 0.4])
        wanted = np.zeros((9, 9))
        for m, inertia, place, phi, psi, short in zip(
            body.node_masses,
            body.node_inertias,
            body.nodes,
            body.translations,
            body.rotations,
            body.foreshortening,
        ):
            arm = place + phi @ value - body.axis * (value @ short @ value) / 2
            moving = phi - np.outer(body.axis, value @ short)
            linear = np.hstack([np.eye(3), -tilde(arm), moving])
            angular = np.hstack([np.zeros((3, 3)), np.eye(3), psi])
            wanted += m * linear.T @ linear + angular.T @ inertia @ angular
        gap = np.abs(function(value).full() - wanted)
        errors.append([gap[:3].max(), gap[3:6, 3:6].max(), gap[3:6, 6:].max()])
    assert errors[0][0] < 1e-14  # linear momentum is exact
    assert errors[0][1] / errors[1][1] > 0.9 * 1e3
    assert errors[0][2] / errors[1][2] > 0.9 * 1e2


def test_an_undeformed_body_equals_a_rigid_one() -> None:
    robot = load_robot("flexible_space_robot")
    model, rigid = RobotModel(robot), RobotModel(undeformed(robot))
    case = random_flexible_case(2, base="free", kinds=["revolute", "revolute"], modes=[0, 0])
    force = model.inverse_dynamics(*case.motion, base=case.base)
    close(force[:, :8], rigid.inverse_dynamics(*case.motion, base=case.base), 1e-12)


def test_a_heavy_free_base_converges_to_a_fixed_base() -> None:
    trees_of = {"kinds": ["revolute", "spherical"], "modes": [2, 3], "gravity": False}
    fixed = random_flexible_case(5, base="fixed", **trees_of)
    free = random_flexible_case(5, base="free", **trees_of)
    heavy = free.model.inertial.copy()
    heavy[:10] = [1e12, 0, 0, 0, 1e12, 1e12, 1e12, 0, 0, 0]
    rest = type(free.base).at_rest(np.array([1.0, 0, 0, 0]), len(fixed.position))
    torque = fixed.acceleration
    found = free.model.forward_dynamics(
        fixed.position, fixed.velocity, torque, base=rest, inner=fixed.inner, inertial=heavy
    )
    wanted = fixed.model.forward_dynamics(fixed.position, fixed.velocity, torque, inner=fixed.inner)
    # the base's share falls as the ratio of masses, 1e-12 times a hundred or so
    close(found[:, 6:], wanted, 1e-9)
